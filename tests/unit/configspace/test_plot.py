import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from configspace import (
    Grid,
    InvalidInput,
    PermissibleSpace,
    build_space,
    catalog,
    dump_space,
    load_vehicle,
    parse_space,
    vehicle_from_data,
)
from configspace.plot import (
    plot_blocked,
    plot_catalog,
    plot_curve,
    plot_map,
    plot_rolling_speed,
    plot_space,
    plot_steering_angle,
    plot_surface,
    save_figure,
)
from configspace.plot_data import blocked_ranges, cell_values
from configspace.plot_facets import surface_polygons

GRID = Grid(80, 120)
NAMES = ("ackermann", "differential", "ift-four-steered", "mecanum")
PLANAR = ("ift-four-steered", "mecanum")
# One of each kind of sketch and picture; the others are drawn in the slow run.
FEW = ("exomars", "husky", "synchro-drive", "two-turntables")
CATALOG = [
    pytest.param(name, marks=() if name in FEW else pytest.mark.slow)
    for name in catalog()
]


@pytest.fixture(scope="module")
def spaces() -> dict[str, PermissibleSpace]:
    return {n: build_space(load_vehicle(n), GRID, cache=False) for n in NAMES}


@pytest.fixture
def four_steered(spaces: dict[str, PermissibleSpace]) -> PermissibleSpace:
    return spaces["ift-four-steered"]


def labels(figure: Any) -> str:
    texts = figure.findobj(lambda artist: hasattr(artist, "get_fontsize"))
    return " ".join(text.get_text() for text in texts)


def zlim(figure: Any) -> tuple[float, float]:
    low, high = figure.axes[0].get_zlim()
    return low, high


def area(polygons: list[np.ndarray]) -> float:
    """Area over the (κ_n, β) plane, by the shoelace formula."""
    total = 0.0
    for corners in polygons:
        x, y = corners[:, 0], corners[:, 1]
        total += abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
    return total


def test_map_shows_what_the_space_answers(four_steered: PermissibleSpace) -> None:
    kappa_n, beta, v_max, mixed = cell_values(four_steered)
    assert v_max.shape == mixed.shape == (kappa_n.size, beta.size)
    for i, j in np.random.default_rng(1).integers(0, v_max.shape, (500, 2)):
        answer = float(four_steered.v_max(kappa_n[i], beta[j]))
        assert np.isnan(v_max[i, j]) == (answer == 0)
        assert answer in (0, v_max[i, j])


def test_mixed_are_the_parts_of_mixed_cells_that_a_sheet_cannot_settle(
    four_steered: PermissibleSpace,
) -> None:
    kappa_n, beta, _, mixed = cell_values(four_steered)
    row = np.searchsorted(four_steered.grid.kappa_edges, kappa_n) - 1
    column = np.searchsorted(four_steered.grid.beta_edges, beta) - 1
    in_mixed_cells = four_steered.tables.state[np.ix_(row, column)] == 2
    assert (in_mixed_cells[mixed]).all()
    assert 0 < mixed.sum() < in_mixed_cells.sum()
    sheet = parse_space(dump_space(four_steered))
    answers = sheet.v_max(kappa_n[:, np.newaxis], beta)
    np.testing.assert_array_equal(mixed, in_mixed_cells & (answers == 0))


def test_map_of_a_sheet_shows_what_the_sheet_permits(
    four_steered: PermissibleSpace,
) -> None:
    sheet = parse_space(dump_space(four_steered))
    kappa_n, beta, v_max, mixed = cell_values(sheet)
    _, _, known, _ = cell_values(four_steered)
    answers = sheet.v_max(kappa_n[:, np.newaxis], beta)
    np.testing.assert_array_equal(np.nan_to_num(v_max), answers)
    assert np.isnan(v_max[mixed]).all()
    assert np.isnan(v_max[np.isnan(known)]).all()
    np.testing.assert_array_equal(v_max[~mixed], known[~mixed])


