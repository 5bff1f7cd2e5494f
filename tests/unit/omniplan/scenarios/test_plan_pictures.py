"""Pictures and animations of plans: what they show is where the vehicle is."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Polygon  # noqa: TID251
from PIL import Image

from configspace import InvalidInput
from configspace.plot import save_figure
from omniplan import Trajectory
from omniplan.obstacles import Obstacles
from omniplan.planning.result import Plan, PlanStatus
from omniplan.plots.animation import film_at, save_animation
from omniplan.plots.plan_data import film_of, spread_along
from omniplan.plots.plans import numbers_of, plot_plans
from omniplan.scenarios import Solution
from omniplan.scenarios.scenario import scenario, space_of_platform


def solution_of(name: str) -> Solution:
    """Return a made-up plan: half a metre to the left in 2 s."""
    space = space_of_platform(name)
    k = space.header.reference
    t = np.linspace(0, 2, 21)
    u = t / 2
    poses = np.zeros((21, 3))
    poses[:, 0] = k[0]
    poses[:, 1] = 0.5 * u**2 * (3 - 2 * u)
    trajectory = Trajectory.from_poses(t, poses, reference_point=k)
    plan = Plan(space.name, PlanStatus.FOUND, "found", trajectory, stops=1, cusps=1)
    hall = Obstacles.from_polygons(scenario("parking").obstacles)
    return Solution(space, hall, plan)


@pytest.fixture(scope="module")
def sideways() -> Solution:
    return solution_of("mecanum")


def test_films_follow_the_footprint(sideways: Solution) -> None:
    trajectory = sideways.plan.raise_for_status()
    film = film_of(trajectory, sideways.space)
    assert film.t[[0, -1]].tolist() == [0, 2]
    footprint = np.array(sideways.space.header.footprint)
    assert film.outlines[0] == pytest.approx(footprint)
    assert film.outlines[-1] == pytest.approx(footprint + np.array([0, 0.5]))
    assert film.wheels.shape[1:] == (4, 4, 2)
    middles = film.wheels[-1].mean(axis=1)
    assert sorted(map(tuple, middles.round(9).tolist())) == [
        (-0.4, 0.22),
        (-0.4, 0.78),
        (0.4, 0.22),
        (0.4, 0.78),
    ]
    tips = film.noses[:, 0] - footprint[:, 0].max() * np.array([1, 0])
    assert tips == pytest.approx(film.k - film.k[0])
    at = film_at(film, np.array([1.0]))
    assert at.k[0] == pytest.approx((0, 0.25), abs=1e-3)
    chosen = spread_along(film, 0.1)
    assert chosen[0] == 0
    assert film.t[chosen[-1]] == 2
    assert np.diff(film.k[chosen, 1]).max() < 0.13


def test_wheels_turn_with_their_steering() -> None:
    space = space_of_platform("swerve")
    t = np.linspace(0, 2, 41)
    u = t / 2
    poses = np.zeros((41, 3))
    poses[:, 1] = 0.5 * u**2 * (3 - 2 * u)
    film = film_of(Trajectory.from_poses(t, poses), space)
    wheel = film.wheels[len(film.t) // 2, 0]
    along = wheel[0] - wheel[1]
    assert abs(along[0]) < 1e-6 < abs(along[1])


def test_numbers_are_those_of_the_plan(sideways: Solution) -> None:
    assert numbers_of(sideways) == "1.44 m² swept · 2.0 s · 1 cusp · 1 stop"
    no = Plan("platform-mecanum", PlanStatus.TIMEOUT, "no way was found")
    none = Solution(sideways.space, sideways.obstacles, no, "Mecanum")
    assert numbers_of(none) == "no plan: timeout"
    assert none.swept_area is None
    assert none.to_dict()["swept_area"] is None
    assert none.title == "Mecanum"
    assert sideways.title == "platform-mecanum"


def test_pictures_show_all_plans_and_those_that_failed(
    sideways: Solution, tmp_path: Path
) -> None:
    no = Plan("platform-mecanum", PlanStatus.TIMEOUT, "no way was found")
    none = Solution(sideways.space, sideways.obstacles, no)
    figure = plot_plans([sideways, none], "Sideways")
    assert [axes.get_xlabel() for axes in figure.axes] == [
        numbers_of(sideways),
        "no plan: timeout",
    ]
    x0, x1 = figure.axes[0].get_xlim()
    y0, y1 = figure.axes[0].get_ylim()
    assert x0 < -2.8 < 2.8 < x1
    assert y0 < -0.75 < 0.85 < y1
    save_figure(figure, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 5000


def test_a_plan_that_failed_shows_start_goal_and_where(sideways: Solution) -> None:
    space = sideways.space
    k = complex(*space.header.reference)
    start, goal = (k.real, 0.0, 0.0), (8.0, 0.5, math.pi / 2)
    status, message = PlanStatus.GOAL_BLOCKED, "goal blocked: at the goal it hits it"
    no = Plan(space.name, status, message, place=goal)
    wall = Obstacles.from_polygons([[(7, -90), (7.2, -90), (7.2, 90), (7, 90)]])
    (axes,) = plot_plans([Solution(space, wall, no, ends=(start, goal))]).axes
    outlines = [patch for patch in axes.patches if isinstance(patch, Polygon)]
    footprint = np.array(space.header.footprint)
    drawn = [outline.get_xy()[:-1] for outline in outlines]
    noses = [corners for corners in drawn if len(corners) == 3]
    drawn = [corners for corners in drawn if len(corners) == 4]
    turned = (footprint @ [1, 1j] - k) * 1j + complex(*goal[:2])
    at_goal = np.stack([turned.real, turned.imag], axis=-1)
    assert drawn[0] == pytest.approx(footprint)
    assert drawn[1] == pytest.approx(at_goal)
    assert drawn[2] == pytest.approx(at_goal)
    # Ahead, in the middle of the front: to the right at the start, up at the goal.
    assert noses[0][0] == pytest.approx((footprint[:, 0].max(), 0.0))
    assert noses[1][0] == pytest.approx((goal[0], at_goal[:, 1].max()))
    assert (noses[1][1:, 1] < noses[1][0, 1]).all()
    crosses = [line for line in axes.lines if line.get_marker() == "X"]
    assert [np.ravel(line.get_xydata()).tolist() for line in crosses] == [[8.0, 0.5]]
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    for corners in drawn:
        assert (corners > [x0, y0]).all()
        assert (corners < [x1, y1]).all()
    assert y1 - y0 < 40  # the whole wall would hide where it failed


def test_animations_are_small_and_as_long_as_the_plan(
    sideways: Solution, tmp_path: Path
) -> None:
    seen = []
    path = tmp_path / "plan.gif"
    save_animation(
        [sideways], path, "Sideways", speed=1.0, progress=lambda *n: seen.append(n)
    )
    assert seen[-1] == (21, 21)
    assert path.stat().st_size < 200_000
    with Image.open(path) as film:
        assert film.n_frames >= 18  # type: ignore[attr-defined]
        total, first = 0, np.asarray(film.convert("RGB"))
        for i in range(film.n_frames):  # type: ignore[attr-defined]
            film.seek(i)
            total += film.info["duration"]
        last = np.asarray(film.convert("RGB"))
    assert total == pytest.approx(2000 + 1500 + 100, abs=200)
    assert (first != last).any()
    assert not list(tmp_path.glob(".*"))


def test_animations_need_a_gif(sideways: Solution, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"must end in \.gif"):
        save_animation([sideways], tmp_path / "plan.mp4")
    with pytest.raises(InvalidInput, match="must be writable"):
        save_animation([sideways], tmp_path / "nowhere" / "plan.gif")
