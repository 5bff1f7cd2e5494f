"""`omniplan bench`: batches against the memory and against a loop of WPILib.

Ratios are taken within one run, on the same threads; the best of a few repetitions
counts, as other work only makes things slower.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import contextlib
import math
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from numba import njit, prange

from configspace import Grid, PermissibleSpace, build_space, load_vehicle
from omniplan.batch.many import Batch, check_twists
from omniplan.bench_cases import KINDS, random_trajectories, random_vehicles

__all__ = ["QUICK", "Size", "bench", "bench_table"]

FloatArray = npt.NDArray[np.float32]

REPEATS = 7
LOOKUPS = ("ift-four-steered", "mecanum", "care-o-bot-3", "differential")
"""Vehicles whose spaces are looked up."""
LIBRARY = "robotpy-wpimath"


@dataclass(frozen=True)
class Size:
    """How much is measured."""

    twists: int = 20_000_000
    loops: int = 50_000
    """Passes of the loop over WPILib."""
    vehicles: int = 1000
    trajectories: int = 1000
    samples: int = 100
    """Per trajectory."""
    repeats: int = REPEATS


QUICK = Size(twists=8_000_000, loops=2_000, vehicles=100, trajectories=100, repeats=2)
"""Arrays as large as they have to be, but few repetitions."""
CACHE_SIZE = "/sys/devices/system/cpu/cpu0/cache/index3/size"
USUAL_CACHE = 32 << 20
"""Bytes, where the system does not tell."""


def bench(size: Size | None = None) -> dict[str, Any]:
    """Measure and return plain data: machine, versions, figures.

    Parameters
    ----------
    size : Size, optional
    """
    size = size or Size()
    size = replace(size, twists=max(size.twists, _beyond_cache()))
    rng = np.random.default_rng(1)
    many = _many(rng, size)  # first: the peak of memory is told right after it
    triad = _triad_rate(rng, size)
    return {
        "machine": _machine(),
        "triad": {"elements_per_s": triad, "elements": size.twists},
        "check_twists": [_lookup(rng, name, size, triad) for name in LOOKUPS],
        "wpilib": _against_wpilib(rng, size),
        "validate_many": many,
    }


def _beyond_cache() -> int:
    """Return so many elements that no array of a triad stays in the cache."""
    cache = USUAL_CACHE
    with contextlib.suppress(OSError, ValueError):
        text = Path(CACHE_SIZE).read_text(encoding="ascii").strip()
        cache = int(text.removesuffix("K")) << 10
    return cache // np.dtype(np.float32).itemsize


def _best(task: Callable[[], object], repeats: int) -> float:
    """Return the least time of a task, s, after one run that does not count."""
    task()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        task()
        times.append(time.perf_counter() - start)
    return min(times)


@njit(parallel=True, cache=True)
def _triad(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> None:
    for i in prange(a.size):
        a[i] = b[i] + c[i] * d[i]


def _triad_rate(rng: np.random.Generator, size: Size) -> float:
    """Return the elements per second of ``a = b + c * d`` in float32."""
    count = size.twists
    a = np.zeros(count, np.float32)
    b, c, d = (rng.random(count, dtype=np.float32) for _ in range(3))
    return count / _best(lambda: _triad(a, b, c, d), size.repeats)


def _twists(
    rng: np.random.Generator, space: PermissibleSpace, count: int
) -> FloatArray:
    """Return twists of which some are too fast; a bound vehicle's are on its line."""
    line = space.line_beta
    fastest = float(space.v_max(0.0, 0.0 if line is None else line))
    twists = rng.random((count, 3), dtype=np.float32) * np.float32(2) - np.float32(1)
    twists *= np.float32(1.2) * np.array([1, 1, space.kappa_g], np.float32)
    twists *= np.float32(fastest)
    if line is not None:
        along = twists[:, 0].copy()
        twists[:, 0], twists[:, 1] = along * np.cos(line), along * np.sin(line)
    return twists


def _lookup(
    rng: np.random.Generator, name: str, size: Size, triad: float
) -> dict[str, Any]:
    space = build_space(load_vehicle(name))
    twists = _twists(rng, space, size.twists)
    seconds = _best(lambda: check_twists(twists, space), size.repeats)
    rate = size.twists / seconds
    return {
        "vehicle": name,
        "samples_per_s": rate,
        "of_triad": rate / triad,
        "permitted": float(check_twists(twists, space).mean()),
    }


