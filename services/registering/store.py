"""Registered vehicles in a folder, one file each, that survive a kill at any moment.

    store.json               format and name of this store
    lock                     held while a program uses the folder
    vehicles/NAME.HASH.json  the newest record of one vehicle
    damaged/                 records that were set aside

A record is written to a temporary name, synced, renamed over the old one, and the
folder is synced; only then is it acknowledged. What carries no sound checksum is set
aside and reported, never used. A deleted vehicle keeps a record that says so, as other
servers would bring it back otherwise.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import secrets
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, Self

from services.errors import StoreError
from services.protocol.keys import checked_chunk
from services.registering.versions import MAX_COUNTER, Version, is_instance

__all__ = ["MAX_REQUESTS", "Record", "VehicleStore"]

MAX_REQUESTS = 16
"""Requests that are remembered for each vehicle."""

_FORMAT = "omniplan vehicle store 1"
_TEMPORARY = ".tmp-"

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Record:
    """The newest state of one vehicle.

    Raises
    ------
    InvalidInput
        If the name can be no chunk of a key.
    """

    id: str
    version: Version
    vehicle: str | None
    """The vehicle file as JSON; None: deleted."""
    requests: tuple[str, ...] = field(default=(), compare=False)
    """Names of the requests that made the newest changes; see `after`. Servers that
    heard of changes in another order may know of others."""

    def __post_init__(self) -> None:
        checked_chunk("vehicle", self.id)
        for name in self.requests:
            checked_chunk("request", name)

    def after(self, old: Record | None) -> Record:
        """Return this record, knowing also the requests behind the one before.

        So one that is asked again because its answer was lost is recognised, also where
        another change has followed, after a restart, or by another server.
        """
        before = () if old is None else old.requests
        known = dict.fromkeys((*before, *self.requests))
        return replace(self, requests=tuple(known)[-MAX_REQUESTS:])

    @property
    def is_deleted(self) -> bool:
        """Whether there is no such vehicle any longer."""
        return self.vehicle is None


class VehicleStore:
    """A folder of records; use it in a ``with`` block. One program at a time.

    Parameters
    ----------
    folder : path
        Made if it is not there; its parent must be.

    Raises
    ------
    StoreError
        If the folder cannot be used, or another program uses it.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self._vehicles = self.folder / "vehicles"
        self._damaged = self.folder / "damaged"
        self._records: dict[str, Record] = {}
        self.damaged: tuple[str, ...] = ()
        """What was set aside when the store was opened, one line for each."""
        with _named(self.folder, "opened"):
            for path in (self.folder, self._vehicles, self._damaged):
                path.mkdir(exist_ok=True)
            self._lock = _locked(self.folder / "lock")
        try:
            with _named(self.folder, "opened"):
                self.instance = self._read_instance()
                self._read_all()
        except BaseException:
            self.close()
            raise

    @property
    def records(self) -> Mapping[str, Record]:
        """The newest record of each vehicle, by name; a copy."""
        return MappingProxyType(dict(self._records))

    def write(self, record: Record) -> None:
        """Keep a record in place of the one before; on return it is durable.

        Raises
        ------
        StoreError
            If it cannot be written. The record before is still there, or, if only the
            last sync failed, perhaps the new one.
        """
        if self._lock < 0:
            raise StoreError(f"vehicle store {self.folder}: is closed")
        with _named(self.folder, "written"):
            _replace(self._vehicles / _file_name(record.id), _dumped(record))
        self._records[record.id] = record

    def close(self) -> None:
        """Let other programs use the folder."""
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _read_instance(self) -> str:
        """Return the name of the store; a new one gets its name here."""
        path = self.folder / "store.json"
        try:
            data = json.loads(path.read_bytes())
            if data["format"] == _FORMAT and is_instance(data["instance"]):
                return str(data["instance"])
            reason = f"format {data['format']!r}; this program reads {_FORMAT!r}"
        except FileNotFoundError:
            instance = secrets.token_hex(8)
            content = json.dumps({"format": _FORMAT, "instance": instance})
            _replace(path, content.encode())
            return instance
        except (ValueError, KeyError, TypeError) as error:
            reason = f"damaged: {error!r}"
        # Its records may be of a format that this program would take for damaged.
        raise StoreError(f"vehicle store {path}: {reason}")

    def _read_all(self) -> None:
        """Read every record; set aside what is none."""
        reports = []
        for path in sorted(self._vehicles.iterdir()):
            if path.name.startswith(_TEMPORARY):
                path.unlink()  # a write that was never acknowledged
                continue
            try:
                record = _parsed(path.read_bytes())
                if path.name != _file_name(record.id):
                    raise ValueError(f"is the record of {record.id!r}")
            except (ValueError, RecursionError) as error:
                reports.append(self._set_aside(path, str(error)[:200]))
            else:
                self._records[record.id] = record
        self.damaged = tuple(reports)

    def _set_aside(self, path: Path, reason: str) -> str:
        kept = self._damaged / f"{path.name}.{secrets.token_hex(4)}"
        os.rename(path, kept)
        _sync_folder(self._vehicles)
        report = f"vehicle record {path.name}: {reason}; set aside as {kept.name}"
        _log.error("%s", report)
        return report


def _file_name(id: str) -> str:
    """Return the name of a vehicle's file, also where A and a are the same file."""
    return f"{id}.{hashlib.sha256(id.encode()).hexdigest()[:8]}.json"


def _dumped(record: Record) -> bytes:
    content = {
        "id": record.id,
        "counter": record.version.counter,
        "instance": record.version.instance,
        "vehicle": record.vehicle,
        "requests": record.requests,
    }
    return json.dumps({"checksum": _checksum(content), **content}).encode()


def _parsed(data: bytes) -> Record:
    """Return the record that a file holds; ValueError if it is not sound."""
    content = json.loads(data)
    if not isinstance(content, dict):
        raise ValueError("is no record")
    if content.pop("checksum", None) != _checksum(content):
        raise ValueError("the checksum does not match")
    match content:
        case {
            "id": str(id),
            "counter": int(counter),
            "instance": str(instance),
            "vehicle": None | str() as vehicle,
            "requests": [*requests],
        } if (
            0 < counter <= MAX_COUNTER
            and is_instance(instance)
            and all(isinstance(name, str) for name in requests)
        ):
            return Record(id, Version(counter, instance), vehicle, tuple(requests))
    raise ValueError("its keys are not those of a record")


def _checksum(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _replace(path: Path, content: bytes) -> None:
    """Write a file so that at any moment the old or the new one is there, whole."""
    temporary = path.with_name(f"{_TEMPORARY}{secrets.token_hex(8)}")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
    _sync_folder(path.parent)


def _sync_folder(path: Path) -> None:
    """Make renames within a folder durable."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _locked(path: Path) -> int:
    """Return the handle of a lock file that ends with this program, however it ends."""
    import fcntl  # not on every platform, and needed by servers with a store only

    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        message = f"vehicle store {path.parent}: another program uses it"
        raise StoreError(message) from error
    except BaseException:
        os.close(handle)
        raise
    return handle


@contextlib.contextmanager
def _named(folder: Path, what: str) -> Iterator[None]:
    """Turn errors of the system into StoreError."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise StoreError(
            f"vehicle store {folder}: cannot be {what}: {reason}"
        ) from error
