"""The checks that OMPL programs are given."""

from __future__ import annotations

import gc
import itertools
import json
import math
import re
import threading
import weakref
from typing import Any

import numpy as np
import pytest

import configspace
from configspace import PermissibleSpace
from configspace.errors import InvalidInput
from configspace.omni_curve import curvature_of_ratio
from omniplan import sampling
from omniplan.obstacles import CollisionChecker, Obstacles
from omniplan.planning.moves import Move
from omniplan.sampling.curves import arcs_of
from omniplan.sampling.ompl_bindings import base, geometric, quiet, seeded


@pytest.fixture(scope="module")
def spaces() -> dict[str, PermissibleSpace]:
    names = ("ift-four-steered", "mecanum", "ackermann", "differential", "romea-4ws")
    return {
        name: configspace.build_space(configspace.load_vehicle(name)) for name in names
    }


class Disc:
    """A round obstacle and a vehicle that is a point: every question by hand."""

    def __init__(self, x: float, y: float, radius: float) -> None:
        self.centre = np.array([x, y])
        self.radius = radius
        self.motions: list[Any] = []

    def distance(self, pose: Any) -> float:
        apart = math.hypot(pose[0] - self.centre[0], pose[1] - self.centre[1])
        return max(0.0, apart - self.radius)

    def is_free(self, pose: Any) -> bool:
        return self.distance(pose) > 0

    def is_motion_free(self, motion: Any) -> bool:
        self.motions.append(motion)
        poses = motion.poses(np.linspace(0, 1, 2001))
        apart = np.hypot(*(poses[:, :2] - self.centre).T)
        return bool((apart > self.radius + 1e-3).all())


def _information(state_space: Any | None = None) -> Any:
    state_space = state_space or base.SE2StateSpace()
    state_space.setBounds(sampling.bounds_of((-10, -10, 10, 10)))
    return base.SpaceInformation(state_space)


def _state(si: Any, x: float, y: float, theta: float) -> Any:
    state = si.getStateSpace().allocState()
    state.setXY(x, y)
    state.setYaw(theta)
    return state


def _dense(space: PermissibleSpace, first: Any, second: Any, si: Any) -> bool | None:
    """Return whether one representation is permitted at 400 places; None if near."""
    between = si.getStateSpace().allocState()
    poses = []
    for share in np.linspace(0, 1, 401):
        si.getStateSpace().interpolate(first, second, share, between)
        poses.append((between.getX(), between.getY(), between.getYaw()))
    at = np.array(poses)
    at[:, 2] = np.unwrap(at[:, 2])
    step = at[-1] - at[0]
    way, turn = math.hypot(step[0], step[1]), step[2] / space.kappa_g
    kappa_n = float(curvature_of_ratio(way, turn))
    beta = math.atan2(step[1], step[0]) - at[:, 2]
    answers = []
    for k, b in ((kappa_n, beta), (-kappa_n, beta + np.pi)):
        answers.append(bool((space.v_max(k, b, reachable_only=True) > 0).all()))
    return any(answers)


@pytest.mark.parametrize("name", ["ift-four-steered", "mecanum", "romea-4ws"])
def test_motions_are_judged_as_dense_sampling_does(
    spaces: dict[str, PermissibleSpace], name: str
) -> None:
    space, si = spaces[name], _information()
    sampling.equip(si, space)
    rng = np.random.default_rng(3)
    answers = []
    for _ in range(150):
        ends = rng.uniform([-4, -4, -4], [4, 4, 4], (2, 3))
        if rng.random() < 0.3:
            ends[1, :2] = ends[0, :2] + rng.normal(0, 1e-3, 2)
        if rng.random() < 0.3:
            ends[1, 2] = ends[0, 2] + rng.choice([0.0, 2 * math.pi])
        first, second = _state(si, *ends[0]), _state(si, *ends[1])
        answer = si.checkMotion(first, second)
        answers.append(answer)
        assert answer == _dense(space, first, second, si)
    assert any(answers)
    assert all(answers) == (name == "mecanum")


