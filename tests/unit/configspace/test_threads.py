from __future__ import annotations

import importlib
import inspect
import re
import sys
from pathlib import Path
from types import ModuleType

import numba
import pytest

import configspace
import omniplan
from configspace import threads


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """The layers that can be imported; empty at first."""
    names: set[str] = set()

    def import_module(name: str) -> ModuleType:
        if name.rpartition(".")[2].removesuffix("pool") not in names:
            raise ImportError(name)
        return sys

    monkeypatch.setattr(importlib, "import_module", import_module)
    monkeypatch.setattr(numba.config, "THREADING_LAYER", "default")
    priority = ["tbb", "omp", "workqueue"]
    monkeypatch.setattr(numba.config, "THREADING_LAYER_PRIORITY", priority)
    return names


def test_the_lock_is_kept_where_only_workqueue_is_there(installed: set[str]) -> None:
    assert not threads._has_safe_layer()
    installed.add("omp")
    assert threads._has_safe_layer()


def test_the_layer_that_comes_first_decides(
    installed: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    installed.add("omp")
    priority = ["workqueue", "omp", "tbb"]
    monkeypatch.setattr(numba.config, "THREADING_LAYER_PRIORITY", priority)
    assert not threads._has_safe_layer()


@pytest.mark.parametrize(
    ("layer", "is_safe"),
    [
        ("workqueue", False),
        ("forksafe", False),
        ("omp", True),
        ("tbb", True),
        ("threadsafe", True),
    ],
)
def test_a_layer_that_was_chosen_decides(
    installed: set[str], monkeypatch: pytest.MonkeyPatch, layer: str, is_safe: bool
) -> None:
    monkeypatch.setattr(numba.config, "THREADING_LAYER", layer)
    assert threads._has_safe_layer() == is_safe


def test_every_parallel_kernel_releases_the_lock() -> None:
    found = []
    for package in (configspace, omniplan):
        for path in Path(inspect.getfile(package)).parent.rglob("*.py"):
            if path.name == "bench.py":  # measures the machine, answers nobody
                continue
            found += re.findall(r"@njit\((.*parallel=True.*)\)", path.read_text())
    assert found
    assert [x for x in found if "nogil=RELEASES_LOCK" not in x] == []
