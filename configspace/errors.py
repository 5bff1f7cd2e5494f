"""The error tree; every error of the three packages descends from `OmniplanError`.

    OmniplanError
      InvalidInput (also ValueError)
        InvalidVehicle
        InvalidTrajectory     (omniplan.errors)
        InvalidMessage        (services.errors)
      CacheError
      NotDrivable             (omniplan.errors)
      PlanningError           (omniplan.errors)
        NoPlanFound
        OptimisationFailed
      ServiceError ...        (services.errors)

The class words the message: where, what was given, what is allowed. Errors of other
libraries are wrapped with ``raise ... from``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

__all__ = [
    "CacheError",
    "InvalidInput",
    "InvalidVehicle",
    "OmniplanError",
    "Problem",
]


class OmniplanError(Exception):
    """Root of all errors raised on purpose by omniplan."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with an input."""

    where: str
    """Path of the offending value, such as ``wheels[2].max_speed``."""
    given: str
    """What stands there."""
    allowed: str
    """What may stand there."""

    def __str__(self) -> str:
        """Return ``where: given; allowed``."""
        return f"{self.where}: {self.given}; {self.allowed}"


class InvalidInput(OmniplanError, ValueError):
    """An input that cannot be used, with all its problems at once.

    Parameters
    ----------
    problems : Problem or iterable of Problem
    subject : str
        What was read, such as ``vehicle file agv.yaml``.
    """

    def __init__(
        self, problems: Problem | Iterable[Problem], subject: str = ""
    ) -> None:
        self.problems: tuple[Problem, ...] = (
            (problems,) if isinstance(problems, Problem) else tuple(problems)
        )
        self.subject = subject
        lines = [str(problem) for problem in self.problems]
        if subject and len(lines) == 1:
            text = f"{subject}: {lines[0]}"
        elif subject:
            text = "\n  ".join([f"{subject}: {len(lines)} problems", *lines])
        else:
            text = "\n".join(lines)
        super().__init__(text)


class InvalidVehicle(InvalidInput):
    """A vehicle description that cannot be used."""


class CacheError(OmniplanError):
    """A data sheet or cache entry that is damaged, outdated or cannot be written."""
