"""Versions of registered vehicles, ordered alike by every server.

A version is a pair (counter, instance), compared in this order; the greater one wins.
The counter is a hybrid logical clock: the time of day in milliseconds, but always more
than any counter seen before. So versions grow even when a clock is set back, the last
writer wins across servers as far as their clocks agree, and two servers never give the
same version.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from configspace.errors import InvalidInput, Problem

__all__ = ["MAX_COUNTER", "Clock", "Version", "is_instance"]

MAX_COUNTER = 2**53 - 1
"""The largest counter that every JSON reader keeps exactly."""

_INSTANCE = re.compile(r"[0-9a-f]{16}")
_TEXT = re.compile(r"([1-9][0-9]{0,15})-([0-9a-f]{16})")


@dataclass(frozen=True, order=True)
class Version:
    """One version of one vehicle.

    Examples
    --------
    >>> Version.parse("7-00000000000000aa") < Version.parse("8-0000000000000000")
    True
    """

    counter: int
    """1 to `MAX_COUNTER`."""
    instance: str
    """The store that gave it, 16 hexadecimal digits."""

    @classmethod
    def parse(cls, text: str, where: str = "version") -> Version:
        """Return the version that a text stands for.

        Raises
        ------
        InvalidInput
            If it stands for none.
        """
        match = _TEXT.fullmatch(text)
        if match is None or int(match[1]) > MAX_COUNTER:
            allowed = "COUNTER-INSTANCE, as the service gives them"
            raise InvalidInput(Problem(where, repr(text)[:80], allowed))
        return cls(int(match[1]), match[2])

    def __str__(self) -> str:
        """Return ``COUNTER-INSTANCE``."""
        return f"{self.counter}-{self.instance}"


class Clock:
    """Gives versions that grow; safe with threads.

    Parameters
    ----------
    instance : str
        The store that the versions are given by.
    now : callable, optional
        Time of day in s.
    """

    def __init__(self, instance: str, now: Callable[[], float] = time.time) -> None:
        self.instance = instance
        self._now = now
        self._last = 0
        self._lock = threading.Lock()

    def next(self) -> Version:
        """Return a version greater than all given or seen."""
        with self._lock:
            self._last = max(self._last + 1, self._time())
            return Version(self._last, self.instance)

    def see(self, version: Version) -> None:
        """Take note of a version that another store gave."""
        with self._lock:
            self._last = max(self._last, version.counter)

    @staticmethod
    def believes(version: Version) -> bool:
        """Return whether versions can go on to grow after this one.

        A wrong clock at another server does no harm, as all go on from there; only a
        counter so near the largest that there is no way on would.
        """
        return version.counter <= MAX_COUNTER // 2

    def _time(self) -> int:
        return int(self._now() * 1000)


def is_instance(text: str) -> bool:
    """Return whether a text can name a store."""
    return _INSTANCE.fullmatch(text) is not None
