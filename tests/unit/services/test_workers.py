from __future__ import annotations

import threading

from services.workers import WorkerPool


def test_jobs_are_handled_in_their_order() -> None:
    done: list[int] = []
    all_done = threading.Event()

    def handle(job: int) -> None:
        done.append(job)
        if job == 9:
            all_done.set()

    pool = WorkerPool(handle, 1, 10)
    assert all(pool.submit(job) for job in range(10))
    assert all_done.wait(30)
    assert pool.stop() == []
    pool.join()
    assert done == list(range(10))


def test_a_full_or_stopped_pool_takes_nothing() -> None:
    entered, opened = threading.Event(), threading.Event()
    done: list[str] = []

    def handle(job: str) -> None:
        entered.set()
        opened.wait(30)
        done.append(job)

    pool = WorkerPool(handle, 1, 1)
    assert pool.submit("running")
    assert entered.wait(30)
    assert pool.submit("waiting")
    assert not pool.submit("refused")
    assert len(pool) == 1
    assert pool.stop() == ["waiting"]
    assert not pool.submit("late")
    opened.set()
    pool.join()
    assert done == ["running"]
