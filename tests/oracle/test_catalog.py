"""The catalogue against numbers worked out from its sources."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

import configspace
from configspace import Grid, PermissibleSpace
from configspace.vehicle import SteeredWheel, Turntable, Vehicle

NUMBERS: dict[str, dict[str, Any]] = tomllib.loads(
    (Path(__file__).parent / "catalog_numbers.toml").read_text("utf-8")
)
PAGE = (Path(__file__).parents[2] / "docs" / "vehicles.md").read_text("utf-8")
NAMES = configspace.catalog()
each_vehicle = pytest.mark.parametrize("name", NAMES)
load = cache(configspace.load_vehicle)


@cache
def small_space(name: str) -> PermissibleSpace:
    return configspace.build_space(load(name), grid=Grid(40, 72), cache=False)


def natural_motion(name: str) -> tuple[float, float]:
    kappa_n, beta_deg = NUMBERS[name].get("motion", (0.0, 0.0))
    return kappa_n, np.radians(beta_deg)


def mobility(vehicle: Vehicle) -> str:
    if vehicle.mobility.is_translating:
        return "translation"
    return "plane" if vehicle.mobility.line_beta is None else "line"


def test_numbers_are_given_for_every_vehicle() -> None:
    assert sorted(NUMBERS) == list(NAMES)
    assert len(NAMES) >= 32


@each_vehicle
def test_the_file_is_named_like_its_vehicle_and_says_its_source(name: str) -> None:
    vehicle = load(name)
    assert vehicle.name == name
    assert vehicle.description
    assert len(vehicle.source) > 60
    assert len(vehicle.footprint) >= 4


@each_vehicle
def test_wheels_and_mobility_are_those_of_the_undercarriage(name: str) -> None:
    vehicle, expected = load(name), NUMBERS[name]
    assert len(vehicle.wheels) == expected["wheels"]
    assert mobility(vehicle) == expected["mobility"]
    if expected["mobility"] == "line":
        assert vehicle.mobility.line_beta == 0


@each_vehicle
def test_the_boundary_curvature_is_right_to_the_printed_digits(name: str) -> None:
    printed: str = NUMBERS[name]["kappa_g"]
    half = 0.5000001 * 10 ** -len(printed.partition(".")[2])
    assert load(name).boundary_curvature == pytest.approx(float(printed), abs=half)


@each_vehicle
def test_the_natural_motion_is_permitted_at_its_key_speed(name: str) -> None:
    kappa_n, beta = natural_motion(name)
    exact = float(configspace.exact_v_max(load(name), kappa_n, beta))
    assert exact == pytest.approx(NUMBERS[name]["v"], rel=1e-5)
    table = float(small_space(name).v_max(kappa_n, beta))
    # The table of a coarse grid may be cautious, never bold.
    assert 0.95 * exact < table <= exact * (1 + 1e-6)


@each_vehicle
def test_the_wheels_stand_on_the_footprint(name: str) -> None:
    vehicle = load(name)
    corners = np.array([complex(x, y) for x, y in vehicle.footprint])
    edges = np.roll(corners, -1) - corners
    for wheel in vehicle.wheels:
        offsets = wheel.offsets if isinstance(wheel, SteeredWheel | Turntable) else (0,)
        for offset in offsets:
            contact = wheel.position + 1j * offset
            aside = (np.conj(edges) * (contact - corners)).imag
            assert (aside >= 0).all(), wheel.id


# --- key numbers of single vehicles -------------------------------------------


def wheels_of(name: str) -> Iterator[SteeredWheel]:
    for wheel in load(name).wheels:
        if isinstance(wheel, SteeredWheel):
            yield wheel


@pytest.mark.parametrize(
    ("name", "rad_s", "radius"),
    [
        ("care-o-bot-3", 3000 / 60 * 2 * np.pi / 30, 0.075),
        ("care-o-bot-4", 19.95, 0.0782),
        ("mpo-700", 20.5, 0.090),
        ("rox-argo", 4540 / 60 * 2 * np.pi / 11.88, 0.050),
        ("rover-mirrored-stops", 5, 0.085),
        ("robotis-ffw", 50, 0.033),
        ("choreo-frc-swerve", 6000 / 60 * 2 * np.pi / 6.5, 0.0508),
    ],
)
def test_drive_speeds_follow_from_motor_gear_and_radius(
    name: str, rad_s: float, radius: float
) -> None:
    for wheel in wheels_of(name):
        assert wheel.max_speed == pytest.approx(rad_s * radius, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "rad_s"),
    [
        ("care-o-bot-3", 24.0),
        ("care-o-bot-4", 10.0),
        ("mpo-700", 8.0),
        ("raw3-long", 12.0),
        ("robotis-ffw", 1.0),
        ("romea-4ws", 1.0),
        ("ford-escort", 0.4),
        ("truck", 0.7103),
    ],
)
def test_steering_rates_are_those_of_the_source_and_never_more(
    name: str, rad_s: float
) -> None:
    for wheel in wheels_of(name):
        rate = wheel.max_steering_rate_deg
        assert rate is not None
        assert 0.999 * rad_s < np.radians(rate) <= rad_s


def test_offsets_stand_on_the_sides_their_sources_say() -> None:
    assert [w.offset for w in wheels_of("mpo-700")] == [0.045] * 4
    assert [w.offset for w in wheels_of("care-o-bot-3")] == [0.022] * 4
    # Left wheels have D > 0, right ones D < 0 (Zehnter, table 6.1).
    for name in ("exomars", "romea-4ws"):
        assert all(w.offset * w.y > 0 for w in wheels_of(name))


@pytest.mark.parametrize("name", ["ford-escort", "bmw-320i", "vw-vanagon", "truck"])
def test_ranges_of_front_wheels_meet_at_the_single_track_angle(name: str) -> None:
    angle = {"ford-escort": 0.91, "bmw-320i": 1.066, "vw-vanagon": 1.023, "truck": 0.55}
    radius = 1 / load(name).boundary_curvature / np.tan(angle[name])
    left, right = wheels_of(name)
    expected = [np.arctan2(w.x, radius - w.y) for w in (left, right)]
    found = [left.steering_range[1], right.steering_range[1]]
    np.testing.assert_allclose(found, expected, atol=2e-4)
    np.testing.assert_allclose(
        [-right.steering_range[0], -left.steering_range[0]], found, atol=1e-9
    )


def test_some_ranges_of_robotis_do_not_contain_straight_ahead() -> None:
    ranges = [w.steering_range for w in wheels_of("robotis-ffw")]
    assert [low <= 0 <= high for low, high in ranges] == [False, True, False, True]
    assert float(configspace.exact_v_max(load("robotis-ffw"), 0.0, 0.0)) == 0
    turned = [w.steering_range for w in wheels_of("robotis-ffw-reversed")]
    for (low, high), (low_turned, high_turned) in zip(ranges, turned, strict=True):
        half_turns = (low - low_turned) / np.pi
        assert round(half_turns) == pytest.approx(half_turns)
        assert high - low == pytest.approx(high_turned - low_turned)


def test_the_three_wheeled_example_has_further_maxima_near_1_8() -> None:
    vehicle = load("ift-three-steered")
    kappa_n, beta = np.linspace(1.05, 1.97, 185), np.radians(np.arange(-180, 180))
    v_max = configspace.exact_v_max(vehicle, kappa_n[:, None], beta[None, :])
    row, column = np.unravel_index(v_max.argmax(), v_max.shape)
    assert kappa_n[row] == pytest.approx(1.8, abs=0.05)
    assert v_max[row, column] > 1.2
    # β is about 90° off the bearing of the offset wheel, on the far side (figure 13).
    bearing = np.angle(vehicle.wheels[0].position)
    assert np.degrees(bearing - beta[column]) == pytest.approx(90, abs=15)
    assert v_max[row, column] == ndimage.maximum_filter(v_max, 9)[row, column]
    # The symmetric example has none there.
    four = load("ift-four-steered")
    assert (configspace.exact_v_max(four, 1.8, beta) < 1).all()


# --- what the files must keep saying -------------------------------------------


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mpo-700", "y = 0.18 instead of 0.19"),
        ("mpo-700", "side of the lever arm"),
        ("care-o-bot-3", "r = 0.15 m"),
        ("care-o-bot-3", "side of the offset"),
        ("rox-argo", "c = 1, hence steering_coupling 0.05, is assumed"),
        ("rox-argo", "(+-0.367, +-0.274)"),
        ("robotis-ffw", "0.125, 0.125, -0.125, -0.125"),
        ("romea-4ws", "not verified"),
        ("ridgeback", "3.81 times"),
        ("dingo-o", "3.45 times"),
        ("lru", "27.0 kg"),
        ("exomars", "d3 = 0.10 m is assumed"),
        ("msl", "kappa_n may change at v_n = 0 only"),
        ("ift-three-steered", "paper gives no dimensions"),
        ("ford-escort", "not h_s = 0.594 m"),
        ("double-ackermann", "passive fixed wheel at K"),
    ],
)
def test_known_doubts_about_sources_are_told(name: str, words: str) -> None:
    assert words in load(name).source


@pytest.mark.parametrize(
    ("has", "least"),
    [
        (lambda v: v.load is not None, 4),
        (lambda v: v.guaranteed is not None, 3),
        (lambda v: v.limits.max_lateral_acceleration is not None, 5),
        (lambda v: v.skid_steer is not None, 3),
        (lambda v: any(getattr(w, "offset", 0) < 0 for w in v.wheels), 3),
        (lambda v: any(getattr(w, "steering_coupling", 0) for w in v.wheels), 3),
        (lambda v: any(isinstance(w, Turntable) for w in v.wheels), 1),
        (lambda v: v.synchro, 1),
    ],
    ids=["load", "guaranteed", "lateral", "skid", "offset", "coupling", "table", "syn"],
)
def test_every_feature_of_vehicle_files_is_shown(
    has: Callable[[Vehicle], bool], least: int
) -> None:
    assert sum(has(load(name)) for name in NAMES) >= least


# --- docs/vehicles.md -------------------------------------------------------------


def test_the_page_lists_the_catalogue_as_it_is() -> None:
    rows = re.findall(
        r"^\| `([^`]+)` \| [^|]+ \| (\d+) \| (\w+) \| ([\d.]+) \| ([^|]+) \|",
        PAGE,
        re.MULTILINE,
    )
    found = [
        (name, int(count), mobile, kappa_g) for name, count, mobile, kappa_g, _ in rows
    ]
    assert found == [
        (
            name,
            len(load(name).wheels),
            mobility(load(name)),
            f"{load(name).boundary_curvature:.4f}",
        )
        for name in NAMES
    ]
    assert f"{len(NAMES)} ready vehicles" in PAGE


@each_vehicle
def test_speeds_on_the_page_stand_in_the_file(name: str) -> None:
    (speeds,) = re.findall(rf"^\| `{name}` \|(?:[^|]+\|){{4}} ([^|]+) \|", PAGE, re.M)
    vehicle = load(name)
    given = {vehicle.limits.max_speed, vehicle.limits.max_reverse_speed}
    given |= {vehicle.limits.max_yaw_rate_deg, round(NUMBERS[name]["v"], 2)}
    for wheel in vehicle.wheels:
        given |= {getattr(wheel, key, None) for key in ("max_speed",)}
        given |= {getattr(wheel, "max_steering_rate_deg", None)}
    for number in re.findall(r"\d+(?:\.\d+)?", speeds):
        assert float(number) in given
