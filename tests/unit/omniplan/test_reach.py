"""Pieces in another component of the space than straight ahead."""

from __future__ import annotations

import json
from collections import deque
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import configspace
from configspace import Grid, PermissibleSpace, exact_v_max, vehicle_from_data
from configspace.testing import random_vehicle
from omniplan import Report, Trajectory, cli, select, validate, write_trajectories

BoolArray = npt.NDArray[np.bool_]


def two_islands(grid: Grid | None = None) -> PermissibleSpace:
    """Two wheels on the x axis, so that both move ahead or both move back.

    Wheel a never points back, so wheel b points ahead: from -20° to 90°, where straight
    ahead is, or from 270° to 320°, that is -90° to -40°. No way joins the two.
    """
    wheels = [
        {"id": "a", "type": "steered", "x": 0.4, "y": 0.0, "max_speed": 1.0,
         "steering_range_deg": (-50, 50), "max_steering_rate_deg": 90},
        {"id": "b", "type": "steered", "x": -0.4, "y": 0.0, "max_speed": 1.0,
         "steering_range_deg": (-20, 320), "max_steering_rate_deg": 90},
    ]  # fmt: skip
    data = {"name": "islands", "kappa_g": 2.5, "wheels": wheels}
    return configspace.build_space(
        vehicle_from_data(data), grid or Grid(100, 180), cache=False
    )


@pytest.fixture(scope="module")
def islands() -> PermissibleSpace:
    return two_islands()


def aside(angle: float, speed: float = 0.1) -> list[float]:
    """The twist with wheel a straight ahead and wheel b at an angle in degrees."""
    lateral = speed * np.tan(np.radians(angle))  # v - 0.4 ω, while v + 0.4 ω = 0
    return [speed, lateral / 2, -lateral / 0.8]


def driven(*twists: list[float], rest: float = 0.0) -> Trajectory:
    """Every twist from rest to rest."""
    t, samples = [0.0], [[0.0, 0.0, 0.0]]
    for i, twist in enumerate(twists):
        if i and rest:
            t, samples = [*t, t[-1] + rest], [*samples, [0.0, 0.0, 0.0]]
        t += [t[-1] + 1, t[-1] + 2, t[-1] + 3]
        samples += [twist, twist, [0.0, 0.0, 0.0]]
    return Trajectory.from_twists(t, samples)


def limits(report: Report) -> set[str]:
    return {violation.limit for violation in report.violations}


def test_the_other_island_is_refused_and_said_so(islands: PermissibleSpace) -> None:
    assert validate(driven(aside(10)), islands).valid
    report = validate(driven(aside(-65)), islands)
    (violation,) = report.violations
    assert violation.limit == "UNREACHABLE"
    assert violation.wheel is None
    assert violation.is_proved
    assert violation.t_start == pytest.approx(0, abs=0.05)
    assert violation.t_end == pytest.approx(3, abs=0.05)
    assert violation.t == violation.t_start
    there = validate(driven(aside(-65)), islands, allow_unreachable=True)
    assert there.valid
    assert islands.contains(violation.kappa_n, violation.beta, 0.01)
    assert not islands.is_reachable(violation.kappa_n, violation.beta)
    assert "no way inside the space leads there from straight ahead" in str(violation)
    assert report.speed_factor == 0
    assert report.advice == ()


def test_driven_backwards_it_is_the_same_island(islands: PermissibleSpace) -> None:
    back = driven([-x for x in aside(-65)])
    assert limits(validate(back, islands)) == {"UNREACHABLE"}
    assert validate(back, islands, allow_unreachable=True).valid
    assert validate(driven([-x for x in aside(10)]), islands).valid


def test_the_data_sheet_alone_says_so_too(islands: PermissibleSpace) -> None:
    sheet = configspace.parse_space(configspace.dump_space(islands))
    assert limits(validate(driven(aside(-65)), sheet)) == {"UNREACHABLE"}
    assert validate(driven(aside(-65)), sheet, allow_unreachable=True).valid
    assert validate(driven(aside(10)), sheet).valid


def test_only_the_pieces_that_are_apart_are_named(islands: PermissibleSpace) -> None:
    report = validate(driven(aside(10), aside(-65), rest=60.0), islands)
    kinds = [(v.limit, round(v.t)) for v in report.violations]
    # The way from one island to the other does not exist either.
    assert kinds == [("RECONFIGURATION", 33), ("UNREACHABLE", 63)]


