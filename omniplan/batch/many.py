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
from omniplan.batch.coarse import groups_of
from omniplan.batch.fleet import Fleet, fleet_of, is_connected, is_plain
from omniplan.batch.motions import Knots, knots_of, parts_of
from omniplan.batch.reaches import codes_of
from omniplan.batch.twists import check_twists
from omniplan.batch.verdicts import UNCLEAR, VALID, judge_pairs
from omniplan.judging.rows import Tolerances
from omniplan.report import Report
from omniplan.trajectory import Trajectory
from omniplan.validation import judged

__all__ = ["Batch", "check_twists", "require_names", "validate_many"]

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
UNKNOWN = -1
"""Instead of a label: nothing refuses the pair, and nothing limits it."""
KERNEL_FORMS = ("poses", "twists")

_LOG = logging.getLogger(__name__)

_TEXT = pa.dictionary(pa.int32(), pa.string())
SCHEMA = pa.schema(
    [
        pa.field("trajectory", _TEXT, nullable=False),
        pa.field("vehicle", _TEXT, nullable=False),
        pa.field("valid", pa.bool_(), nullable=False),
        pa.field("margin", pa.float64(), nullable=False),
        pa.field("duration", pa.float64(), nullable=False),
        pa.field("limit", _TEXT),
        pa.field("wheel", _TEXT),
        pa.field("t", pa.float64()),
        pa.field("value", pa.float64()),
        pa.field("bound", pa.float64()),
        pa.field("unit", _TEXT),
        pa.field("u", pa.float64()),
    ]
)


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
            sharp to a thousandth as in a `Report`; of a refused one, reached. Where a
            standstill sets it, the time there is counts from where the vehicle surely
            stands, which may be some hundredths of a second less than in a `Report`.
        ``duration``
            s.
        ``limit``, ``wheel``
            What refuses the pair, as the headline of its `Report`. Of a valid pair what
            the margin belongs to. Null where nothing limits it, or no wheel does.
        ``t``, ``value``, ``bound``, ``unit``
            Of a refused pair the sample, s, at which the limit is broken most, and by
            how much. The headline of a `Report` may have a worse place between two
            samples in the same stretch.
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
        found = _Verdicts.empty(len(chunk), len(self.spaces))
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

    def _run_owners(self, chunk: Sequence[Trajectory], found: _Verdicts) -> None:
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
        found: _Verdicts,
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


@dataclass(eq=False)
class _Verdicts:
    """The verdicts on a chunk, (n, m) each."""

    status: npt.NDArray[np.uint8]
    margin: FloatArray
    t: FloatArray
    value: FloatArray
    bound: FloatArray
    label: npt.NDArray[np.int32]
    labels: dict[tuple[str, Name, Name], int] = field(default_factory=dict)
    """Limit, wheel and unit by their number."""

    @classmethod
    def empty(cls, n: int, m: int) -> _Verdicts:
        margin, t, value, bound = np.full((4, n, m), np.nan)
        status = np.full((n, m), UNCLEAR, np.uint8)
        label = np.full((n, m), UNKNOWN, np.int32)
        return cls(status, margin, t, value, bound, label)

    def code(self, fleet: Fleet) -> npt.NDArray[np.int32]:
        """Return the numbers of all that a fleet tells."""
        return np.array(
            [
                self._number(label.limit, label.wheel or None, label.unit)
                for label in fleet.told
            ],
            dtype=np.int32,
        )

    def _number(self, limit: str, wheel: Name, unit: Name) -> int:
        return self.labels.setdefault((limit, wheel, unit), len(self.labels))

    def take(self, i: int, j: int, report: Report) -> None:
        """Take over the report of `validate` on one pair."""
        self.status[i, j] = VALID if report.valid else VALID + 1
        self.margin[i, j] = report.margin
        told = report.headline
        if told is None:
            limit, _, wheel = report.tightest.partition(" ")
            if limit != "nothing":
                self.label[i, j] = self._number(limit, wheel or None, None)
            return
        self.label[i, j] = self._number(told.limit, told.wheel, told.unit)
        self.t[i, j], self.bound[i, j] = told.t, told.bound
        self.value[i, j] = math.nan if told.value is None else told.value

    def to_batch(
        self, trajectories: list[str], durations: list[float], vehicles: list[str]
    ) -> pa.RecordBatch:
        n, m = self.status.shape
        valid = (self.status == VALID).ravel()
        label = self.label.ravel()
        texts = list(zip(*self.labels, strict=True)) or [(), (), ()]
        limit, wheel, unit = (
            _coded(label, values, hide=hide)
            for values, hide in zip(texts, (None, None, valid), strict=True)
        )
        return pa.record_batch(
            [
                _named(np.repeat(np.arange(n, dtype=np.int32), m), trajectories),
                _named(np.tile(np.arange(m, dtype=np.int32), n), vehicles),
                pa.array(valid),
                pa.array(self.margin.ravel()),
                pa.array(np.repeat(durations, m)),
                limit,
                wheel,
                *(
                    pa.array(x.ravel(), mask=valid | np.isnan(x.ravel()))
                    for x in (self.t, self.value, self.bound)
                ),
                unit,
                pa.nulls(label.size, pa.float64()),
            ],
            schema=SCHEMA,
        )


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


def _named(index: npt.NDArray[np.int32], names: list[str]) -> Any:
    return pa.DictionaryArray.from_arrays(index, pa.array(names, pa.string()))


def _coded(
    label: npt.NDArray[np.int32],
    values: Sequence[Name],
    hide: npt.NDArray[np.bool_] | None,
) -> Any:
    """Return texts by their numbers; null for no number, no text, or what is hidden."""
    texts = sorted({value for value in values if value is not None})
    code = {text: i for i, text in enumerate(texts)}
    table = np.array([code.get(v, -1) if v else -1 for v in values] + [-1], np.int32)
    index = table[label]  # no label is the last entry
    missing = index < 0 if hide is None else (index < 0) | hide
    return pa.DictionaryArray.from_arrays(
        pa.array(np.maximum(index, 0), pa.int32(), mask=missing),
        pa.array(texts, pa.string()),
    )


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
            Problem(what, f"{repeated[0]} more than once", "names must differ")
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
