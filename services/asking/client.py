"""A client: asks a server, with the same values as the calls within Python."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from configspace.errors import CacheError
from configspace.space import PermissibleSpace
from configspace.storage import parse_space
from configspace.vehicle import Vehicle
from configspace.vehicle_io import parse_vehicle
from omniplan.batch.many import SCHEMA, require_names
from omniplan.choosing.requirements import Requirement
from omniplan.report import Ranking, Report
from omniplan.trajectory import Trajectory, timed
from services.asking.batch_client import Part, Progress, asked, questions_of, slices_of
from services.asking.connection import Connection, checked_timeout
from services.errors import ServiceError
from services.protocol.arrow_motions import table_of_twists
from services.protocol.batch_messages import BatchTwistsRequest, BatchValidateRequest
from services.protocol.keys import Route
from services.protocol.messages import (
    Health,
    SelectReply,
    SelectRequest,
    ValidateReply,
    ValidateRequest,
    VehiclesReply,
    decode,
    encode,
)
from services.registering.registry_messages import (
    RegisterReply,
    RegisterRequest,
    UnregisterRequest,
)
from services.wire.exchange import Stop

__all__ = ["Client"]

T = TypeVar("T")


class Client(Connection):
    """Asks a server; use it in a ``with`` block. It may be shared by threads.

    The connection is made by the first question and made again by itself after a loss.

    Every question raises `ServiceUnreachable` if nobody is there, `ServiceTimeout` if
    the answer takes too long, `RemoteError` if the answer is an error, and
    `ServiceError` if it cannot be understood.

    Parameters
    ----------
    endpoint : str or sequence of str
        Where the server listens, ``tcp/HOST:PORT`` or ``tls/HOST:PORT``; of several
        servers of the site any that is there answers.
    site : str
        The site the server answers for.
    timeout : float, s, > 0
        For each question, all attempts together; in a batch for each part of the
        answer.
    attempt_timeout : float, s, > 0, optional
        After so long without an answer all servers are asked again, not only the
        nearest; default `timeout`.
    retry : bool
        Ask again, within `timeout`, where the server is busy or about to stop, or has
        gone after it was there. All questions may be repeated without harm.
    security : Security, optional
        Certificates, for ``tls/HOST:PORT``; see ``docs/security.md``.

    Raises
    ------
    InvalidInput
        If a value is not allowed: InvalidEndpoint for the address, InvalidSecurity for
        a certificate.
    """

    def validate(
        self,
        trajectories: Sequence[Trajectory],
        vehicle: str,
        *,
        allow_unreachable: bool = False,
    ) -> tuple[Report, ...]:
        """Ask whether a vehicle can drive trajectories.

        Parameters
        ----------
        trajectories : sequence of Trajectory
        vehicle : str
            One of `vehicles`.
        allow_unreachable : bool
            As for `omniplan.validate`.

        Returns
        -------
        reports : tuple of Report
            One for each trajectory, as `omniplan.validate` gives them.
        """
        request = ValidateRequest.of(
            trajectories, vehicle, allow_unreachable=allow_unreachable
        )
        payload = self._ask_question(Route("validate"), request)
        reports = _read(lambda: decode(ValidateReply, payload).values())
        return _one_each(reports, trajectories)

    def select(
        self,
        trajectories: Sequence[Trajectory],
        vehicles: Sequence[str] | None = None,
        by: str = "duration",
        *,
        requirements: Sequence[Requirement | str] = (),
        allow_unreachable: bool = False,
        online_only: bool = False,
    ) -> tuple[Ranking, ...]:
        """Ask which vehicles can drive trajectories, best first.

        Parameters
        ----------
        trajectories : sequence of Trajectory
        vehicles : sequence of str, optional
            Which to compare; default all that the server knows.
        by : {"duration", "margin", "manoeuvrability"}
        requirements : sequence of Requirement or str
        allow_unreachable : bool
            Both as for `omniplan.select`.
        online_only : bool
            Compare only vehicles that are online now.

        Returns
        -------
        rankings : tuple of Ranking
            One for each trajectory, as `omniplan.select` gives them.
        """
        request = SelectRequest.of(
            trajectories,
            vehicles,
            by,
            requirements,
            allow_unreachable=allow_unreachable,
            online_only=online_only,
        )
        payload = self._ask_question(Route("select"), request)
        rankings = _read(lambda: decode(SelectReply, payload).values())
        return _one_each(rankings, trajectories)

    def validate_many(
        self,
        trajectories: Sequence[Trajectory],
        vehicles: Sequence[str] | None = None,
        *,
        allow_unreachable: bool = False,
        progress: Progress | None = None,
        timeout: float | None = None,
    ) -> pa.Table:
        """Ask which of many trajectories which vehicles can drive.

        Parameters
        ----------
        trajectories : sequence of Trajectory
            Of any number; the client cuts the batch into requests. Names must differ.
        vehicles : sequence of str, optional
            Default all that the server knows.
        allow_unreachable : bool
            As for `omniplan.validate_many`.
        progress : callable, optional
            Is given the number of pairs that are done and of all, after every part.
        timeout : float, s, > 0, optional
            For the whole batch. In any case every part must come within the timeout of
            the client.

        Returns
        -------
        table : pyarrow.Table
            One row per pair, as `omniplan.validate_many` gives them.

        Raises
        ------
        InvalidInput
            If there is no trajectory, names repeat, or a path has no times.
        """
        parts = self._verdicts(trajectories, vehicles, allow_unreachable, timeout)
        found = list(_told(parts, progress))
        table = pa.concat_tables([part.rows for part in found]).cast(SCHEMA)
        counts = {
            "omniplan.pairs": str(table.num_rows),
            "omniplan.asked": str(sum(part.asked for part in found)),
        }
        return table.replace_schema_metadata(counts)

    def verdicts(
        self,
        trajectories: Sequence[Trajectory],
        vehicles: Sequence[str] | None = None,
        *,
        allow_unreachable: bool = False,
        progress: Progress | None = None,
        timeout: float | None = None,
    ) -> Generator[pa.Table, None, None]:
        """Ask as `validate_many`, and yield the rows in parts as they come.

        Closing the generator cancels what the server has not done yet.
        """
        parts = self._verdicts(trajectories, vehicles, allow_unreachable, timeout)
        for part in _told(parts, progress):
            yield part.rows

    def check_twists(
        self,
        twists: npt.ArrayLike,
        vehicle: str,
        *,
        progress: Progress | None = None,
        timeout: float | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Ask which twists are permitted.

        Parameters
        ----------
        twists : (n, 3) float32 or float64, m/s, m/s, rad/s
            As for `omniplan.check_twists`.
        vehicle : str
        progress, timeout
            As for `validate_many`.

        Returns
        -------
        permitted : (n,) bool
        """
        table = table_of_twists(twists)
        parts = asked(
            self._asker,
            Route("batch_twists"),
            slices_of(table, BatchTwistsRequest(vehicle=vehicle)),
            table.num_rows,
            _checked_overall(timeout),
            self._stop or Stop(),
        )
        found = [part.rows["permitted"] for part in _told(parts, progress)]
        permitted = pa.chunked_array([x for column in found for x in column.chunks])
        return np.asarray(permitted.to_numpy(), dtype=np.bool_)

    def vehicles(self) -> tuple[str, ...]:
        """Return the names of the vehicles that the server knows."""
        payload = self._ask(Route("vehicles"))
        return _read(lambda: decode(VehiclesReply, payload).vehicles)

    def vehicle(self, name: str) -> Vehicle:
        """Return a vehicle."""
        payload = self._ask(Route("vehicle", name))
        return _read(lambda: parse_vehicle(payload.decode()))

    def space(self, name: str) -> PermissibleSpace:
        """Return a vehicle's data sheet, to check with it without asking again.

        It is kept until a server publishes that the vehicle has changed, or cannot be
        seen any longer; so this may be called before every check.
        """
        known = self._sheets.get(name)
        if known is not None:
            return known
        route = Route("space", name)
        self._asker.keys.of(route)  # refuses what is no name before connecting
        mark = self._sheets.follow(self._asker.peer(self._timeout))
        payload = self._ask(route)
        space = _read(lambda: parse_space(payload))
        self._sheets.put(name, space, mark)
        return space

    def health(self) -> Health:
        """Return the state of the server."""
        payload = self._ask(Route("health"))
        return _read(lambda: decode(Health, payload))

    def register(self, vehicle: Vehicle, expected_version: str | None = None) -> str:
        """Register a vehicle, or a new version of it, with all servers of the site.

        Where the answer is lost it is asked again, and done once: if somebody else has
        changed the vehicle since, RemoteError with code ``conflict`` says so.

        Parameters
        ----------
        vehicle : Vehicle
        expected_version : str, optional
            The version that it replaces, or ``"absent"``: if there is another one,
            RemoteError with code ``conflict``.

        Returns
        -------
        version : str
            That which is there now; the same as before if the vehicle is.
        """
        text = vehicle.model_dump_json(exclude_none=True)
        request = RegisterRequest(
            vehicle=text, expected_version=expected_version, request=uuid.uuid4().hex
        )
        payload = self._ask(Route("register", vehicle.name), encode(request))
        return _read(lambda: decode(RegisterReply, payload).version)

    def unregister(self, name: str, expected_version: str | None = None) -> str:
        """Remove a registered vehicle from all servers of the site.

        Where the answer is lost it is asked again, as by `register`.

        Parameters
        ----------
        name : str
        expected_version : str, optional
            The version that is to be removed: if there is another one, RemoteError with
            code ``conflict``.

        Returns
        -------
        version : str
            That of the removal.
        """
        request = UnregisterRequest(
            expected_version=expected_version, request=uuid.uuid4().hex
        )
        payload = self._ask(Route("unregister", name), encode(request))
        return _read(lambda: decode(RegisterReply, payload).version)

    @contextmanager
    def announce(self, vehicle: str) -> Iterator[None]:
        """Let a vehicle be online within a ``with`` block.

        It is so for as long as there is a connection, and again after a loss.

        Parameters
        ----------
        vehicle : str
            Name of the vehicle.
        """
        peer = self._asker.peer(self._timeout)
        withdraw = peer.announce(self._asker.keys.online(vehicle))
        try:
            yield
        finally:
            withdraw()

    def _verdicts(
        self,
        trajectories: Sequence[Trajectory],
        vehicles: Sequence[str] | None,
        allow_unreachable: bool,
        timeout: float | None,
    ) -> Iterator[Part]:
        require_names("trajectories", [timed(one).name for one in trajectories])
        names = None if vehicles is None else tuple(vehicles)
        parameters = BatchValidateRequest(
            vehicles=names, allow_unreachable=allow_unreachable
        )
        return asked(
            self._asker,
            Route("batch_validate"),
            questions_of(trajectories, parameters),
            len(trajectories),
            _checked_overall(timeout),
            self._stop or Stop(),
        )


def _told(parts: Iterator[Part], progress: Progress | None) -> Iterator[Part]:
    """Yield parts, and tell of each."""
    for part in parts:
        yield part
        if progress is not None:
            progress(part.done, part.total)


def _read(parse: Callable[[], T]) -> T:
    """Return what an answer says; ServiceError if it cannot be understood."""
    try:
        return parse()
    except (CacheError, ValueError) as error:
        raise ServiceError(f"the server's answer cannot be read: {error}") from error


def _one_each(
    answers: tuple[T, ...], trajectories: Sequence[Trajectory]
) -> tuple[T, ...]:
    if len(answers) != len(trajectories):
        raise ServiceError(
            f"the server's answer cannot be read: {len(answers)} verdicts on "
            f"{len(trajectories)} trajectories"
        )
    return answers


def _checked_overall(timeout: float | None) -> float | None:
    return None if timeout is None else checked_timeout("timeout", timeout)
