"""Every key expression of the service; the version stands near the root.

omniplan/v1/{site}/vehicles            names of the vehicles
omniplan/v1/{site}/vehicles/{id}       one vehicle file
omniplan/v1/{site}/spaces/{id}         one data sheet
omniplan/v1/{site}/validate            trajectories for one vehicle
omniplan/v1/{site}/select              trajectories for a fleet
omniplan/v1/{site}/health              state of the server
omniplan/v1/{site}/servers/{instance}  liveliness token of a server
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypeAlias

from configspace.errors import InvalidInput, Problem
from services.errors import InvalidMessage

__all__ = ["ROOT", "Keys", "Route", "Verb", "checked_chunk"]

ROOT = "omniplan/v1"

Verb: TypeAlias = Literal[
    "health", "select", "space", "validate", "vehicle", "vehicles"
]

# One chunk without any of zenoh's signs: / * $ ? # @.
_CHUNK = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_PLAIN: dict[str, Verb] = {
    "vehicles": "vehicles",
    "validate": "validate",
    "select": "select",
    "health": "health",
}
_WITH_ID: dict[str, Verb] = {"vehicles": "vehicle", "spaces": "space"}


@dataclass(frozen=True)
class Route:
    """What a concrete key asks for."""

    verb: Verb
    id: str = ""
    """Name of the vehicle, for ``vehicle`` and ``space``."""

    @property
    def takes_payload(self) -> bool:
        """Whether the question is in the payload rather than in the key."""
        return self.verb in ("validate", "select")


@dataclass(frozen=True)
class Keys:
    """The keys of one site.

    Raises
    ------
    InvalidInput
        If the site cannot be one chunk of a key.
    """

    site: str

    def __post_init__(self) -> None:
        checked_chunk("site", self.site)

    @property
    def root(self) -> str:
        """What all keys of the site begin with."""
        return f"{ROOT}/{self.site}"

    @property
    def everything(self) -> str:
        """The expression that a server answers."""
        return f"{self.root}/**"

    @property
    def servers(self) -> str:
        """The expression that matches the tokens of all servers."""
        return f"{self.root}/servers/*"

    def server(self, instance: str) -> str:
        """Return the token of one server."""
        return f"{self.root}/servers/{checked_chunk('instance', instance)}"

    def of(self, route: Route) -> str:
        """Return the concrete key of a question."""
        if route.verb in _PLAIN:
            return f"{self.root}/{route.verb}"
        return f"{self.root}/{route.verb}s/{checked_chunk('vehicle', route.id)}"

    def all_of(self, vehicles: Iterable[str]) -> tuple[str, ...]:
        """Return every concrete key that a server of these vehicles answers."""
        routes = [Route(verb) for verb in _PLAIN.values()]
        routes += [Route(verb, id) for id in vehicles for verb in _WITH_ID.values()]
        return tuple(map(self.of, routes))

    def route(self, key: str) -> Route:
        """Return what a concrete key asks for.

        Raises
        ------
        InvalidMessage
            With code ``unknown_key`` if the site has no such key.
        """
        match key.removeprefix(f"{self.root}/").split("/"):
            case [plain] if plain in _PLAIN:
                return Route(_PLAIN[plain])
            case [kind, id] if kind in _WITH_ID and _CHUNK.fullmatch(id):
                return Route(_WITH_ID[kind], id)
        known = [*_PLAIN, *(f"{kind}/{{id}}" for kind in _WITH_ID)]
        raise InvalidMessage(
            Problem("key", key[:200], f"{self.root}/ followed by {', '.join(known)}"),
            code="unknown_key",
        )


def checked_chunk(where: str, text: str) -> str:
    """Return the text if it can stand as one chunk of a key.

    Parameters
    ----------
    where : str
        What it is, for the error.
    text : str

    Raises
    ------
    InvalidInput
        If it is empty, longer than 64 characters or has other signs.
    """
    if not _CHUNK.fullmatch(text):
        allowed = "1 to 64 letters, digits, '.', '_' or '-', the first no sign"
        raise InvalidInput(Problem(where, repr(text)[:80], allowed))
    return text
