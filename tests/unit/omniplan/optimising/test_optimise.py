"""`omniplan.optimise`: better, proved, or why not."""

from __future__ import annotations

import math
import re
from pathlib import Path as FilePath

import numpy as np
import pytest
from optimised import assert_kept
from planned import assert_free

import omniplan
from configspace import (
    Grid,
    InvalidInput,
    PermissibleSpace,
    build_space,
    load_space,
    load_vehicle,
    vehicle_from_data,
)
from omniplan import Path, Plan, PlanStatus, Trajectory, fastest, optimise, validate
from omniplan.errors import InvalidTrajectory, NoPlanFound
from omniplan.motion import PoseMotion
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.optimising import repairing
from omniplan.optimising.limits import rules_of
from omniplan.optimising.measure import jerk_of
from omniplan.optimising.pace import least_duration, top_rates
from omniplan.optimising.problem import OptimisationProblem
from omniplan.optimising.setting import Guess, Objective, Solution, SolverStatus
from omniplan.optimising.warm_start import leg_through

CORNER = Path.from_poses([[0, 0, 0], [1, 0, 0], [1, 1, 0]], name="corner")
PILLAR = {"pillar": [(1.0, -0.2), (1.3, -0.2), (1.3, 0.25), (1.0, 0.25)]}
MANOEUVRES = FilePath(__file__).parents[4] / "examples" / "manoeuvres"
LONG = 60.0  # s: enough on any machine


@pytest.fixture(scope="module")
def mecanum() -> PermissibleSpace:
    return build_space(load_vehicle("mecanum"), cache=False)


@pytest.fixture(scope="module")
def ackermann() -> PermissibleSpace:
    return build_space(load_vehicle("ackermann"), cache=False)


def line(y: float = 0.4) -> Trajectory:
    return Trajectory.from_poses([0, 3, 6], [[-0.5, y, 0], [1, y, 0], [3, y, 0]])


def manoeuvre(name: str) -> Trajectory:
    (given,) = omniplan.read_trajectories(MANOEUVRES / f"{name}.csv")
    assert isinstance(given, Trajectory)
    return given


def bend(radius: float, speed: float = 0.8) -> Trajectory:
    """Straight, a quarter turn, straight."""
    a = np.linspace(0, math.pi / 2, 20)
    arc = np.stack([2 + radius * np.sin(a), radius * (1 - np.cos(a)), a], -1)
    lead = np.stack([np.linspace(0, 2, 20), np.zeros(20), np.zeros(20)], -1)[:-1]
    way = radius + np.linspace(0, 2, 20)
    out = np.stack([np.full(20, 2 + radius), way, np.full(20, math.pi / 2)], -1)[1:]
    poses = np.concatenate([lead, arc, out])
    steps = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)
    t = np.concatenate([[0.0], np.cumsum(steps)]) / speed
    return Trajectory.from_poses(t, poses, name="bend")


def assert_drivable(plan: Plan, space: PermissibleSpace) -> Trajectory:
    """Every limit is kept, from rest to rest."""
    assert plan.status is PlanStatus.FOUND, plan.message
    trajectory = plan.raise_for_status()
    simulation = assert_kept(trajectory, space)
    assert simulation.v_s[[0, -1]] == pytest.approx(0, abs=1e-4)
    return trajectory


def test_a_corner_is_rounded_by_who_can(mecanum: PermissibleSpace) -> None:
    plan = optimise(CORNER, mecanum, time=LONG)
    trajectory = assert_drivable(plan, mecanum)
    assert plan.stops == plan.cusps == 0
    assert trajectory.duration < 0.8 * fastest(CORNER, mecanum).duration
    ends = CORNER.poses[[0, -1]]
    np.testing.assert_allclose(trajectory.samples[[0, -1]], ends, atol=1e-9)
    assert plan.statistics["way"] == "solver"
    assert plan.statistics["after"] == trajectory.duration
    assert plan.duration == trajectory.duration
    assert str(round(trajectory.duration, 2))[:3] in plan.message


@pytest.mark.slow
def test_wheels_that_point_somewhere_are_led_round_as_well() -> None:
    space = build_space(load_vehicle("four-wheel-steering"), cache=False)
    curve = Path.from_poses(
        np.array([[0, 0, 0], [1, 0.1, 0], [2, 0.3, 0.1], [3, 0.6, 0.2]])
    )
    plan = optimise(curve, space, time=LONG)
    trajectory = assert_drivable(plan, space)
    assert trajectory.duration <= fastest(curve, space).duration


