from __future__ import annotations

import importlib
import pkgutil

import services
from configspace import OmniplanError


def test_all_is_sorted_and_complete() -> None:
    assert services.__all__ == sorted(services.__all__)
    public = {
        name
        for name, value in vars(services).items()
        if isinstance(value, type) and not name.startswith("_")
    }
    assert public == set(services.__all__)


def test_every_module_names_what_it_offers() -> None:
    for info in pkgutil.walk_packages(services.__path__, "services."):
        if info.ispkg:
            continue
        module = importlib.import_module(info.name)
        assert set(module.__all__) <= set(vars(module)), info.name
        assert module.__all__ == sorted(module.__all__, key=_ruffs_order), info.name


def _ruffs_order(name: str) -> tuple[int, str]:
    return (0 if name.isupper() else 1 if name[0].isupper() else 2, name)


def test_every_error_descends_from_the_one_root() -> None:
    from services import errors

    classes = [getattr(errors, name) for name in errors.__all__ if name != "CODES"]
    assert all(issubclass(error, OmniplanError) for error in classes)
