from __future__ import annotations

import math
import os
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from services.answering.metrics import N_BINS, Histogram, Metrics, resident_bytes

RATIO = 10 ** (1 / 20)


@given(
    values=st.lists(st.floats(1e-5, 900.0), min_size=1, max_size=200),
    q=st.floats(0.0, 1.0),
)
@example(values=[1e-5], q=0.5)
@example(values=[1e-4, 1e-3, 1e-2], q=1.0)
def test_a_quantile_is_that_of_the_numbers_within_one_bin(
    values: list[float], q: float
) -> None:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    exact = float(np.quantile(values, q, method="inverted_cdf"))
    found = histogram.quantile(q)
    assert exact <= found * (1 + 1e-12)
    assert found <= exact * RATIO * (1 + 1e-12)
    assert found <= max(values)
    assert len(histogram) == len(values)


@given(st.lists(st.floats(0.0, math.inf), min_size=1, max_size=50))
def test_quantiles_grow_with_their_share(values: list[float]) -> None:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    found = [histogram.quantile(q) for q in (0.0, 0.1, 0.5, 0.9, 0.99, 1.0)]
    assert found == sorted(found)
    assert found[-1] <= max(values)


def test_the_memory_of_a_histogram_is_fixed() -> None:
    histogram = Histogram()
    for value in np.geomspace(1e-9, 1e9, 1000):
        histogram.add(float(value))
    assert len(histogram._counts) == N_BINS
    assert sum(histogram._counts) == 1000


def test_without_numbers_quantiles_are_zero() -> None:
    assert Histogram().quantile(0.99) == 0.0


def test_answers_are_counted_by_key_and_code_by_many_threads() -> None:
    metrics = Metrics()

    def count() -> None:
        for index in range(500):
            metrics.count("validate", "ok" if index % 5 else "busy", 0.01)

    threads = [threading.Thread(target=count) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    metrics.count("health", "ok", 0.001)
    figures = metrics.figures()
    assert list(figures) == ["health", "validate"]
    assert figures["validate"].codes == {"ok": 1600, "busy": 400}
    assert figures["validate"].p50 == figures["validate"].p99 == 0.01


def test_figures_are_those_of_all_answers_also_when_asked_in_between() -> None:
    metrics = Metrics()
    metrics.count("health", "ok", 0.001)
    first = metrics.figures()
    assert metrics.figures() == first
    metrics.count("validate", "ok", 0.02)
    metrics.count("validate", "busy", 0.04)
    found = metrics.figures()
    assert found["health"] == first["health"]
    assert found["validate"].codes == {"ok": 1, "busy": 1}
    assert found["validate"].p99 == 0.04
    metrics.count("validate", "ok", 0.08)
    assert metrics.figures()["validate"].codes == {"ok": 2, "busy": 1}
    assert found["validate"].codes == {"ok": 1, "busy": 1}


def test_memory_is_read_where_the_system_tells_it(tmp_path: Path) -> None:
    assert resident_bytes(tmp_path / "none") is None
    told = tmp_path / "statm"
    page = os.sysconf("SC_PAGE_SIZE")
    for text, expected in (
        ("12 x", None),
        ("", None),
        ("900 30 20", 30 * page),
        ("900 31 20", 31 * page),
    ):
        told.write_text(text)
        assert resident_bytes(told) == expected


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="no Linux")
def test_memory_grows_by_what_is_held() -> None:
    before = resident_bytes()
    # Larger than what malloc would take from memory freed before.
    held = np.ones(200_000_000 // 8)
    after = resident_bytes()
    assert before is not None
    assert after is not None
    assert after - before > 100_000_000
    assert held.size > 0
