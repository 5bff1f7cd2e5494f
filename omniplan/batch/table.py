"""The verdicts on a chunk of pairs, and their rows in Arrow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from omniplan.batch.fleet import Fleet
from omniplan.batch.verdicts import UNCLEAR, VALID
from omniplan.report import Report

__all__ = ["SCHEMA", "UNKNOWN", "Verdicts"]

FloatArray = npt.NDArray[np.float64]
Name: TypeAlias = str | None

UNKNOWN = -1
"""Instead of a label: nothing refuses the pair, and nothing limits it."""

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


@dataclass(eq=False)
class Verdicts:
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
    def empty(cls, n: int, m: int) -> Verdicts:
        """Return verdicts of which nothing is known."""
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
        """Return the rows of `validate_many`."""
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
