"""What the pictures of a verdict show; not how they look."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import configspace
from configspace import InvalidInput, PermissibleSpace
from omniplan import Trajectory, plot_report, read_trajectories, validate
from omniplan.plots.data import drive_of, marks_of, telling_wheels
from omniplan.plots.map import joined
from omniplan.plots.path import wheel_corners
from omniplan.plots.pictures import plot_on_space, plot_times, plot_way
from omniplan.plots.style import BROKEN, MARGINS

SpaceOf = Callable[[str], PermissibleSpace]
MANOEUVRES = Path(__file__).parents[3] / "examples" / "manoeuvres"


def manoeuvre(name: str) -> Trajectory:
    (found,) = read_trajectories(MANOEUVRES / f"{name}.csv")
    assert isinstance(found, Trajectory)
    return found


def texts(figure: Any) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def below(figure: Any) -> str:
    """Return what stands under a figure."""
    titles = [legend.get_title().get_text() for legend in figure.legends]
    label = figure._supxlabel.get_text() if figure._supxlabel is not None else ""
    return "\n".join([*titles, label])


def circle(radius: float, speed: float) -> Trajectory:
    t = [0.0, 2 * math.pi * radius / speed]
    return Trajectory.from_twists(t, [[speed, 0.0, speed / radius]] * 2, name="circle")


def test_twists_are_drawn_as_the_way_they_lead(space_of: SpaceOf) -> None:
    drive = drive_of(circle(2.0, 0.4), space_of("ift-four-steered"))
    centre = drive.poses[:, :2] - [0.0, 2.0]
    np.testing.assert_allclose(np.hypot(*centre.T), 2.0, atol=1e-9)
    assert drive.poses[-1] == pytest.approx([0, 0, 2 * math.pi], abs=1e-9)
    assert drive.t.size >= 600


def test_poses_are_those_of_the_frame_of_the_vehicle(space_of: SpaceOf) -> None:
    turn = np.linspace(0, math.pi / 2, 10)
    poses = np.stack([np.full(10, 3.0), np.zeros(10), turn], axis=-1)
    about_front = Trajectory.from_poses(
        np.arange(10), poses, reference_point=(0.5, 0.0)
    )
    drive = drive_of(about_front, space_of("mecanum"))
    assert drive.poses[0] == pytest.approx([2.5, 0, 0])
    assert drive.poses[-1] == pytest.approx([3.0, -0.5, math.pi / 2])


def test_wheel_states_are_those_of_the_single_track_formula(space_of: SpaceOf) -> None:
    space = space_of("ackermann")
    drive = drive_of(circle(2.0, 0.4), space)
    left = space.header.wheel_ids.index("front-left")
    expected = math.atan2(0.8, 2.0 - 0.275)
    np.testing.assert_allclose(drive.alpha[:, left], expected, atol=1e-9)
    speed = 0.4 / 2.0 * math.hypot(0.8, 2.0 - 0.275)
    np.testing.assert_allclose(drive.u[:, left], speed, atol=1e-9)
    rear = space.header.wheel_ids.index("rear-left")
    assert np.isnan(drive.alpha[:, rear]).all()


def test_steering_angles_are_unwrapped_and_joined_at_rest(space_of: SpaceOf) -> None:
    # The direction of travel turns through ±180°; free wheels follow it.
    t = np.linspace(0, 10, 101)
    way = 0.3 * np.exp(0.5j * t)
    twists = np.stack([way.real, way.imag, 0 * t], axis=-1)
    drive = drive_of(Trajectory.from_twists(t, twists), space_of("mpo-700"))
    free = np.flatnonzero(np.isfinite(drive.alpha).all(axis=0))
    assert free.size
    for i in free:
        followed = drive.alpha[:, i] - drive.alpha[0, i]
        np.testing.assert_allclose(followed, 0.5 * drive.t, atol=2e-3)
    stops = drive_of(manoeuvre("forward-stop-sideways"), space_of("ift-four-steered"))
    first, last = np.flatnonzero(np.isfinite(stops.alpha[:, 0]))[[0, -1]]
    assert np.isfinite(stops.alpha[first : last + 1]).all()
    turned = stops.alpha[last, 0] - stops.alpha[first, 0]
    assert abs(math.degrees(turned)) == pytest.approx(90, abs=1)


@pytest.mark.parametrize(
    ("vehicle", "name"),
    [
        ("mecanum", "parking-sideways"),
        ("ackermann", "parking-ackermann"),
        ("ift-four-steered", "turn-on-the-spot"),
        ("synchro-drive", "crab-corner"),
    ],
)
def test_three_pictures_are_written(
    space_of: SpaceOf, tmp_path: Path, vehicle: str, name: str
) -> None:
    trajectory, space = manoeuvre(name), space_of(vehicle)
    report = validate(trajectory, space)
    paths = plot_report(report, trajectory, space, tmp_path / "new")
    stem = f"{name}-{vehicle}"
    assert [path.name for path in paths] == [
        f"{stem}-{kind}.png" for kind in ("way", "space", "times")
    ]
    for path in paths:
        assert 10_000 < path.stat().st_size < 300_000


def test_violations_are_numbered_alike_in_all_pictures(space_of: SpaceOf) -> None:
    trajectory, space = manoeuvre("parking-sideways"), space_of("four-wheel-steering")
    report = validate(trajectory, space)
    way, mark = marks_of(report)
    assert (way.number, way.violation.limit) == (1, "RECONFIGURATION")
    assert way.text == "reconfiguration of front-left at t = 3.00 s"
    assert (mark.number, mark.violation.limit) == (2, "STEER_RANGE")
    assert "steering range of front-left: -90.0°, permitted -40.0°" in mark.text
    assert "(and 3 more)" in mark.text
    drive = drive_of(trajectory, space)
    for figure in (
        plot_way(drive, report, trajectory),
        plot_on_space(drive, report),
        plot_times(drive, report),
    ):
        assert {"1", "2"} <= set(texts(figure))
        assert f"(1)  {way.text}\n(2)  {mark.text}" in below(figure)
        assert "not permitted" in figure.get_suptitle()


def test_every_axis_has_its_unit(space_of: SpaceOf) -> None:
    trajectory, space = manoeuvre("parking-ackermann"), space_of("ackermann")
    report, drive = validate(trajectory, space), drive_of(trajectory, space)
    times = plot_times(drive, report)
    assert [axes.get_ylabel() for axes in times.axes] == [
        "speed of K\n[m/s]",
        "yaw rate ω\n[°/s]",
        "rolling speed\n[m/s]",
        "steering angle α\n[°]",
        "margin\n[%]",
    ]
    assert times.axes[-1].get_xlabel() == "t [s]"
    way = plot_way(drive, report, trajectory).axes[0]
    assert (way.get_xlabel(), way.get_ylabel()) == ("x [m]", "y [m]")
    assert way.get_aspect() == 1.0


def test_a_data_sheet_alone_has_no_wheels_to_draw(
    space_of: SpaceOf, tmp_path: Path
) -> None:
    space = space_of("ift-four-steered")
    sheet = configspace.parse_space(configspace.dump_space(space))
    trajectory = manoeuvre("docking")
    report = validate(trajectory, sheet)
    assert len(plot_times(drive_of(trajectory, sheet), report).axes) == 3
    assert len(plot_report(report, trajectory, sheet, tmp_path)) == 3


def test_many_wheels_are_a_band_and_the_telling_ones(space_of: SpaceOf) -> None:
    space = space_of("heavy-load-24")
    trajectory = circle(8.0, 1.3)
    report, drive = validate(trajectory, space), drive_of(trajectory, space)
    assert not report.valid
    chosen = telling_wheels(drive, report, 4)
    assert len(chosen) == 4
    worst = max(report.violations, key=lambda v: v.excess)
    assert space.header.wheel_ids.index(worst.wheel or "") in chosen
    figure = plot_times(drive, report)
    rolling = figure.axes[2]
    legend = rolling.get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels[0] == "all 24 wheels"
    assert len(rolling.lines) <= 4 + 2 + len(marks_of(report))


def test_names_that_are_no_file_names_are_mended(
    space_of: SpaceOf, tmp_path: Path
) -> None:
    space = space_of("differential")
    odd = Trajectory.from_twists([0, 1], [[0.3, 0, 0]] * 2, name="../a $x^ b")
    paths = plot_report(validate(odd, space), odd, space, tmp_path)
    assert {path.parent for path in paths} == {tmp_path}
    assert paths[0].name == ".._a_x_b-differential-way.png"
    taken = tmp_path / "file"
    taken.write_text("")
    with pytest.raises(InvalidInput, match="folder"):
        plot_report(validate(odd, space), odd, space, taken)


def test_lines_are_cut_at_the_seam_and_through_a_pole() -> None:
    x, y = joined(np.array([0.0, 0.2, 0.4]), np.array([170.0, 178.0, -178.0]))
    np.testing.assert_allclose(x, [0.0, 0.2, 0.3, np.nan, 0.3, 0.4])
    np.testing.assert_allclose(y, [170, 178, 180, np.nan, -180, -178])
    x, y = joined(np.array([1.98, 1.98]), np.array([10.0, -170.0]))
    np.testing.assert_allclose(y, [10, np.nan, -170])
    x, y = joined(np.array([0.0, 1.0]), np.array([0.0, 40.0]))
    np.testing.assert_allclose(y, [0, 40])


def test_wheels_are_drawn_as_they_are_steered(space_of: SpaceOf) -> None:
    vehicle = space_of("ift-four-steered").vehicle
    assert vehicle is not None
    corners = wheel_corners(vehicle, np.full(4, math.pi / 2), 0.1)
    first = corners[0] - vehicle.wheels[0].position
    np.testing.assert_allclose(np.abs(first.imag), 0.05)
    np.testing.assert_allclose(np.abs(first.real), 0.02)


def test_what_is_broken_is_darker_than_any_margin() -> None:
    shares = [0.299, 0.587, 0.114]
    broken = np.dot([int(BROKEN[i : i + 2], 16) / 255 for i in (1, 3, 5)], shares)
    assert broken < (MARGINS(np.linspace(0, 1, 64))[:, :3] @ shares).min() - 0.05
