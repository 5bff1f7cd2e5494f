from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.answering import workers
from services.answering.workers import PoolLimits, WorkerPool


@dataclass
class Job:
    """Writes its name into a record at each of its steps."""

    name: str
    n_steps: int = 1
    gate: threading.Event | None = None
    """What its first step waits for."""
    entered: threading.Event = field(default_factory=threading.Event)


class Recorder:
    """A pool of jobs, and the order of their steps."""

    def __init__(self, **limits: int) -> None:
        self.steps: list[str] = []
        self.finished = threading.Semaphore(0)
        values = {"n_workers": 1, "queue_size": 64, "queue_bytes": 1000} | limits
        self.pool = WorkerPool(self._begin, PoolLimits(**values))

    def _begin(self, job: Job) -> Iterator[None]:
        job.entered.set()
        if job.gate is not None:
            assert job.gate.wait(30)
        for index in range(job.n_steps):
            self.steps.append(job.name)
            if index < job.n_steps - 1:
                yield
        self.finished.release()

    def hold(self, is_large: bool = False) -> threading.Event:
        """Occupy a worker until the event is set."""
        job = Job("held", gate=threading.Event())
        assert job.gate is not None
        assert self.pool.submit(job, is_large=is_large)
        assert job.entered.wait(30)
        return job.gate

    def large(self, name: str, n_steps: int = 1, n_bytes: int = 0) -> bool:
        return self.pool.submit(Job(name, n_steps), is_large=True, n_bytes=n_bytes)

    def small(self, name: str, n_steps: int = 1) -> bool:
        return self.pool.submit(Job(name, n_steps))

    def wait(self, n: int) -> list[str]:
        for _ in range(n):
            assert self.finished.acquire(timeout=30)
        return self.steps

    def close(self) -> None:
        self.pool.stop()
        assert self.pool.join(30)


def test_jobs_of_one_lane_are_done_in_their_order() -> None:
    recorder = Recorder()
    for name in "abcdefghij":
        assert recorder.small(name)
    assert recorder.wait(10) == list("abcdefghij")
    recorder.close()


def test_small_jobs_go_before_large_ones_that_came_earlier() -> None:
    recorder = Recorder()
    gate = recorder.hold()
    recorder.large("L", n_steps=3)
    recorder.small("a")
    recorder.small("b")
    gate.set()
    assert recorder.wait(4) == ["held", "a", "b", "L", "L", "L"]
    recorder.close()


def test_a_large_job_gives_way_after_each_step() -> None:
    recorder = Recorder()
    order: list[str] = []

    def begin(job: str) -> Iterator[None]:
        if job == "large":
            for index in range(3):
                order.append(f"large {index}")
                # Comes while the worker is busy, and goes first.
                assert pool.submit(f"small {index}")
                yield
        else:
            order.append(job)
        if len(order) == 6:
            recorder.finished.release()

    pool = WorkerPool(begin, PoolLimits(1, 64, 1000))
    assert pool.submit("large", is_large=True)
    assert recorder.finished.acquire(timeout=30)
    assert order == [f"{kind} {i}" for i in range(3) for kind in ("large", "small")]
    pool.stop()
    assert pool.join(30)
    recorder.close()


def test_large_jobs_take_turns() -> None:
    recorder = Recorder()
    gate = recorder.hold()
    for name in "AB":
        recorder.large(name, n_steps=3)
    gate.set()
    assert recorder.wait(3) == ["held", *"ABABAB"]
    recorder.close()


def test_few_large_jobs_are_begun_and_not_finished() -> None:
    recorder = Recorder()
    gate = recorder.hold()
    names = "ABCDEFG"
    for name in names:
        recorder.large(name, n_steps=4)
    gate.set()
    steps = recorder.wait(1 + len(names))[1:]
    for index in range(len(steps)):
        counts = [steps[: index + 1].count(name) for name in names]
        assert sum(0 < count < 4 for count in counts) <= workers.LARGE_BEGUN
    recorder.close()


