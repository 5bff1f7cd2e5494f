"""The command line given paths: it times them, judges them, and says so."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from omniplan.cli import main


@pytest.fixture
def corner(tmp_path: Path) -> Path:
    file = tmp_path / "corner.csv"
    file.write_text("trajectory,x,y,theta\nc,0,0,0\nc,1,0,0\nc,1,1,0\n")
    return file


def test_a_path_is_timed_and_judged(
    corner: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(corner), "--vehicle", "mecanum"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("timed: c by mecanum: 3.2")
    assert "c by mecanum: permitted" in text
    assert "s as timed, at best" in text


def test_a_path_that_cannot_be_driven_is_a_no(
    corner: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(corner), "--vehicle", "differential"]) == 1
    text = capsys.readouterr().out
    assert "blocked" in text
    assert "sideways slip 90.0°" in text
    assert "at x = 1.00 m, y = 0.00 m, θ = 0°, 1.00 m along the path" in text


def test_json_tells_the_timing(
    corner: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(corner), "--vehicle", "mecanum", "--json"]) == 0
    (yes,) = json.loads(capsys.readouterr().out)
    assert yes["valid"]
    assert yes["timing"]["status"] == "found"
    assert yes["timing"]["duration"] == pytest.approx(yes["duration"])
    assert yes["timing"]["optimum"] < yes["timing"]["duration"]
    assert main(["check", str(corner), "--vehicle", "differential", "--json"]) == 1
    (no,) = json.loads(capsys.readouterr().out)
    assert not no["valid"]
    assert no["timing"]["fault"]["limit"] == "FIXED_WHEEL"
    assert no["timing"]["duration"] is None
