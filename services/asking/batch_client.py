"""Batches asked by a client: cut into requests, a few of them under way at a time.

A server sees requests of bounded size, one that is lost is asked again without the
others, and the parts of all answers come in the order of the question.
"""

from __future__ import annotations

import time
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import pyarrow as pa

from configspace.vehicle import Vehicle
from omniplan.trajectory import Trajectory
from services.asking.asker import Asker, Attempts, error_of
from services.errors import (
    InvalidMessage,
    ServiceError,
    ServiceTimeout,
    ServiceUnreachable,
)
from services.protocol.arrow import ARROW, parameters_of, read_table, write_table
from services.protocol.arrow_motions import table_of_trajectories
from services.protocol.batch_messages import (
    BatchPart,
    BatchTwistsRequest,
    BatchValidateRequest,
)
from services.protocol.keys import Route
from services.protocol.messages import decode, encode
from services.wire.exchange import Reply, Stop, Stream

__all__ = ["Part", "Progress", "Question", "asked", "questions_of", "slices_of"]

Progress: TypeAlias = Callable[[int, int], None]
"""Is given the rows that are done and those there are, after every part."""
Parameters: TypeAlias = BatchValidateRequest | BatchTwistsRequest

SAMPLES = 1 << 16
"""Samples of one request: about 2 MiB."""
UNDER_WAY = 3
"""Requests: one is judged while another travels; more would only wait."""
MAX_ROWS = 1 << 31


@dataclass(frozen=True, eq=False)
class Question:
    """One request of a batch."""

    n_items: int
    """Trajectories or twists in it."""
    table: pa.Table
    parameters: Parameters


@dataclass(frozen=True, eq=False)
class Part:
    """One part of the answer to a batch."""

    rows: pa.Table
    asked: int
    """Pairs that the kernels left to `omniplan.validate`."""
    done: int
    """Rows of the whole batch up to and with this part."""
    total: int
    """Rows of the whole batch."""


def questions_of(
    trajectories: Sequence[Trajectory], parameters: BatchValidateRequest
) -> Iterator[Question]:
    """Yield a batch as requests, in its order.

    One table holds one form, and parameters of one vehicle.
    """
    start = n_samples = 0
    for stop, trajectory in enumerate(trajectories):
        first = trajectories[start]
        is_full = n_samples + trajectory.t.size > SAMPLES
        if stop > start and (is_full or _kind(first) != _kind(trajectory)):
            yield _question(trajectories[start:stop], parameters)
            start, n_samples = stop, 0
        n_samples += trajectory.t.size
    yield _question(trajectories[start:], parameters)


def slices_of(twists: pa.Table, parameters: BatchTwistsRequest) -> Iterator[Question]:
    """Yield twists as requests, in their order."""
    for start in range(0, max(twists.num_rows, 1), 4 * SAMPLES):
        table = twists.slice(start, 4 * SAMPLES)
        yield Question(table.num_rows, table, parameters)


def asked(
    asker: Asker,
    route: Route,
    questions: Iterable[Question],
    n_items: int,
    timeout: float | None,
    stop: Stop,
) -> Iterator[Part]:
    """Ask a batch and yield the parts of its answer in their order.

    Closing the iterator cancels what is under way.

    Parameters
    ----------
    asker : Asker
    route : Route
    questions : iterable of Question
    n_items : int
        Trajectories or twists of all questions.
    timeout : float, s, optional
        For the whole batch. In any case a part must come within the time for one
        attempt.
    stop : Stop
        Ends it; is set at the end.

    Raises
    ------
    ServiceError
        As for any question; also where a vehicle changes while the batch is judged.
    """
    batch = _Batch(asker, route, stop, timeout)
    waiting = iter(questions)
    running: deque[_Request] = deque()
    done = 0
    try:
        while True:
            while len(running) < UNDER_WAY:
                question = next(waiting, None)
                if question is None:
                    break
                running.append(_Request(batch, question))
            if not running:
                return
            request = running[0]
            for rows, part in request.parts():
                done += rows.num_rows
                # Every item of a batch has as many rows as any other.
                total = part.total * n_items // max(request.question.n_items, 1)
                yield Part(rows, part.asked, done, total)
            running.popleft()
    finally:
        for request in running:
            request.cancel()
        stop.set()


class _Batch:
    """What the requests of one batch have in common."""

    def __init__(
        self, asker: Asker, route: Route, stop: Stop, timeout: float | None
    ) -> None:
        self.asker, self.stop = asker, stop
        self.key = asker.keys.of(route)
        self._timeout = timeout
        self._ends_at = time.monotonic() + (timeout or 0.0)
        self._fleet: str | None = None

    @property
    def is_over(self) -> bool:
        """Whether the time for the batch is over, or nobody waits for it."""
        is_late = self._timeout is not None and time.monotonic() >= self._ends_at
        return is_late or self.stop.is_set

    def left(self) -> float | None:
        """Return the time that is left for the whole batch, s; raises if none is."""
        if self._timeout is None:
            return None
        left = self._ends_at - time.monotonic()
        if left <= 0:
            raise ServiceTimeout(self.key, self._timeout)
        return left

    def check_fleet(self, fleet: str) -> None:
        """Raise unless all parts are about the same vehicles."""
        self._fleet = self._fleet or fleet
        if fleet != self._fleet:
            raise ServiceError(f"{self.key}: a vehicle has changed meanwhile; ask anew")


