import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from configspace import InvalidInput
from configspace.plot import save_figure
from omniplan.choosing.shortfalls import Shortfall, Unfit
from omniplan.plots.pictures import (
    cusps,
    outlines_along,
    plot_manoeuvres,
    plot_trajectory,
    plot_verdicts,
)
from omniplan.plots.verdicts import verdict_text, verdicts
from omniplan.report import Candidate, Ranking, Report, Violation
from omniplan.trajectory import Trajectory

FOOTPRINT = ((0.35, 0.2), (-0.35, 0.2), (-0.35, -0.2), (0.35, -0.2))


def parallel_parking() -> Trajectory:
    """Forward past the gap, then backwards into it along two arcs."""
    forward = [(x, 0.0, 0.0) for x in np.linspace(0, 1.5, 16)]
    radius, angle = 0.8, np.linspace(0, 0.9, 10)[1:]
    first = [
        (1.5 - radius * math.sin(a), -radius * (1 - math.cos(a)), a) for a in angle
    ]
    x, y, end = first[-1]
    second = [
        (
            x - radius * (math.sin(end) - math.sin(a)),
            y - radius * (math.cos(a) - math.cos(end)),
            a,
        )
        for a in angle[::-1][1:]
    ]
    last = (second[-1][0] - 0.1, second[-1][1], 0.0)
    poses = np.array([*forward, *first, *second, last])
    return Trajectory.from_poses(
        np.linspace(0, 8, len(poses)), poses, name="parallel-parking"
    )


def turn_on_the_spot() -> Trajectory:
    theta = np.linspace(0, math.pi, 13)
    poses = np.stack([np.ones(13), np.full(13, 2.0), theta], axis=-1)
    return Trajectory.from_poses(np.linspace(0, 4, 13), poses, name="turn-on-the-spot")


def crab_corner() -> Trajectory:
    """Round a right-angled corner without turning the vehicle."""
    side = np.linspace(0, 1.2, 9)
    poses = [(x, 0.0, 0.0) for x in side] + [(1.2, y, 0.0) for y in side[1:]]
    return Trajectory.from_poses(np.arange(17.0), poses, name="crab-corner")


def report(vehicle: str, violations: tuple[Violation, ...] = ()) -> Report:
    return Report(
        vehicle=vehicle,
        trajectory="",
        valid=not violations,
        violations=violations,
        margin=-0.5 if violations else 0.3,
        tightest="WHEEL_SPEED",
        duration=8.0,
        speed_factor=0.0 if violations else 1.25,
        fastest_duration=None if violations else 6.4,
        top_speed=0.5,
        top_yaw_rate=0.3,
        advice=(),
        interpolation="",
        not_judged=(),
    )


def violation(limit: str, wheel: str | None, t_start: float) -> Violation:
    return Violation(
        limit=limit,
        wheel=wheel,
        value=2.0,
        bound=1.0,
        unit="rad",
        index=0,
        t=t_start,
        t_start=t_start,
        t_end=t_start + 1,
        kappa_n=0.0,
        beta=0.0,
        pose=None,
        is_proved=True,
    )


@pytest.fixture
def rankings() -> list[Ranking]:
    out_of_range = violation("STEER_RANGE", "front-left", 1.0)
    sideways = violation("FIXED_WHEEL", "left", 0.5)
    four, mecanum = report("ift-four-steered"), report("mecanum")
    return [
        Ranking(
            "parallel-parking",
            "duration",
            (
                Candidate("mecanum", 6.0, mecanum),
                Candidate("ift-four-steered", 7, four),
            ),
            (report("ackermann", (out_of_range,)), report("differential", (sideways,))),
        ),
        Ranking(
            "turn-on-the-spot",
            "duration",
            (Candidate("differential", 3.0, replace(four, vehicle="differential")),),
            (report("ackermann", (out_of_range, violation("SINGULAR", None, 0.1))),),
        ),
        Ranking(
            "crab-corner",
            "duration",
            (Candidate("mecanum", 6.0, mecanum),),
            (
                report("ift-four-steered", (violation("RECONFIGURATION", "w", 0.0),)),
                report("ackermann", (sideways,)),
                report("differential", (sideways,)),
            ),
        ),
    ]


def texts(figure: Any) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_outline_turns_about_the_reference_point() -> None:
    trajectory = Trajectory.from_poses(
        [0, 1], np.array([[1, 2, 0], [1, 2, math.pi / 2]]), reference_point=(0.35, 0.0)
    )
    outlines = outlines_along(trajectory, FOOTPRINT)
    assert outlines.shape == (2, 4, 2)
    # The front edge goes through the reference point.
    np.testing.assert_allclose(outlines[0, 0], [1.0, 2.2])
    np.testing.assert_allclose(outlines[1, 0], [0.8, 2.0])
    np.testing.assert_allclose(outlines[1, 2], [1.2, 1.3])


def test_reversal_and_corner_are_cusps() -> None:
    np.testing.assert_array_equal(cusps(parallel_parking()), [15])
    np.testing.assert_array_equal(cusps(crab_corner()), [8])


def test_smooth_path_and_turn_on_the_spot_have_no_cusp() -> None:
    a = np.linspace(0, 2 * math.pi, 12)
    circle = Trajectory.from_poses(a, np.stack([np.sin(a), -np.cos(a), a], axis=-1))
    assert cusps(circle).size == 0
    assert cusps(turn_on_the_spot()).size == 0


