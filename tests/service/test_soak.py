"""A minute of `benchmarks/soak.py`: nothing lost, nothing wrong, memory flat."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "soak.py"


@pytest.mark.slow
@pytest.mark.service
@pytest.mark.timeout(600)
def test_a_minute_of_mixed_load_while_a_server_is_killed(tmp_path: Path) -> None:
    command = [sys.executable, str(SCRIPT), "--minutes", "1", "--kill-every", "10"]
    # A file: nobody reads a pipe while it runs.
    with (tmp_path / "out").open("w+") as out, (tmp_path / "err").open("w+") as err:
        run = subprocess.run(command, stdout=out, stderr=err, timeout=580, check=False)
        out.seek(0)
        err.seek(0)
        said, errors = out.read(), err.read()
    assert said, errors
    result = json.loads(said)
    found = {name: result[name] for name in ("lost", "wrong", "errors_in_logs")}
    assert found == {"lost": [], "wrong": [], "errors_in_logs": []}
    assert result["exit_codes"] == [0, 0]
    assert not result["has_grown"], result["memory_mib"]
    assert result["kills"] >= 2
    assert set(result["kinds"]) >= {"validate", "select", "validate_many", "register"}
    assert run.returncode == 0, errors
