import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
import pytest

import configspace
import omniplan
from configspace import Grid, InvalidInput, PermissibleSpace, build_space
from configspace.grid import edges_of
from configspace.testing import ALL_KINDS, random_vehicle
from omniplan import Tolerances, Trajectory, validate_many
from omniplan.batch.files import write_verdicts
from omniplan.batch.fleet import fleet_of, is_plain
from omniplan.batch.many import SCHEMA, Batch
from omniplan.batch.motions import FIELDS, motions_of
from omniplan.bench_cases import random_trajectories, random_vehicles
from omniplan.cli import main
from omniplan.demo import manoeuvres
from omniplan.judging.vehicle_judge import VehicleJudge
from omniplan.motion import Intervals, motion_of
from omniplan.validation import judged

GRID = Grid(40, 72)
NAMES = (
    "mecanum",
    "robotino",
    "differential",
    "ackermann",
    "tricycle",
    "raw3-short",
    "one-steered-castors",
    "rover-mirrored-stops",
    "synchro-drive",
    "bmw-320i",
)


def space_of(name: str) -> PermissibleSpace:
    return build_space(configspace.load_vehicle(name), GRID, cache=False)


def random_twists(rng: np.random.Generator, name: str, *, rest: bool) -> Trajectory:
    """Smooth twists, from rest to rest or in full motion."""
    t = np.linspace(0, rng.uniform(4, 12), 40)
    share = t[:, None] / t[-1]
    size = rng.uniform(0.05, 0.6, 3) * rng.choice([0, 1, 1], 3)
    wave = np.sin(share * rng.uniform(1, 5, 3) + rng.uniform(0, 6, 3))
    envelope = np.sin(np.pi * share) ** 2 if rest else 1.0
    point = tuple(rng.uniform(-0.3, 0.3, 2)) if rng.random() < 0.5 else (0.0, 0.0)
    return Trajectory.from_twists(
        t, envelope * wave * size + 1e-3 * (not rest), name=name, reference_point=point
    )


def some_trajectories(seed: int, count: int) -> list[Trajectory]:
    rng = np.random.default_rng(seed)
    twists = [random_twists(rng, f"twists-{i}", rest=i % 3 > 0) for i in range(count)]
    return [*twists, *random_trajectories(rng, count, samples=40)]


def assert_alike(
    trajectories: Sequence[Trajectory],
    spaces: Sequence[PermissibleSpace],
    tolerances: Tolerances | None = None,
) -> dict[str, float]:
    """Assert that a batch says what `validate` says of every pair; return shares."""
    tolerances = tolerances or Tolerances()
    table = validate_many(trajectories, spaces, tolerances)
    rows = table.to_pylist()
    pairs = [(t, s) for t in trajectories for s in spaces]
    assert len(rows) == len(pairs)
    told_alike, refused = 0, 0
    for row, (trajectory, space) in zip(rows, pairs, strict=True):
        report = judged(trajectory, space, tolerances, False)
        at = f"{trajectory.name} {space.name}: {report.headline or report.margin}"
        assert (row["trajectory"], row["vehicle"]) == (trajectory.name, space.name)
        assert row["valid"] == report.valid, at
        assert row["duration"] == trajectory.duration
        if report.valid:
            used = max(1 - row["margin"], 0.05), max(1 - report.margin, 0.05)
            # Near rests neither knows accelerations of steering any better.
            is_blunt = row["limit"] in {"STEER_ACCELERATION", "WHEEL_ACCELERATION"}
            assert used[0] == pytest.approx(used[1], rel=2e-2 if is_blunt else 2.5e-3)
            assert row["t"] is None
        else:
            told = report.headline
            assert told is not None
            assert row["t"] is None or 0 <= row["t"] <= trajectory.t[-1]
            refused += 1
            told_alike += row["limit"] == told.limit
    meta = table.schema.metadata or {}
    return {
        "valid": float(np.mean([row["valid"] for row in rows])),
        "asked": int(meta[b"omniplan.asked"]) / len(rows),
        "told_alike": told_alike / max(refused, 1),
    }


