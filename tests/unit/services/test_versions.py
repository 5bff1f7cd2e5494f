from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configspace import InvalidInput
from services.registering.versions import MAX_COUNTER, Clock, Version

A, B = "a" * 16, "b" * 16
VERSIONS = st.builds(
    Version,
    st.integers(1, MAX_COUNTER),
    st.text("0123456789abcdef", min_size=16, max_size=16),
)


@given(VERSIONS)
def test_a_version_survives_its_text(version: Version) -> None:
    assert Version.parse(str(version)) == version


@given(VERSIONS, VERSIONS)
def test_versions_are_ordered_by_counter_then_instance(x: Version, y: Version) -> None:
    expected = (x.counter, x.instance) < (y.counter, y.instance)
    assert (x < y) == expected
    assert (x < y) + (y < x) + (x == y) == 1


@pytest.mark.parametrize(
    "text",
    ["", "1", f"0-{A}", f"01-{A}", f"-1-{A}", f"1-{A}0", f"{2**53}-{A}", f"1-{A}\n"],
)
def test_a_text_that_is_no_version_is_named(text: str) -> None:
    with pytest.raises(InvalidInput, match="expected_version: "):
        Version.parse(text, "expected_version")


@given(st.lists(st.floats(1, 2e9), min_size=1), st.lists(VERSIONS))
def test_versions_grow_whatever_the_clock_does(
    times: list[float], seen: list[Version]
) -> None:
    readings = iter([*times, *[times[-1]] * (len(seen) + 1)])
    clock = Clock(A, lambda: next(readings))
    given_ = [clock.next() for _ in times]
    for version in seen:
        if version.counter < MAX_COUNTER:
            clock.see(version)
            given_.append(clock.next())
            assert given_[-1] > version
    assert given_ == sorted(set(given_))


def test_the_counter_is_the_time_in_milliseconds() -> None:
    assert Clock(A, lambda: 12.3456).next() == Version(12345, A)


def test_a_version_that_none_could_follow_is_not_believed() -> None:
    assert Clock.believes(Version(MAX_COUNTER // 2, B))
    assert not Clock.believes(Version(MAX_COUNTER // 2 + 1, B))
