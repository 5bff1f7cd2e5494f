import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import configspace
from configspace import PermissibleSpace
from omniplan import Trajectory, margins, read_trajectories, validate

SpaceOf = Callable[[str], PermissibleSpace]
MANOEUVRES = Path(__file__).parents[3] / "examples" / "manoeuvres"


def manoeuvre(name: str) -> Trajectory:
    (found,) = read_trajectories(MANOEUVRES / f"{name}.csv")
    assert isinstance(found, Trajectory)
    return found


@pytest.mark.parametrize("vehicle", ["mecanum", "ackermann", "ift-four-steered"])
@pytest.mark.parametrize(
    "name", ["docking", "parking-ackermann", "crab-corner", "forward-stop-sideways"]
)
def test_the_least_margin_is_that_of_the_report(
    space_of: SpaceOf, vehicle: str, name: str
) -> None:
    trajectory, space = manoeuvre(name), space_of(vehicle)
    report, trace = validate(trajectory, space), margins(trajectory, space)
    at = int(trace.margin.argmin())
    if report.valid:
        assert trace.margin[at] == pytest.approx(report.margin, abs=1e-12)
        assert report.tightest.startswith(trace.limit[at])
    else:
        assert trace.margin[at] < 0
        assert trace.limit[at] in {v.limit for v in report.violations}


def test_stretches_cover_the_trajectory(space_of: SpaceOf) -> None:
    trajectory = manoeuvre("forward-stop-sideways")
    trace = margins(trajectory, space_of("ift-four-steered"), longest=0.05)
    assert trace.t[0, 0] == trajectory.t[0]
    assert trace.t[-1, 1] == trajectory.t[-1]
    moving = [limit != "RECONFIGURATION" for limit in trace.limit]
    np.testing.assert_array_equal(trace.t[moving][1:, 0], trace.t[moving][:-1, 1])
    assert (np.diff(trace.t) <= 0.05).sum() == sum(moving)
    stop = trace.limit.index("RECONFIGURATION")
    assert trace.stands[stop]
    assert math.degrees(abs(np.diff(trace.beta[stop])[0])) == pytest.approx(90, abs=1)


def test_a_data_sheet_has_margins_too(space_of: SpaceOf) -> None:
    sheet = configspace.parse_space(configspace.dump_space(space_of("mecanum")))
    trajectory = manoeuvre("docking")
    report, trace = validate(trajectory, sheet), margins(trajectory, sheet)
    assert trace.margin.min() == pytest.approx(report.margin, abs=1e-12)
    assert set(trace.limit) == {"V_MAX"}
    assert set(trace.wheel) == {None}


def test_margin_over_time_is_that_of_the_wheel_speed(space_of: SpaceOf) -> None:
    speeds = Trajectory.from_twists([0, 5, 10], [[0.0, 0, 0], [0.9, 0, 0], [0.2, 0, 0]])
    trace = margins(speeds, space_of("differential"), longest=0.02)
    v = np.interp(trace.t, speeds.t, speeds.samples[:, 0])
    rate = 0.9 / 5 / acceleration_of(space_of("differential"))
    # 1 m/s, or the acceleration where that is tighter.
    expected = 1 - np.maximum(v.max(axis=1), np.where(trace.t[:, 1] <= 5, rate, 0))
    late = trace.t[:, 0] > 5
    expected[late] = np.minimum(expected[late], 1 - rate * 0.7 / 0.9)
    np.testing.assert_allclose(trace.margin, expected, atol=1e-9)
    np.testing.assert_allclose(trace.v_s, v, atol=1e-12)


def acceleration_of(space: PermissibleSpace) -> float:
    """Return the tightest acceleration straight ahead, m/s²."""
    assert space.vehicle is not None
    limits = [getattr(w, "max_acceleration", None) for w in space.vehicle.wheels]
    limits += [space.vehicle.limits.max_acceleration]
    return float(min(limit for limit in limits if limit is not None))


def test_what_is_driven_is_the_representation_that_is_chosen(space_of: SpaceOf) -> None:
    # 170° aside the wheels of ±155° stand at -10° and roll backwards.
    v = 0.3 * np.exp(1j * math.radians(170))
    trajectory = Trajectory.from_twists([0, 1], [[v.real, v.imag, 0.1]] * 2)
    trace = margins(trajectory, space_of("ift-four-steered"))
    space = space_of("ift-four-steered")
    assert (trace.v_s < 0).all()
    twist = configspace.to_twist(trace.kappa_n, trace.beta, trace.v_s, space.kappa_g)
    np.testing.assert_allclose(twist[0, 0], [v.real, v.imag, 0.1], atol=1e-12)
    for array in (trace.t, trace.margin, trace.kappa_n):
        assert not array.flags.writeable


def test_line_mobile_vehicles_stay_on_their_line(space_of: SpaceOf) -> None:
    trajectory = manoeuvre("parking-ackermann")
    trace = margins(trajectory, space_of("ackermann"), longest=0.1)
    assert (trace.beta[~trace.stands] == 0).all()
    assert trace.v_s.min() < -0.5
    assert trace.v_s.max() > 0.3


def test_own_parameters_have_speeds_as_shares_of_v_max(space_of: SpaceOf) -> None:
    space = space_of("ift-four-steered")
    assert space.vehicle is not None
    kappa_n, beta, v_n = [0.0, 0.5, 1.5], [0.0, 0.3, 0.2], [0.2, 0.5, 0.4]
    own = Trajectory.from_omni_curve([0, 1, 2], kappa_n, beta, v_n, space.vehicle)
    trace = margins(own, space)
    v_max = space.v_max(kappa_n[-1], beta[-1])
    assert trace.v_s[-1, 1] == pytest.approx(0.4 * float(v_max))
    assert (trace.kappa_n[0, 0], trace.beta[0, 0]) == pytest.approx((0.0, 0.0))
