"""Requests and replies, and their JSON.

Unknown keys are errors. JSON has no sign for infinite numbers; in replies they are the
texts ``"Infinity"`` and ``"-Infinity"``, in requests they are not allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails, from_json

from configspace.errors import InvalidInput, Problem
from omniplan.choosing.fitness import requirements_of
from omniplan.choosing.fleet import Criterion
from omniplan.choosing.requirements import Requirement
from omniplan.report import Ranking, Report
from omniplan.trajectory import Trajectory
from services.errors import InvalidMessage

__all__ = [
    "JSON",
    "CancelReply",
    "ErrorReply",
    "Health",
    "KeyHealth",
    "Message",
    "Question",
    "RequestLimits",
    "SelectReply",
    "SelectRequest",
    "ValidateReply",
    "ValidateRequest",
    "VehiclesReply",
    "decode",
    "encode",
    "fitting",
    "trajectories_from",
]

JSON = "application/json"
MAX_PROBLEMS = 20
"""More mistakes of one message are not listed."""

# In JSON a tuple is a list; everything inside stays strict.
Names: TypeAlias = Annotated[tuple[str, ...], Field(strict=False)]
Objects: TypeAlias = Annotated[tuple[dict[str, Any], ...], Field(strict=False)]
Count: TypeAlias = Annotated[int, Field(ge=0)]
Seconds: TypeAlias = Annotated[float, Field(ge=0)]
CHUNK = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
"""What can stand as one chunk of a key."""


@dataclass(frozen=True)
class RequestLimits:
    """What a server takes in one request.

    Raises
    ------
    InvalidInput
        If a limit is not positive.
    """

    max_bytes: int = 8 * 2**20
    """Largest payload, bytes; at most 32 MiB."""
    max_samples: int = 100_000
    """Largest number of samples of all trajectories together."""
    max_time: float = 60.0
    """Time for a request from its arrival, s."""
    max_batch_samples: int = 1_000_000
    """Largest number of samples, or twists, of a batch in Arrow."""

    def __post_init__(self) -> None:
        if not 1 <= self.max_bytes <= 32 * 2**20:
            raise InvalidInput(
                Problem("max_bytes", f"{self.max_bytes}", f"1 to {32 * 2**20}")
            )
        if self.max_samples < 1:
            raise InvalidInput(
                Problem("max_samples", f"{self.max_samples}", "at least 1")
            )
        if self.max_batch_samples < 1:
            raise InvalidInput(
                Problem("max_batch_samples", f"{self.max_batch_samples}", "at least 1")
            )
        if not 0 < self.max_time < math.inf:
            raise InvalidInput(
                Problem("max_time", f"{self.max_time} s", "positive and finite")
            )


class Message(BaseModel):
    """Frozen, strict, no unknown keys."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        ser_json_inf_nan="strings",
        use_attribute_docstrings=True,
    )


class Question(Message):
    """What every question may say about itself."""

    request: Annotated[str, Field(pattern=CHUNK)] | None = None
    """Name of the request for ``cancel``; one that nobody guesses."""
    deadline: Annotated[float, Field(gt=0)] | None = None
    """After this time the answer is of no use, s from the arrival."""


class ValidateRequest(Question):
    """The question whether a vehicle can drive trajectories."""

    vehicle: str
    """One of those that the server knows."""
    trajectories: Objects
    """As `Trajectory.to_dict` gives them."""
    allow_unreachable: bool = False
    """As for `omniplan.validate`."""

    @classmethod
    def of(
        cls,
        trajectories: Iterable[Trajectory],
        vehicle: str,
        *,
        allow_unreachable: bool = False,
    ) -> ValidateRequest:
        """Return the request for these values."""
        plain = tuple(trajectory.to_dict() for trajectory in trajectories)
        data = {"vehicle": vehicle, "trajectories": plain}
        return fitting(cls, {**data, "allow_unreachable": allow_unreachable})


class ValidateReply(Message):
    """One report for each trajectory, in their order."""

    reports: Objects
    """As `Report.to_dict` gives them."""

    @classmethod
    def of(cls, reports: Iterable[Report]) -> ValidateReply:
        """Return the reply for these values."""
        return cls(reports=tuple(report.to_dict() for report in reports))

    def values(self) -> tuple[Report, ...]:
        """Return the reports; ValueError if they are none."""
        return tuple(map(Report.from_dict, self.reports))


class SelectRequest(Question):
    """The question which vehicles can drive trajectories, best first."""

    trajectories: Objects
    """As `Trajectory.to_dict` gives them."""
    vehicles: Names | None = None
    """Which to compare; None for all that the server knows."""
    by: Criterion = "duration"
    """What is best."""
    requirements: Annotated[Names, Field(max_length=100)] = ()
    """What a vehicle must meet besides: phrases of `omniplan.choosing.requirements`."""
    allow_unreachable: bool = False
    """As for `omniplan.select`."""
    online_only: bool = False
    """Compare only vehicles that are online."""

    @classmethod
    def of(
        cls,
        trajectories: Iterable[Trajectory],
        vehicles: Iterable[str] | None,
        by: str,
        requirements: Iterable[Requirement | str] = (),
        *,
        allow_unreachable: bool = False,
        online_only: bool = False,
    ) -> SelectRequest:
        """Return the request for these values."""
        plain = tuple(trajectory.to_dict() for trajectory in trajectories)
        names = None if vehicles is None else tuple(vehicles)
        phrases = tuple(map(str, requirements_of(requirements)))
        data = {
            "trajectories": plain,
            "vehicles": names,
            "by": by,
            "requirements": phrases,
            "allow_unreachable": allow_unreachable,
            "online_only": online_only,
        }
        return fitting(cls, data)