def test_surface_stays_within_the_permitted_area(
    four_steered: PermissibleSpace,
) -> None:
    permitted, blocked = surface_polygons(four_steered)
    corners = np.concatenate(permitted)
    answers = four_steered.v_max(corners[:, 0], corners[:, 1])
    assert (answers > 0).all()
    # No curtain: no corner hangs below the lowest speed that is permitted.
    assert corners[:, 2].min() >= 0.49
    np.testing.assert_array_equal(corners[:, 2], answers)
    assert (np.concatenate(blocked)[:, 2] == 0).all()


def test_middle_of_a_facet_is_permitted_and_of_the_ground_blocked(
    four_steered: PermissibleSpace,
) -> None:
    for polygons, is_free in zip(
        surface_polygons(four_steered), (True, False), strict=True
    ):
        middles = np.array([polygon.mean(axis=0) for polygon in polygons])
        free = four_steered.v_max(middles[:, 0], middles[:, 1]) > 0
        assert np.mean(free == is_free) > 0.98


@pytest.mark.parametrize("name", PLANAR)
def test_surface_and_ground_fill_the_plane(
    spaces: dict[str, PermissibleSpace], name: str
) -> None:
    permitted, blocked = surface_polygons(spaces[name])
    assert area(permitted) + area(blocked) == pytest.approx(8 * np.pi)
    _, _, v_max, _ = cell_values(spaces[name])
    share = area(blocked) / (8 * np.pi)
    assert share == pytest.approx(np.isnan(v_max).mean(), abs=0.01)


def test_vehicle_without_steering_has_no_ground(
    spaces: dict[str, PermissibleSpace],
) -> None:
    permitted, blocked = surface_polygons(spaces["mecanum"])
    assert not blocked
    assert {len(facet) for facet in permitted} == {4}


def test_blocked_ranges_end_where_the_steering_does(
    spaces: dict[str, PermissibleSpace],
) -> None:
    # Inner front wheel at its stop: radius 0.80 / tan 40° + 0.275 m.
    space = spaces["ackermann"]
    end = 1 / (0.80 / np.tan(np.radians(40)) + 0.275) / space.kappa_g
    np.testing.assert_allclose(blocked_ranges(space), [(-2, -end), (end, 2)], atol=1e-6)
    assert blocked_ranges(spaces["differential"]) == []


def test_backwards_is_drawn_only_where_it_differs(
    spaces: dict[str, PermissibleSpace],
) -> None:
    lines = plot_curve(spaces["ackermann"]).axes[0].lines[:2]
    assert [line.get_label() for line in lines] == ["forwards", "backwards"]
    speeds = [np.nanmax(np.asarray(line.get_ydata(), float)) for line in lines]
    np.testing.assert_allclose(speeds, [1.5, 0.8], rtol=1e-6)
    assert "forwards and backwards" in labels(plot_curve(spaces["differential"]))


def test_direction_is_said_where_it_matters(
    spaces: dict[str, PermissibleSpace],
) -> None:
    slow = load_vehicle("mecanum").model_dump()
    slow["limits"]["max_reverse_speed"] = 0.1
    space = build_space(vehicle_from_data(slow, "slow"), GRID, cache=False)
    assert "mecanum, forwards" in labels(plot_map(space))
    assert "mecanum, backwards" in labels(plot_map(space, reverse=True))
    _, _, v_max, _ = cell_values(space, reverse=True)
    assert v_max[100, 100] == pytest.approx(0.1, rel=0.02)
    assert "forwards" not in labels(plot_map(spaces["mecanum"]))


def test_curve_has_a_gap_where_it_is_blocked(
    spaces: dict[str, PermissibleSpace],
) -> None:
    axes = plot_curve(spaces["ackermann"]).axes[0]
    kappa_n, v_max = np.asarray(axes.lines[0].get_data(), float)
    # The inner front wheel stands at 40 degrees where K goes round 1.228 m.
    edge = 1 / (1.25 * (0.8 / np.tan(np.radians(40)) + 0.275))
    assert np.isnan(v_max[np.abs(kappa_n) > edge]).all()
    assert np.isfinite(v_max[np.abs(kappa_n) < edge * 0.99]).all()
    assert "blocked: steering range\nfront-left" in labels(axes.figure)


