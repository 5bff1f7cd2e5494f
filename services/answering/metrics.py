"""What a server counts: answers by key and code, and how long they took.

Memory is bounded: keys and codes are those of the protocol, and latencies go into a
histogram of fixed, logarithmically spaced bins.
"""

from __future__ import annotations

import math
import os
import threading
from bisect import bisect_left
from collections import Counter
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

__all__ = ["Histogram", "KeyFigures", "Metrics", "resident_bytes"]

FIRST = 1e-5
"""Upper edge of the first bin, s."""
PER_DECADE = 20
"""Bins in which latencies grow tenfold: neighbouring edges are 12 % apart."""
N_BINS = 8 * PER_DECADE + 2
"""From 10 µs to 1000 s; the first and the last are open."""


class Histogram:
    """Counts of positive numbers in fixed bins; quantiles to 12 %.

    Not safe with several threads.
    """

    def __init__(self) -> None:
        self._counts = [0] * N_BINS
        self._n = 0
        self._largest = 0.0

    def __len__(self) -> int:
        """Return how many numbers were added."""
        return self._n

    def add(self, value: float) -> None:
        """Count a number."""
        self._counts[_bin(value)] += 1
        self._n += 1
        self._largest = max(self._largest, value)

    def quantile(self, q: float) -> float:
        """Return a number that a share q of all do not exceed; 0 if there are none.

        Parameters
        ----------
        q : float, 0 to 1

        Returns
        -------
        value : float
            Never less than the quantile, at most 12 % more; the largest number where
            that is less.
        """
        return self.quantiles(q)[0]

    def quantiles(self, *shares: float) -> tuple[float, ...]:
        """Return the quantiles for several shares."""
        if not self._n:
            return (0.0,) * len(shares)
        seen = list(accumulate(self._counts))
        ranks = (max(1, math.ceil(q * self._n)) for q in shares)
        bins = (bisect_left(seen, rank) for rank in ranks)
        return tuple(min(_upper_edge(index), self._largest) for index in bins)


@dataclass(frozen=True)
class KeyFigures:
    """What was counted for one kind of key."""

    codes: dict[str, int]
    """Answers by code, ``ok`` among them."""
    p50: float
    """Latency from arrival to the last reply that half of all do not exceed, s."""
    p90: float
    """Likewise for nine of ten, s."""
    p99: float
    """Likewise for 99 of 100, s."""


class Metrics:
    """Answers by key and code, with latencies; safe with several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._codes: dict[str, Counter[str]] = {}
        self._times: dict[str, Histogram] = {}

    def count(self, kind: str, code: str, seconds: float) -> None:
        """Count one answer.

        Parameters
        ----------
        kind : str
            What was asked, one of a fixed set.
        code : str
        seconds : float, s
            From arrival to the last reply.
        """
        with self._lock:
            self._codes.setdefault(kind, Counter())[code] += 1
            self._times.setdefault(kind, Histogram()).add(seconds)

    def figures(self) -> dict[str, KeyFigures]:
        """Return what was counted, by kind of key."""
        with self._lock:
            return {
                kind: KeyFigures(
                    dict(self._codes[kind]),
                    *self._times[kind].quantiles(0.5, 0.9, 0.99),
                )
                for kind in sorted(self._codes)
            }


def resident_bytes(statm: str | Path = "/proc/self/statm") -> int | None:
    """Return the memory this process holds, bytes; None where it is not known."""
    try:
        # Half of what `health` takes, if read through layers of text and buffers.
        with open(statm, "rb", buffering=0) as file:
            pages = int(file.read(200).split()[1])
    except (OSError, ValueError, IndexError):  # no Linux
        return None
    return pages * os.sysconf("SC_PAGE_SIZE")


def _bin(value: float) -> int:
    if not value > FIRST:
        return 0
    # The bin whose upper edge is the first that is not below the value; rounding up
    # to the next bin where the logarithm is not exact keeps that.
    index = math.ceil(PER_DECADE * math.log10(value / FIRST)) if value < 1e9 else N_BINS
    if index < N_BINS - 1 and value > _upper_edge(index):
        index += 1
    return min(index, N_BINS - 1)


def _upper_edge(index: int) -> float:
    if index >= N_BINS - 1:
        return math.inf
    return FIRST * math.pow(10.0, index / PER_DECADE)
