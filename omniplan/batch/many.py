"""Many trajectories for many vehicles at once: `validate_many` and `check_twists`.

What the kernels of `batch_verdicts` know is proved there, all else by `validate`, so
every verdict is that of `validate`.
"""

from __future__ import annotations

import contextlib
import logging
import math
from collections import Counter, deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numba
import numpy as np
import numpy.typing as npt
import pyarrow as pa

from configspace import InvalidInput, PermissibleSpace, Problem
from configspace.space import require_space
from omniplan.batch.fleet import Fleet, fleet_of, is_connected, is_plain
from omniplan.batch.groups import groups_of
from omniplan.batch.motions import Knots, knots_of, parts_of
from omniplan.batch.reaches import codes_of
from omniplan.batch.table import SCHEMA, UNKNOWN, Verdicts
from omniplan.batch.twists import check_twists
from omniplan.batch.verdicts import UNCLEAR, judge_pairs
from omniplan.judging.rows import Tolerances
from omniplan.trajectory import Trajectory
from omniplan.validation import judged

__all__ = ["SCHEMA", "Batch", "check_twists", "require_names", "validate_many"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Name: TypeAlias = str | None

CHUNK = 1 << 18
"""Pairs whose verdicts are held at once."""
SLICES = 64
"""Into at least so many tasks for the threads a chunk is cut ..."""
SAMPLES = 1 << 15
"""... and into more where one would have more samples than this."""
AHEAD = 2
"""Tasks per thread that may be under way."""
KERNEL_FORMS = ("poses", "twists")

_LOG = logging.getLogger(__name__)


def validate_many(
    trajectories: Sequence[Trajectory],
    spaces: Sequence[PermissibleSpace],
    tolerances: Tolerances | None = None,
    *,
    allow_unreachable: bool = False,
    progress: bool = False,
) -> pa.Table:
    """Judge every trajectory for every vehicle; the verdicts are those of `validate`.

    Parameters
    ----------
    trajectories : sequence of Trajectory
        At least one; names must differ.
    spaces : sequence of PermissibleSpace
        At least one; names must differ. Vehicles that differ in their names only are
        judged once.
    tolerances : Tolerances, optional
    allow_unreachable : bool
        As for `validate`.
    progress : bool
        Show a progress bar on standard error.

    Returns
    -------
    table : pyarrow.Table
        One row per pair, all vehicles of the first trajectory first:

        ``trajectory``, ``vehicle``
            Their names.
        ``valid``
            As ``validate(trajectory, space).valid``.
        ``margin``
            1 - the largest utilisation of any limit: of a valid pair never exceeded and
            sharp to a thousandth as in a `Report`; of a refused one, reached.
        ``duration``
            s.
        ``limit``, ``wheel``
            What refuses the pair, as the headline of its `Report`. Of a valid pair what
            the margin belongs to. Null where nothing limits it, or no wheel does.
        ``t``, ``value``, ``bound``, ``unit``
            Of a refused pair the sample, s, at which the limit is broken most, and by
            how much. The headline of a `Report` may have a worse place between two
            samples in the same stretch. Where nothing is broken at a sample: the same
            with the intervals between the samples halved evenly until something is.
        ``u``
            How far along a path the limit is met, m (`Path.parameter`), where rows are
            of paths (`PathBatch`) and the path has no timing; otherwise null.

        The metadata count the pairs (``omniplan.pairs``) and those that `validate`
        was asked for (``omniplan.asked``).

    Raises
    ------
    InvalidInput
        If a list is empty, names repeat, or a path has no times.

    Examples
    --------
    >>> import configspace, omniplan
    >>> fleet = [configspace.build_space(configspace.load_vehicle(name), cache=False)
    ...          for name in ("mecanum", "differential")]
    >>> aside = omniplan.Trajectory.from_poses([0, 2], [[0, 0, 0], [0, 1, 0]])
    >>> table = omniplan.validate_many([aside], fleet)
    >>> table["valid"].to_pylist(), table["limit"].to_pylist()[1]
    ([True, False], 'FIXED_WHEEL')
    """
    batch = Batch(
        trajectories,
        spaces,
        tolerances or Tolerances(),
        allow_unreachable=allow_unreachable,
    )
    table = pa.Table.from_batches(list(batch.verdicts(progress=progress)), SCHEMA)
    counts = {"omniplan.pairs": str(batch.pairs), "omniplan.asked": str(batch.asked)}
    return table.replace_schema_metadata(counts)


@dataclass(eq=False)
class Batch:
    """Pairs of trajectories and vehicles, judged chunk by chunk."""

    trajectories: Sequence[Trajectory]
    spaces: Sequence[PermissibleSpace]
    tolerances: Tolerances = field(default_factory=Tolerances)
    allow_unreachable: bool = False
    asked: int = 0
    """How many pairs `validate` was asked for so far."""

    def __post_init__(self) -> None:
        require_names("trajectories", [_name(x) for x in self.trajectories])
        for i, space in enumerate(self.spaces):
            require_space(space, f"spaces[{i}]")
        require_names("spaces", [space.name for space in self.spaces])

    @property
    def pairs(self) -> int:
        """How many pairs there are."""
        return len(self.trajectories) * len(self.spaces)

    @cached_property
    def _plain(self) -> list[int]:
        """The vehicles that the kernels know."""
        unreachable = self.allow_unreachable
        return [
            i
            for i, space in enumerate(self.spaces)
            if is_plain(space, allow_unreachable=unreachable)
        ]

    @cached_property
    def _types(self) -> tuple[Fleet, IntArray]:
        """The different vehicles among the plain ones, and which each of them is."""
        spaces = [self.spaces[i] for i in self._plain]
        vehicles = [space.vehicle for space in spaces if space.vehicle is not None]
        codes = [
            None if self.allow_unreachable or is_connected(space) else codes_of(space)
            for space in spaces
        ]
        fleet = fleet_of(vehicles, self.tolerances, codes=codes)
        known: dict[bytes, int] = {}
        kind = np.array(
            [
                known.setdefault(fleet.content(i), len(known))
                for i in range(len(self._plain))
            ],
            dtype=np.int64,
        )
        chosen = [int(np.flatnonzero(kind == k)[0]) for k in range(len(known))]
        return fleet.picked(chosen), kind

    def verdicts(self, *, progress: bool = False) -> Iterator[pa.RecordBatch]:
        """Yield the rows of `validate_many` in chunks of bounded size.

        Parameters
        ----------
        progress : bool
            Show a progress bar on standard error.
        """
        step = max(CHUNK // len(self.spaces), 1)
        with _bar(self.pairs if progress else 0) as advance:
            for start in range(0, len(self.trajectories), step):
                chunk = self.trajectories[start : start + step]
                yield _whole(self.in_turns(chunk))
                advance(len(chunk) * len(self.spaces))
        _LOG.info("%d pairs, validate was asked for %d", self.pairs, self.asked)

    def in_turns(
        self, chunk: Sequence[Trajectory]
    ) -> Generator[None, None, pa.RecordBatch]:
        """Judge some of the trajectories; returns their rows.

        Yields after every pair that `validate` was asked for, so that other work can
        have its turn.
        """
        found = Verdicts.empty(len(chunk), len(self.spaces))
        rows = [i for i, x in enumerate(chunk) if x.form in KERNEL_FORMS]
        if rows and self._plain:
            fleet, kind = self._types
            known = [chunk[i] for i in rows]
            self._run_kernels(known, fleet, found, np.ix_(rows, self._plain), kind)
        self._run_owners(chunk, found)
        for i, j in np.argwhere(found.status == UNCLEAR):
            report = judged(
                chunk[i], self.spaces[j], self.tolerances, self.allow_unreachable
            )
            found.take(int(i), int(j), report)
            self.asked += 1
            yield
        return found.to_batch(
            [trajectory.name for trajectory in chunk],
            [trajectory.duration for trajectory in chunk],
            [space.name for space in self.spaces],
        )

    def _run_owners(self, chunk: Sequence[Trajectory], found: Verdicts) -> None:
        """Judge Omni-Curve-Parameters for their own vehicles by the kernels."""
        by_owner: dict[int, list[int]] = {}
        for i, trajectory in enumerate(chunk):
            if trajectory.vehicle is not None:
                by_owner.setdefault(id(trajectory.vehicle), []).append(i)
        for rows in by_owner.values():
            owner = chunk[rows[0]].vehicle
            own = [
                j
                for j in self._plain
                if self.spaces[j].vehicle == owner
                and (self.allow_unreachable or is_connected(self.spaces[j]))
            ]
            if owner is None or not own:
                continue
            fleet = fleet_of([owner], self.tolerances, is_own=True)
            known = [chunk[i] for i in rows]
            kind = np.zeros(len(own), dtype=np.int64)
            self._run_kernels(known, fleet, found, np.ix_(rows, own), kind, is_own=True)

    def _run_kernels(
        self,
        trajectories: Sequence[Trajectory],
        fleet: Fleet,
        found: Verdicts,
        at: tuple[Any, ...],
        kind: IntArray,
        *,
        is_own: bool = False,
    ) -> None:
        """Judge by the kernels and write what they say to places `at`.

        While threads judge some of the trajectories the splines of the next are made.
        """
        t = self.tolerances
        # An own (κ_n, β) is a configuration even where the vehicle stands.
        standstill = -1.0 if is_own else t.standstill
        limits = np.array(
            (standstill, math.sin(t.slip_angle), t.slip_speed, t.alignment)
        )
        shape = len(trajectories), len(fleet.bodies)
        status = np.empty(shape, np.uint8)
        which = np.empty(shape, np.int32)
        numbers = np.full((*shape, 4), np.nan)
        known = fleet.arrays

        def judge(knots: Knots, place: slice) -> None:
            moved = parts_of(knots)
            judge_pairs(
                (*moved.arrays, moved.samples, *groups_of(moved)),
                known,
                limits,
                status[place],
                which[place],
                numbers[place],
            )

        workers = numba.get_num_threads()
        with ThreadPoolExecutor(workers) as threads:
            running: deque[Future[None]] = deque()
            for place in _slices(trajectories):
                knots = knots_of(trajectories[place], is_own=is_own)
                if len(running) == AHEAD * workers:
                    running.popleft().result()
                running.append(threads.submit(judge, knots, place))
            for task in running:
                task.result()
        found.status[at] = status[:, kind]
        found.margin[at] = numbers[:, kind, 0]
        for column, numbers_ in zip(
            (found.t, found.value, found.bound),
            np.moveaxis(numbers, 2, 0)[1:],
            strict=True,
        ):
            column[at] = numbers_[:, kind]
        label = np.where(which >= 0, found.code(fleet)[which], UNKNOWN)
        found.label[at] = label[:, kind]


def _slices(trajectories: Sequence[Trajectory]) -> Iterator[slice]:
    """Yield runs of trajectories that are judged together."""
    most = -(-len(trajectories) // SLICES)
    start, samples = 0, 0
    for i, trajectory in enumerate(trajectories):
        size = trajectory.t.size
        if i > start and (i - start == most or samples + size > SAMPLES):
            yield slice(start, i)
            start, samples = i, 0
        samples += size
    yield slice(start, len(trajectories))


def _whole(turns: Generator[None, None, pa.RecordBatch]) -> pa.RecordBatch:
    """Return what a generator returns."""
    while True:
        try:
            next(turns)
        except StopIteration as end:
            rows: pa.RecordBatch = end.value
            return rows


def _name(trajectory: object) -> str:
    if not isinstance(trajectory, Trajectory):
        raise InvalidInput(
            Problem(
                "trajectories",
                type(trajectory).__name__,
                "trajectories; give a path its times by `fastest`",
            )
        )
    return trajectory.name


def require_names(what: str, names: Sequence[str]) -> None:
    """Raise InvalidInput unless there are names and all differ."""
    if not names:
        raise InvalidInput(Problem(what, "empty", "at least one"))
    repeated = sorted(name for name, count in Counter(names).items() if count > 1)
    if repeated:
        raise InvalidInput(
            Problem(
                what,
                f'the name "{repeated[0]}" more than once',
                "names that differ; give each its own, as by name=...",
            )
        )


@contextlib.contextmanager
def _bar(total: int) -> Iterator[Any]:
    """Yield a function that advances a progress bar; without a total there is none."""
    if not total:
        yield lambda count: None
        return
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    # Where nobody watches even an invisible bar ends with a blank line.
    is_hidden = not console.is_terminal
    with Progress(console=console, transient=True, disable=is_hidden) as bar:
        task = bar.add_task("Judging pairs", total=total)
        yield lambda count: bar.advance(task, count)
