"""Messages about registered vehicles, for clients and among servers."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from configspace.errors import InvalidInput
from services.protocol.messages import CHUNK, Message
from services.registering.snapshot import Change, Snapshot
from services.registering.store import MAX_REQUESTS, Record
from services.registering.versions import Version

__all__ = [
    "Digest",
    "RecordEntry",
    "Records",
    "RegisterReply",
    "RegisterRequest",
    "UnregisterRequest",
    "VehicleEvent",
    "Wanted",
]

MAX_WANTED = 100
"""Records that are sent at once."""
MAX_RECORDS_BYTES = 4 * 2**20
"""Vehicle files that are sent at once, characters; one longer is sent alone."""

Kind: TypeAlias = Literal["put", "delete"]
Names: TypeAlias = Annotated[tuple[str, ...], Field(strict=False)]
RequestName: TypeAlias = Annotated[str, Field(pattern=CHUNK)]
RequestNames: TypeAlias = Annotated[tuple[RequestName, ...], Field(strict=False)]


class RegisterRequest(Message):
    """A vehicle to be registered; its name is in the key, too."""

    vehicle: dict[str, Any] | str
    """A vehicle file: as a JSON object, or the text of a JSON or YAML file."""
    expected_version: str | None = None
    """The version that it replaces, or ``absent``; None for whatever is there."""
    request: RequestName | None = None
    """Name of this change, the same when it is asked again; one that nobody guesses."""

    def content(self) -> bytes:
        """Return the vehicle file."""
        text = self.vehicle
        if not isinstance(text, str):
            text = json.dumps(text)
        # What is no text (lone surrogates) is refused as no UTF-8.
        return text.encode(errors="surrogatepass")


class UnregisterRequest(Message):
    """A vehicle to be removed; its name is in the key."""

    expected_version: str | None = None
    """The version that is to be removed; None for whatever is there."""
    request: RequestName | None = None
    """As in a RegisterRequest."""


class RegisterReply(Message):
    """What is known of a vehicle now; to register and unregister."""

    id: str
    """Name of the vehicle."""
    version: str
    """Its version, later ones sort after earlier ones by their counter."""
    kind: Kind
    """``put``: it is registered; ``delete``: it was removed."""
    fingerprint: str
    """Content hash of its data sheet; empty for ``delete``."""

    @classmethod
    def of(cls, change: Change) -> RegisterReply:
        """Return the reply for a change."""
        return cls(
            id=change.id,
            version=str(change.version),
            kind=change.kind,
            fingerprint=change.fingerprint,
        )


class VehicleEvent(RegisterReply):
    """Published by every server whose vehicle has changed."""

    server: str
    """The server that publishes it."""

    @classmethod
    def by(cls, change: Change, server: str) -> VehicleEvent:
        """Return the event for a change."""
        return cls(**RegisterReply.of(change).model_dump(), server=server)


class RecordEntry(Message):
    """Name and version of one record, and what it says if that was asked for."""

    id: str
    version: str
    vehicle: str | None = None
    """The vehicle file as JSON; None: it was removed."""
    requests: Annotated[RequestNames, Field(max_length=MAX_REQUESTS)] = ()
    """Names of the requests that made its newest changes."""

    def value(self) -> Record:
        """Return the record; InvalidInput if it is none."""
        version = Version.parse(self.version)
        return Record(self.id, version, self.vehicle, self.requests)


class Digest(Message):
    """Which versions a server has."""

    state: str
    """Hash of all names and versions."""
    versions: dict[str, str]
    """Version by name; empty where the asking server has the same state."""

    @classmethod
    def of(cls, snapshot: Snapshot, known_state: str) -> Digest:
        """Return the digest for a server whose own state is `known_state`."""
        versions = {}
        if snapshot.state != known_state:
            versions = {id: str(r.version) for id, r in snapshot.records.items()}
        return cls(state=snapshot.state, versions=versions)

    def newer_than(self, snapshot: Snapshot) -> dict[str, Version]:
        """Return what the other server has in a newer version; what is none is left."""
        newer = {}
        for id, text in self.versions.items():
            try:
                version = Version.parse(text)
            except InvalidInput:
                continue
            own = snapshot.records.get(id)
            if own is None or own.version < version:
                newer[id] = version
        return newer


class Wanted(Message):
    """Whose records are asked for."""

    names: Annotated[Names, Field(max_length=MAX_WANTED)]


class Records(Message):
    """Records; those that are left out for their size are asked for again."""

    records: Annotated[tuple[RecordEntry, ...], Field(strict=False)]

    @classmethod
    def of(cls, snapshot: Snapshot, names: Iterable[str]) -> Records:
        """Return the records of these names, as many as one message holds."""
        entries: list[RecordEntry] = []
        size = 0
        for name in names:
            record = snapshot.records.get(name)
            if record is None:
                continue
            size += len(record.vehicle or "")
            if entries and size > MAX_RECORDS_BYTES:
                break
            version = str(record.version)
            entry = RecordEntry(
                id=name,
                version=version,
                vehicle=record.vehicle,
                requests=record.requests,
            )
            entries.append(entry)
        return cls(records=tuple(entries))
