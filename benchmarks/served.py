"""A server in a process of its own, and what it is asked, for the benchmarks."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator

import numpy as np

import omniplan

VEHICLE = "mecanum"
PER_TRAJECTORY = 10_000


def wave(n: int, name: str) -> omniplan.Trajectory:
    """Return a slow drive along a wave of n samples."""
    t = np.linspace(0.0, 20.0, n)
    poses = np.column_stack([0.2 * t, 0.05 * np.sin(t), 0.1 * np.sin(0.5 * t)])
    return omniplan.Trajectory.from_poses(t, poses, name=name)


@contextlib.contextmanager
def served() -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Yield the endpoint of a server of `VEHICLE` and its process."""
    command = [sys.executable, "-m", "omniplan.cli", "serve", "--json"]
    command += ["--fleet", VEHICLE, "--listen", "tcp/127.0.0.1:0"]
    with subprocess.Popen(
        [*command, "--log-level", "warning"], stdout=subprocess.PIPE, text=True
    ) as server:
        assert server.stdout is not None
        text = ""
        while not text.endswith("}\n"):
            line = server.stdout.readline()
            if not line:
                raise SystemExit("the server has not started")
            text += line
        yield json.loads(text)["endpoint"], server
        server.terminate()