def test_standstill_does_not_hide_a_cusp() -> None:
    x = [0, 1, 2, 2, 2, 1]
    poses = [[v, 0, 0] for v in x]
    np.testing.assert_array_equal(cusps(Trajectory.from_poses(range(6), poses)), [4])


@pytest.mark.parametrize("make", [parallel_parking, turn_on_the_spot, crab_corner])
@pytest.mark.parametrize("footprint", [FOOTPRINT, None])
def test_trajectory_picture_is_written(
    make: Callable[[], Trajectory],
    footprint: tuple[tuple[float, float], ...] | None,
    tmp_path: Path,
) -> None:
    trajectory = make()
    figure = plot_trajectory(trajectory, footprint=footprint)
    save_figure(figure, tmp_path / "picture.png")
    assert 10_000 < (tmp_path / "picture.png").stat().st_size < 300_000
    assert trajectory.name in figure.axes[0].get_title()
    assert figure.axes[0].get_aspect() == 1.0


def test_all_of_the_vehicle_is_in_the_picture() -> None:
    axes = plot_trajectory(turn_on_the_spot(), footprint=FOOTPRINT).axes[0]
    x_low, x_high = axes.get_xlim()
    assert x_low < 0.65
    assert x_high > 1.35


def test_only_poses_are_drawn() -> None:
    twists = Trajectory.from_twists([0, 1], [[1, 0, 0], [1, 0, 0]])
    with pytest.raises(InvalidInput, match="form twists"):
        plot_trajectory(twists)
    with pytest.raises(InvalidInput, match="form twists"):
        plot_manoeuvres([twists], [None])


def test_manoeuvres_stand_in_a_grid_with_their_names(tmp_path: Path) -> None:
    manoeuvres = [parallel_parking(), turn_on_the_spot(), crab_corner()]
    figure = plot_manoeuvres(manoeuvres, [FOOTPRINT, FOOTPRINT, None])
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["parallel-parking", "turn-on-the-spot", "crab-corner"]
    save_figure(figure, tmp_path / "picture.svg")
    assert "<svg" in (tmp_path / "picture.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize("n_footprints", [0, 2])
def test_every_manoeuvre_needs_its_footprint(n_footprints: int) -> None:
    with pytest.raises(InvalidInput, match="footprints"):
        plot_manoeuvres([crab_corner()], [None] * n_footprints)


def test_no_manoeuvre_is_an_error() -> None:
    with pytest.raises(InvalidInput, match="at least one"):
        plot_manoeuvres([], [])


def test_verdict_text_names_duration_or_first_violation() -> None:
    assert verdict_text(report("a")) == "6.40 s"
    late, early = (
        violation("WHEEL_SPEED", None, 2.0),
        violation("STEER_RATE", "w1", 1.0),
    )
    assert verdict_text(report("a", (late, early))) == "steering rate\nw1"
    assert verdict_text(report("a", (late,))) == "wheel speed\nvehicle"


def test_refusal_without_a_violation_is_said_all_the_same() -> None:
    assert verdict_text(replace(report("a"), valid=False)) == "refused"


def test_verdicts_has_a_cell_for_every_report(rankings: list[Ranking]) -> None:
    cells = verdicts(rankings)
    assert len(cells) == 4 + 2 + 4
    refused = cells["ackermann", 1]
    assert isinstance(refused, Report)
    assert refused.violations[1].limit == "SINGULAR"
    assert ("mecanum", 1) not in cells


def test_verdict_picture_shows_every_cell(
    rankings: list[Ranking], tmp_path: Path
) -> None:
    figure = plot_verdicts(rankings)
    shown = texts(figure)
    assert len(shown) == 4 * 3
    assert shown.count("not asked") == 2
    assert shown.count("6.40 s") == 4
    assert "steering range\nfront-left" in shown
    vehicles = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert vehicles == ["ackermann", "differential", "ift-four-steered", "mecanum"]
    save_figure(figure, tmp_path / "picture.png")
    assert 10_000 < (tmp_path / "picture.png").stat().st_size < 300_000


def test_names_are_text_even_if_they_look_like_formulas(tmp_path: Path) -> None:
    trajectory = replace(crab_corner(), name=r"costs $5^ or $\frac{")
    bad = report("$x_{", (violation("STEER_RANGE", "$w^$" * 10, 0.0),))
    ranking = Ranking("long $x^ " * 9, "duration", (), (bad,))
    for figure in (
        plot_trajectory(trajectory),
        plot_manoeuvres([trajectory], [None]),
        plot_verdicts([ranking]),
    ):
        save_figure(figure, tmp_path / "picture.png")


def test_verdicts_of_nobody_are_an_error() -> None:
    with pytest.raises(InvalidInput, match="no vehicle"):
        plot_verdicts([])


def test_who_is_unfit_has_a_cell_with_the_requirement(
    rankings: list[Ranking],
) -> None:
    short = Shortfall("crab 90 deg", "to the left", 0.0, 0.0, "m/s", "SINGULAR", None)
    unfit = Unfit("tricycle", (short,))
    assert verdict_text(unfit) == "unfit:\ncrab 90 deg"
    figure = plot_verdicts([replace(rankings[0], unfit=(unfit,))])
    assert "unfit:\ncrab 90 deg" in texts(figure)
