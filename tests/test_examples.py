"""Every example, README snippet and docs snippet runs and prints what it says."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PAGES = [ROOT / "README.md", ROOT / "docs" / "planning.md"]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {file: file.read_bytes() for file in (ROOT / "examples").rglob("*.csv")}
    try:
        runpy.run_path(str(path), run_name="__main__")
        written = {
            file: file.read_bytes() for file in (ROOT / "examples").rglob("*.csv")
        }
    finally:
        for file, content in before.items():
            file.write_bytes(content)
    assert written == before
    if path.stem != "make_manoeuvres":
        assert capsys.readouterr().out


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_snippet_prints_the_text_that_follows_it(
    page: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = re.findall(
        r"```python\n(.*?)```\n+```text\n(.*?)```", page.read_text("utf-8"), re.DOTALL
    )
    assert found
    for code, expected in found:
        exec(compile(code, str(page), "exec"), {})
        assert capsys.readouterr().out == expected


def test_changelog_names_the_version() -> None:
    from importlib.metadata import version

    assert f"## [{version('omniplan')}]" in (ROOT / "CHANGELOG.md").read_text("utf-8")