def test_the_vehicles_own_parameters_are_judged_alike(
    islands: PermissibleSpace,
) -> None:
    assert islands.vehicle is not None
    vx, vy, omega = aside(-65)
    (kappa_n,), (beta,), _ = (
        np.atleast_1d(x)
        for x in configspace.from_twist(
            np.array([vx, vy, omega]), islands.vehicle.boundary_curvature
        )
    )
    own = Trajectory.from_omni_curve(
        [0, 1], [kappa_n] * 2, [beta] * 2, [0.5, 0.5], islands.vehicle
    )
    assert limits(validate(own, islands)) == {"UNREACHABLE"}
    assert validate(own, islands, allow_unreachable=True).valid


def test_select_hands_it_through(islands: PermissibleSpace) -> None:
    trajectory = driven(aside(-65))
    (strict,) = select(trajectory, [islands])
    (lenient,) = select(trajectory, [islands], allow_unreachable=True)
    assert strict.best is None
    assert limits(strict.refused[0]) == {"UNREACHABLE"}
    assert lenient.best is not None
    assert lenient.best.vehicle == "islands"


def test_the_command_line_hands_it_through(
    islands: PermissibleSpace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, sheet = tmp_path / "t.csv", tmp_path / "islands.safetensors"
    write_trajectories(file, [driven(aside(-65))])
    islands.save(sheet)
    for command, option in (("check", "--vehicle"), ("select", "--fleet")):
        call = [command, str(file), option, str(sheet)]
        assert cli.main(call) == 1
        assert "[UNREACHABLE]" in capsys.readouterr().out
        assert cli.main([*call, "--allow-unreachable"]) == 0
        capsys.readouterr()


def test_a_report_of_it_travels(islands: PermissibleSpace) -> None:
    report = validate(driven(aside(-65)), islands)
    text = json.dumps(report.to_dict(), allow_nan=False)
    assert Report.from_dict(json.loads(text)) == report


def flood(permitted: BoolArray, start: tuple[int, int]) -> BoolArray:
    """What is connected with a start: 8 neighbours, β round, poles one place."""
    k, m = permitted.shape
    seen = np.zeros_like(permitted)
    queue = deque([start])
    seen[start] = True
    while queue:
        i, j = queue.popleft()
        near = [
            (i + a, (j + b) % m)
            for a in (-1, 0, 1)
            for b in (-1, 0, 1)
            if 0 <= i + a < k
        ]
        if i in {0, k - 1}:
            near += [(i, n) for n in range(m)]
        for place in near:
            if permitted[place] and not seen[place]:
                seen[place] = True
                queue.append(place)
    return seen


def test_no_refusal_where_a_flood_of_points_gets_there() -> None:
    """Random places of random two-wheel vehicles against a plain flood fill."""
    rng = np.random.default_rng(5)
    apart = connected = 0
    for _ in range(12):
        # As `two_islands`: with luck a belt of blocked directions of b parts them.
        low, high, gap = rng.uniform((-80, 20, 5), (-20, 80, 60))
        ranges = (low, high), (-gap, 360 - gap - rng.uniform(1, 40))
        wheels = [
            {"id": f"w{i}", "type": "steered", "x": x, "y": 0.0, "max_speed": 1.0,
             "steering_range_deg": both}
            for i, (x, both) in enumerate(zip((0.4, -0.4), ranges, strict=True))
        ]  # fmt: skip
        data = {"name": "random", "kappa_g": 2.5, "wheels": wheels}
        vehicle = vehicle_from_data(data)
        space = configspace.build_space(vehicle, Grid(80, 144), cache=False)
        kappa, beta = np.linspace(-2, 2, 161), np.linspace(-np.pi, np.pi, 289)[:-1]
        k, b = np.meshgrid(kappa, beta, indexing="ij")
        permitted = exact_v_max(vehicle, k, b) > 0
        if not permitted[80, 144]:
            continue
        inside = flood(permitted, (80, 144))
        places = np.argwhere(permitted)
        for i, j in places[rng.choice(len(places), 25)].tolist():
            own = Trajectory.from_omni_curve(
                [0, 1], [kappa[i]] * 2, [beta[j]] * 2, [0.1, 0.1], vehicle
            )
            found = limits(validate(own, space))
            assert found <= {"UNREACHABLE"}
            if inside[i, j]:
                assert not found
                connected += 1
            else:
                apart += bool(found)
    assert connected > 20
    assert apart > 5


def test_random_vehicles_that_hold_together_are_never_refused_for_it() -> None:
    rng = np.random.default_rng(6)
    for kind in ("differential", "mecanum", "omni"):
        vehicle = random_vehicle(rng, kind)
        space = configspace.build_space(vehicle, Grid(40, 72), cache=False)
        for _ in range(5):
            twist = rng.normal(size=3) * 0.2
            trajectory = Trajectory.from_twists([0, 1], [twist, twist])
            assert "UNREACHABLE" not in limits(validate(trajectory, space))
