"""Validity for OMPL programs: which states and motions a vehicle permits.

    from omniplan import sampling
    si.setStateValidityChecker(sampling.validity_checker(si, space, checker))
    si.setMotionValidator(sampling.motion_validator(si, space, checker))

The names are loaded when they are first used, as OMPL is heavy.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from omniplan.sampling.intervals import PermittedIntervals
    from omniplan.sampling.line_radius import least_radius
    from omniplan.sampling.ompl_bindings import (
        Collisions,
        MotionValidator,
        StateValidityChecker,
        bounds_of,
        equip,
        line_space,
        motion_validator,
        seeded,
        validity_checker,
    )

__all__ = [
    "Collisions",
    "MotionValidator",
    "PermittedIntervals",
    "StateValidityChecker",
    "bounds_of",
    "equip",
    "least_radius",
    "line_space",
    "motion_validator",
    "seeded",
    "validity_checker",
]

_HOMES = {"PermittedIntervals": "intervals", "least_radius": "line_radius"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES.get(name, "ompl_bindings")
    value = getattr(importlib.import_module(f"{__name__}.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
