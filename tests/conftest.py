"""Fixtures of all tests: no test touches the user's cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache

import pytest
from hypothesis import settings

import configspace

# What CI accepts is what the next run accepts. New examples are drawn by
# `make test-slow`.
settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")


@pytest.fixture(scope="session", autouse=True)
def _cache_folder_of_the_tests(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMNIPLAN_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def space_of() -> Callable[[str], configspace.PermissibleSpace]:
    """Return the space of a catalogue vehicle on the default grid, built once."""

    @cache
    def build(name: str) -> configspace.PermissibleSpace:
        return configspace.build_space(configspace.load_vehicle(name), cache=False)

    return build