@pytest.mark.slow
def test_cusps_stay_and_move_to_where_they_cost_least(
    ackermann: PermissibleSpace,
) -> None:
    given = manoeuvre("parking-ackermann")
    plan = optimise(given, ackermann, intervals=20, time=LONG)
    trajectory = assert_drivable(plan, ackermann)
    assert (plan.stops, plan.cusps) == (2, 2)
    assert trajectory.duration < 0.75 * fastest(given, ackermann).duration
    ends = given.samples[[0, -1]]
    np.testing.assert_allclose(trajectory.samples[[0, -1]], ends, atol=1e-6)


def test_obstacles_are_passed_at_the_clearance(mecanum: PermissibleSpace) -> None:
    obstacles = Obstacles.from_polygons(PILLAR)
    way = Path.from_poses([[-0.5, 0, 0], [0.3, 1.2, 0], [2.0, 1.2, 0], [3.0, 0, 0]])
    bounds = (-2.0, -2.0, 5.0, 3.0)
    plan = optimise(
        way,
        mecanum,
        obstacles,
        bounds=bounds,
        clearance=0.05,
        intervals=24,
        time=LONG,
    )
    trajectory = assert_drivable(plan, mecanum)
    assert trajectory.duration < fastest(way, mecanum).duration
    poses = PoseMotion(trajectory.t, trajectory.samples, 0j).poses_at(
        np.linspace(0, trajectory.t[-1], 300)
    )
    assert_free(poses, mecanum, PILLAR, 0.05, bounds)
    checker = CollisionChecker(mecanum, obstacles)
    nearest = min(checker.distance(pose) for pose in poses)
    assert 0.05 <= nearest < 0.08
    # Without them the way is shorter, right through the pillar.
    free = optimise(way, mecanum, intervals=24, time=LONG)
    assert free.duration is not None
    assert free.duration < trajectory.duration
    assert checker.first_hit_of_trajectory(free.raise_for_status()) is not None


def test_smooth_is_smoother_in_no_more_time(mecanum: PermissibleSpace) -> None:
    given = fastest(CORNER, mecanum)
    plan = optimise(given, mecanum, objective="smooth", time=LONG)
    trajectory = assert_drivable(plan, mecanum)
    assert trajectory.duration <= given.duration * (1 + 1e-6)
    before, after = (jerk_of(t, space_kappa(mecanum)) for t in (given, trajectory))
    assert after < 0.1 * before
    assert plan.statistics["after"] == pytest.approx(after)
    assert plan.statistics["before"] == pytest.approx(before)


def space_kappa(space: PermissibleSpace) -> float:
    assert space.vehicle is not None
    return space.vehicle.boundary_curvature


def test_jerk_is_that_of_finite_differences(mecanum: PermissibleSpace) -> None:
    trajectory = fastest(CORNER, mecanum)
    motion = PoseMotion(trajectory.t, trajectory.samples, 0j)
    middles = (trajectory.t[1:] + trajectory.t[:-1]) / 2
    step = 0.2 * np.diff(trajectory.t)
    rows = [motion.poses_at(middles + k * step) for k in (-1.5, -0.5, 0.5, 1.5)]
    jerk = (rows[3] - 3 * rows[2] + 3 * rows[1] - rows[0]) / step[:, None] ** 3
    square = (jerk * [1, 1, 1 / 2.0]) ** 2
    expected = float(square.sum(axis=1) @ np.diff(trajectory.t))
    assert jerk_of(trajectory, 2.0) == pytest.approx(expected, rel=1e-3)


def test_what_is_permitted_is_not_changed(mecanum: PermissibleSpace) -> None:
    given = line()
    plan = optimise(given, mecanum, objective="change")
    assert plan.trajectory is given
    assert plan.statistics["way"] == "input"
    assert "nothing was changed" in plan.message


def test_what_is_only_too_fast_keeps_its_path(ackermann: PermissibleSpace) -> None:
    given = manoeuvre("wide-curve-fast").scaled(4.0)
    assert not validate(given, ackermann).valid
    plan = optimise(given, ackermann, objective="change", time=LONG)
    trajectory = assert_drivable(plan, ackermann)
    assert plan.statistics["largest_change"] == 0
    assert trajectory.duration > given.duration