def test_axes_carry_symbols_units_and_ticks(four_steered: PermissibleSpace) -> None:
    for figure in (plot_surface(four_steered), plot_map(four_steered)):
        text = labels(figure)
        for wanted in (r"$\kappa_n$ [1]", r"$\beta$ [°]", r"$v_{\max}$ [m/s]"):
            assert wanted in text
        assert "ift-four-steered" in text
        assert r"$\kappa_g$ = 4.1 m$^{-1}$" in text
        np.testing.assert_array_equal(
            figure.axes[0].get_yticks(), [-180, -90, 0, 90, 180]
        )


def test_kind_of_picture_must_fit_the_vehicle(
    spaces: dict[str, PermissibleSpace],
) -> None:
    for plot in (plot_surface, plot_map):
        with pytest.raises(InvalidInput, match="plot_curve"):
            plot(spaces["differential"])
    with pytest.raises(InvalidInput, match="plot_surface"):
        plot_curve(spaces["mecanum"])


@pytest.mark.parametrize("name", NAMES)
def test_overview_is_written_below_the_limit(
    spaces: dict[str, PermissibleSpace], name: str, tmp_path: Path
) -> None:
    save_figure(plot_space(spaces[name]), tmp_path / "space.png")
    content = (tmp_path / "space.png").read_bytes()
    assert content.startswith(b"\x89PNG")
    assert 20_000 < len(content) < 300_000


@pytest.mark.slow
@pytest.mark.parametrize("name", CATALOG)
def test_every_vehicle_of_the_catalogue_draws(name: str, tmp_path: Path) -> None:
    assert_draws(name, tmp_path)


@pytest.mark.parametrize("name", ["ackermann", "heavy-load-24", "synchro-drive"])
def test_vehicles_of_the_catalogue_draw(name: str, tmp_path: Path) -> None:
    assert_draws(name, tmp_path)


def assert_draws(name: str, tmp_path: Path) -> None:
    space = build_space(load_vehicle(name), GRID, cache=False)
    save_figure(plot_space(space), tmp_path / "space.png")
    assert 20_000 < (tmp_path / "space.png").stat().st_size < 300_000


def test_sketch_shows_turntables_and_load() -> None:
    space = build_space(load_vehicle("two-turntables"), GRID, cache=False)
    axes = plot_space(space).axes[-1]
    treads = [patch for patch in axes.patches if type(patch).__name__ == "Rectangle"]
    assert len(treads) == 4
    text = labels(axes.figure)
    for wanted in ("steering axis", "castor", "support polygon", "0.7 m high"):
        assert wanted in text


def test_sketch_shows_wheels_and_effective_track_of_a_skid_steer() -> None:
    space = build_space(load_vehicle("husky"), GRID, cache=False)
    axes = plot_space(space).axes[-1]
    treads = [patch for patch in axes.patches if type(patch).__name__ == "Rectangle"]
    assert [patch.get_linestyle() for patch in treads] == ["solid"] * 4 + ["--"] * 2
    assert "effective track 1.04 m" in labels(axes.figure)


def test_synchro_drive_is_a_curve_over_beta() -> None:
    space = build_space(load_vehicle("synchro-drive"), GRID, cache=False)
    figure = plot_curve(space)
    beta, v_max = np.asarray(figure.axes[0].lines[0].get_data(), float)
    assert (beta.min(), beta.max()) == (-180, 180)
    np.testing.assert_allclose(v_max, 0.6, rtol=1e-6)
    assert r"$\beta$ [°]" in labels(figure)
    assert "turning radius" not in labels(figure)
    for plot in (plot_surface, plot_map, plot_blocked):
        with pytest.raises(InvalidInput, match="plot_curve"):
            plot(space)