def test_a_motion_to_where_one_is_needs_nothing(
    spaces: dict[str, PermissibleSpace],
) -> None:
    si = _information()
    sampling.equip(si, spaces["ackermann"])
    assert si.checkMotion(_state(si, 1, 1, 0.3), _state(si, 1, 1, 0.3))
    assert si.checkMotion(_state(si, 1, 1, 0.3), _state(si, 1, 1, 0.3 + 2 * math.pi))


def test_a_differential_drive_drives_straight_or_turns_on_the_spot(
    spaces: dict[str, PermissibleSpace],
) -> None:
    si = _information()
    sampling.equip(si, spaces["differential"])
    here = _state(si, 0, 0, 0)
    assert si.checkMotion(here, _state(si, 0, 0, 2.5))
    assert si.checkMotion(here, _state(si, 3, 0, 0))
    assert si.checkMotion(here, _state(si, -3, 0, 0))
    assert not si.checkMotion(here, _state(si, 3, 0.01, 0))
    assert not si.checkMotion(here, _state(si, 3, 0, 0.01))


def test_an_ackermann_vehicle_does_not_turn_on_the_spot(
    spaces: dict[str, PermissibleSpace],
) -> None:
    si = _information()
    sampling.equip(si, spaces["ackermann"])
    assert not si.checkMotion(_state(si, 0, 0, 0), _state(si, 0, 0, 0.5))


def test_the_last_valid_state_is_where_the_wheels_stop_turning() -> None:
    data = configspace.load_vehicle("ift-four-steered").model_dump(mode="json")
    for wheel in data["wheels"]:
        wheel["steering_range_deg"] = [-100, 100]
    vehicle = configspace.Vehicle.model_validate_json(json.dumps(data))
    si = _information()
    sampling.equip(si, configspace.build_space(vehicle, cache=False))
    validator = si.getMotionValidator()
    stop = math.radians(100)
    # Far away the curvature is next to nothing: all wheels point along β.
    first, second = _state(si, -9e5, 0, 0.0), _state(si, 9e5, 0, -2.5)
    si.getStateSpace().setBounds(sampling.bounds_of((-1e6, -1, 1e6, 1)))
    reached = si.getStateSpace().allocState()
    share = validator.last_valid(first, second, reached, 1e-9)
    assert share == pytest.approx(stop / 2.5, abs=1e-5)
    assert reached.getYaw() == pytest.approx(-stop, abs=1e-5)
    assert validator.last_valid(first, first) == 1.0


def test_states_are_valid_within_bounds_and_beside_obstacles(
    spaces: dict[str, PermissibleSpace],
) -> None:
    si = _information()
    disc = Disc(0, 0, 2)
    si.setStateValidityChecker(sampling.validity_checker(si, spaces["mecanum"], disc))
    assert si.isValid(_state(si, 3, 0, 0))
    assert not si.isValid(_state(si, 1, 1, 0))
    assert not si.isValid(_state(si, 11, 0, 0))
    path = geometric.PathGeometric(si, _state(si, 5, 0, 0))
    assert path.clearance() == pytest.approx(3.0)
    free = sampling.validity_checker(si, spaces["mecanum"])
    assert free.clearance(_state(si, 5, 0, 0)) == math.inf


def test_motions_are_held_against_obstacles_as_a_whole(
    spaces: dict[str, PermissibleSpace],
) -> None:
    si = _information()
    disc = Disc(0, 0, 0.01)  # between two steps of OMPL's own check
    sampling.equip(si, spaces["mecanum"], disc)
    assert not si.checkMotion(_state(si, -5, 0, 0), _state(si, 5, 0, 1))
    assert si.checkMotion(_state(si, -5, 0.1, 0), _state(si, 5, 0.1, 1))
    assert disc.motions[-1].turn == pytest.approx(1.0)