def test_a_bend_that_is_too_narrow_is_widened_a_little(
    ackermann: PermissibleSpace,
) -> None:
    given = bend(1.1)  # the inner front wheel allows 1.23 m
    report = validate(given, ackermann)
    assert {v.limit for v in report.violations} >= {"STEER_RANGE"}
    plan = optimise(given, ackermann, objective="change", time=LONG)
    trajectory = assert_drivable(plan, ackermann)
    largest = float(plan.statistics["largest_change"])
    assert 0.01 < largest < 0.12
    way = PoseMotion(given.t, given.samples, 0j).poses_at(
        np.linspace(given.t[0], given.t[-1], 3000)
    )
    apart = np.abs(trajectory.samples[:, None, :2] - way[None, :, :2])
    off = np.linalg.norm(apart, axis=2).min(axis=1)
    assert off.max() < largest + 0.01
    np.testing.assert_allclose(
        trajectory.samples[[0, -1]], given.samples[[0, -1]], atol=1e-6
    )


@pytest.mark.slow
def test_a_hit_is_evaded_by_a_small_change(mecanum: PermissibleSpace) -> None:
    obstacles = Obstacles.from_polygons(PILLAR)
    given = line(y=0.5)  # 0.32 m wide: 7 cm too near
    checker = CollisionChecker(mecanum, obstacles, 0.03)
    assert checker.first_hit_of_trajectory(given) is not None
    plan = optimise(
        given, mecanum, obstacles, objective="change", clearance=0.03, time=LONG
    )
    trajectory = assert_drivable(plan, mecanum)
    assert checker.first_hit_of_trajectory(trajectory) is None
    assert 0.09 < float(plan.statistics["largest_change"]) < 0.3


@pytest.mark.slow
def test_only_change_may_move_the_ends(mecanum: PermissibleSpace) -> None:
    obstacles = Obstacles.from_polygons(PILLAR)
    given = Trajectory.from_poses([0, 4], [[-0.5, 0.7, 0], [0.9, 0.5, 0]])
    blocked = optimise(given, mecanum, obstacles, objective="change")
    assert blocked.status is PlanStatus.GOAL_BLOCKED
    plan = optimise(
        given, mecanum, obstacles, objective="change", keep_ends=False, time=LONG
    )
    trajectory = assert_drivable(plan, mecanum)
    assert np.abs(trajectory.samples[-1] - given.samples[-1]).max() > 0.01


def test_an_optimum_is_returned_as_it_is(mecanum: PermissibleSpace) -> None:
    straight = fastest(Path.from_poses([[0, 0, 0], [2, 0, 0]]), mecanum)
    plan = optimise(straight, mecanum, time=LONG)
    assert plan.trajectory is straight
    assert "nothing better" in plan.message
    assert plan.statistics["before"] == plan.statistics["after"]


@pytest.mark.slow
def test_a_plan_is_a_start(mecanum: PermissibleSpace) -> None:
    first = optimise(CORNER, mecanum, intervals=12, time=LONG)
    second = optimise(first, mecanum, time=LONG)
    assert second.duration is not None
    assert first.duration is not None
    assert second.duration <= first.duration
    assert second.to_dict()["status"] == "found"


def test_a_start_or_goal_in_an_obstacle_is_told(mecanum: PermissibleSpace) -> None:
    obstacles = Obstacles.from_polygons(PILLAR)
    for poses, status in (
        ([[1.1, 0, 0], [3, 0, 0]], PlanStatus.START_BLOCKED),
        ([[3, 0, 0], [1.1, 0, 0]], PlanStatus.GOAL_BLOCKED),
    ):
        plan = optimise(Path.from_poses(np.array(poses)), mecanum, obstacles)
        assert plan.status is status
        assert "pillar" in plan.message
        assert plan.place == pytest.approx((1.1, 0, 0))
        with pytest.raises(NoPlanFound, match="pillar"):
            plan.raise_for_status()


def test_what_no_small_change_mends_is_refused_with_its_place(
    ackermann: PermissibleSpace,
) -> None:
    sideways = Path.from_poses([[0, 0, 0], [0, 1, 0]], name="sideways")
    plan = optimise(sideways, ackermann, intervals=12, max_iterations=20, time=LONG)
    assert not plan.is_found
    assert plan.trajectory is None
    assert plan.status is PlanStatus.INFEASIBLE
    assert "sideways by ackermann" in plan.message
    assert "40.0° permitted" in plan.message or "sideways slip" in plan.message
    assert plan.place is not None
    # With stops and cusps there is a way, but it is another one.
    anew = optimise(
        sideways,
        ackermann,
        objective="change",
        intervals=12,
        max_iterations=20,
        time=LONG,
    )
    assert_drivable(anew, ackermann)
    assert anew.statistics["way"] == "plan"
    assert "planned anew between the ends: no small" in anew.message