def test_blocked_map_marks_the_singular_points(
    four_steered: PermissibleSpace,
) -> None:
    figure = plot_blocked(four_steered)
    assert len(figure.axes[0].lines) == 8
    assert "centre of rotation on a steering axis" in labels(figure)
    assert not plot_blocked(parse_space(dump_space(four_steered))).axes[0].lines


def test_pictures_of_a_wheel_say_which(
    four_steered: PermissibleSpace, tmp_path: Path
) -> None:
    angle = plot_steering_angle(four_steered, "front-right")
    speed = plot_rolling_speed(four_steered, 3)
    assert "steering angle of wheel 2 (front-right)" in labels(angle)
    assert r"$\alpha_{2}$ [°]" in labels(angle)
    assert "rolling speed of wheel 4 (rear-right), at $v_s$ = 1 m/s" in labels(speed)
    assert r"$u_{4}$ [m/s]" in labels(speed)
    assert zlim(speed)[1] > 2
    for figure in (angle, speed):
        save_figure(figure, tmp_path / "wheel.png")


def test_wheel_that_rolls_backwards_is_drawn_below_the_ground(
    spaces: dict[str, PermissibleSpace], tmp_path: Path
) -> None:
    figure = plot_rolling_speed(spaces["mecanum"], 0)
    low, high = zlim(figure)
    assert low < -1 < 1 < high
    save_figure(figure, tmp_path / "wheel.png")


def test_pictures_of_a_wheel_need_the_vehicle(four_steered: PermissibleSpace) -> None:
    sheet = parse_space(dump_space(four_steered))
    for plot in (plot_steering_angle, plot_rolling_speed):
        with pytest.raises(InvalidInput, match="data sheet"):
            plot(sheet, 0)
        with pytest.raises(InvalidInput, match="one of front-left"):
            plot(four_steered, "nobody")


def test_overview_of_many_names_all(
    spaces: dict[str, PermissibleSpace], tmp_path: Path
) -> None:
    figure = plot_catalog(list(spaces.values()), columns=3)
    assert all(name in labels(figure) for name in NAMES)
    assert "ift-four-steered\n1 m/s" in labels(figure)
    save_figure(figure, tmp_path / "catalog.png")


def test_overview_of_a_sheet_needs_no_vehicle(
    four_steered: PermissibleSpace, tmp_path: Path
) -> None:
    sheet = parse_space(dump_space(four_steered))
    assert sheet.vehicle is None
    with_wheels, without = plot_space(four_steered), plot_space(sheet)
    assert len(without.axes[-1].patches) < len(with_wheels.axes[-1].patches)
    save_figure(without, tmp_path / "sheet.png")


def test_name_with_dollar_signs_is_no_formula(
    spaces: dict[str, PermissibleSpace], tmp_path: Path
) -> None:
    space = spaces["differential"]
    odd = replace(space, header=replace(space.header, name=r"$5_ $\frac{"))
    save_figure(plot_curve(odd), tmp_path / "curve.png")


def test_svg_is_the_same_every_time(
    spaces: dict[str, PermissibleSpace], tmp_path: Path
) -> None:
    for name in ("first.svg", "second.svg"):
        save_figure(plot_curve(spaces["ackermann"]), tmp_path / name)
    first = (tmp_path / "first.svg").read_text(encoding="utf-8")
    assert "<svg" in first
    assert first == (tmp_path / "second.svg").read_text(encoding="utf-8")


def test_other_suffixes_and_missing_folders_are_refused(
    spaces: dict[str, PermissibleSpace], tmp_path: Path
) -> None:
    figure = plot_curve(spaces["differential"])
    with pytest.raises(InvalidInput, match=r"must end in \.png or \.svg"):
        save_figure(figure, tmp_path / "curve.pdf")
    with pytest.raises(InvalidInput, match="No such file"):
        save_figure(figure, tmp_path / "missing" / "curve.png")


def test_matplotlib_is_imported_only_when_used() -> None:
    code = "import sys, configspace; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
