"""Exit codes where something goes wrong: never 1, which is the answer "no"."""

import json
from pathlib import Path

import pytest

from configspace import InvalidInput, OmniplanError, Problem
from omniplan import cli
from omniplan.shell import answers, looking
from services.errors import CODES, RemoteError

Capture = pytest.CaptureFixture[str]


def failing_with(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(options: object) -> int:
        raise error

    monkeypatch.setattr(looking, "catalog", fail)


@pytest.mark.parametrize(
    "error",
    [ZeroDivisionError("a mistake of ours"), OSError(28, "No space left on device")],
)
def test_what_nobody_expected_is_a_failure(
    error: Exception, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    failing_with(error, monkeypatch)
    assert cli.main(["catalog"]) == answers.FAILURE
    assert f"omniplan: {error}" in capsys.readouterr().err
    assert cli.main(["catalog", "--json"]) == answers.FAILURE
    assert json.loads(capsys.readouterr().out)["error"] == type(error).__name__


def test_a_mistake_of_ours_leaves_its_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    failing_with(ZeroDivisionError("ours"), monkeypatch)
    cli.main(["catalog"])
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["inspect", "mecanum", "--plot"],
        ["check", "some.csv", "--vehicle", "mecanum", "--plot"],
        ["demo", "--output"],
    ],
)
def test_a_folder_that_cannot_be_made_is_told_before_the_work(
    arguments: list[str], tmp_path: Path, capsys: Capture
) -> None:
    file = tmp_path / "file"
    file.touch()
    assert cli.main([*arguments, str(file / "pictures")]) == answers.BAD_INPUT
    said = capsys.readouterr().err
    assert f"{file / 'pictures'}: Not a directory; a folder" in said


def test_what_a_server_calls_bad_input_is_bad_input() -> None:
    assert answers.code_of(InvalidInput(Problem("a", "b", "c"))) == answers.BAD_INPUT
    assert answers.code_of(OmniplanError("full")) == answers.FAILURE
    assert CODES.keys() >= answers.ASKED_WRONGLY
    for code in CODES:
        expected = (
            answers.BAD_INPUT if code in answers.ASKED_WRONGLY else answers.FAILURE
        )
        assert answers.code_of(RemoteError(code, "text")) == expected