@pytest.mark.parametrize(
    ("name", "motion", "objective", "text"),
    [
        (
            "synchro-drive",
            Path.from_poses([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]),
            "time",
            r"keeps its heading, and the goal's is \+57.3° off",
        ),
        (
            "mecanum",
            Trajectory.from_poses([0, 1], [[0, 0, 0], [3, 0, 0]]),
            "smooth",
            r"1 s are given, and at the wheels' largest speeds alone .* 2\.4",
        ),
    ],
)
def test_what_cannot_be_is_told_at_once(
    name: str, motion: Path | Trajectory, objective: Objective, text: str
) -> None:
    space = build_space(load_vehicle(name), cache=False)
    plan = optimise(motion, space, objective=objective)
    assert plan.status is PlanStatus.INFEASIBLE
    assert re.search(text, plan.message)
    assert plan.statistics["solves"] == 0


def test_a_vehicle_that_may_not_move_at_all_is_told() -> None:
    """The axles of three wheels never meet, however they steer."""
    wheels = [
        {
            "id": name,
            "type": "steered",
            "x": x,
            "y": y,
            "steering_range_deg": [middle - 1.0, middle + 1.0],
            "max_speed": 1.0,
        }
        for name, x, y, middle in (
            ("a", 0.0, 0.0, 0.0),
            ("b", 0.5, 0.0, 90.0),
            ("c", 0.0, 0.5, 45.0),
        )
    ]
    stuck = vehicle_from_data({"name": "stuck", "wheels": wheels})
    plan = optimise(line(), build_space(stuck, Grid(20, 36), cache=False))
    assert plan.status is PlanStatus.INFEASIBLE
    assert "no configuration of the wheels" in plan.message


def test_no_motion_is_quicker_than_the_least_duration(
    mecanum: PermissibleSpace, ackermann: PermissibleSpace
) -> None:
    for space in (mecanum, ackermann):
        assert space.vehicle is not None
        rules = rules_of(space.vehicle)
        for goal in ([2.0, 0.5, 0.3], [3.0, 0.0, 0.0]):
            path = Path.from_poses(np.array([[0.0, 0.0, 0.0], goal]))
            found = optimise(path, space, objective="change", time=LONG)
            quick = fastest(found.raise_for_status(), space).duration
            assert 0 < least_duration(rules, np.array([[0, 0, 0], goal])) < quick
    # Straight ahead at 1.2 m/s, were it not for starting and braking.
    assert mecanum.vehicle is not None
    speed, _ = top_rates(rules_of(mecanum.vehicle))
    assert 1.2 <= speed < 1.2 * 1.03


def test_without_time_the_timing_is_what_is_left(mecanum: PermissibleSpace) -> None:
    plan = optimise(CORNER, mecanum, time=1e-6)
    assert plan.is_found
    assert plan.statistics["way"] == "timing"
    assert plan.statistics["solves"] == 0


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"objective": "beauty"}, "time, smooth, change"),
        ({"time": 0.0}, "time: 0.0"),
        ({"time": "3"}, "time: '3'; positive"),
        ({"max_iterations": 2.5}, "max_iterations: 2.5; a whole number"),
        ({"intervals": 12.5}, "intervals: 12.5; a whole number"),
        ({"clearance": -1.0}, "clearance: -1.0; a finite distance"),
        ({"clearance": math.nan}, "clearance: nan"),
        ({"time": math.nan}, "positive"),
        ({"max_iterations": 0}, "at least 1"),
        ({"intervals": 4}, "from 8 to 120"),
        ({"keep_ends": False}, "only change may move the ends"),
        ({"bounds": (0, 0, 1)}, "bounds"),
        ({"obstacles": {"pillar": [(0, 0)]}}, "from_polygons"),
        ({"bounds": (0, 0, 1, 1), "clearance": -1.0}, "clearance"),
    ],
)
def test_bad_arguments_are_told(
    mecanum: PermissibleSpace, arguments: dict[str, object], text: str
) -> None:
    with pytest.raises(InvalidInput, match=text):
        optimise(CORNER, mecanum, **arguments)  # type: ignore[arg-type]


