import logging
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import configspace
from configspace import Grid, PermissibleSpace
from configspace.vehicle import Vehicle

GRID = Grid(16, 24)


@pytest.fixture
def vehicle() -> Vehicle:
    return configspace.load_vehicle("ift-four-steered")


def assert_same(one: PermissibleSpace, other: PermissibleSpace) -> None:
    assert one.header == other.header
    assert one.vehicle == other.vehicle
    for name, array in vars(one.tables).items():
        np.testing.assert_array_equal(array, getattr(other.tables, name))


def entries(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


def test_a_hit_equals_what_is_computed(vehicle: Vehicle, tmp_path: Path) -> None:
    computed = configspace.build_space(vehicle, GRID, cache=False)
    first = configspace.build_space(vehicle, GRID, cache=tmp_path)
    assert len(entries(tmp_path)) == 1
    second = configspace.build_space(vehicle, GRID, cache=str(tmp_path))
    assert_same(computed, first)
    assert_same(computed, second)
    kappa_n, beta = np.linspace(-2, 2, 99), np.linspace(-3, 3, 99)
    np.testing.assert_array_equal(
        computed.v_max(kappa_n, beta), second.v_max(kappa_n, beta)
    )


def test_a_hit_is_not_computed_again(
    vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    configspace.build_space(vehicle, GRID, cache=tmp_path)

    def refuse(*_: object) -> None:
        raise AssertionError("computed")

    monkeypatch.setattr("configspace.build._compute", refuse)
    configspace.build_space(vehicle, GRID, cache=tmp_path)


def test_other_content_has_another_key(vehicle: Vehicle, tmp_path: Path) -> None:
    faster = vehicle.model_copy(
        update={"limits": vehicle.limits.model_copy(update={"max_speed": 1.5})}
    )
    for one in (vehicle, faster):
        for grid in (GRID, Grid(20, 24), Grid(16, 25)):
            configspace.build_space(one, grid, cache=tmp_path)
    assert len(entries(tmp_path)) == 6


@pytest.mark.parametrize("damage", ["empty", "truncated", "flipped", "text", "other"])
def test_a_damaged_entry_is_computed_anew_and_logged(
    vehicle: Vehicle,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    damage: str,
) -> None:
    computed = configspace.build_space(vehicle, GRID, cache=tmp_path)
    (entry,) = entries(tmp_path)
    content = bytearray(entry.read_bytes())
    if damage == "empty":
        content.clear()
    elif damage == "truncated":
        del content[len(content) // 2 :]
    elif damage == "flipped":
        content[-1] ^= 1
    elif damage == "text":
        content[:] = b"hello"
    else:
        mecanum = configspace.load_vehicle("mecanum")
        other = configspace.build_space(mecanum, GRID, cache=False)
        content[:] = configspace.dump_space(other)
    entry.write_bytes(content)
    with caplog.at_level(logging.WARNING, logger="configspace"):
        assert_same(computed, configspace.build_space(vehicle, GRID, cache=tmp_path))
    assert "computed anew" in caplog.text
    caplog.clear()
    # The entry was repaired.
    assert_same(computed, configspace.build_space(vehicle, GRID, cache=tmp_path))
    assert not caplog.records


def test_the_environment_names_the_folder(
    vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "not" / "there" / "yet"
    monkeypatch.setenv("OMNIPLAN_CACHE", str(folder))
    configspace.build_space(vehicle, GRID)
    assert len(entries(folder)) == 1


def test_without_cache_nothing_is_written(
    vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMNIPLAN_CACHE", str(tmp_path))
    configspace.build_space(vehicle, GRID, cache=False)
    assert entries(tmp_path) == []


def test_a_folder_that_cannot_be_written_is_logged_and_the_answer_given(
    vehicle: Vehicle, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    computed = configspace.build_space(vehicle, GRID, cache=False)
    a_file = tmp_path / "file"
    a_file.write_text("")
    for folder in (a_file, a_file / "below", Path("/proc/omniplan")):
        caplog.clear()
        with caplog.at_level(logging.WARNING, logger="configspace"):
            assert_same(computed, configspace.build_space(vehicle, GRID, cache=folder))
        assert "not written" in caplog.text


def test_an_entry_that_cannot_be_opened_is_computed_anew(
    vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    configspace.build_space(vehicle, GRID, cache=tmp_path)

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    # What a cache folder of another user answers.
    for name in ("stat", "read_bytes"):
        with monkeypatch.context() as patch:
            patch.setattr(f"pathlib.Path.{name}", refuse)
            assert configspace.build_space(vehicle, GRID, cache=tmp_path).vehicle


def test_a_refused_vehicle_leaves_the_cache_as_it_is(tmp_path: Path) -> None:
    vehicle = configspace.vehicle_from_data(
        {"name": "v", "wheels": [{"id": "a", "type": "steered", "x": 1, "y": 0}]}
    )
    with pytest.raises(configspace.InvalidVehicle):
        configspace.build_space(vehicle, GRID, cache=tmp_path)
    assert entries(tmp_path) == []


def test_processes_may_build_the_same_space_at_once(tmp_path: Path) -> None:
    code = (
        "import configspace, hashlib\n"
        "from configspace import Grid\n"
        "vehicle = configspace.load_vehicle('mecanum')\n"
        "for _ in range(3):\n"
        "    space = configspace.build_space(vehicle, Grid(64, 96))\n"
        "tables = vars(space.tables).values()\n"
        "print([hashlib.sha256(table.tobytes()).hexdigest() for table in tables])\n"
    )
    environment = {**os.environ, "OMNIPLAN_CACHE": str(tmp_path)}
    running = [
        subprocess.Popen(
            [sys.executable, "-c", code],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(3)
    ]
    done = [process.communicate(timeout=100) for process in running]
    assert [process.returncode for process in running] == [0, 0, 0], done
    assert len({output for output, _ in done}) == 1
    assert all(not errors for _, errors in done), done
    assert len(entries(tmp_path)) == 1


def test_threads_may_build_the_same_space_at_once(tmp_path: Path) -> None:
    # In a process of its own: some thread layers of numba abort instead of failing.
    code = (
        "import configspace, sys\n"
        "from concurrent.futures import ThreadPoolExecutor\n"
        "from configspace import Grid\n"
        "vehicle = configspace.load_vehicle('mecanum')\n"
        "def build(_):\n"
        "    space = configspace.build_space(vehicle, Grid(64, 96), cache=False)\n"
        "    return tuple(t.tobytes() for t in vars(space.tables).values())\n"
        "with ThreadPoolExecutor(4) as pool:\n"
        "    found = set(pool.map(build, range(40)))\n"
        "sys.exit(len(found) - 1)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