def test_states_and_motions_agree_with_the_collision_checker(
    spaces: dict[str, PermissibleSpace],
) -> None:
    """What is decided at a glance, and what is not, near and far."""
    rng = np.random.default_rng(4)
    pillars = [
        [(x, y), (x + 0.5, y), (x + 0.5, y + 0.5), (x, y + 0.5)]
        for x, y in rng.uniform(-9, 9, (6, 2))
    ]
    space, si = spaces["mecanum"], _information()
    halls = Obstacles.from_polygons(pillars)
    checker, other = (CollisionChecker(space, halls, 0.1) for _ in range(2))
    sampling.equip(si, space, checker)
    poses = np.column_stack([rng.uniform(-9.9, 9.9, (80, 2)), rng.uniform(-3, 3, 80)])
    for _ in range(2):  # the second time the floor is known
        answers = [si.isValid(_state(si, *pose)) for pose in poses]
        assert answers == [other.is_free(pose) for pose in poses]
    motions = [
        si.checkMotion(_state(si, *one), _state(si, *two))
        for one, two in itertools.pairwise(poses)
    ]
    assert motions == [
        other.is_motion_free(Move.straight(one, two))
        for one, two in itertools.pairwise(poses)
    ]
    assert 0 < sum(motions) < len(motions)
    assert 0 < sum(answers) < len(answers)


def test_bounds_count_as_they_are_when_asked(
    spaces: dict[str, PermissibleSpace],
) -> None:
    """What is known of the floor outlives the bounds of the state space."""
    si = _information()
    far = Obstacles.from_polygons([[(9, 9), (9.5, 9), (9, 9.5)]])
    sampling.equip(si, spaces["mecanum"], CollisionChecker(spaces["mecanum"], far))
    state = _state(si, -5, -5, 0)
    assert si.isValid(state)
    assert si.isValid(state)
    si.getStateSpace().setBounds(sampling.bounds_of((-4, -4, 4, 4)))
    assert not si.isValid(state)
    assert si.isValid(_state(si, 0, 0, 0))
    state.setXY(0.0, 0.0)
    state.setYaw(4.0)
    assert not si.isValid(state)


@pytest.mark.parametrize("place", [(math.nan, 0), (0, math.nan), (math.nan, math.nan)])
def test_a_place_that_is_no_number_is_never_open_floor(
    spaces: dict[str, PermissibleSpace], place: tuple[float, float]
) -> None:
    si = _information()
    checker = CollisionChecker(spaces["mecanum"])
    sampling.equip(si, spaces["mecanum"], checker)
    state = _state(si, 0, 0, 0)
    assert si.isValid(state)
    assert checker.open_floor.longest
    state.setXY(*place)
    with pytest.raises(InvalidInput, match="finite numbers"):
        si.isValid(state)


def test_without_a_checker_the_programs_own_states_are_asked(
    spaces: dict[str, PermissibleSpace],
) -> None:
    space, si = spaces["mecanum"], _information()
    si.setStateValidityChecker(lambda state: abs(state.getX()) > 1)
    si.setMotionValidator(sampling.motion_validator(si, space))
    si.setup()
    first, second = _state(si, -5, 0, 0), _state(si, 5, 0, 0)
    assert not si.checkMotion(first, second)
    si.setMotionValidator(sampling.motion_validator(si, space, Disc(0, 0, 1)))
    assert not si.checkMotion(first, second)
    with pytest.raises(InvalidInput, match="one of omniplan already"):
        sampling.motion_validator(si, space)
    alone = sampling.motion_validator(si, space, ask_states=False)
    assert alone.checkMotion(first, second)