def _against_wpilib(rng: np.random.Generator, size: Size) -> dict[str, Any]:
    """Return the rate of a loop over WPILib's Mecanum kinematics and ours."""
    try:
        from wpimath.geometry import Translation2d
        from wpimath.kinematics import ChassisSpeeds, MecanumDriveKinematics
    except ImportError:
        return {"missing": f"pip install {LIBRARY}"}
    vehicle = load_vehicle("mecanum")
    limit = min(getattr(wheel, "max_speed", math.inf) for wheel in vehicle.wheels)
    space = build_space(vehicle)
    twists = _twists(rng, space, size.twists)
    places = [Translation2d(wheel.x, wheel.y) for wheel in vehicle.wheels]
    kinematics = MecanumDriveKinematics(*places)
    rows = twists[: size.loops].tolist()

    def loop() -> list[bool]:
        answers = []
        for vx, vy, omega in rows:
            speeds = kinematics.toWheelSpeeds(ChassisSpeeds(vx, vy, omega))
            before = speeds.frontLeft
            speeds.desaturate(limit)
            answers.append(speeds.frontLeft == before)
        return answers

    theirs = size.loops / _best(loop, min(size.repeats, 3))
    ours = size.twists / _best(lambda: check_twists(twists, space), size.repeats)
    return {
        "library": f"{LIBRARY} {metadata.version(LIBRARY)}",
        "loop_per_s": theirs,
        "samples_per_s": ours,
        "ratio": ours / theirs,
    }


def _many(rng: np.random.Generator, size: Size) -> dict[str, Any]:
    """Return what a large fleet takes, from trajectories and spaces to verdicts."""
    vehicles = random_vehicles(rng, size.vehicles)
    spaces = [build_space(v, Grid(40, 72), cache=False) for v in vehicles]
    trajectories = random_trajectories(rng, size.trajectories, size.samples)
    few = Batch(trajectories[:2], spaces[: len(KINDS)])
    list(few.verdicts())  # compiles
    start = time.perf_counter()
    batch = Batch(trajectories, spaces)
    valid = sum(_count_valid(batch))
    seconds = time.perf_counter() - start
    return {
        "vehicles": size.vehicles,
        "trajectories": size.trajectories,
        "samples": size.samples,
        "checks": batch.pairs * size.samples,
        "kinds": list(KINDS),
        "seconds": seconds,
        "peak_memory": _peak_memory(),
        "valid": valid / batch.pairs,
        "asked": batch.asked / batch.pairs,
    }


def _count_valid(batch: Batch) -> Iterator[int]:
    for rows in batch.verdicts():
        yield int(np.count_nonzero(rows["valid"].to_numpy(zero_copy_only=False)))


def _peak_memory() -> int | None:
    """Return the most memory this process has held so far, bytes; None on Windows."""
    try:
        import resource
    except ImportError:
        return None
    unit = 1 if platform.system() == "Darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def _machine() -> dict[str, Any]:
    return {
        "processor": _processor(),
        "threads": numba.get_num_threads(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in ("numpy", "numba", "omniplan")},
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [
                line.split(":")[1].strip() for line in file if "model name" in line
            ]
    except OSError:
        names = []
    return names[0] if names else platform.processor()


def bench_table(found: dict[str, Any]) -> Any:
    """Return the figures of `bench` as a rich table.

    Parameters
    ----------
    found : dict
    """
    from rich.table import Table

    machine = found["machine"]
    title = ", ".join(f"{k} {v}" for k, v in machine.items())
    table = Table("work", "measured", "bar", title=title)
    table.add_row("triad a = b + c*d", f"{found['triad']['elements_per_s']:.3g} /s", "")
    for row in found["check_twists"]:
        table.add_row(
            f"check_twists, {row['vehicle']} ({row['permitted']:.0%} permitted)",
            f"{row['samples_per_s']:.3g} /s = {row['of_triad']:.0%} of the triad",
            "25 %",
        )
    wpilib = found["wpilib"]
    if "missing" in wpilib:
        table.add_row("against WPILib", f"not installed: {wpilib['missing']}", "")
    else:
        text = f"{wpilib['ratio']:.0f} times a loop of {wpilib['loop_per_s']:.3g} /s"
        table.add_row(f"check_twists against {wpilib['library']}", text, "300")
    many = found["validate_many"]
    peak = many["peak_memory"]
    memory = "" if peak is None else f"; {peak / 2**20:.0f} MiB at most"
    table.add_row(
        f"{many['vehicles']} vehicles x {many['trajectories']} trajectories x "
        f"{many['samples']} samples",
        f"{many['seconds']:.2f} s; {many['valid']:.0%} valid, validate asked for "
        f"{many['asked']:.2%}{memory}",
        "3 s for 1e8",
    )
    return table
