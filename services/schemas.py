"""JSON Schemas of all messages, for those who ask from another language."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from configspace.errors import InvalidInput, Problem
from services.protocol import batch_messages, messages
from services.protocol.messages import Message
from services.registering import registry_messages

__all__ = ["MESSAGES", "message_schema"]

_KINDS: tuple[type[Message], ...] = (
    messages.ValidateRequest,
    messages.ValidateReply,
    messages.SelectRequest,
    messages.SelectReply,
    messages.VehiclesReply,
    messages.Health,
    messages.CancelReply,
    messages.ErrorReply,
    batch_messages.BatchValidateRequest,
    batch_messages.BatchTwistsRequest,
    batch_messages.BatchPart,
    registry_messages.RegisterRequest,
    registry_messages.UnregisterRequest,
    registry_messages.RegisterReply,
    registry_messages.VehicleEvent,
)

MESSAGES: Mapping[str, type[Message]] = MappingProxyType(
    {kind.__name__: kind for kind in _KINDS}
)
"""Every message between clients and servers, by its name."""


def message_schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a message.

    Parameters
    ----------
    name : str
        One of `MESSAGES`.

    Raises
    ------
    InvalidInput
        If there is no such message.
    """
    if name not in MESSAGES:
        raise InvalidInput(Problem("message", repr(name), ", ".join(MESSAGES)))
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return {**dialect, **MESSAGES[name].model_json_schema()}
