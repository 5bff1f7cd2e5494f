"""The page of the architecture names the modules that there are, and no others."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text("utf-8")
PACKAGES = ("configspace", "omniplan", "services")


def section(package: str) -> str:
    found = re.search(rf"^## {package}:.*?(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE)
    assert found is not None
    return found[0]


def modules(package: str) -> set[str]:
    files = (ROOT / package).rglob("*.py")
    return {file.stem for file in files if file.stem not in ("__init__", "__main__")}


def rooms(package: str) -> set[str]:
    return {folder.parent.name for folder in (ROOT / package).rglob("__init__.py")}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_has_its_place_on_the_page(package: str) -> None:
    named = set(re.findall(r"`(\w+)`", section(package)))
    plots = {name for name in modules(package) if name.startswith("plot_")}
    assert modules(package) - named - plots == set()


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_in_the_tables_is_a_module_or_a_room(package: str) -> None:
    there = modules(package) | rooms(package) | {"catalog", "plot_*"}
    rows = re.findall(r"^\| (?!module|---)(.*?) \|[^|]*\|$", section(package), re.M)
    assert rows
    named = {name for row in rows for name in re.findall(r"`([\w*]+)/?`", row)}
    assert named - there == set()
