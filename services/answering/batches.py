"""Batches on the server: one question in Arrow, its answer in parts as they come."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import pyarrow as pa

from configspace.space import PermissibleSpace
from configspace.vehicle import Vehicle
from configspace.vehicle_io import vehicle_from_data
from omniplan.batch.many import Batch
from omniplan.batch.twists import check_twists
from omniplan.trajectory import Trajectory
from services.answering.answers import Answer, Parts
from services.answering.calls import Call
from services.protocol.arrow import ARROW, parameters_of, read_table, write_table
from services.protocol.arrow_motions import trajectories_in, twists_in
from services.protocol.batch_messages import (
    BatchPart,
    BatchTwistsRequest,
    BatchValidateRequest,
)
from services.protocol.messages import RequestLimits, decode, encode

__all__ = ["Choose", "fleet_digest", "judge_twists", "validate_batch"]

Choose = Callable[[Sequence[str] | None], Sequence[PermissibleSpace]]
"""Returns vehicles by their names, all for None."""

TURN = 0.02
"""After so long others have their turn, s."""
FIRST = 1 << 16
"""Samples times vehicles of the first part: about two turns. Cut smaller, the kernels
have too little to do at once, and each part costs a millisecond besides."""
MAX_PAIRS = 1 << 16
"""Rows of one part: its size stays in the order of a megabyte."""
TWISTS = 1 << 18
"""Twists of one part."""


def validate_batch(
    payload: bytes, choose: Choose, limits: RequestLimits, call: Call
) -> Parts:
    """Judge every trajectory for every vehicle, as `omniplan.validate_many` does.

    Nothing is sent before all trajectories are known to be sound.
    """
    table = read_table(payload, limits.max_batch_samples)
    request = decode(BatchValidateRequest, parameters_of(table))
    call.begin(request.request, request.deadline)
    call.n_samples += table.num_rows
    spaces = choose(request.vehicles)
    vehicle = None
    if request.parameters_of is not None:
        vehicle = vehicle_from_data(request.parameters_of, "parameters_of")
    trajectories = yield from _read_in_turns(table, vehicle)
    batch = Batch(trajectories, spaces, allow_unreachable=request.allow_unreachable)
    parts = _Numbered(batch.pairs, fleet_digest(spaces), request.request)
    mean = table.num_rows / len(trajectories)
    size = max(1, round(FIRST / (mean * max(len(spaces), 1))))
    start = asked = 0
    while start < len(trajectories):
        began = time.perf_counter()
        chunk = trajectories[start : start + size]
        rows = yield from batch.in_turns(chunk)
        answer = parts.answer(rows, batch.asked - asked)
        start, asked = start + size, batch.asked
        if start >= len(trajectories):
            return answer
        yield answer
        size = _next_size(size, time.perf_counter() - began, len(spaces))
    return None


def judge_twists(
    payload: bytes, choose: Choose, limits: RequestLimits, call: Call
) -> Parts:
    """Tell which twists are permitted, as `omniplan.check_twists` does."""
    table = read_table(payload, limits.max_batch_samples)
    request = decode(BatchTwistsRequest, parameters_of(table))
    call.begin(request.request, request.deadline)
    call.n_samples += table.num_rows
    spaces = choose((request.vehicle,))
    twists = twists_in(table)
    parts = _Numbered(len(twists), fleet_digest(spaces), request.request)
    for start in range(0, max(len(twists), 1), TWISTS):
        permitted = check_twists(twists[start : start + TWISTS], spaces[0])
        rows = pa.record_batch({"permitted": permitted})
        answer = parts.answer(rows)
        if parts.done == len(twists):
            return answer
        yield answer
    return None


def fleet_digest(spaces: Sequence[PermissibleSpace]) -> str:
    """Return what tells whether the same vehicles were judged."""
    lines = [f"{space.name} {space.header.fingerprint}" for space in spaces]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _read_in_turns(
    table: pa.Table, vehicle: Vehicle | None
) -> Generator[None, None, list[Trajectory]]:
    """Return the trajectories of a table; yields where it takes long."""
    found = []
    began = time.perf_counter()
    for trajectory in trajectories_in(table, vehicle):
        found.append(trajectory)
        if time.perf_counter() - began > TURN:
            yield
            began = time.perf_counter()
    return found


def _next_size(size: int, took: float, n_vehicles: int) -> int:
    """Return how many trajectories the next part has: about two turns of work."""
    wanted = size * min(max(2 * TURN / max(took, 1e-6), 0.25), 2.0)
    return max(1, min(round(wanted), MAX_PAIRS // max(n_vehicles, 1)))


@dataclass
class _Numbered:
    """Numbers the parts of one answer."""

    total: int
    fleet: str
    request: str | None
    sequence: int = 0
    done: int = 0

    def answer(self, rows: pa.RecordBatch, asked: int = 0) -> Answer:
        """Return the next part with these rows."""
        first, self.done = self.done, self.done + rows.num_rows
        part = BatchPart(
            request=self.request,
            sequence=self.sequence,
            first=first,
            done=self.done,
            total=self.total,
            is_last=self.done == self.total,
            fleet=self.fleet,
            asked=asked,
        )
        self.sequence += 1
        return Answer(write_table(rows, encode(part)), ARROW)
