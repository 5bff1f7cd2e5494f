"""A bounded queue and the threads that empty it."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

__all__ = ["WorkerPool"]

T = TypeVar("T")


class WorkerPool(Generic[T]):
    """Handles jobs in a few threads; a job that finds the queue full is not taken.

    Parameters
    ----------
    handle : callable
        Handles one job; must not raise.
    n_workers : int, ≥ 1
    queue_size : int, ≥ 1
        Jobs that may wait beside those being handled.
    """

    def __init__(
        self, handle: Callable[[T], None], n_workers: int, queue_size: int
    ) -> None:
        self._handle = handle
        self._queue_size = queue_size
        self._jobs: deque[T] = deque()
        self._changed = threading.Condition()
        self._is_open = True
        self._threads = [
            threading.Thread(
                target=self._work, name=f"omniplan-worker-{i}", daemon=True
            )
            for i in range(n_workers)
        ]
        for thread in self._threads:
            thread.start()

    def __len__(self) -> int:
        """Return how many jobs wait."""
        return len(self._jobs)

    def submit(self, job: T) -> bool:
        """Put a job into the queue; return whether it was taken. Never waits."""
        with self._changed:
            if not self._is_open or len(self._jobs) >= self._queue_size:
                return False
            self._jobs.append(job)
            self._changed.notify()
            return True

    def stop(self) -> list[T]:
        """Take no more jobs and return those that wait; the running ones go on."""
        with self._changed:
            self._is_open = False
            waiting = list(self._jobs)
            self._jobs.clear()
            self._changed.notify_all()
        return waiting

    def join(self) -> None:
        """Wait for the running jobs, after `stop`."""
        for thread in self._threads:
            thread.join()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._jobs or not self._is_open)
                if not self._jobs:
                    return
                job = self._jobs.popleft()
            self._handle(job)
