"""The bounds of groups are held against what the rows say of single parts."""

import itertools
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import configspace
from omniplan import Tolerances, Trajectory
from omniplan.batch.chords import HIGH, LOW, ROOM
from omniplan.batch.coarse import screen
from omniplan.batch.fleet import Fleet, fleet_of
from omniplan.batch.groups import PER_ROW, groups_of
from omniplan.batch.kinds import BOUND, KIND, RANGE, RANGE_ERROR, SIGN, SWING
from omniplan.batch.motions import LANES, Motions, enclose, motions_of
from omniplan.batch.refine import KEPT, NO, YES, load, one_row
from omniplan.batch.rows import SETTLING
from omniplan.bench_cases import KINDS, random_trajectories, random_vehicles

FloatArray = npt.NDArray[np.float64]

TOLERANCES = Tolerances()
LIMITS = np.array(
    [TOLERANCES.standstill, math.sin(TOLERANCES.slip_angle), TOLERANCES.slip_speed]
)


def waves_at(t: FloatArray) -> FloatArray:
    phase = np.array([0.0, 1.0, 2.0])
    wave = np.sin(np.outer(t, [1.0, 0.7, 1.3]) + phase) * np.array([0.8, 0.3, 0.6])
    return np.asarray(wave, np.float64)


def trajectories() -> list[Trajectory]:
    rng = np.random.default_rng(3)
    t = np.linspace(0, 5, 60)
    waves = waves_at(t)
    twists = Trajectory.from_twists(t, waves, name="twists")
    return [*random_trajectories(rng, 8, samples=60), twists]


def fleet() -> Fleet:
    rng = np.random.default_rng(4)
    names = ("bmw-320i", "synchro-drive", "rover-mirrored-stops", "tricycle")
    vehicles = [configspace.load_vehicle(name) for name in names]
    return fleet_of([*random_vehicles(rng, len(KINDS)), *vehicles], TOLERANCES)


def bounds_of(
    motions: Motions, n: int, rows: FloatArray, vehicle: FloatArray
) -> FloatArray:
    """(r, blocks) upper bounds."""
    groups, first = groups_of(motions)
    mine = groups[first[n] : first[n + 1]]
    out = np.empty((len(rows), PER_ROW * len(mine)))
    crest = np.empty((PER_ROW * len(mine), 2))
    screen(mine, rows, vehicle, LIMITS, out, crest)
    np.testing.assert_array_equal(crest[:, 0], out.max(axis=0))
    counting = np.where(np.isfinite(out), out, 0.0)[rows[:, SIGN] == 0]
    np.testing.assert_array_equal(crest[:, 1], counting.max(axis=0, initial=0.0))
    return out[:, : motions.first[n + 1] - motions.first[n]]


def parts_of(
    motions: Motions, n: int, rows: FloatArray, vehicle: FloatArray, exact: Any
) -> tuple[FloatArray, FloatArray]:
    """(r, parts) what is reached and what is never exceeded, part by part."""
    blocks = motions.blocks[motions.first[n] : motions.first[n + 1]]
    low, high = np.empty((2, len(rows), len(blocks) * LANES))
    room = np.zeros(ROOM)
    for b in range(len(blocks)):
        at = slice(b * LANES, (b + 1) * LANES)
        for r in range(len(rows)):
            load(blocks, b, room, False)
            one_row_alone(room, rows, r, vehicle, exact)
            low[r, at] = room[LOW : LOW + LANES]
            high[r, at] = room[HIGH : HIGH + LANES]
    return low, high


