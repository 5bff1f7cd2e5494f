"""Every key expression of the service; the version stands near the root.

omniplan/v1/{site}/vehicles            names of the vehicles
omniplan/v1/{site}/vehicles/{id}       one vehicle file
omniplan/v1/{site}/spaces/{id}         one data sheet
omniplan/v1/{site}/validate            trajectories for one vehicle
omniplan/v1/{site}/select              trajectories for a fleet
omniplan/v1/{site}/batches/validate    many trajectories for a fleet, in Arrow
omniplan/v1/{site}/batches/twists      many twists for one vehicle, in Arrow
omniplan/v1/{site}/cancel/{request}    ends a request under way
omniplan/v1/{site}/health              state of the server
omniplan/v1/{site}/register/{id}       a vehicle to be registered
omniplan/v1/{site}/unregister/{id}     a vehicle to be removed
omniplan/v1/{site}/events/vehicles/{id}   published when a vehicle has changed
omniplan/v1/{site}/servers/{instance}     liveliness token of a server
omniplan/v1/{site}/vehicles/{id}/online   liveliness token of a vehicle
omniplan/v1/{site}/@sync/{instance}/...   what servers say among themselves
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

from configspace.errors import InvalidInput, Problem
from services.errors import InvalidMessage

__all__ = ["ROOT", "Keys", "Route", "Verb", "checked_chunk"]

ROOT = "omniplan/v1"

Verb: TypeAlias = Literal[
    "batch_twists",
    "batch_validate",
    "cancel",
    "health",
    "register",
    "select",
    "space",
    "unregister",
    "validate",
    "vehicle",
    "vehicles",
]

# One chunk without any of zenoh's signs: / * $ ? # @.
_CHUNK = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_PLAIN: dict[str, Verb] = {
    "vehicles": "vehicles",
    "validate": "validate",
    "select": "select",
    "batches/validate": "batch_validate",
    "batches/twists": "batch_twists",
    "health": "health",
}
_WITH_ID: dict[str, Verb] = {
    "vehicles": "vehicle",
    "spaces": "space",
    "register": "register",
    "unregister": "unregister",
    "cancel": "cancel",
}
_OF_VEHICLE: tuple[Verb, ...] = ("vehicle", "space")
_PATH = {verb: path for path, verb in (*_PLAIN.items(), *_WITH_ID.items())}


@dataclass(frozen=True)
class Route:
    """What a concrete key asks for."""

    verb: Verb
    id: str = ""
    """Name of the vehicle, for ``vehicle`` and ``space``; of the request to cancel."""

    @property
    def is_change(self) -> bool:
        """Whether it may change what a server knows."""
        return self.verb in ("register", "unregister")

    @property
    def takes_payload(self) -> bool:
        """Whether the question is in the payload rather than in the key."""
        return self.verb in (
            "validate",
            "select",
            "batch_validate",
            "batch_twists",
            "register",
            "unregister",
        )


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

    @property
    def files(self) -> str:
        """The expression that matches the keys of all vehicle files."""
        return f"{self.root}/vehicles/*"

    @property
    def events(self) -> str:
        """The expression that matches the events of all vehicles."""
        return f"{self.root}/events/vehicles/*"

    def event(self, id: str) -> str:
        """Return the key under which changes of a vehicle are published."""
        return f"{self.root}/events/vehicles/{checked_chunk('vehicle', id)}"

    @property
    def all_online(self) -> str:
        """The expression that matches the tokens of all vehicles."""
        return f"{self.root}/vehicles/*/online"

    def online(self, id: str) -> str:
        """Return the token of one vehicle."""
        return f"{self.root}/vehicles/{checked_chunk('vehicle', id)}/online"

    def sync(self, instance: str, *rest: str) -> str:
        """Return a key that servers use among themselves.

        Its chunk ``@sync`` is matched by no wildcard.

        Parameters
        ----------
        instance : str
            The server, or ``*`` for all.
        rest : str
            What follows, chunks or ``*``.
        """
        chunks = (instance, *rest)
        checked = (c if c == "*" else checked_chunk("sync key", c) for c in chunks)
        return "/".join((self.root, "@sync", *checked))

    def of(self, route: Route) -> str:
        """Return the concrete key of a question."""
        path = f"{self.root}/{_PATH[route.verb]}"
        if route.verb in _PLAIN.values():
            return path
        what = "request" if route.verb == "cancel" else "vehicle"
        return f"{path}/{checked_chunk(what, route.id)}"

    def all_of(self, vehicles: Iterable[str]) -> tuple[str, ...]:
        """Return every concrete key that a server of these vehicles answers.

        Without those that change something: no wildcard stands for them.
        """
        routes = [Route(verb) for verb in _PLAIN.values()]
        routes += [Route(verb, id) for id in vehicles for verb in _OF_VEHICLE]
        return tuple(map(self.of, routes))

    @cached_property
    def _plain(self) -> dict[str, Route]:
        """What the keys without a name ask for."""
        return {f"{self.root}/{path}": Route(verb) for path, verb in _PLAIN.items()}

    def route(self, key: str) -> Route:
        """Return what a concrete key asks for.

        Raises
        ------
        InvalidMessage
            With code ``unknown_key`` if the site has no such key.
        """
        plain = self._plain.get(key)
        if plain is not None:
            return plain
        match key.removeprefix(f"{self.root}/").split("/"):
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
