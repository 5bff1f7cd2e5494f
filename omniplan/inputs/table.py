"""Trajectories and paths as tables in long form: what CSV and Parquet share.

Columns: ``[trajectory,] t`` and one of ``x, y, theta``, ``vx, vy, omega`` or
``kappa_n, beta, v_n``; poses without ``t`` are a path. SI units and radians.

Optional: ``reference_x, reference_y``, the point described, the same in all rows of a
trajectory; for paths ``max_speed`` and ``max_yaw_rate`` from a row to the next (those
of the last row are not used) and ``stop``, 1 where the vehicle must stand, else 0.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from configspace import InvalidInput, Problem, Vehicle
from omniplan.errors import InvalidTrajectory
from omniplan.path import Path
from omniplan.samples import invalid_row
from omniplan.trajectory import COLUMNS, Form, Trajectory

__all__ = [
    "Header",
    "Table",
    "columns_of",
    "each_of",
    "header_of",
    "merged",
    "span",
    "trajectories_of",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

POINT = ("reference_x", "reference_y")
CAPS = ("max_speed", "max_yaw_rate")
PATH_ONLY = (*CAPS, "stop")
SAMPLES = {name for names in COLUMNS.values() for name in names}
KNOWN = {"trajectory", "t", *POINT, *PATH_ONLY} | SAMPLES


@dataclass(frozen=True)
class Header:
    """What the names of the columns say."""

    form: Form
    is_timed: bool
    numbers: tuple[str, ...]
    """All columns of numbers."""
    is_named: bool
    """Whether a column ``trajectory`` names them."""


@dataclass(frozen=True, eq=False)
class Table:
    """The columns of a file, n rows."""

    source: str
    header: Header
    columns: Mapping[str, FloatArray]
    """(n,) each column of numbers."""
    names: Sequence[str]
    """The names, in the order in which they first appear."""
    code: IntArray
    """(n,) which name each row has."""
    place: Callable[[int, int], str]
    """Words for the rows from one to another, such as ``lines 2 to 9``."""


def header_of(source: str, names: Sequence[str]) -> Header:
    """Return what column names mean, or raise."""
    known = set(names)
    repeated = sorted({name for name in names if names.count(name) > 1})
    unknown = [name for name in names if name not in KNOWN]
    forms = [form for form, columns in COLUMNS.items() if set(columns) <= known]
    is_timed = "t" in known
    allowed = "; or ".join("t, " + ", ".join(names) for names in COLUMNS.values())
    allowed = f"[trajectory,] {allowed}; or x, y, theta: a path"
    if repeated:
        given = f"column {repeated[0]} twice"
    elif unknown:
        given = f"unknown column {unknown[0]!r}{_hint(unknown[0])}"
    elif len(forms) != 1 or known & SAMPLES != set(COLUMNS[forms[0]]):
        given = f"columns {', '.join(names)}"
    elif not is_timed and forms[0] != "poses":
        given = f"no column t for {', '.join(COLUMNS[forms[0]])}"
    elif len(known & set(POINT)) == 1 or (
        known & set(POINT) and forms[0] == "omni_curve"
    ):
        given = f"columns {', '.join(names)}"
        allowed = "reference_x and reference_y together, beside poses or twists"
    elif is_timed and known & set(PATH_ONLY):
        given = f"column {min(known & set(PATH_ONLY))} beside t"
        allowed = f"{', '.join(PATH_ONLY)}: for paths, which have no t"
    else:
        numbers = tuple(name for name in names if name != "trajectory")
        return Header(forms[0], is_timed, numbers, "trajectory" in known)
    raise InvalidTrajectory(Problem(f"{source}: header", given, allowed))


def _hint(unknown: str) -> str:
    """Return what may be meant by an unknown column."""
    if any(mark in unknown for mark in ";\t|"):
        return " (columns are separated by commas)"
    near = difflib.get_close_matches(unknown.lower(), KNOWN, n=1, cutoff=0.8)
    return f" (did you mean {near[0]}?)" if near else ""


def span(what: str, first: int, last: int) -> str:
    """Return words for rows, such as ``line 2`` or ``lines 2 to 9``."""
    return f"{what} {first}" if first == last else f"{what}s {first} to {last}"


def merged(
    names: list[str], code: IntArray, default: str
) -> tuple[list[str], IntArray]:
    """Return names without blanks around them, and the codes of those that remain."""
    seen: dict[str, int] = {}
    new = [seen.setdefault(name.strip() or default, len(seen)) for name in names]
    return list(seen), np.array(new)[code]


def trajectories_of(
    table: Table, vehicle: Vehicle | None
) -> tuple[Trajectory | Path, ...]:
    """Return the trajectories or paths of a table, in the order of its names.

    Raises
    ------
    InvalidTrajectory
        With the rows and what is wrong in them.
    """
    return tuple(each_of(table, vehicle))


def each_of(table: Table, vehicle: Vehicle | None) -> Iterator[Trajectory | Path]:
    """Yield what `trajectories_of` returns, one after the other."""
    for name, rows in _groups(table):
        first, last = (
            (rows.start, rows.stop - 1)
            if isinstance(rows, slice)
            else (int(rows[0]), int(rows[-1]))
        )
        columns = {key: values[rows] for key, values in table.columns.items()}
        try:
            yield _built(name, table.header, columns, vehicle)
        except InvalidInput as error:
            subject = f"{table.source} ({table.place(first, last)})"
            raise InvalidTrajectory(error.problems, subject) from error


def _groups(table: Table) -> Iterator[tuple[str, slice | IntArray]]:
    """Yield every name and its rows, a slice where they stand together."""
    code = table.code
    changes = np.flatnonzero(np.diff(code)) + 1
    if changes.size + 1 == len(table.names):
        bounds = [0, *changes.tolist(), code.size]
        for i, name in enumerate(table.names):
            yield name, slice(bounds[i], bounds[i + 1])
        return
    order = np.argsort(code, kind="stable")
    starts = np.searchsorted(code[order], np.arange(len(table.names) + 1))
    for i, name in enumerate(table.names):
        yield name, order[starts[i] : starts[i + 1]]


def _built(
    name: str,
    header: Header,
    columns: Mapping[str, FloatArray],
    vehicle: Vehicle | None,
) -> Trajectory | Path:
    samples = np.stack([columns[key] for key in COLUMNS[header.form]], axis=-1)
    point = _point(name, columns)
    if not header.is_timed:
        caps = {key: columns[key][:-1] for key in CAPS if key in columns}
        stops = (
            np.flatnonzero(_flags(name, columns["stop"])) if "stop" in columns else ()
        )
        return Path.from_poses(
            samples, name=name, reference_point=point, stops=stops, **caps
        )
    t = columns["t"]
    if header.form == "poses":
        return Trajectory.from_poses(t, samples, name=name, reference_point=point)
    if header.form == "twists":
        return Trajectory.from_twists(t, samples, name=name, reference_point=point)
    if vehicle is None:
        allowed = "name it: vehicle=, --parameters-of"
        problem = Problem(name, "kappa_n, beta, v_n of no vehicle", allowed)
        raise InvalidTrajectory(problem)
    kappa_n, beta, v_n = samples.T
    return Trajectory.from_omni_curve(t, kappa_n, beta, v_n, vehicle, name=name)


def _point(name: str, columns: Mapping[str, FloatArray]) -> tuple[float, float]:
    if POINT[0] not in columns:
        return 0.0, 0.0
    for key in POINT:
        values = columns[key]
        other = np.flatnonzero(values != values[0])
        if other.size:
            row = int(other[0])
            given = f"{values[row]:g} after {values[0]:g}"
            raise invalid_row(name, row, key, given, "the same in all rows")
    x, y = (float(columns[key][0]) for key in POINT)
    return x, y


def _flags(name: str, values: FloatArray) -> FloatArray:
    bad = np.flatnonzero((values != 0) & (values != 1))
    if bad.size:
        row = int(bad[0])
        raise invalid_row(name, row, "stop", f"{values[row]:g}", "0 or 1")
    return values


def columns_of(
    trajectories: Sequence[Trajectory | Path],
) -> tuple[list[str], IntArray, dict[str, FloatArray]]:
    """Return names, the lengths that belong to them, and the columns of numbers.

    Raises
    ------
    InvalidInput
        If there are none, or their forms differ.
    """
    forms = sorted({_kind(trajectory) for trajectory in trajectories})
    if len(forms) != 1:
        raise InvalidInput(
            Problem("trajectories", f"forms {forms}", "exactly one form per file")
        )
    parts = [_columns(trajectory) for trajectory in trajectories]
    columns = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    needless = {"max_speed": np.inf, "max_yaw_rate": np.inf, "stop": 0.0}
    for key, value in needless.items():
        if key in columns and (columns[key] == value).all():
            del columns[key]
    if POINT[0] in columns and not any(columns[key].any() for key in POINT):
        for key in POINT:
            del columns[key]
    names = [trajectory.name for trajectory in trajectories]
    sizes = np.array([len(part[next(iter(part))]) for part in parts])
    return names, sizes, columns


def _kind(trajectory: Trajectory | Path) -> str:
    return "path" if isinstance(trajectory, Path) else trajectory.form


def _columns(trajectory: Trajectory | Path) -> dict[str, FloatArray]:
    """Return all columns of one trajectory, needed or not."""
    if isinstance(trajectory, Path):
        n = len(trajectory.poses)
        columns = dict(zip(COLUMNS["poses"], trajectory.poses.T, strict=True))
        for key, caps in (
            ("max_speed", trajectory.max_speed),
            ("max_yaw_rate", trajectory.max_yaw_rate),
        ):
            columns[key] = np.append(
                np.full(n - 1, np.inf) if caps is None else caps, np.inf
            )
        columns["stop"] = trajectory.stops.astype(np.float64)
    else:
        n = trajectory.t.size
        labels = COLUMNS[trajectory.form]
        columns = {
            "t": trajectory.t,
            **dict(zip(labels, trajectory.samples.T, strict=True)),
        }
        if trajectory.form == "omni_curve":
            return columns
    for key, value in zip(POINT, trajectory.reference_point, strict=True):
        columns[key] = np.full(n, value)
    return columns