def one_row_alone(
    room: FloatArray, rows: FloatArray, r: int, vehicle: FloatArray, exact: Any
) -> None:
    one_row(room, rows, r, vehicle, LIMITS, exact)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_bounds_of_groups_are_never_exceeded_and_often_of_use() -> None:
    motions, vehicles = motions_of(trajectories()), fleet()
    useful, seen = [], set()
    for n in range(len(motions.count)):
        for v, body in enumerate(vehicles.bodies):
            rows = vehicles.rows[vehicles.first[v] : vehicles.first[v + 1]]
            top = np.repeat(bounds_of(motions, n, rows, body), LANES, axis=1)
            low, high = parts_of(motions, n, rows, body, NO)
            error = np.where(rows[:, KIND] == RANGE, RANGE_ERROR / np.maximum(
                rows[:, BOUND], 1e-3), 0.0)  # fmt: skip
            assert (low <= top * (1 + 1e-9) + error[:, None]).all()
            counting = low[(rows[:, KIND] != RANGE)].max(initial=0.0)
            useful.append(np.mean(top <= min(counting, KEPT)))
            seen |= set(rows[:, KIND].astype(int))
            # What is never exceeded may be less sharp, part by part, but not by much.
            assert np.isfinite(high).any()
    assert len(seen) >= 12
    assert np.mean(useful) > 0.3


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_bounds_of_groups_hold_between_the_ends_of_parts() -> None:
    """The same motion, sampled 8 times as finely, reaches no more."""
    t = np.linspace(0, 6, 31)
    waves = waves_at(t)
    coarse = Trajectory.from_twists(t, waves, name="coarse")
    fine_t = np.linspace(0, 6, 30 * 8 + 1)
    fine_waves = np.stack([np.interp(fine_t, t, wave) for wave in waves.T], axis=-1)
    fine = Trajectory.from_twists(fine_t, fine_waves, name="fine")
    motions, vehicles = motions_of([coarse, fine]), fleet()
    ends = [
        motions.blocks[a:b].transpose(1, 0, 2).reshape(motions.blocks.shape[1], -1)[16]
        for a, b in zip(motions.first, motions.first[1:], strict=False)
    ]
    block = np.minimum(
        np.searchsorted(ends[0], ends[1] - 1e-9) // LANES, len(ends[0]) // LANES - 1
    )
    for v, body in enumerate(vehicles.bodies):
        rows = vehicles.rows[vehicles.first[v] : vehicles.first[v + 1]]
        top = bounds_of(motions, 0, rows, body)[:, block]
        low, _ = parts_of(motions, 1, rows, body, YES)
        assert (low <= top * (1 + 1e-9) + 1e-9).all()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_bounds_of_groups_hold_between_the_ends_of_parts_of_splines() -> None:
    """At times inside the parts, towards rest as well, no more is reached."""
    motions, vehicles = motions_of(trajectories()[:3]), fleet()
    room = np.zeros(ROOM)
    view = room.reshape(-1, LANES)
    for n, v in itertools.product(range(len(motions.count)), range(len(KINDS))):
        rows = vehicles.rows[vehicles.first[v] : vehicles.first[v + 1]]
        top = bounds_of(motions, n, rows, vehicles.bodies[v])
        # Those about accelerations of steering need more than the enclosures.
        plain = [r for r in range(len(rows)) if rows[r, KIND] < SWING]
        for b in range(top.shape[1]):
            at = motions.first[n] + b
            for share in (0.1, 0.5, 0.93):
                for k in range(LANES):
                    start, end = motions.blocks[at, 15:17, k]
                    t = start + share * (end - start)
                    knot = motions.knots[motions.knot_of[at, k]]
                    enclose(knot, motions.forms[n], t, t, view, k)
                for r in plain:
                    one_row_alone(room, rows, r, vehicles.bodies[v], YES)
                    low = room[LOW : LOW + LANES].max()
                    assert low <= top[r, b] * (1 + 1e-9) + 1e-9, (n, v, b, r)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_range_is_settled_as_by_arc_tangents() -> None:
    motions, vehicles = motions_of(trajectories()), fleet()
    room, seen = np.zeros(ROOM), set()
    for v, body in enumerate(vehicles.bodies):
        rows = vehicles.rows[vehicles.first[v] : vehicles.first[v + 1]]
        for b, r in itertools.product(
            range(0, len(motions.blocks), 3), np.flatnonzero(rows[:, KIND] == RANGE)
        ):
            found = []
            for exact in (YES, SETTLING):
                load(motions.blocks, b, room, False)
                one_row_alone(room, rows, int(r), body, exact)
                found.append(
                    (room[LOW : LOW + LANES] + 0, room[HIGH : HIGH + LANES] + 0)
                )
            (low, high), (quick_low, quick_high) = found
            open_ = high > KEPT
            np.testing.assert_array_equal(quick_low[open_], low[open_])
            np.testing.assert_array_equal(quick_high[open_], high[open_])
            assert (quick_low <= low).all()
            assert (quick_high >= low * (1 - 1e-12)).all()
            seen |= set(open_)
    assert seen == {True, False}