def test_says_what_validate_says_of_the_catalogue() -> None:
    spaces = [space_of(name) for name in NAMES]
    unknown = np.mean([not is_plain(space) for space in spaces])
    found = assert_alike(some_trajectories(1, 3), spaces)
    assert 0.1 < found["valid"] < 0.9
    assert found["asked"] < unknown + 0.15
    assert found["told_alike"] > 0.95


def test_says_what_validate_says_of_manoeuvres_with_stops_and_cusps() -> None:
    spaces = [space_of(name) for name in ("mecanum", "raw3-short", "ackermann")]
    found = assert_alike(manoeuvres(), spaces)
    assert found["valid"] > 0.1
    assert found["asked"] < 0.9


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_says_what_validate_says_of_random_vehicles(kind: Any) -> None:
    rng = np.random.default_rng(7)
    vehicle = random_vehicle(rng, kind)
    assert_alike(some_trajectories(3, 2), [build_space(vehicle, GRID, cache=False)])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ALL_KINDS)
def test_says_what_validate_says_of_many_random_vehicles(kind: Any) -> None:
    rng = np.random.default_rng(11)
    for i in range(4):
        space = build_space(random_vehicle(rng, kind), GRID, cache=False)
        assert_alike(some_trajectories(20 + i, 5), [space])


@pytest.mark.slow
def test_says_what_validate_says_of_the_benchmark() -> None:
    rng = np.random.default_rng(1)
    spaces = [build_space(v, GRID, cache=False) for v in random_vehicles(rng, 24)]
    found = assert_alike(random_trajectories(rng, 20), spaces)
    assert found["valid"] > 0.4
    assert found["asked"] < 0.01


def test_tolerances_count() -> None:
    t = np.linspace(0, 2, 20)
    aside = np.stack([np.full(20, 0.5), np.full(20, 0.02), np.zeros(20)], axis=-1)
    trajectory, space = Trajectory.from_twists(t, aside), space_of("differential")
    strict = validate_many([trajectory], [space])
    wide = validate_many(
        [trajectory], [space], Tolerances(slip_angle=math.radians(5.0))
    )
    assert strict["valid"].to_pylist() == [False]
    assert strict["limit"].to_pylist() == ["FIXED_WHEEL"]
    value, bound = strict["value"][0].as_py(), strict["bound"][0].as_py()
    # The sine of slip is against |v|.
    assert value == pytest.approx(math.asin(0.02 / math.hypot(0.5, 0.02)), rel=1e-6)
    assert bound == pytest.approx(math.radians(1.0))
    assert wide["valid"].to_pylist() == [True]


def test_a_refusal_names_wheel_place_and_numbers() -> None:
    # Faster and faster: a wheel is at its largest speed of 1.2 m/s somewhere.
    space = space_of("mecanum")
    limit = max(getattr(w, "max_speed", 0.0) for w in space.vehicle.wheels)  # type: ignore[union-attr]
    t = np.linspace(0, 4, 41)
    ahead = np.stack([t / 4 * 2 * limit, 0 * t, 0 * t], axis=-1)
    row = validate_many([Trajectory.from_twists(t, ahead)], [space]).to_pylist()[0]
    assert row["limit"] == "WHEEL_SPEED"
    assert row["wheel"] in {w.id for w in space.vehicle.wheels}  # type: ignore[union-attr]
    assert (row["t"], row["unit"]) == (4.0, "m/s")
    assert row["value"] == pytest.approx(2 * limit)
    assert row["bound"] == limit
    assert row["margin"] == pytest.approx(-1.0)