def test_what_is_no_motion_of_poses_is_told(
    mecanum: PermissibleSpace, tmp_path: FilePath
) -> None:
    twists = Trajectory.from_twists([0, 1], [[0.5, 0, 0], [0.5, 0, 0]])
    with pytest.raises(InvalidTrajectory, match="twists"):
        optimise(twists, mecanum)
    still = Trajectory.from_poses([0, 1], [[0, 0, 0], [0, 0, 0]])
    with pytest.raises(InvalidTrajectory, match="the same pose"):
        optimise(still, mecanum)
    with pytest.raises(InvalidTrajectory, match="a Trajectory or a Path"):
        optimise("line", mecanum)  # type: ignore[arg-type]
    nothing = Plan("mecanum", PlanStatus.TIMEOUT, "no way")
    with pytest.raises(InvalidTrajectory, match="timeout"):
        optimise(nothing, mecanum)
    mecanum.save(tmp_path / "sheet")
    with pytest.raises(InvalidInput, match="a data sheet alone"):
        optimise(CORNER, load_space(tmp_path / "sheet"))


@pytest.mark.slow
def test_poses_of_another_point_mean_the_same_motion(
    mecanum: PermissibleSpace,
) -> None:
    """A turn about a point 0.4 m ahead of K, told by that point or by K."""
    theta = np.linspace(0, 1.2, 13)
    still = np.stack([np.zeros(13), np.zeros(13), theta], axis=-1)
    ahead = Path.from_poses(still, reference_point=(0.4, 0.0))
    k = -0.4 * np.exp(1j * theta)
    of_k = Path.from_poses(np.stack([k.real, k.imag, theta], axis=-1))
    plans = [optimise(path, mecanum, time=LONG) for path in (ahead, of_k)]
    first, second = (assert_drivable(plan, mecanum) for plan in plans)
    assert first.duration == pytest.approx(second.duration, rel=1e-2)
    assert plans[0].statistics["way"] == "solver"
    assert first.reference_point == (0.0, 0.0)
    np.testing.assert_allclose(first.samples[-1], of_k.poses[-1], atol=1e-6)