def test_both_the_checker_and_the_states_may_be_asked(
    spaces: dict[str, PermissibleSpace],
) -> None:
    space, si = spaces["mecanum"], _information()
    si.setStateValidityChecker(lambda state: abs(state.getX()) > 1)
    checker = Disc(0, 50, 1)
    si.setMotionValidator(
        sampling.motion_validator(si, space, checker, ask_states=True)
    )
    si.setup()
    assert not si.checkMotion(_state(si, -5, 0, 0), _state(si, 5, 0, 0))
    assert si.checkMotion(_state(si, -5, 0, 0), _state(si, -5, 5, 0))
    assert len(checker.motions) == 2


def test_planned_motions_are_drivable(spaces: dict[str, PermissibleSpace]) -> None:
    space, si = spaces["ift-four-steered"], _information()
    disc = Disc(0, 0, 2)
    seeded(4)
    sampling.equip(si, space, disc)
    problem = base.ProblemDefinition(si)
    problem.setStartAndGoalStates(_state(si, -8, 0, 0), _state(si, 8, 0, 3), 1e-3)
    planner = geometric.RRTConnect(si)
    planner.setProblemDefinition(problem)
    planner.setup()
    with quiet():
        planner.solve(5.0)
    assert problem.hasExactSolution()
    states = problem.getSolutionPath().getStates()
    for first, second in itertools.pairwise(states):
        assert _dense(space, first, second, si)