class _Request:
    """One request of a batch, asked again where it is lost."""

    def __init__(self, batch: _Batch, question: Question) -> None:
        self.question = question
        self._batch = batch
        self._attempts = Attempts(
            batch.asker, batch.key, batch.asker.attempt_timeout, batch.stop
        )
        self._n_rows = 0
        self._stream = Stream()
        self._failure: ServiceError | None = None
        self._start()

    def parts(self) -> Iterator[tuple[pa.Table, BatchPart]]:
        """Yield the parts of the answer that were not yielded before."""
        self._attempts.begin()
        while True:
            try:
                if self._failure is not None:
                    raise self._failure
                yield from self._received()
                return
            except ServiceError as error:
                if self._batch.is_over:
                    raise
                self._attempts.pause_after(error)
            self.cancel()
            self._start()

    def cancel(self) -> None:
        """Tell the server that nobody waits any longer."""
        asker = self._batch.asker
        try:
            asker.cancel(asker.peer(asker.attempt_timeout), self._name)
        except ServiceError:
            return  # Then nobody is there who would go on.

    def _start(self) -> None:
        """Ask; a failure is told when it is this request's turn."""
        self._name = uuid.uuid4().hex
        batch = self._batch
        asker = batch.asker
        self._failure = None
        try:
            left = batch.left()
            own = {"request": self._name, "deadline": left}
            parameters = self.question.parameters.model_copy(update=own)
            self._attempt = asker.attempt(batch.stop)
            self._stream = asker.peer(asker.attempt_timeout).stream(
                batch.key,
                write_table(self.question.table, encode(parameters)),
                ARROW,
                FOREVER if left is None else left,
                everyone=self._attempts.is_everyone_asked,
                stop=self._attempt,
            )
        except ServiceError as error:
            self._failure = error

    def _received(self) -> Iterator[tuple[pa.Table, BatchPart]]:
        """Yield parts until the last one; raises if it does not come."""
        batch = self._batch
        while True:
            rows, part = _read(self._next())
            batch.check_fleet(part.fleet)
            batch.asker.met()
            if part.first > self._n_rows:
                raise ServiceUnreachable(batch.asker.where, "a part has been lost")
            # Another server, or attempt, may have sent the beginning before.
            rows = rows.slice(self._n_rows - part.first)
            self._n_rows += rows.num_rows
            self._attempts.begin()
            if rows.num_rows or not part.total:
                yield rows, part
            if self._n_rows >= part.total:
                return

    def _next(self) -> Reply:
        """Return the next reply that is none of an error."""
        batch = self._batch
        patience = batch.asker.attempt_timeout
        left = batch.left()
        try:
            reply = self._stream.receive(
                patience if left is None else min(patience, left)
            )
        except TimeoutError:
            batch.left()
            raise ServiceTimeout(batch.key, patience) from None
        if batch.stop.is_set:
            raise ServiceError(f"{batch.key}: the question was cancelled")
        if reply is None:
            where, reason = batch.asker.where, f"nobody answers {batch.key} to the end"
            raise ServiceUnreachable(where, reason)
        if reply.is_timeout:
            raise ServiceTimeout(batch.key, patience)
        if reply.is_error:
            batch.asker.met()
            raise error_of(reply)
        return reply


FOREVER = 24 * 3600.0
"""zenoh wants an end, s; ours are the pauses between two parts."""


def _question(
    trajectories: Sequence[Trajectory], parameters: BatchValidateRequest
) -> Question:
    vehicle = trajectories[0].vehicle
    if vehicle is not None:
        data = vehicle.model_dump(mode="json")
        parameters = parameters.model_copy(update={"parameters_of": data})
    return Question(len(trajectories), table_of_trajectories(trajectories), parameters)


def _kind(trajectory: Trajectory) -> tuple[str, Vehicle | None]:
    return trajectory.form, trajectory.vehicle


def _read(reply: Reply) -> tuple[pa.Table, BatchPart]:
    """Return rows and place of one part; ServiceError if it cannot be understood."""
    try:
        table = read_table(reply.payload, MAX_ROWS)
        return table.replace_schema_metadata(None), decode(
            BatchPart, parameters_of(table)
        )
    except InvalidMessage as error:
        raise ServiceError(f"the server's answer cannot be read: {error}") from error
