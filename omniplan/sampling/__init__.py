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
    from omniplan.sampling.motion_validity import (
        MotionValidator,
        equip,
        motion_validator,
    )
    from omniplan.sampling.ompl_bindings import bounds_of, seeded
    from omniplan.sampling.state_spaces import line_space
    from omniplan.sampling.state_validity import (
        Collisions,
        StateValidityChecker,
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

_HOMES = {
    "Collisions": "state_validity",
    "MotionValidator": "motion_validity",
    "PermittedIntervals": "intervals",
    "StateValidityChecker": "state_validity",
    "bounds_of": "ompl_bindings",
    "equip": "motion_validity",
    "least_radius": "line_radius",
    "line_space": "state_spaces",
    "motion_validator": "motion_validity",
    "seeded": "ompl_bindings",
    "validity_checker": "state_validity",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