def test_threads_do_not_meet(spaces: dict[str, PermissibleSpace]) -> None:
    space, si = spaces["ift-four-steered"], _information()
    sampling.equip(si, space)
    rng = np.random.default_rng(8)
    pairs = [
        (_state(si, *rng.uniform(-4, 4, 3)), _state(si, *rng.uniform(-4, 4, 3)))
        for _ in range(300)
    ]
    expected = [si.checkMotion(*pair) for pair in pairs]
    found: dict[int, list[bool]] = {}

    def ask(number: int) -> None:
        for _ in range(10):
            found[number] = [si.checkMotion(*pair) for pair in pairs]

    threads = [threading.Thread(target=ask, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    assert all(each == expected for each in found.values())


def test_the_checks_hold_nothing_that_holds_them(
    spaces: dict[str, PermissibleSpace],
) -> None:
    class Mark:
        pass

    for state_space in (None, base.ReedsSheppStateSpace(2.0)):
        si = _information(state_space)
        sampling.equip(si, spaces["ackermann"], Disc(0, 0, 1))
        si.checkMotion(_state(si, 2, 2, 0), _state(si, 5, 2, 0))
        si.mark = Mark()
        mark = weakref.ref(si.mark)
        gc.collect()
        assert isinstance(si.getMotionValidator(), sampling.MotionValidator)
        del si
        gc.collect()
        assert mark() is None


@pytest.mark.parametrize("reverse", [True, False])
def test_line_spaces_have_the_least_radius(
    spaces: dict[str, PermissibleSpace], reverse: bool
) -> None:
    space = spaces["ackermann"]
    vehicle = space.vehicle
    assert vehicle is not None
    least = sampling.least_radius(space)
    # By head: the inner front wheel is at its stop.
    front = [w for w in vehicle.wheels if w.type == "steered"]
    x = front[0].x - vehicle.reference.real
    track = max(w.y for w in front) - vehicle.reference.imag
    stop = min(abs(end) for w in front for end in w.steering_range)
    assert least == pytest.approx(x / math.tan(stop) + track, rel=1e-6)
    curves = sampling.line_space(space, reverse=reverse, bounds=(-9, -9, 9, 9))
    kind = base.ReedsSheppStateSpace if reverse else base.DubinsStateSpace
    assert type(curves) is kind
    unit = kind(1.0)
    ends = []
    for each in (curves, unit):
        first, second = each.allocState(), each.allocState()
        first.setXY(0.0, 0.0)
        first.setYaw(0.0)
        second.setXY(0.0, 0.0)
        second.setYaw(math.pi / 2)
        ends.append(each.distance(first, second))
    assert ends[0] / ends[1] == pytest.approx(least, rel=1e-9)


def test_line_spaces_refuse_what_has_none(spaces: dict[str, PermissibleSpace]) -> None:
    with pytest.raises(InvalidInput, match=r"vehicle mecanum: .*not line-mobile"):
        sampling.line_space(spaces["mecanum"])
    with pytest.raises(InvalidInput, match=r"vehicle differential: .*on the spot"):
        sampling.line_space(spaces["differential"])
    with pytest.raises(InvalidInput, match=r"vehicle ackermann: radius: 0\.5 m"):
        sampling.line_space(spaces["ackermann"], radius=0.5)
    with pytest.raises(InvalidInput, match="radius: nan m"):
        sampling.line_space(spaces["ackermann"], radius=math.nan)
    assert sampling.line_space(spaces["differential"], radius=0.5) is not None


def test_curves_that_are_too_tight_are_refused(
    spaces: dict[str, PermissibleSpace],
) -> None:
    si = _information(base.ReedsSheppStateSpace(1.0))
    least = sampling.least_radius(spaces["ackermann"])
    with pytest.raises(
        InvalidInput,
        match=re.escape(f"radius of the curves: 1 m; at least {least:.6g}"),
    ):
        sampling.equip(si, spaces["ackermann"])
    sampling.equip(si, spaces["mecanum"])
    with pytest.raises(InvalidInput, match="vehicle romea-4ws"):
        sampling.equip(_information(base.DubinsStateSpace(0.1)), spaces["romea-4ws"])


@pytest.mark.parametrize("reverse", [True, False])
def test_curves_are_cut_into_their_arcs(
    spaces: dict[str, PermissibleSpace], reverse: bool
) -> None:
    curves = sampling.line_space(spaces["ackermann"], reverse=reverse)
    radius = sampling.least_radius(spaces["ackermann"])
    si = _information(curves)
    rng = np.random.default_rng(2)
    for _ in range(40):
        first = _state(si, *rng.uniform(-3, 3, 3))
        second = _state(si, *rng.uniform(-3, 3, 3))
        between = _state(si, 0, 0, 0)

        def pose_at(
            share: float, first: Any = first, second: Any = second, at: Any = between
        ) -> tuple[float, float, float]:
            curves.interpolate(first, second, share, at)
            return at.getX(), at.getY(), at.getYaw()

        length = curves.distance(first, second)
        moves = arcs_of(pose_at, length, radius)
        assert 1 <= len(moves) <= (5 if reverse else 3)
        assert sum(move.length for move in moves) == pytest.approx(length, abs=1e-9)
        done = 0.0
        for move in moves:
            straight = abs(move.turn) < 1e-12
            assert straight or abs(move.turn) * radius == pytest.approx(move.length)
            for u in (0.0, 0.37, 1.0):
                x, y, theta = move.poses([u])[0]
                share = min(1.0, (done + u * move.length) / length)
                there = pose_at(share)
                assert math.hypot(x - there[0], y - there[1]) < 1e-5
                assert abs(math.remainder(theta - there[2], 2 * math.pi)) < 1e-5
            done += move.length


def test_curves_are_held_against_obstacles_and_bounds(
    spaces: dict[str, PermissibleSpace],
) -> None:
    curves = sampling.line_space(spaces["ackermann"])
    si = _information(curves)
    radius = sampling.least_radius(spaces["ackermann"])
    half_round = _state(si, 0, 2 * radius, math.pi)
    first = _state(si, 0, 0, 0)
    top = (radius, radius)
    sampling.equip(si, spaces["ackermann"], Disc(*top, 0.02))
    assert not si.checkMotion(first, half_round)
    sampling.equip(si, spaces["ackermann"], Disc(0, radius, 0.9 * radius))
    assert si.checkMotion(first, half_round)
    curves.setBounds(sampling.bounds_of((-1, -1, radius - 0.01, 10)))
    assert not si.checkMotion(first, half_round)
    curves.setBounds(sampling.bounds_of((-1, -1, radius + 0.01, 10)))
    assert si.checkMotion(first, half_round)


def test_curves_without_a_checker_stay_within_the_bounds(
    spaces: dict[str, PermissibleSpace],
) -> None:
    curves = sampling.line_space(spaces["ackermann"])
    si = _information(curves)
    radius = sampling.least_radius(spaces["ackermann"])
    curves.setBounds(sampling.bounds_of((-1, -1, radius - 0.1, 10)))
    sampling.equip(si, spaces["ackermann"])
    si.setup()
    assert not si.checkMotion(_state(si, 0, 0, 0), _state(si, 0, 2 * radius, math.pi))


def test_other_state_spaces_are_refused(spaces: dict[str, PermissibleSpace]) -> None:
    si = base.SpaceInformation(base.SO2StateSpace())
    with pytest.raises(InvalidInput, match="si: state space: SO2StateSpace"):
        sampling.motion_validator(si, spaces["mecanum"])
    with pytest.raises(InvalidInput, match="si: state space: SO2StateSpace"):
        sampling.validity_checker(si, spaces["mecanum"])
    with pytest.raises(InvalidInput, match="space: str"):
        sampling.motion_validator(_information(), "mecanum")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "bounds", [(0, 0, 0, 1), (0, 0, math.inf, 1), (math.nan, 0, 1, 1), (0, 1)]
)
def test_bounds_are_checked(bounds: Any) -> None:
    with pytest.raises(InvalidInput, match="bounds"):
        sampling.bounds_of(bounds)


@pytest.mark.parametrize("seed", [0, -1, 2**32])
def test_seeds_are_checked(seed: int) -> None:
    with pytest.raises(InvalidInput, match="seed"):
        sampling.seeded(seed)


def test_intervals_of_moves_agree_with_the_kernel_of_motions(
    spaces: dict[str, PermissibleSpace],
) -> None:
    space, si = spaces["ift-four-steered"], _information()
    sampling.equip(si, space)
    intervals = sampling.PermittedIntervals(space)
    rng = np.random.default_rng(9)
    for _ in range(300):
        ends = rng.uniform([-1, -1, -3], [1, 1, 3], (2, 3))
        move = Move.straight(ends[0], ends[1])
        k, b0, b1 = move.kappa_n(space.kappa_g), move.beta_0, move.beta_1
        either = intervals.permits(k, b0, b1) or intervals.permits(
            -k, b0 + math.pi, b1 + math.pi
        )
        assert si.checkMotion(_state(si, *ends[0]), _state(si, *ends[1])) == either


def test_plain_and_array_questions_agree(spaces: dict[str, PermissibleSpace]) -> None:
    intervals = sampling.PermittedIntervals(spaces["ift-four-steered"])
    rng = np.random.default_rng(1)
    kappa_n, beta_0 = rng.uniform(-2, 2, 200), rng.uniform(-4, 4, 200)
    beta_1 = beta_0 + rng.normal(0, 1, 200)
    permitted = intervals.is_permitted(kappa_n, beta_0, beta_1)
    speed = intervals.v_max(kappa_n, beta_0, beta_1)
    assert ((speed > 0) == permitted).all()
    for i in range(200):
        piece = (kappa_n[i], beta_0[i], beta_1[i])
        assert intervals.permits(*piece) == permitted[i]
        assert intervals.piece_speed(*piece) == speed[i]


def _slowest_of(
    space: PermissibleSpace, kappa_n: float, beta_0: float, beta_1: float
) -> float:
    """Return the speed of a piece by a loop over all nodes around it."""
    load = space.tables.load[0]
    rows, columns = load.shape[0] - 1, load.shape[1] - 1
    place = (kappa_n + 2) * rows / 4
    row = min(int(place), rows - 1)
    share = place - row
    low, high = min(beta_0, beta_1), max(beta_0, beta_1)
    first = math.floor((low + math.pi) * columns / (2 * math.pi))
    last = math.ceil((high + math.pi) * columns / (2 * math.pi))
    below = max(load[row, j % columns] for j in range(first, last + 1))
    above = max(load[row + 1, j % columns] for j in range(first, last + 1))
    return 1 / math.sqrt((1 - share) * below + share * above)


@pytest.mark.parametrize("name", ["ift-four-steered", "mecanum"])
def test_the_speed_of_a_piece_is_that_of_the_nodes_around_it(
    spaces: dict[str, PermissibleSpace], name: str
) -> None:
    space = spaces[name]
    intervals = sampling.PermittedIntervals(space)
    rng = np.random.default_rng(6)
    seen = 0
    for _ in range(200):
        k, b0 = rng.uniform(-2, 2), rng.uniform(-4, 4)
        b1 = b0 + rng.normal(0, 1.5)
        speed = intervals.piece_speed(k, b0, b1)
        if speed == 0:
            continue
        seen += 1
        assert speed == pytest.approx(_slowest_of(space, k, b0, b1), rel=1e-6)
        dense = space.v_max(k, np.linspace(b0, b1, 500)).min()
        assert 0.98 * dense < speed <= dense
    assert seen > 50


def test_questions_out_of_range_are_refused(
    spaces: dict[str, PermissibleSpace],
) -> None:
    intervals = sampling.PermittedIntervals(spaces["mecanum"])
    with pytest.raises(InvalidInput, match="kappa_n"):
        intervals.is_permitted(2.1, 0.0, 1.0)
    with pytest.raises(InvalidInput, match="beta_1"):
        intervals.v_max(1.0, 0.0, math.nan)
    with pytest.raises(InvalidInput, match="space"):
        sampling.PermittedIntervals("mecanum")  # type: ignore[arg-type]


def test_every_public_name_is_there() -> None:
    assert sampling.__all__ == sorted(sampling.__all__)
    assert all(hasattr(sampling, name) for name in sampling.__all__)
    assert set(sampling.__all__) <= set(dir(sampling))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = sampling.nothing


MAKERS = (sampling.validity_checker, sampling.motion_validator, sampling.equip)


@pytest.mark.parametrize("make", MAKERS)
def test_what_is_no_space_information_is_refused(
    spaces: dict[str, PermissibleSpace], make: Any
) -> None:
    setup = geometric.SimpleSetup(base.SE2StateSpace())
    for given, name in ((None, "NoneType"), (setup, "SimpleSetup")):
        words = rf"si: {name}; an ompl.base.SpaceInformation; a SimpleSetup has one"
        with pytest.raises(InvalidInput, match=words):
            make(given, spaces["mecanum"])
    make(setup.getSpaceInformation(), spaces["mecanum"])


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize(
    ("checker", "name"), [(5, "int"), (Obstacles(), "Obstacles"), ("hall", "str")]
)
def test_what_is_no_checker_is_refused(
    spaces: dict[str, PermissibleSpace], make: Any, checker: object, name: str
) -> None:
    words = (
        rf"checker: {name}; a CollisionChecker, or anything with "
        "is_free, is_motion_free, distance"
    )
    with pytest.raises(InvalidInput, match=words):
        make(_information(), spaces["mecanum"], checker)


@pytest.mark.parametrize("make", MAKERS)
def test_a_checker_of_another_vehicle_is_refused(
    spaces: dict[str, PermissibleSpace], make: Any
) -> None:
    words = (
        "checker: checks vehicle ackermann, whose footprint or reference point "
        "differs; a CollisionChecker of vehicle mecanum"
    )
    with pytest.raises(InvalidInput, match=words):
        make(_information(), spaces["mecanum"], CollisionChecker(spaces["ackermann"]))
    for same in (
        CollisionChecker(spaces["mecanum"]),
        CollisionChecker(configspace.load_vehicle("mecanum"), clearance=0.1),
        CollisionChecker([(1, 1), (-1, 1), (0, -1)]),
    ):
        make(_information(), spaces["mecanum"], same)