def test_large_jobs_are_not_starved_by_small_ones() -> None:
    recorder = Recorder()
    gate = recorder.hold()
    recorder.large("L", n_steps=2)
    for index in range(3 * workers.SMALL_IN_A_ROW):
        recorder.small(f"s{index}")
    gate.set()
    steps = recorder.wait(2 + 3 * workers.SMALL_IN_A_ROW)[1:]
    places = [index for index, name in enumerate(steps) if name == "L"]
    n = workers.SMALL_IN_A_ROW
    assert places == [n, 2 * n + 1]
    recorder.close()


def test_one_worker_is_kept_for_small_jobs() -> None:
    recorder = Recorder(n_workers=3, n_large=2)
    gates = [recorder.hold(is_large=True) for _ in range(2)]
    # All workers that may do large ones are held; the third does small ones only.
    recorder.large("L")
    recorder.small("a")
    recorder.small("b")
    assert recorder.wait(2) == ["a", "b"]
    assert len(recorder.pool) == 1
    for gate in gates:
        gate.set()
    assert sorted(recorder.wait(3)) == ["L", "a", "b", "held", "held"]
    recorder.close()


def test_no_more_large_jobs_run_together_than_allowed() -> None:
    recorder = Recorder(n_workers=4, n_large=1)
    gate = recorder.hold(is_large=True)
    recorder.large("L")
    for name in "abc":
        recorder.small(name)
    assert sorted(recorder.wait(3)) == ["a", "b", "c"]
    gate.set()
    assert recorder.wait(2)[3:] == ["held", "L"]
    recorder.close()


def test_more_large_jobs_run_together_while_no_small_one_is_about(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "QUIET", 1e9)
    recorder = Recorder(n_workers=3, n_large=1, n_large_alone=2)
    # Both are begun: no small job was ever there.
    gates = [recorder.hold(is_large=True) for _ in range(2)]
    recorder.small("a")
    recorder.wait(1)
    for name in "LM":
        recorder.large(name)
    gates[0].set()
    assert recorder.wait(1) == ["a", "held"]
    # From now on one at a time, and that one is still held.
    assert len(recorder.pool) == 2
    gates[1].set()
    assert recorder.wait(3)[2:] == ["held", "L", "M"]
    recorder.close()


def test_what_is_prepared_knows_how_many_large_jobs_run_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[tuple[bool, int]] = []
    done = threading.Semaphore(0)
    gate = threading.Event()

    def begin(job: str) -> Iterator[None]:
        if job == "held":
            assert gate.wait(30)
        done.release()
        return iter(())

    pool = WorkerPool(
        begin,
        PoolLimits(1, 8, 1000, n_large=1, n_large_alone=2),
        lambda is_large, is_alone, n_large: calls.append((is_alone, n_large)),
    )
    pool.submit("held", is_large=True)
    pool.submit("A", is_large=True)
    pool.submit("B", is_large=True)
    gate.set()
    for _ in range(3):
        assert done.acquire(timeout=30)
    pool.stop()
    assert pool.join(30)
    assert calls[0][0]
    assert [n for _, n in calls[1:]] == [2, 1]


def test_a_small_job_that_takes_long_goes_on_as_a_large_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "SLICE", 0.0)
    recorder = Recorder()
    gate = recorder.hold()
    recorder.small("long", n_steps=3)
    for name in "ab":
        recorder.small(name)
    gate.set()
    assert recorder.wait(4) == ["held", "long", "a", "b", "long", "long"]
    recorder.close()


def test_small_jobs_of_several_steps_take_turns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "SLICE", 1e9)
    recorder = Recorder()
    gate = recorder.hold()
    recorder.small("a", n_steps=2)
    recorder.small("b", n_steps=2)
    gate.set()
    assert recorder.wait(3) == ["held", *"abab"]
    recorder.close()


def test_a_full_or_stopped_pool_takes_nothing() -> None:
    recorder = Recorder(queue_size=1)
    gate = recorder.hold()
    assert recorder.small("waiting")
    assert not recorder.small("refused")
    assert not recorder.large("refused")
    assert len(recorder.pool) == 1
    assert recorder.pool.n_running == 1
    (waiting,) = recorder.pool.stop()
    assert waiting.name == "waiting"
    assert not recorder.small("late")
    assert not recorder.pool.join(0.0)
    gate.set()
    assert recorder.pool.join(30)
    assert recorder.steps == ["held"]


