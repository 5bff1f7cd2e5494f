import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import configspace
from configspace import PermissibleSpace, exact_v_max
from configspace.omni_curve import components
from omniplan import Trajectory, select
from omniplan.choosing.manoeuvrability import fleet_clearance, reserve
from omniplan.proving import prove

SpaceOf = Callable[[str], PermissibleSpace]
TURN = 0.5  # metres that a radian of turning counts


def directions(kappa_n: np.ndarray, beta: np.ndarray, kappa_g: float) -> np.ndarray:
    c, s = components(kappa_n)
    w = np.stack([c * np.cos(beta), c * np.sin(beta), s * kappa_g * TURN], axis=-1)
    return np.asarray(w / np.linalg.norm(w, axis=-1, keepdims=True))


def naive_clearance(space: PermissibleSpace, kappa_n: float, beta: float) -> float:
    """Return the angle to the nearest of many blocked configurations."""
    assert space.vehicle is not None
    kappa, betas = np.meshgrid(
        np.linspace(-2, 2, 401), np.linspace(-np.pi, np.pi, 721), indexing="ij"
    )
    blocked = exact_v_max(space.vehicle, kappa, betas) == 0
    there = directions(kappa[blocked], betas[blocked], space.kappa_g)
    here = directions(np.array(kappa_n), np.array(beta), space.kappa_g)
    return float(np.arccos(np.clip(there @ here, -1, 1)).min())


def drive(v: complex, omega: float) -> Trajectory:
    return Trajectory.from_twists([0, 2], [[v.real, v.imag, omega]] * 2)


@pytest.mark.parametrize(
    ("v", "omega"),
    [(0.3, 0.0), (0.2j, 0.0), (0.3, 0.4), (0.0, 0.5), (0.1 - 0.1j, -0.5)],
)
def test_reserve_of_one_motion_is_the_angle_to_the_nearest_blocked_one(
    space_of: SpaceOf, v: complex, omega: float
) -> None:
    space = space_of("ift-four-steered")
    found = reserve(prove(drive(v, omega), space), fleet_clearance(space))
    twist = (complex(v).real, complex(v).imag, omega)
    both = [
        naive_clearance(space, float(k), float(b))
        for k, b, _ in (
            configspace.from_twist(twist, space.kappa_g, s) for s in (1, -1)
        )
    ]
    assert min(abs(found - one) for one in both) < math.radians(1.5)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(*[st.floats(-0.3, 0.3)] * 3).filter(lambda v: np.abs(v).max() > 0.05),
        min_size=2,
        max_size=4,
    )
)
def test_reserve_is_never_more_than_the_clearance_anywhere(
    space_of: SpaceOf, twists: list[tuple[float, float, float]]
) -> None:
    space = space_of("ift-four-steered")
    trajectory = Trajectory.from_twists(np.arange(len(twists)) * 2.0, twists)
    proved = prove(trajectory, space, longest=0.01)
    clearance = fleet_clearance(space)
    from omniplan.trace import trace_of

    trace = trace_of(proved)
    moving = ~trace.stands
    at = clearance(trace.kappa_n[moving], trace.beta[moving])
    assert reserve(proved, clearance) <= at.min(initial=math.pi) + 1e-9


def test_mecanum_blocks_nothing_and_fixed_wheels_block_everything_aside(
    space_of: SpaceOf,
) -> None:
    ahead = drive(0.3, 0.1)
    for name, expected in (("mecanum", math.pi), ("differential", 0.0)):
        space = space_of(name)
        assert reserve(prove(ahead, space), fleet_clearance(space)) == expected


def test_from_and_into_rest_the_direction_counts(space_of: SpaceOf) -> None:
    space = space_of("four-wheel-steering")
    clearance = fleet_clearance(space)
    steady = reserve(prove(drive(0.3, 0.0), space), clearance)
    starts = Trajectory.from_twists([0, 1, 2], [[0.0] * 3, [0.3, 0.0, 0.0], [0.0] * 3])
    assert reserve(prove(starts, space), clearance) == pytest.approx(steady, abs=1e-9)
    assert 0.3 < steady < math.radians(40)
    stands = Trajectory.from_poses([0, 1], [[0, 0, 0], [0, 0, 0]])
    assert reserve(prove(stands, space), clearance) == math.pi


def test_by_manoeuvrability_the_freest_vehicle_comes_first(space_of: SpaceOf) -> None:
    names = ("differential", "four-wheel-steering", "mecanum", "ift-four-steered")
    (ranking,) = select(
        drive(0.3, 0.0), [space_of(name) for name in names], by="manoeuvrability"
    )
    order = [candidate.vehicle for candidate in ranking.suitable]
    assert order == [
        "mecanum",
        "ift-four-steered",
        "four-wheel-steering",
        "differential",
    ]
    assert ranking.suitable[0].score == -math.pi
