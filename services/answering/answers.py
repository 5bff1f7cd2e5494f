"""What handlers give back: an answer at once, or in parts."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import TypeAlias

from services.protocol.messages import JSON

__all__ = ["Answer", "Parts"]


@dataclass(frozen=True)
class Answer:
    """What a server sends back."""

    payload: bytes
    encoding: str = JSON


Parts: TypeAlias = Generator[Answer | None, None, Answer | None]
"""An answer in parts: what is yielded is sent at once, what is returned comes last.

None sends nothing and lets others have their turn; so does every part.
"""