@pytest.mark.parametrize("objective", ["time", "change"])
def test_a_solver_that_lies_is_not_believed(
    mecanum: PermissibleSpace,
    objective: Objective,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It claims to have converged, to a motion too fast and through the pillar.

    So does the search for the nearest way, and there is no planner to help.
    """

    def lie(problem: OptimisationProblem, start: Guess, **_: object) -> Solution:
        legs = []
        for leg in start.legs:
            s = np.linspace(0, 1, len(leg.h) + 1)[:, None]
            first, last = leg.poses[[0, -1]]
            straight = first + (3 * s**2 - 2 * s**3) * (last - first)
            legs.append(leg_through(np.maximum(leg.h / 50, 2e-3), straight))
        value = Guess(tuple(legs), start.waits, start.lines)
        return Solution(
            SolverStatus.CONVERGED, value, 0.0, None, {"iterations": 1, "time": 0.0}
        )

    monkeypatch.setattr(OptimisationProblem, "solve", lie)
    monkeypatch.setattr(repairing, "projected", lambda course, *_, **__: course)
    monkeypatch.setattr(repairing, "polished", lambda _, courses, __: courses)
    monkeypatch.setattr(repairing.Repair, "planned", lambda _: None)
    obstacles = Obstacles.from_polygons(PILLAR)
    around = np.array([[-0.5, 0, 0], [0.3, 1.2, 0], [2.0, 1.2, 0], [3.0, 0, 0]])
    given = fastest(Path.from_poses(around), mecanum)
    plan = optimise(given, mecanum, obstacles, objective=objective, time=LONG)
    assert plan.trajectory is given
    through = optimise(line(0.0), mecanum, obstacles, objective=objective, time=LONG)
    assert through.status is PlanStatus.NOT_PROVED
    assert through.trajectory is None
    assert "pillar" in through.message
    assert through.place is not None
    free = optimise(line(0.0), mecanum, objective=objective, time=LONG)
    trajectory = free.raise_for_status()
    assert validate(trajectory, mecanum).valid


@pytest.mark.slow
def test_vehicles_without_limits_on_rates_are_no_trouble() -> None:
    wheels = [
        {"id": name, "type": "steered", "x": x, "y": y, "max_speed": 1.0}
        for name, x, y in (("a", 0.4, 0.3), ("b", -0.4, 0.3), ("c", 0.0, -0.3))
    ]
    free = vehicle_from_data({"name": "free", "wheels": wheels})
    space = build_space(free, Grid(20, 36), cache=False)
    plan = optimise(line(), space, max_iterations=20, time=LONG)
    assert plan.is_found
    assert validate(plan.raise_for_status(), space).valid


@pytest.mark.parametrize("degrees", [3.0, 8.0])
def test_a_heading_that_is_off_is_mended_within_its_own_size(degrees: float) -> None:
    """Straight ahead, the heading aslant: the axle of a differential drive slips.

    To turn at the start, drive straight and turn back changes every heading by the
    angle; what is found is hardly farther than that, margins for the proof included.
    """
    space = build_space(load_vehicle("differential"), cache=False)
    off = math.radians(degrees)
    poses = np.linspace([0.0, 0, off], [4.0, 0, off], 20)
    given = Trajectory.from_poses(np.linspace(0, 10, 20), poses)
    assert not validate(given, space).valid
    plan = optimise(given, space, objective="change", time=LONG)
    trajectory = assert_drivable(plan, space)
    assert 0 < float(plan.statistics["after"]) <= 1.05 * off / space_kappa(space)
    np.testing.assert_allclose(trajectory.samples[[0, -1]], poses[[0, -1]], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "goal", "way", "speed", "change"),
    [
        ("mecanum", [2.0, 0.0, 0.0], 2.0, 1.2, 1.5),
        ("differential", [3.0, 0.0, 0.0], 3.0, 1.0, 1.0),
        ("differential", [0.0, 0.0, math.pi / 2], 0.22 * math.pi / 2, 1.0, 1.0),
    ],
)
def test_known_optima_are_met(
    name: str, goal: list[float], way: float, speed: float, change: float
) -> None:
    """Wheels that all roll as far: they speed up and slow down as fast as they may."""
    space = build_space(load_vehicle(name), cache=False)
    path = Path.from_poses(np.linspace([0.0, 0, 0], goal, 3))
    plan = optimise(path, space, time=LONG)
    best = 2 * math.sqrt(way / change)
    if way * change > speed**2:
        best = way / speed + speed / change
    assert plan.duration is not None
    assert best * (1 - 1e-9) <= plan.duration < best * 1.002


@pytest.mark.parametrize("slower", [1.0, 1.1, 3.0])
def test_nothing_slower_than_a_valid_start_is_returned(
    mecanum: PermissibleSpace, ackermann: PermissibleSpace, slower: float
) -> None:
    for space, motion in (
        (mecanum, CORNER),
        (mecanum, line()),
        (ackermann, manoeuvre("wide-curve-fast")),
    ):
        given = fastest(motion, space).scaled(1 / slower)
        assert validate(given, space).valid
        plan = optimise(given, space, intervals=12, max_iterations=40, time=LONG)
        assert plan.is_found
        assert plan.duration is not None
        assert plan.duration <= given.duration
        assert plan.statistics["before"] == given.duration


def test_without_time_that_is_said_and_not_that_there_is_no_way(
    ackermann: PermissibleSpace,
) -> None:
    sideways = Path.from_poses([[0, 0, 0], [0, 1, 0]], name="sideways")
    plan = optimise(sideways, ackermann, time=1e-6)
    assert plan.status is PlanStatus.TIMEOUT
    assert "no time to mend it; as given: wheel front" in plan.message
    assert "at most 40.0° permitted" in plan.message
    assert plan.place is not None
    anew = optimise(sideways, ackermann, objective="change", time=1e-6)
    assert anew.statistics["way"] == "plan"
    assert "there was no time to mend the way" in anew.message


def test_two_samples_are_enough(ackermann: PermissibleSpace) -> None:
    given = Trajectory.from_poses([0, 1], [[0, 0, 0], [2, 0, 0]])
    plan = optimise(given, ackermann, objective="change", time=LONG)
    assert plan.statistics["largest_change"] == 0
    trajectory = plan.raise_for_status()
    assert validate(trajectory, ackermann).valid
    np.testing.assert_allclose(trajectory.samples[[0, -1]], given.samples[[0, -1]])
