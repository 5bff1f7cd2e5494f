"""A disk that is full and a process that is killed while it writes a data sheet."""

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import configspace
from configspace import CacheError, Grid

SMALL = Grid(40, 72)
WRITE_FOR_EVER = """
import sys, configspace
space = configspace.build_space(
    configspace.load_vehicle("mecanum"), configspace.Grid(40, 72), cache=False)
print("ready", flush=True)
while True:
    space.save(sys.argv[1])
"""


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Mount 128 KiB of memory as a disk."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=128k", "tmpfs", str(disk)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("mounting a tmpfs needs rights this process does not have")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def built(name: str, grid: Grid = SMALL) -> configspace.PermissibleSpace:
    return configspace.build_space(configspace.load_vehicle(name), grid, cache=False)


def test_a_full_disk_is_reported_and_the_older_sheet_stays(small_disk: Path) -> None:
    path = small_disk / "sheet.safetensors"
    built("differential", Grid(4, 8)).save(path)
    before = path.read_bytes()
    with pytest.raises(CacheError, match="No space left on device"):
        built("ift-four-steered", Grid(400, 720)).save(path)
    assert path.read_bytes() == before
    assert os.listdir(small_disk) == ["sheet.safetensors"]
    assert configspace.load_space(path).name == "differential"


def test_a_cache_on_a_full_disk_still_answers(small_disk: Path) -> None:
    vehicle = configspace.load_vehicle("ift-four-steered")
    space = configspace.build_space(vehicle, cache=small_disk)
    assert space.v_max(0.0, 0.0) > 0.99
    assert os.listdir(small_disk) == []


def test_a_file_that_may_not_grow_is_reported(tmp_path: Path) -> None:
    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))

    code = (
        "import configspace, sys\n"
        "vehicle = configspace.load_vehicle('mecanum')\n"
        "space = configspace.build_space(vehicle, configspace.Grid(40, 72), False)\n"
        "try:\n    space.save(sys.argv[1])\n"
        "except configspace.CacheError as error:\n    print('refused', error)\n"
    )
    # The kernels are compiled already, or numba could not write its own cache.
    built("mecanum")
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "sheet")],
        capture_output=True,
        text=True,
        check=True,
        preexec_fn=limit,
    )
    assert "refused" in done.stdout
    assert "cannot be written" in done.stdout
    assert os.listdir(tmp_path) == []


def test_a_process_killed_while_it_writes_leaves_a_whole_sheet_or_none(
    tmp_path: Path,
) -> None:
    path = tmp_path / "sheet.safetensors"
    expected = built("mecanum")
    rng = np.random.default_rng(1)
    whole = 0
    for _ in range(6):
        command = [sys.executable, "-c", WRITE_FOR_EVER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            assert writer.stdout.readline() == "ready\n"
            try:
                writer.wait(timeout=float(rng.uniform(0.0, 0.05)))
            except subprocess.TimeoutExpired:
                writer.kill()
        if path.exists():
            whole += 1
            found = configspace.load_space(path)
            np.testing.assert_array_equal(found.tables.load, expected.tables.load)
            np.testing.assert_array_equal(found.tables.parts, expected.tables.parts)
    assert whole > 0