def test_everything_the_kernels_do_not_know_is_asked_for() -> None:
    known, steered = space_of("mecanum"), space_of("choreo-frc-swerve").vehicle
    assert steered is not None
    winding = [
        wheel.model_copy(update={"steering_range_deg": (-270.0, 270.0)})
        for wheel in steered.wheels
    ]
    spaces = [
        build_space(
            steered.model_copy(update={"wheels": tuple(winding)}), GRID, cache=False
        ),
        dataclasses.replace(
            known, vehicle=None, header=dataclasses.replace(known.header, name="sheet")
        ),
    ]
    assert not any(is_plain(space) for space in spaces)
    vehicle = known.vehicle
    assert vehicle is not None
    own = Trajectory.from_omni_curve(
        [0, 1], [0, 0.5], [0, 0.1], [0.2, 0.2], vehicle, name="own"
    )
    trajectories = [own, random_twists(np.random.default_rng(0), "twists", rest=True)]
    found = assert_alike(trajectories, [known, *spaces])
    assert found["asked"] == 4 / 6


@pytest.mark.parametrize("name", configspace.catalog())
def test_the_rows_are_those_of_the_vehicle_judge(name: str) -> None:
    vehicle = configspace.load_vehicle(name)
    judge = VehicleJudge(
        vehicle, Tolerances(), is_own=False, has_rates=True, has_swing=True
    )
    wanted = {
        (row.limit, judge.wheel_ids[row.wheel] if row.wheel >= 0 else "")
        for row in judge.rows
    }
    fleet = fleet_of([vehicle], Tolerances())
    assert {(label.limit, label.wheel) for label in fleet.labels} == wanted
    own = VehicleJudge(vehicle, Tolerances(), is_own=True, has_rates=False)
    wanted = {
        (row.limit, own.wheel_ids[row.wheel] if row.wheel >= 0 else "")
        for row in own.rows
    }
    fleet = fleet_of([vehicle], Tolerances(), is_own=True)
    assert {(label.limit, label.wheel) for label in fleet.labels} == wanted


def test_parts_are_those_of_the_motion() -> None:
    rng = np.random.default_rng(4)
    trajectories = [random_twists(rng, "a", rest=True), *random_trajectories(rng, 3)]
    motions = motions_of(trajectories)
    for n, trajectory in enumerate(trajectories):
        rows = slice(motions.first[n], motions.first[n + 1])
        count = motions.count[n]
        found = motions.blocks[rows].transpose(1, 0, 2).reshape(FIELDS, -1)[:, :count]
        knot = motions.knot_of[rows].ravel()[:count]
        np.testing.assert_array_equal(found[15, 1:], found[16, :-1])
        assert found[15, 0] == trajectory.t[0]
        assert found[16, -1] == trajectory.t[-1]
        motion = motion_of(trajectory, is_own=False)
        part = motion.enclose(Intervals(knot - knot[0], found[15], found[16]))
        wanted: list[npt.NDArray[np.float64]] = []
        for v, omega in (
            (part.v0, part.omega0),
            (part.v1, part.omega1),
            (part.v_dot0, part.omega_dot0),
            (part.v_dot1, part.omega_dot1),
        ):
            wanted += [v.real, v.imag, omega]
        wanted += [part.v_ddot, part.omega_ddot, part.dt]
        np.testing.assert_allclose(found[:15], wanted, rtol=1e-9, atol=1e-12)


def test_second_derivatives_by_differences() -> None:
    rng = np.random.default_rng(8)
    trajectory = Trajectory.from_poses(
        np.arange(20) * 0.2,
        np.cumsum(rng.normal(0.1, 0.02, (20, 3)), axis=0),
        reference_point=(0.3, -0.2),
    )
    motions = motions_of([trajectory])
    blocks = motions.blocks
    motion = motion_of(trajectory, is_own=False)
    for b in range(len(blocks)):
        for k in range(0, 16, 5):
            knot, t, end = motions.knot_of[b, k], *blocks[b, 15:17, k]
            h = 1e-4 * (end - t)
            times = np.array([t, end - h])
            part = motion.enclose(Intervals(np.array([knot, knot]), times, times + h))
            v_ddot = (part.v_dot1 - part.v_dot0) / h
            assert complex(*blocks[b, 17:19, k]) == pytest.approx(
                v_ddot[0], rel=1e-2, abs=1e-2
            )
            change = abs(v_ddot[1] - v_ddot[0]) / (end - h - t)
            assert change <= blocks[b, 20, k] * 1.01 + 1e-2