def test_half_of_the_places_stay_for_small_jobs() -> None:
    recorder = Recorder(queue_size=4)
    gate = recorder.hold()
    assert [recorder.large("L") for _ in range(3)] == [True, True, False]
    assert [recorder.small("s") for _ in range(3)] == [True, True, False]
    gate.set()
    recorder.wait(5)
    recorder.close()


def test_bytes_of_large_jobs_are_bounded_until_they_are_done() -> None:
    recorder = Recorder(queue_bytes=100)
    gate = recorder.hold()
    assert recorder.large("A", n_bytes=60)
    assert not recorder.large("B", n_bytes=41)
    assert recorder.large("C", n_bytes=40)
    assert recorder.pool.n_bytes == 100
    # A small one holds few bytes; they are bounded by the number of places.
    assert recorder.pool.submit(Job("s"), n_bytes=10)
    gate.set()
    recorder.wait(4)
    assert recorder.large("D", n_bytes=100)
    recorder.wait(1)
    recorder.close()
    assert recorder.pool.n_bytes == 0


def test_stopping_lets_jobs_finish_that_were_begun() -> None:
    for n_workers in (1, 2, 3):
        entered, opened = threading.Event(), threading.Event()
        done: list[str] = []

        def begin(
            job: str,
            entered: threading.Event = entered,
            opened: threading.Event = opened,
            done: list[str] = done,
        ) -> Iterator[None]:
            for _ in range(3):
                entered.set()
                assert opened.wait(30)
                yield
            done.append(job)

        pool = WorkerPool(begin, PoolLimits(n_workers, 8, 1000))
        assert pool.submit("large", is_large=True)
        assert entered.wait(30)
        # While the large one holds its worker it cannot be begun.
        assert pool.submit("waiting", is_large=True)
        assert pool.stop() == ["waiting"]
        opened.set()
        assert pool.join(30)
        assert done == ["large"]


@settings(max_examples=40, deadline=None)
@given(
    jobs=st.lists(
        st.tuples(st.booleans(), st.integers(1, 4), st.integers(0, 30)), max_size=40
    ),
    n_workers=st.integers(1, 4),
    n_large=st.integers(1, 3),
)
def test_every_job_taken_is_done_once_and_completely(
    jobs: list[tuple[bool, int, int]], n_workers: int, n_large: int
) -> None:
    recorder = Recorder(
        n_workers=n_workers, n_large=n_large, queue_size=20, queue_bytes=100
    )
    taken = {}
    for index, (is_large, n_steps, n_bytes) in enumerate(jobs):
        job = Job(f"{index}", n_steps)
        if recorder.pool.submit(job, is_large=is_large, n_bytes=n_bytes):
            taken[job.name] = n_steps
        assert recorder.pool.n_bytes <= 100
        assert len(recorder.pool) <= 20 + n_workers
    steps = recorder.wait(len(taken))
    assert {name: steps.count(name) for name in taken} == taken
    assert len(steps) == sum(taken.values())
    recorder.close()
    assert recorder.pool.n_bytes == len(recorder.pool) == recorder.pool.n_running == 0


def test_what_is_prepared_knows_whether_small_jobs_are_about(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "QUIET", 1e9)
    calls: list[tuple[bool, bool]] = []
    done = threading.Semaphore(0)

    def begin(job: str) -> Iterator[None]:
        done.release()
        return iter(())

    pool = WorkerPool(
        begin,
        PoolLimits(1, 8, 1000),
        lambda is_large, is_alone, n_large: calls.append((is_large, is_alone)),
    )
    pool.submit("L", is_large=True)
    assert done.acquire(timeout=30)
    pool.submit("s")
    assert done.acquire(timeout=30)
    pool.submit("L", is_large=True)
    assert done.acquire(timeout=30)
    pool.stop()
    assert pool.join(30)
    # Alone at first; afterwards a small one was there, never too long ago.
    assert calls == [(True, True), (False, False), (True, False)]


def test_join_gives_up_in_time() -> None:
    recorder = Recorder()
    gate = recorder.hold()
    recorder.pool.stop()
    began = time.monotonic()
    assert not recorder.pool.join(0.01)
    assert time.monotonic() >= began
    gate.set()
    assert recorder.pool.join(30)
