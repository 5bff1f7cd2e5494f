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
from functools import cache
from itertools import accumulate
from pathlib import Path

from services.protocol.messages import KeyHealth

__all__ = ["Histogram", "Metrics", "resident_bytes"]

FIRST = 1e-5
"""Upper edge of the first bin, s."""
PER_DECADE = 20
"""Bins in which latencies grow tenfold: neighbouring edges are 12 % apart."""
N_BINS = 8 * PER_DECADE + 2
"""From 10 µs to 1000 s; the first and the last are open."""
EDGES = (*(FIRST * 10.0 ** (i / PER_DECADE) for i in range(N_BINS - 1)), math.inf)
"""Upper edges of the bins, s."""


class Histogram:
    """Counts of positive numbers in fixed bins; quantiles to 12 %.

    Not safe with several threads.
    """

    def __init__(self) -> None:
        self._counts = [0] * N_BINS
        self._used = N_BINS, -1  # the first and the last bin with a count
        self._n = 0
        self._largest = 0.0

    def __len__(self) -> int:
        """Return how many numbers were added."""
        return self._n

    def add(self, value: float) -> None:
        """Count a number."""
        index = bisect_left(EDGES, value)
        first, last = self._used
        if not first <= index <= last:
            self._used = min(first, index), max(last, index)
        self._counts[index] += 1
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
        first, last = self._used
        seen = list(accumulate(self._counts[first : last + 1]))
        found = []
        for share in shares:
            place = first + bisect_left(seen, max(1, math.ceil(share * self._n)))
            found.append(min(EDGES[place], self._largest))
        return tuple(found)


class Metrics:
    """Answers by key and code, with latencies; safe with several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._codes: dict[str, Counter[str]] = {}
        self._times: dict[str, Histogram] = {}
        self._figures: dict[str, KeyHealth] = {}
        """Of the kinds that nothing was counted for since they were asked for."""

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
            if kind not in self._codes:
                self._codes[kind], self._times[kind] = Counter(), Histogram()
            self._codes[kind][code] += 1
            self._times[kind].add(seconds)
            self._figures.pop(kind, None)

    def figures(self) -> dict[str, KeyHealth]:
        """Return what was counted, by kind of key."""
        with self._lock:
            for kind in self._codes.keys() - self._figures.keys():
                p50, p90, p99 = self._times[kind].quantiles(0.5, 0.9, 0.99)
                self._figures[kind] = KeyHealth(
                    codes=dict(self._codes[kind]), p50=p50, p90=p90, p99=p99
                )
            return {kind: self._figures[kind] for kind in sorted(self._figures)}


def resident_bytes(statm: str | Path = "/proc/self/statm") -> int | None:
    """Return the memory this process holds, bytes; None where it is not known."""
    try:
        # The path means another file in a process that was forked.
        pages = int(os.pread(_opened(statm, os.getpid()), 200, 0).split()[1])
    except (OSError, ValueError, IndexError):  # no Linux
        return None
    return pages * os.sysconf("SC_PAGE_SIZE")


@cache
def _opened(path: str | Path, process: int) -> int:
    """Return the descriptor of a file that stays open: to open it takes longest."""
    return os.open(path, os.O_RDONLY)
