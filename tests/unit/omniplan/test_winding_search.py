"""The search for full turns against trying all of them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omniplan.judging.rows import WindingWheel
from omniplan.standing.ways import Way
from omniplan.standing.winding import Sweep, joined
from omniplan.standing.winding_search import SHORT_REST, Track

TURN = 2 * math.pi
RATE = 2.0


@st.composite
def sweeps(draw: st.DrawFn) -> Sweep:
    start, turn = draw(st.floats(-3.1, 3.1)), draw(st.floats(-9, 9))
    more = draw(st.floats(0, 2)), draw(st.floats(0, 2))
    return Sweep(start, turn, min(0.0, turn) - more[0], max(0.0, turn) + more[1])


@st.composite
def wheels(draw: st.DrawFn) -> WindingWheel:
    half, middle = draw(st.floats(3.2, 9.4)), draw(st.floats(-4, 4))
    return WindingWheel(0, 0, 0j, middle - half, middle + half, RATE)


def room(wheel: WindingWheel, angle: float, sweep: Sweep) -> float:
    return min(angle + sweep.low - wheel.least, wheel.largest - angle - sweep.high)


def fewest_turns(
    wheel: WindingWheel, angle: float, way: Sweep, total: int, margin: float
) -> float:
    """Turns before the way, that fit, and after it, by trying."""
    tried = [
        abs(n) + abs(total - n)
        for n in range(-12, 13)
        if room(wheel, angle + n * TURN, way) >= margin
    ]
    return min(tried, default=math.inf)


def aligned(before: Sweep, way: Sweep, after: Sweep) -> Sweep:
    """The piece after the way, which starts where the way ends."""
    start = math.remainder(before.start + before.turn + way.turn, TURN)
    return Sweep(start, after.turn, after.low, after.high)


@settings(max_examples=150, deadline=None)
@given(wheels(), sweeps(), sweeps(), sweeps(), st.floats(0.0, 12.0))
def test_two_pieces_fit_where_trying_finds_turns(
    wheel: WindingWheel, one: Sweep, along: Sweep, next_: Sweep, rest: float
) -> None:
    two = aligned(one, along, next_)
    way = Way(0.5, (along,))

    def possible(margin: float) -> bool:
        for k, n in itertools.product(range(-5, 6), repeat=2):
            first, second = one.start + k * TURN, two.start + n * TURN
            if room(wheel, first, one) < margin or room(wheel, second, two) < margin:
                continue
            end = first + one.turn
            total = round((second - end - along.turn) / TURN)
            turns = fewest_turns(wheel, end, along, total, margin)
            if 0.5 + turns * TURN / RATE <= rest - margin:
                return True
        return False

    track = Track.begin(wheel, one).then(way, 0, two, rest)
    if rest < 0.5:  # the way alone is too long: not the wheel's mistake
        return
    if possible(1e-9):
        assert track.least < SHORT_REST
    if not possible(-1e-9):
        assert track.least >= SHORT_REST


@settings(max_examples=100, deadline=None)
@given(wheels(), sweeps(), sweeps(), sweeps())
def test_what_is_chosen_is_what_it_says(
    wheel: WindingWheel, one: Sweep, along: Sweep, next_: Sweep
) -> None:
    two = aligned(one, along, next_)
    track = Track.begin(wheel, one).then(Way(0.0, (along,)), 0, two, 1e6)
    (k, n), (unwinding,) = track.unwound()
    first, second = one.start + k * TURN, two.start + n * TURN
    for start in (first, second):
        assert wheel.least - 1e-9 <= start <= wheel.largest + 1e-9
    if track.least < SHORT_REST:
        assert room(wheel, first, one) >= -1e-9
        assert room(wheel, second, two) >= -1e-9
        # Way and full turns lead from one piece to the next.
        led = first + one.turn + along.turn + unwinding.turns * TURN
        assert led == pytest.approx(second, abs=1e-9)
        least = abs(unwinding.turns) * TURN / RATE
        assert least - 1e-9 <= unwinding.time < math.inf
        assert [step.sweep for step in track.line()] == [one, two]


def test_a_wheel_without_a_rate_turns_at_once_but_not_past_a_stop() -> None:
    wheel = WindingWheel(0, 0, 0j, -4.0, 4.0, math.inf)
    still = Sweep(0.0)
    wide = Way(0.0, (Sweep(0.0, 0.0, -5.0, 5.0),))
    barred = Track.begin(wheel, still).then(wide, 0, still, 1e6)
    assert barred.unwound()[1][0].time == math.inf
    assert barred.least >= SHORT_REST
    free = Track.begin(wheel, still).then(Way(0.0, (still,)), 0, still, 0.0)
    assert free.unwound()[1][0].time == 0


def test_stretches_are_joined_end_to_end() -> None:
    one, two = Sweep(0.3, 2.0, -0.1, 2.5), Sweep(-1.0, -3.0, -3.2, 0.4)
    assert joined([one, two]) == Sweep(0.3, -1.0, pytest.approx(-1.2), 2.5)  # type: ignore[arg-type]
    assert joined([]) == Sweep(0.0)
    assert one.opposite().start == pytest.approx(0.3 + math.pi)
    assert np.isclose(one.opposite().turn, one.turn)
