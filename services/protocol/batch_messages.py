"""What stands in the metadata of batches: JSON under the key ``omniplan``."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from services.protocol.messages import CHUNK, Count, Message, Names, Question

__all__ = ["BatchPart", "BatchTwistsRequest", "BatchValidateRequest"]


class BatchValidateRequest(Question):
    """The question which of many trajectories which vehicles can drive."""

    vehicles: Names | None = None
    """Which to judge; None for all that the server knows."""
    parameters_of: dict[str, Any] | None = None
    """The vehicle file whose parameters ``kappa_n, beta, v_n`` are, if these are."""
    allow_unreachable: bool = False
    """As for `omniplan.validate_many`."""


class BatchTwistsRequest(Question):
    """The question which of many twists are permitted."""

    vehicle: str
    """One of those that the server knows."""


class BatchPart(Message):
    """Which part of the answer a reply is."""

    request: Annotated[str, Field(pattern=CHUNK)] | None = None
    """As in the question."""
    sequence: Count
    """0 for the first part."""
    first: Count
    """Rows of the answer before this part."""
    done: Count
    """Rows of the answer up to and with this part."""
    total: Count
    """Rows of the whole answer."""
    is_last: bool
    """Whether the answer is complete with this part."""
    fleet: Annotated[str, Field(max_length=64)]
    """Digest of the vehicles that were judged: the same for the same data sheets."""
    asked: Count = 0
    """Pairs of this part that the kernels left to `omniplan.validate`."""