class SelectReply(Message):
    """One ranking for each trajectory, in their order."""

    rankings: Objects
    """As `Ranking.to_dict` gives them."""

    @classmethod
    def of(cls, rankings: Iterable[Ranking]) -> SelectReply:
        """Return the reply for these values."""
        return cls(rankings=tuple(ranking.to_dict() for ranking in rankings))

    def values(self) -> tuple[Ranking, ...]:
        """Return the rankings; ValueError if they are none."""
        return tuple(map(Ranking.from_dict, self.rankings))


class VehiclesReply(Message):
    """Which vehicles a server knows."""

    vehicles: Names
    """Their names."""


class CancelReply(Message):
    """Whether the request to be cancelled is under way."""

    cancelled: bool
    """False also for one that is still to come, which is not begun then."""


class KeyHealth(Message):
    """What a server has answered to one kind of key since its start."""

    codes: dict[str, Count]
    """Answers by code, ``ok`` among them."""
    p50: Seconds
    """Time from arrival to the last reply that half of the answers keep, s."""
    p90: Seconds
    """Likewise nine of ten, s."""
    p99: Seconds
    """Likewise 99 of 100, s."""


class Health(Message):
    """State of a server."""

    version: str
    """Version of omniplan."""
    instance: str
    """Name of the running server, new at each start."""
    vehicles: Count
    """Number of vehicles."""
    queue_length: Count
    """Requests that wait now, for their first turn or their next."""
    queue_size: Count
    """Requests that may wait; more are answered ``busy``."""
    queue_bytes: Count
    """Bytes of large requests that wait or are worked at."""
    running: Count
    """Requests that are worked at in this moment."""
    requests: Count
    """Requests received since the start, this one included."""
    errors: Count
    """Error replies since the start."""
    uptime: Seconds
    """Time since the start, s."""
    memory: Count | None = None
    """What the process holds in memory, bytes; null where that is not known."""
    sheet_bytes: Count
    """What the data sheets of the vehicles take of it."""
    keys: dict[str, KeyHealth] = {}
    """What was answered, by kind of key: ``validate``, ``space``, ...; ``unknown``."""


class ErrorReply(Message):
    """Why there is no other reply."""

    code: str
    """One of `services.errors.CODES`."""
    message: str
    """What is wrong, in words: where, what was given, what is allowed."""
    field: str | None = None
    """Path of the offending value within the request."""


M = TypeVar("M", bound=Message)


def encode(message: Message) -> bytes:
    """Return a message as JSON."""
    return message.model_dump_json().encode()


def decode(kind: type[M], payload: bytes) -> M:
    """Return the message that JSON describes.

    Raises
    ------
    InvalidMessage
        If it is no JSON (truncated, NaN, nested too deep) or does not fit; all
        mistakes are reported at once.
    """
    try:
        data = from_json(payload, allow_inf_nan=False)
    except ValueError as error:
        problem = Problem("payload", str(error), "JSON without NaN is needed")
        raise InvalidMessage(problem, kind.__name__) from error
    return fitting(kind, data)


def fitting(kind: type[M], data: object) -> M:
    """Return the message with these values, or raise InvalidMessage."""
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        problems = [_problem(kind, item) for item in error.errors()[:MAX_PROBLEMS]]
        raise InvalidMessage(problems, kind.__name__) from error


def trajectories_from(
    objects: Sequence[dict[str, Any]], limits: RequestLimits
) -> tuple[Trajectory, ...]:
    """Return the trajectories of a request.

    Raises
    ------
    InvalidMessage
        With code ``too_large`` if they have too many samples.
    InvalidTrajectory, InvalidVehicle
        With the place of the first mistake, such as ``trajectories[2]: row 5, x``.
    """
    # Counted before arrays are built; what is no list is refused there anyhow.
    times = [item.get("t") for item in objects]
    n_samples = sum(len(t) for t in times if isinstance(t, list))
    if n_samples > limits.max_samples:
        allowed = f"at most {limits.max_samples} in one request"
        raise InvalidMessage(
            Problem("trajectories", f"{n_samples} samples", allowed), code="too_large"
        )
    return tuple(_trajectory(i, item) for i, item in enumerate(objects))


def _trajectory(index: int, data: dict[str, Any]) -> Trajectory:
    try:
        return Trajectory.from_dict(data)
    except InvalidInput as error:
        problems = [
            Problem(f"trajectories[{index}]: {p.where}", p.given, p.allowed)
            for p in error.problems
        ]
        raise type(error)(problems) from error


def _problem(kind: type[BaseModel], error: ErrorDetails) -> Problem:
    """Word one pydantic error: where, given, allowed."""
    where = "".join(
        f"[{part}]" if isinstance(part, int) else f".{part}" for part in error["loc"]
    ).lstrip(".")
    if error["type"] == "extra_forbidden":
        allowed = f"allowed are {', '.join(kind.model_fields)}"
        return Problem(where, "unknown key", allowed)
    given = "missing" if error["type"] == "missing" else repr(error["input"])[:60]
    return Problem(
        where or "payload", given, error["msg"][:1].lower() + error["msg"][1:]
    )
