"""A bounded queue and the threads that empty it: small jobs never wait for large ones.

A job is done in steps. After each step of a large job others get their turn; a worker
is kept for small jobs, and the others look after large ones in between. Memory is
bounded: by the number of jobs, by the bytes of large ones, and by the number of large
ones that are begun and not finished.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

__all__ = ["PoolLimits", "WorkerPool"]

T = TypeVar("T")
Prepare: TypeAlias = Callable[[bool, bool, int], None]

SLICE = 0.020
"""A small job that took longer, s, and is not finished goes on as a large one."""
SMALL_IN_A_ROW = 8
"""So many small jobs are taken before a large one that waits, by one worker."""
LARGE_BEGUN = 4
"""Jobs taken as large that take turns; others wait with nothing done."""
QUIET = 0.25
"""Without a small job for so long, s, all cores are given to a large one."""


@dataclass(frozen=True)
class PoolLimits:
    """How much a pool takes; what is more is refused."""

    n_workers: int
    """Threads, ≥ 1."""
    queue_size: int
    """Jobs that wait, for their first step or their next; large ones half of that."""
    queue_bytes: int
    """Bytes of large jobs that wait or run; those of small ones are few."""
    n_large: int = 1
    """Large jobs that run together while small ones are about, ≥ 1."""
    n_large_alone: int = 1
    """Likewise while none is; not fewer than those."""


@dataclass(eq=False)
class _Task(Generic[T]):
    """A job on its way."""

    job: T
    is_large: bool
    n_bytes: int
    """Counted while it is there; of a small one not."""
    steps: Iterator[None] | None = None
    spent: float = 0.0
    """Time worked at it, s."""
    is_counted: bool = False
    """Whether it is one of the `LARGE_BEGUN`."""


class WorkerPool(Generic[T]):
    """Does jobs step by step in a few threads; what finds no place is not taken.

    Parameters
    ----------
    begin : callable
        Returns the steps of a job: an iterator that works when it is advanced. Neither
        may raise. One job is advanced by one thread at a time, not always the same.
    limits : PoolLimits
    prepare : callable, optional
        Called in the worker before each step with whether it is of a large job, whether
        no small job is about, and how many large jobs run together.
    """

    def __init__(
        self,
        begin: Callable[[T], Iterator[None]],
        limits: PoolLimits,
        prepare: Prepare = lambda is_large, is_alone, n_large: None,
    ) -> None:
        self._begin = begin
        self._limits = limits
        self._prepare = prepare
        self._small: deque[_Task[T]] = deque()
        self._large: deque[_Task[T]] = deque()  # not begun
        self._begun: deque[_Task[T]] = deque()  # large ones between two steps
        self._n_begun = 0
        self._large_running = 0
        self._large_bytes = 0
        self._small_in_a_row = 0
        self._small_running = 0
        self._small_seen_at = -float("inf")
        self._is_open = True
        lock = threading.Lock()
        # The worker kept for small jobs waits apart, so that a large one never wakes
        # it in vain and sleeps on.
        self._for_kept = threading.Condition(lock)
        self._for_others = threading.Condition(lock)
        self._kept_waits = False
        self._threads = [
            threading.Thread(
                target=self._work,
                args=(i == 0 and limits.n_workers > 1,),
                name=f"omniplan-worker-{i}",
                daemon=True,
            )
            for i in range(limits.n_workers)
        ]
        for thread in self._threads:
            thread.start()

    def __len__(self) -> int:
        """Return how many jobs wait, for their first step or their next."""
        return len(self._small) + len(self._large) + len(self._begun)

    @property
    def n_running(self) -> int:
        """How many jobs are worked at in this moment."""
        return self._small_running + self._large_running

    @property
    def n_bytes(self) -> int:
        """Bytes of large jobs that wait or run."""
        return self._large_bytes

    def submit(self, job: T, *, is_large: bool = False, n_bytes: int = 0) -> bool:
        """Put a job into the queue; return whether it was taken. Never waits.

        Parameters
        ----------
        job : T
        is_large : bool
            Whether it may have to wait for others.
        n_bytes : int
            What it holds in memory.
        """
        task = _Task(job, is_large, n_bytes if is_large else 0)
        with self._for_others:
            if not self._is_open or not self._has_room(task):
                return False
            if is_large:
                self._large_bytes += n_bytes
                self._large.append(task)
                self._for_others.notify()
            else:
                self._small_seen_at = time.monotonic()
                self._small.append(task)
                self._wake_for_small()
            return True

    def stop(self) -> list[T]:
        """Take no more jobs and return those not begun; the others go on."""
        with self._for_others:
            self._is_open = False
            waiting = [task for task in self._small if task.steps is None]
            self._small = deque(t for t in self._small if t.steps is not None)
            waiting += self._large
            self._large_bytes -= sum(task.n_bytes for task in self._large)
            self._large.clear()
            self._for_kept.notify_all()
            self._for_others.notify_all()
        return [task.job for task in waiting]

    def join(self, timeout: float | None = None) -> bool:
        """Wait for the jobs that were begun, after `stop`.

        Parameters
        ----------
        timeout : float, s, optional
            None waits for ever.

        Returns
        -------
        is_done : bool
        """
        until = None if timeout is None else time.monotonic() + timeout
        for thread in self._threads:
            left = None if until is None else max(0.0, until - time.monotonic())
            thread.join(left)
        return not any(thread.is_alive() for thread in self._threads)

    def _has_room(self, task: _Task[T]) -> bool:
        size = self._limits.queue_size
        if len(self) >= size:
            return False
        if not task.is_large:
            return True
        # Half of the places stay for small jobs; a job alone always finds room.
        places = max(1, size // 2)
        total = self._large_bytes + task.n_bytes
        return (
            len(self._large) + len(self._begun) < places
            and total <= self._limits.queue_bytes
        )

    def _wake_for_small(self) -> None:
        (self._for_kept if self._kept_waits else self._for_others).notify()
        self._kept_waits = False  # the next one wakes another

    def _work(self, is_kept: bool) -> None:
        while (task := self._take(is_kept)) is not None:
            is_alone = self._is_alone()
            self._prepare(task.is_large, is_alone, self._n_together(is_alone))
            began = time.monotonic()
            is_done = self._advance(task)
            task.spent += time.monotonic() - began
            self._put_back(task, is_done)

    def _advance(self, task: _Task[T]) -> bool:
        """Do one step; return whether it was the last."""
        if task.steps is None:
            task.steps = self._begin(task.job)
        return next(task.steps, _END) is _END

    def _take(self, is_kept: bool) -> _Task[T] | None:
        """Wait for a job; None if there will be no more."""
        condition = self._for_kept if is_kept else self._for_others
        with condition:
            while (task := self._choose(is_kept)) is None:
                if not self._is_open and not self._is_under_way():
                    return None
                self._kept_waits |= is_kept
                condition.wait()
                if is_kept:
                    self._kept_waits = False
            if task.is_large:
                self._large_running += 1
            else:
                self._small_running += 1
            return task

    def _is_under_way(self) -> bool:
        """Return whether a job may come back from a worker."""
        return bool(len(self) or self._small_running or self._large_running)

    def _choose(self, is_kept: bool) -> _Task[T] | None:
        has_large = self._has_large() and not (is_kept and self._is_open)
        if self._small and (not has_large or self._small_in_a_row < SMALL_IN_A_ROW):
            if has_large:
                self._small_in_a_row += 1
            return self._small.popleft()
        if not has_large:
            return None
        self._small_in_a_row = 0
        if self._large and self._n_begun < LARGE_BEGUN:
            self._n_begun += 1
            task = self._large.popleft()
            task.is_counted = True
            return task
        return self._begun.popleft()

    def _has_large(self) -> bool:
        """Return whether a large job can be advanced now."""
        can_begin = self._large and self._n_begun < LARGE_BEGUN
        is_free = self._large_running < self._most_large(self._is_alone())
        return is_free and bool(can_begin or self._begun)

    def _most_large(self, is_alone: bool) -> int:
        limits = self._limits
        return max(limits.n_large, limits.n_large_alone if is_alone else 1)

    def _n_together(self, is_alone: bool) -> int:
        """Return how many large jobs run now, or will as soon as they are taken."""
        can_begin = min(len(self._large), LARGE_BEGUN - self._n_begun)
        n = self._large_running + len(self._begun) + max(can_begin, 0)
        return max(1, min(n, self._most_large(is_alone)))

    def _put_back(self, task: _Task[T], is_done: bool) -> None:
        with self._for_others:
            if task.is_large:
                self._large_running -= 1
            else:
                self._small_running -= 1
                self._small_seen_at = time.monotonic()
            if is_done:
                self._n_begun -= task.is_counted
                self._large_bytes -= task.n_bytes
            elif task.is_large or task.spent > SLICE:
                task.is_large = True
                self._begun.append(task)
            else:
                self._small.append(task)
                self._wake_for_small()
            if self._has_large():
                self._for_others.notify()
            if not self._is_open:
                self._for_kept.notify_all()
                self._for_others.notify_all()

    def _is_alone(self) -> bool:
        """Return whether no small job is about, so that all cores may be taken."""
        is_quiet = time.monotonic() - self._small_seen_at > QUIET
        return is_quiet and not self._small and not self._small_running


_END = object()
