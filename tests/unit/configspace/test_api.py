import dataclasses
import importlib
import inspect
import pkgutil
import subprocess
import sys

import pytest

import configspace

MODULES = [
    "configspace",
    *(
        f"configspace.{module.name}"
        for module in pkgutil.iter_modules(configspace.__path__)
        if module.name != "testing"
    ),
    "configspace.testing",
]


def test_public_names_are_sorted_and_exist() -> None:
    assert configspace.__all__ == sorted(configspace.__all__)
    for name in configspace.__all__:
        assert hasattr(configspace, name)


def test_public_names_are_complete() -> None:
    promised = {
        "build_space",
        "catalog",
        "from_twist",
        "load_space",
        "load_vehicle",
        "to_twist",
        "wheel_states",
    }
    assert promised <= set(configspace.__all__)
    here = {
        name
        for name, value in vars(configspace).items()
        if not name.startswith("_")
        and not inspect.ismodule(value)
        and getattr(value, "__module__", "").startswith("configspace")
    }
    assert here == set(configspace.__all__)


@pytest.mark.parametrize("name", MODULES)
def test_modules_say_what_is_public(name: str) -> None:
    module = importlib.import_module(name)
    assert module.__doc__
    assert all(hasattr(module, public) for public in module.__all__)


@pytest.mark.parametrize("name", MODULES)
def test_everything_public_is_described(name: str) -> None:
    module = importlib.import_module(name)
    for public in module.__all__:
        value = getattr(module, public)
        if not (inspect.isclass(value) or inspect.isfunction(value)):
            continue
        assert inspect.getdoc(value), public
        if dataclasses.is_dataclass(value):
            # Not the docstring that dataclass makes up.
            assert not (value.__doc__ or "").startswith(f"{public}(")
        if inspect.isclass(value) and value.__module__.startswith("configspace"):
            for method, body in vars(value).items():
                if not method.startswith("_") and inspect.isfunction(body):
                    assert inspect.getdoc(body), f"{public}.{method}"


@pytest.mark.parametrize("error", ["InvalidInput", "InvalidVehicle", "CacheError"])
def test_errors_have_one_root(error: str) -> None:
    assert issubclass(getattr(configspace, error), configspace.OmniplanError)


def test_bad_input_is_a_value_error_too() -> None:
    assert issubclass(configspace.InvalidVehicle, ValueError)


def test_importing_needs_no_test_library_and_no_plotting() -> None:
    code = (
        "import sys, configspace\n"
        "bad = {'hypothesis', 'matplotlib', 'zenoh', 'trimesh', 'pytest'}\n"
        "sys.exit(', '.join(bad & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_strategies_import_hypothesis_when_asked() -> None:
    code = "import sys, configspace.testing\nsys.exit('hypothesis' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True)
    assert done.returncode == 0