def test_vehicles_that_differ_in_their_names_only_are_judged_once() -> None:
    space = space_of("mecanum")
    assert space.vehicle is not None
    twin = build_space(
        space.vehicle.model_copy(update={"name": "twin"}), GRID, cache=False
    )
    batch = Batch(some_trajectories(5, 1), [space, space_of("robotino"), twin])
    rows = [row for part in batch.verdicts() for row in part.to_pylist()]
    assert len(batch._types[0].bodies) == 2
    for first, second in zip(rows[::3], rows[2::3], strict=True):
        assert {**first, "vehicle": "twin"} == second


def test_chunks_are_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    trajectories, spaces = some_trajectories(6, 2), [space_of(n) for n in NAMES[:3]]
    whole = validate_many(trajectories, spaces).to_pylist()
    monkeypatch.setattr(omniplan.batch.many, "CHUNK", 4)
    parts = list(Batch(trajectories, spaces).verdicts())
    assert len(parts) == len(trajectories)
    assert [row for part in parts for row in part.to_pylist()] == whole


@pytest.mark.parametrize(
    ("trajectories", "names", "message"),
    [
        (0, ("mecanum",), "trajectories: empty"),
        (1, (), "spaces: empty"),
        (1, ("mecanum", "mecanum"), 'spaces: the name "mecanum" more than once'),
        (2, ("mecanum",), 'trajectories: the name "trajectory" more than once'),
    ],
)
def test_empty_lists_and_repeated_names_are_refused(
    trajectories: int, names: tuple[str, ...], message: str
) -> None:
    one = Trajectory.from_poses([0, 1], [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    with pytest.raises(InvalidInput, match=message):
        validate_many([one] * trajectories, [space_of(name) for name in names])


def test_a_path_is_refused() -> None:
    path = omniplan.Path.from_poses([[0, 0, 0], [1, 0, 0]])
    with pytest.raises(InvalidInput, match="fastest"):
        validate_many([path], [space_of("mecanum")])  # type: ignore[list-item]


def test_verdicts_go_to_a_parquet_file(tmp_path: Path) -> None:
    trajectories, spaces = some_trajectories(6, 2), [space_of(n) for n in NAMES[:3]]
    table = validate_many(trajectories, spaces)
    path = tmp_path / "verdicts.parquet"
    written = write_verdicts(path, Batch(trajectories, spaces))
    assert pq.read_table(path).to_pylist() == table.to_pylist()
    assert table.schema.names == SCHEMA.names
    assert written.pairs == table.num_rows
    assert written.valid == table["valid"].to_pylist().count(True)
    assert [file.name for file in tmp_path.iterdir()] == ["verdicts.parquet"]


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    batch = Batch(some_trajectories(6, 1), [space_of("mecanum")])
    with pytest.raises(configspace.OmniplanError, match="nowhere"):
        write_verdicts(tmp_path / "nowhere" / "verdicts.parquet", batch)


def test_the_command_line_checks_a_fleet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given, out = tmp_path / "trajectories.csv", tmp_path / "verdicts.parquet"
    aside = Trajectory.from_poses(
        [0, 2, 4], [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0]]
    )
    omniplan.write_trajectories(given, [aside])
    arguments = ["check", str(given), "--fleet", "mecanum", "differential"]
    assert main([*arguments, "--out", str(out)]) == 1
    assert "1 of 2 pairs are valid" in capsys.readouterr().out
    assert pq.read_table(out)["valid"].to_pylist() == [True, False]
    assert main([*arguments[:4], "--out", str(out), "--json"]) == 0
    assert '"valid": 1' in capsys.readouterr().out
    assert main(arguments) == 2


def test_cells_next_to_each_other_are_one_piece() -> None:
    # A fleet of the benchmark is judged by the kernels throughout.
    rng = np.random.default_rng(3)
    for vehicle in random_vehicles(rng, 12):
        space = build_space(vehicle, GRID, cache=False)
        assert is_plain(space)
        assert edges_of(vehicle.mobility, GRID)[0].size >= 2
        assert not (space._reach == 1)[space.tables.state != 1].any()
