"""Trajectories as CSV files, in long form.

The header names the columns: ``t`` and one of ``x, y, theta``, ``vx, vy, omega`` or
``kappa_n, beta, v_n``; with a column ``trajectory`` one file holds many. SI units and
radians; lines that start with ``#`` are comments.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

from configspace import InvalidInput, Problem, Vehicle
from omniplan.errors import InvalidTrajectory
from omniplan.trajectory import COLUMNS, Form, Trajectory

__all__ = ["read_trajectories", "write_trajectories"]


def read_trajectories(
    path: str | Path, vehicle: Vehicle | None = None
) -> tuple[Trajectory, ...]:
    """Read the trajectories of a CSV file, in the order in which they first appear.

    Parameters
    ----------
    path : str or Path
    vehicle : Vehicle, optional
        The vehicle whose parameters a file of ``kappa_n, beta, v_n`` holds.

    Raises
    ------
    InvalidTrajectory
        If the file cannot be read or has mistakes; with the line of the file.
    """
    path = Path(path)
    try:
        lines = path.read_text("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidTrajectory(
            Problem(f"{path}", str(error), "a readable UTF-8 CSV file")
        ) from error
    # Line numbers are kept: comments become empty rows, which the reader skips.
    text = ["" if line.lstrip().startswith("#") else line for line in lines]
    reader = csv.reader(text)
    groups: dict[str, list[tuple[int, list[float]]]] = {}
    try:
        header = next((row for row in reader if row), None)
        if header is None:
            raise InvalidTrajectory(Problem(f"{path}", "no header", "a line of names"))
        form, columns = _form(path, [name.strip() for name in header])
        for row in reader:
            if row:
                name, values = _row(path, reader.line_num, row, header, columns)
                groups.setdefault(name, []).append((reader.line_num, values))
    except csv.Error as error:
        raise InvalidTrajectory(
            Problem(f"{path}: line {reader.line_num}", str(error), "a CSV file")
        ) from error
    if not groups:
        raise InvalidTrajectory(Problem(f"{path}", "no rows", "at least two rows"))
    return tuple(
        _trajectory(path, name, form, rows, vehicle) for name, rows in groups.items()
    )


def _form(path: Path, header: list[str]) -> tuple[Form, list[int]]:
    """Return the form of the samples and where its columns stand, t first."""
    repeated = sorted({name for name in header if header.count(name) > 1})
    known = {"trajectory", "t"}.union(*COLUMNS.values())
    unknown = [name for name in header if name not in known]
    forms = [form for form, names in COLUMNS.items() if set(names) <= set(header)]
    if "t" not in header:
        given = "no column t (a path without time)"
    elif repeated:
        given = f"column {repeated[0]} twice"
    elif unknown:
        given = f"unknown column {unknown[0]!r}"
    elif len(forms) != 1 or len(header) > 5:
        given = f"columns {', '.join(header)}"
    else:
        return forms[0], [header.index(name) for name in ("t", *COLUMNS[forms[0]])]
    allowed = "; or ".join("t, " + ", ".join(names) for names in COLUMNS.values())
    raise InvalidTrajectory(
        Problem(f"{path}: header", given, f"[trajectory,] {allowed}")
    )


def _row(
    path: Path, line: int, row: list[str], header: list[str], columns: list[int]
) -> tuple[str, list[float]]:
    if len(row) != len(header):
        raise InvalidTrajectory(
            Problem(f"{path}: line {line}", f"{len(row)} values", f"{len(header)}")
        )
    values = []
    for column in columns:
        try:
            values.append(float(row[column]))
        except ValueError as error:
            raise InvalidTrajectory(
                Problem(
                    f"{path}: line {line}, {header[column].strip()}",
                    repr(row[column])[:60],
                    "a number",
                )
            ) from error
    names = [name.strip() for name in header]
    if "trajectory" in names:
        return row[names.index("trajectory")].strip() or path.stem, values
    return path.stem, values


def _trajectory(
    path: Path,
    name: str,
    form: Form,
    rows: list[tuple[int, list[float]]],
    vehicle: Vehicle | None,
) -> Trajectory:
    t = [values[0] for _, values in rows]
    samples = [values[1:] for _, values in rows]
    try:
        if form == "poses":
            return Trajectory.from_poses(t, samples, name=name)
        if form == "twists":
            return Trajectory.from_twists(t, samples, name=name)
        if vehicle is None:
            raise InvalidTrajectory(
                Problem(name, "kappa_n, beta, v_n of no vehicle", "name their vehicle")
            )
        kappa_n, beta, v_n = zip(*samples, strict=True)
        return Trajectory.from_omni_curve(t, kappa_n, beta, v_n, vehicle, name=name)
    except InvalidInput as error:
        first, last = rows[0][0], rows[-1][0]
        raise InvalidTrajectory(
            error.problems, subject=f"{path} (lines {first} to {last})"
        ) from error


def write_trajectories(path: str | Path, trajectories: Iterable[Trajectory]) -> None:
    """Write trajectories of one form to a CSV file.

    Raises
    ------
    InvalidInput
        If there are none, or their forms differ.
    """
    trajectories = tuple(trajectories)
    forms = sorted({trajectory.form for trajectory in trajectories})
    if len(forms) != 1:
        raise InvalidInput(
            Problem("trajectories", f"forms {forms}", "exactly one form per file")
        )
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["trajectory", "t", *COLUMNS[trajectories[0].form]])
        for trajectory in trajectories:
            for t, sample in zip(trajectory.t, trajectory.samples, strict=True):
                cells = (f"{value:.9g}" for value in sample)
                writer.writerow([trajectory.name, _time(float(t)), *cells])


def _time(t: float) -> str:
    """Return a time with all its digits; seconds since 1970 need more than nine."""
    short = f"{t:.9g}"
    return short if float(short) == t else repr(t)
