"""Paths in batches: each vehicle drives a path in its own fastest time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from configspace import InvalidInput, PermissibleSpace, Problem
from omniplan.batch.many import SCHEMA, Batch
from omniplan.choosing.faults import Undrivable
from omniplan.choosing.fleet import time_for
from omniplan.path import Path
from omniplan.trajectory import Trajectory

__all__ = ["PathBatch"]

CHUNK = 64
"""Motions whose timings are held at once."""


@dataclass(eq=False)
class PathBatch:
    """Pairs of vehicles and of motions some of which are paths.

    What has times, or has been given them, is judged as in a `Batch`. A path for which
    a vehicle has no timing is not valid; its row has the limit and the wheel that are
    in the way and how far along the path, ``u``, or ``VEHICLE_NOT_KNOWN`` for a data
    sheet alone, an infinite duration, the margin NaN and no numbers: `omniplan.select`
    has them.
    """

    motions: Sequence[Trajectory | Path]
    spaces: Sequence[PermissibleSpace]
    allow_unreachable: bool = False
    asked: int = 0
    """How many pairs `validate` was asked for so far, timing left aside."""

    def __post_init__(self) -> None:
        for what, given in (("trajectories", self.motions), ("spaces", self.spaces)):
            if len({one.name for one in given}) < len(given):
                allowed = "names must differ"
                raise InvalidInput(Problem(what, "a name more than once", allowed))
            if not given:
                raise InvalidInput(Problem(what, "empty", "at least one"))

    @property
    def pairs(self) -> int:
        """How many pairs there are."""
        return len(self.motions) * len(self.spaces)

    def verdicts(self, *, progress: bool = False) -> Iterator[pa.RecordBatch]:
        """Yield the rows of `validate_many`, all vehicles of the first motion first.

        Parameters
        ----------
        progress : bool
            Show a progress bar on standard error.
        """
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True)
        is_hidden = not (progress and console.is_terminal)
        with Progress(console=console, transient=True, disable=is_hidden) as bar:
            task = bar.add_task("Timing and judging", total=self.pairs)
            for start in range(0, len(self.motions), CHUNK):
                chunk = self.motions[start : start + CHUNK]
                columns = []
                for space in self.spaces:
                    columns.append(self._rows(chunk, space))
                    bar.advance(task, len(chunk))
                rows = [row for rows in zip(*columns, strict=True) for row in rows]
                yield pa.RecordBatch.from_pylist(rows, SCHEMA)

    def _rows(
        self, chunk: Sequence[Trajectory | Path], space: PermissibleSpace
    ) -> list[dict[str, Any]]:
        """Return one row for each motion."""
        answers = time_for(chunk, space, allow_unreachable=self.allow_unreachable)
        with_times = [one for one in answers if isinstance(one, Trajectory)]
        judged: Iterator[dict[str, Any]] = iter(())
        if with_times:
            allow = self.allow_unreachable
            batch = Batch(with_times, (space,), allow_unreachable=allow)
            table = pa.Table.from_batches(list(batch.verdicts()), SCHEMA)
            judged = iter(table.to_pylist())
            self.asked += batch.asked
        return [
            _row(motion.name, answer)
            if isinstance(answer, Undrivable)
            else next(judged)
            for motion, answer in zip(chunk, answers, strict=True)
        ]


def _row(name: str, answer: Undrivable) -> dict[str, Any]:
    fault = answer.fault
    return {
        "trajectory": name,
        "vehicle": answer.vehicle,
        "valid": False,
        "margin": math.nan,
        "duration": math.inf,
        "limit": "VEHICLE_NOT_KNOWN" if fault is None else fault.limit,
        "wheel": None if fault is None else fault.wheel,
        "u": None if fault is None else fault.u,
    }
