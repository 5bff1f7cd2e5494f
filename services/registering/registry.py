"""Which vehicles a server knows: those it was started with, and registered ones.

Questions see an immutable snapshot. A change parses, checks and builds the vehicle
first, then stores it, then swaps the snapshot, then tells the subscribers; whatever
fails before the swap leaves everything as it was.

Vehicles that the server was started with cannot be changed by a request. A registered
one of the same name is kept in the store, but not used.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Self, TypeAlias

from configspace.build import build_space
from configspace.errors import InvalidInput, InvalidVehicle, Problem
from configspace.grid import Grid
from configspace.space import PermissibleSpace
from configspace.vehicle import Vehicle
from configspace.vehicle_io import parse_vehicle
from services.errors import CODES, InvalidMessage, RegistrationRefused, StoreError
from services.protocol.keys import checked_chunk
from services.registering.snapshot import Change, Snapshot, sheet_bytes
from services.registering.store import Record, VehicleStore
from services.registering.versions import Clock, Version

__all__ = ["ABSENT", "MAX_MEMORY", "Registry"]

ABSENT = "absent"
"""Expected version of a vehicle that must not be there yet."""
MAX_MEMORY = 2**30
"""What the data sheets of registered vehicles may take by default, bytes."""
MAX_VEHICLE_BYTES = 512 * 1024
"""Longest vehicle file; one with the most wheels that are allowed fits well."""

_log = logging.getLogger(__name__)


Listener: TypeAlias = Callable[[Change], None]


class Registry:
    """The vehicles of a server; safe with threads. With a store, close it at the end.

    Parameters
    ----------
    fleet : sequence of PermissibleSpace
        The vehicles that are always there, each name once.
    store : VehicleStore, optional
        Where registered vehicles are kept; the registry closes it.
    registration : bool
        Whether vehicles may be registered and removed; needs a store.
    max_vehicles : int, ≥ 1
        Names that may ever be registered, removed ones included.
    max_memory : int, bytes, ≥ 1
        What the data sheets of registered vehicles may take together.
    grid : Grid, optional
        Of the data sheets; default as for `build_space`.

    Raises
    ------
    InvalidInput
        If a name stands twice or fits no key, or registration has no store.
    """

    def __init__(
        self,
        fleet: Sequence[PermissibleSpace] = (),
        *,
        store: VehicleStore | None = None,
        registration: bool = False,
        max_vehicles: int = 1000,
        max_memory: int = MAX_MEMORY,
        grid: Grid | None = None,
    ) -> None:
        if registration and store is None:
            allowed = "registered vehicles need a store: a folder to keep them in"
            raise InvalidInput(Problem("registration", "on", allowed))
        if max_vehicles < 1:
            raise InvalidInput(Problem("max_vehicles", f"{max_vehicles}", "at least 1"))
        if max_memory < 1:
            raise InvalidInput(Problem("max_memory", f"{max_memory}", "at least 1"))
        self._fixed = _by_name(fleet)
        self._store = store
        self._is_open = registration
        self._max_vehicles = max_vehicles
        self._max_memory = max_memory
        self._grid = grid
        self._listeners: list[Listener] = []
        self._lock = threading.Lock()
        """Held from the last look at the present state to the end of a change."""
        self._clock = Clock("0" * 16 if store is None else store.instance)
        self._registered: dict[str, PermissibleSpace] = {}
        self._sizes: dict[str, int] = {}  # bytes of their data sheets
        self._problems: dict[str, str] = {}
        self._snapshot = Snapshot(MappingProxyType(self._fixed), MappingProxyType({}))
        if store is not None:
            self._load(store.records)

    @classmethod
    def open(
        cls,
        fleet: Sequence[PermissibleSpace],
        folder: str | Path,
        *,
        registration: bool = True,
        max_vehicles: int = 1000,
        max_memory: int = MAX_MEMORY,
        grid: Grid | None = None,
    ) -> Registry:
        """Return a registry that keeps registered vehicles in a folder.

        Raises
        ------
        StoreError
            If the folder cannot be used, or another program uses it.
        """
        store = VehicleStore(folder)
        try:
            return cls(
                fleet,
                store=store,
                registration=registration,
                max_vehicles=max_vehicles,
                max_memory=max_memory,
                grid=grid,
            )
        except BaseException:
            store.close()
            raise

    @property
    def snapshot(self) -> Snapshot:
        """What is known now."""
        return self._snapshot

    @property
    def fleet(self) -> Mapping[str, PermissibleSpace]:
        """The vehicles known now, by name; it never changes, ask again for a newer."""
        return self._snapshot.fleet

    @property
    def instance(self) -> str:
        """The store that versions given here name."""
        return self._clock.instance

    @property
    def takes_registrations(self) -> bool:
        """Whether vehicles may be registered and removed."""
        return self._is_open

    def put(
        self,
        name: str,
        vehicle: bytes,
        expected_version: str | None = None,
        request: str | None = None,
    ) -> Change:
        """Register a vehicle, or a new version of it; on return it is stored.

        What is registered already, to the same content, stays as it is, whatever is
        expected: so it does no harm to ask again when an answer was lost. With the name
        of the request this holds also where another change has followed: that one is
        not undone.

        Parameters
        ----------
        name : str
            The name that the vehicle file gives, too.
        vehicle : bytes
            A vehicle file, JSON or YAML.
        expected_version : str, optional
            The version that it replaces, or `ABSENT`.
        request : str, optional
            A name for this change, the same when it is asked again.

        Returns
        -------
        change : Change
            With the version that is there now.

        Raises
        ------
        RegistrationRefused
            If registrations are off, the version is another one or the same request was
            followed by another change (``conflict``), the vehicle is one of the start,
            there is no room, or it cannot be stored.
        InvalidInput
            If name, version or vehicle is not allowed: InvalidVehicle for the latter.
        """
        self._check_open(name)
        _check_expected(expected_version)
        space, text = self._built(name, vehicle)
        with self._lock:
            old = self._snapshot.records.get(name)
            if old is not None and old.vehicle == text and name in self._registered:
                return self._change(old)
            self._check_version(name, old, expected_version)
            self._check_followed(old, request)
            self._check_room(name)
            problem = self._too_much(name, space)
            if problem:
                raise RegistrationRefused("registry_full", problem, "vehicle")
            return self._apply(self._next(name, text, request), space)

    def delete(
        self,
        name: str,
        expected_version: str | None = None,
        request: str | None = None,
    ) -> Change:
        """Remove a registered vehicle; one that is removed already stays so.

        Parameters
        ----------
        name : str
        expected_version : str, optional
            The version that is to be removed.
        request : str, optional
            As for `put`.

        Returns
        -------
        change : Change
            With the version of the removal.

        Raises
        ------
        RegistrationRefused
            As `put`; ``unknown_vehicle`` if it was never registered.
        InvalidInput
            If name or version is not allowed.
        """
        self._check_open(name)
        _check_expected(expected_version)
        with self._lock:
            old = self._snapshot.records.get(name)
            if old is None:
                message = f"vehicle: {name!r}; never registered"
                raise RegistrationRefused("unknown_vehicle", message, "vehicle")
            if old.is_deleted:
                return self._change(old)
            self._check_version(name, old, expected_version)
            self._check_followed(old, request)
            return self._apply(self._next(name, None, request), None)

    def merge(self, record: Record) -> bool:
        """Take over what another server has stored, if it is newer.

        A vehicle that cannot be read here is stored, but not used, rather than that
        its outdated version goes on to be used.

        Returns
        -------
        is_new : bool

        Raises
        ------
        RegistrationRefused
            If it cannot be stored, registrations are off, there is no room, or no
            version could follow on its own.
        """
        if not self._is_open:
            raise _refused("registration_off")
        if not self._clock.believes(record.version):
            message = f"version of {record.id}: {record.version}; none could follow"
            raise RegistrationRefused("conflict", message, "version")
        space, problem = None, ""
        if record.vehicle is not None and self._is_newer(record):
            space, problem = self._try_build(record.id, record.vehicle)
        with self._lock:
            if not self._is_newer(record):
                return False
            self._check_room(record.id)
            self._clock.see(record.version)
            self._apply(record, space, problem)
            return True

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Let a function know of every change, in order; return how to end that.

        It is called while further changes wait, so it must be quick and must not
        change the registry.
        """
        with self._lock:
            self._listeners.append(listener)
        return lambda: self._unsubscribe(listener)

    def close(self) -> None:
        """End all changes; what was read stays usable."""
        with self._lock:
            self._is_open = False
            if self._store is not None:
                self._store.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _unsubscribe(self, listener: Listener) -> None:
        with self._lock:
            self._listeners.remove(listener)

    def _load(self, records: Mapping[str, Record]) -> None:
        """Take over what is stored."""
        for name, record in sorted(records.items()):
            self._clock.see(record.version)
            if record.vehicle is not None:
                space, problem = self._try_build(name, record.vehicle)
                self._enter(name, space, problem)
        self._swap(records)

    def _is_newer(self, record: Record) -> bool:
        old = self._snapshot.records.get(record.id)
        return old is None or old.version < record.version

    def _built(self, name: str, content: bytes) -> tuple[PermissibleSpace, str]:
        """Return the space of a vehicle file and the file as it is stored."""
        if len(content) > MAX_VEHICLE_BYTES:
            given, allowed = f"{len(content)} bytes", f"at most {MAX_VEHICLE_BYTES}"
            raise InvalidMessage(Problem("vehicle", given, allowed), code="too_large")
        try:
            text = content.decode()
        except UnicodeDecodeError as error:
            problem = Problem("vehicle", str(error), "UTF-8 text is needed")
            raise InvalidVehicle(problem) from error
        vehicle = parse_vehicle(text)
        if vehicle.name != name:
            allowed = f"the key says {name!r}"
            raise InvalidVehicle(Problem("name", repr(vehicle.name)[:80], allowed))
        return build_space(vehicle, self._grid), _canonical(vehicle)

    def _try_build(self, name: str, text: str) -> tuple[PermissibleSpace | None, str]:
        """Return the space of a stored vehicle, or None and why there is none."""
        try:
            return self._built(name, text.encode())[0], ""
        except InvalidInput as error:
            _log.error("registered vehicle %s is not used: %s", name, error)
            return None, str(error)

    def _check_open(self, name: str) -> None:
        if not self._is_open:
            raise _refused("registration_off")
        checked_chunk("vehicle", name)
        if name in self._fixed:
            message = f"vehicle: {name!r}; the server was started with it"
            raise RegistrationRefused("read_only", message, "vehicle")

    def _check_version(
        self, name: str, old: Record | None, expected: str | None
    ) -> None:
        present = ABSENT if old is None or old.is_deleted else str(old.version)
        if expected is not None and expected != present:
            message = f"expected_version: {expected}; {name} is {present}"
            raise RegistrationRefused("conflict", message, "expected_version")

    def _check_followed(self, old: Record | None, request: str | None) -> None:
        """Raise if a change was made by this request, and then another one."""
        if old is not None and request in old.requests:
            message = (
                f"request: {request}; it was done, and another change followed: "
                f"{old.id} is {ABSENT if old.is_deleted else old.version}"
            )
            raise RegistrationRefused("conflict", message, "request")

    def _too_much(self, name: str, space: PermissibleSpace) -> str:
        """Return why the data sheet of a vehicle has no room; empty if it has."""
        total = sum(self._sizes.values()) - self._sizes.get(name, 0)
        total += sheet_bytes(space)
        if total <= self._max_memory:
            return ""
        return (
            f"vehicle: {name!r}; the data sheets would take {total} bytes, "
            f"at most {self._max_memory} are allowed"
        )

    def _next(self, name: str, text: str | None, request: str | None) -> Record:
        """Return the record of a change that is made here."""
        requests = () if request is None else (request,)
        return Record(name, self._clock.next(), text, requests)

    def _check_room(self, name: str) -> None:
        records = self._snapshot.records
        if name not in records and len(records) >= self._max_vehicles:
            message = (
                f"vehicle: {name!r}; {len(records)} names are registered or were, "
                "there is no room for one more"
            )
            raise RegistrationRefused("registry_full", message, "vehicle")

    def _apply(
        self, record: Record, space: PermissibleSpace | None, problem: str = ""
    ) -> Change:
        """Store, swap, tell; the lock is held."""
        if self._store is None or not self._is_open:
            raise _refused("registration_off")
        record = record.after(self._snapshot.records.get(record.id))
        try:
            self._store.write(record)
        except StoreError as error:
            _log.error("%s", error)
            raise RegistrationRefused("not_stored", str(error)) from error
        self._enter(record.id, space, problem)
        self._swap({**self._snapshot.records, record.id: record})
        change = self._change(record)
        for listener in self._listeners:
            listener(change)
        return change

    def _enter(self, name: str, space: PermissibleSpace | None, problem: str) -> None:
        self._registered.pop(name, None)
        self._sizes.pop(name, None)
        self._problems.pop(name, None)
        if space is not None and (too_much := self._too_much(name, space)):
            # Of another server, or stored while more was allowed.
            _log.error("registered vehicle %s is not used: %s", name, too_much)
            space, problem = None, too_much
        if space is not None:
            self._registered[name] = space
            self._sizes[name] = sheet_bytes(space)
        if problem:
            self._problems[name] = problem
        elif space is not None and name in self._fixed:
            self._problems[name] = "the server was started with another of this name"
            _log.warning("registered vehicle %s: %s", name, self._problems[name])

    def _swap(self, records: Mapping[str, Record]) -> None:
        """Let the next question see the present state."""
        registered = dict(sorted(self._registered.items()))
        # Those of the start come first and win.
        fleet = {**self._fixed, **registered, **self._fixed}
        self._snapshot = Snapshot(
            MappingProxyType(fleet),
            MappingProxyType(dict(records)),
            MappingProxyType(dict(self._problems)),
        )

    def _change(self, record: Record) -> Change:
        fingerprint = self._snapshot.fingerprint(record.id)
        if record.is_deleted:
            return Change(record.id, record.version, "delete", "")
        return Change(record.id, record.version, "put", fingerprint)


def _by_name(fleet: Iterable[PermissibleSpace]) -> dict[str, PermissibleSpace]:
    """Return the fleet by name, or raise where a name repeats or fits no key."""
    spaces: dict[str, PermissibleSpace] = {}
    for index, space in enumerate(fleet):
        where = f"fleet[{index}].name"
        if checked_chunk(where, space.name) in spaces:
            raise InvalidInput(
                Problem(where, f"{space.name!r} again", "each vehicle once")
            )
        spaces[space.name] = space
    return spaces


def _canonical(vehicle: Vehicle) -> str:
    """Return a vehicle file that is the same for all files of the same content."""
    return vehicle.model_dump_json(exclude_none=True)


def _check_expected(version: str | None) -> None:
    if version not in (None, ABSENT):
        Version.parse(version, "expected_version")


def _refused(code: str) -> RegistrationRefused:
    return RegistrationRefused(code, CODES[code])
