from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numba
import pytest

from services.answering.cores import large_at_once, share_cores


@pytest.fixture
def four_cores(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """What the kernels are told on a machine with four cores."""
    told: list[int] = []
    monkeypatch.setattr(numba.config, "NUMBA_NUM_THREADS", 4)
    monkeypatch.setattr(numba, "get_num_threads", lambda: 0)
    monkeypatch.setattr(numba, "set_num_threads", told.append)
    return told


@pytest.mark.parametrize(
    ("workers", "beside_small", "alone"),
    [(1, 1, 1), (2, 1, 1), (3, 2, 2), (4, 3, 3), (5, 3, 4), (64, 3, 4)],
)
def test_a_worker_and_a_core_stay_for_small_requests(
    four_cores: list[int], workers: int, beside_small: int, alone: int
) -> None:
    assert large_at_once(workers, is_alone=False) == beside_small
    assert large_at_once(workers, is_alone=True) == alone


@pytest.mark.parametrize(
    ("is_large", "is_alone", "n_large", "expected"),
    [
        (False, False, 1, 1),
        (False, True, 1, 1),
        (True, True, 1, 4),
        (True, False, 1, 3),
        (True, True, 3, 1),
        (True, False, 3, 1),
        (True, True, 2, 2),
        (True, False, 8, 1),
    ],
)
def test_cores_are_shared(
    four_cores: list[int], is_large: bool, is_alone: bool, n_large: int, expected: int
) -> None:
    share_cores(is_large, is_alone, n_large)
    assert four_cores == [expected]


def test_what_one_thread_may_take_does_not_bind_another() -> None:
    before = numba.get_num_threads()
    seen = threading.Event()

    def narrowed() -> int:
        share_cores(False, False, 1)
        seen.set()
        return int(numba.get_num_threads())

    with ThreadPoolExecutor(1) as executor:
        assert executor.submit(narrowed).result(30) == 1
    assert seen.is_set()
    assert numba.get_num_threads() == before
