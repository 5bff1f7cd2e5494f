"""From request to reply, without zenoh: bytes in, bytes out, nothing is changed."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from configspace.errors import InvalidInput, InvalidVehicle, Problem
from configspace.space import PermissibleSpace
from configspace.storage import dump_space
from omniplan import InvalidTrajectory, select, validate
from services.errors import InvalidMessage
from services.keys import Route
from services.messages import (
    JSON,
    ErrorReply,
    Health,
    RequestLimits,
    SelectReply,
    SelectRequest,
    ValidateReply,
    ValidateRequest,
    VehiclesReply,
    decode,
    encode,
    trajectories_from,
)

__all__ = ["SHEET", "Answer", "Handlers", "check_size", "error_reply"]

SHEET = "application/octet-stream"
"""Encoding of a data sheet."""
# Without an encoding zenoh says zenoh/bytes: taken as JSON too.
_ENCODINGS = (JSON, "zenoh/bytes", "")
_MAX_MESSAGE = 4000  # characters of an error reply: it may repeat what was sent

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Answer:
    """What a server sends back."""

    payload: bytes
    encoding: str = JSON


class Handlers:
    """Answers for a fleet.

    Parameters
    ----------
    fleet : mapping of str to PermissibleSpace
        The vehicles by name; each answer sees one state of it.
    health : callable
        Returns the state of the server.
    limits : RequestLimits
    """

    def __init__(
        self,
        fleet: Mapping[str, PermissibleSpace],
        health: Callable[[], Health],
        limits: RequestLimits | None = None,
    ) -> None:
        self.fleet = fleet
        self.limits = limits or RequestLimits()
        self._health = health

    def answer(self, route: Route, payload: bytes = b"", encoding: str = "") -> Answer:
        """Answer one request.

        Parameters
        ----------
        route : Route
        payload : bytes
        encoding : str
            Encoding of the payload as zenoh names it.

        Raises
        ------
        InvalidInput
            If the request cannot be answered; see `error_reply`.
        """
        check_size(len(payload), self.limits)
        if payload:
            _check_encoding(encoding)
        if payload and not route.takes_payload:
            problem = Problem("payload", f"{len(payload)} bytes", "this key takes none")
            raise InvalidMessage(problem)
        match route.verb:
            case "vehicles":
                return self.vehicles()
            case "vehicle":
                return self.vehicle(route.id)
            case "space":
                return self.space(route.id)
            case "validate":
                return self.validate(payload)
            case "select":
                return self.select(payload)
            case "health":
                return self.health()

    def vehicles(self) -> Answer:
        """Return the names of the vehicles."""
        return Answer(encode(VehiclesReply(vehicles=tuple(self.fleet))))

    def vehicle(self, name: str) -> Answer:
        """Return one vehicle file as JSON."""
        vehicle = self._space(name).vehicle
        if vehicle is None:
            allowed = f"spaces/{name} has the data sheet"
            problem = Problem("vehicle", f"{name!r} has no vehicle file here", allowed)
            raise InvalidMessage(problem, code="no_vehicle_file")
        return Answer(vehicle.model_dump_json(exclude_none=True).encode())

    def space(self, name: str) -> Answer:
        """Return one data sheet."""
        return Answer(dump_space(self._space(name)), SHEET)

    def validate(self, payload: bytes) -> Answer:
        """Judge trajectories for one vehicle."""
        request = decode(ValidateRequest, payload)
        space = self._space(request.vehicle)
        trajectories = trajectories_from(request.trajectories, self.limits)
        return Answer(
            encode(ValidateReply.of(validate(t, space) for t in trajectories))
        )

    def select(self, payload: bytes) -> Answer:
        """Rank the vehicles for trajectories."""
        request = decode(SelectRequest, payload)
        fleet = self._chosen(request.vehicles)
        trajectories = trajectories_from(request.trajectories, self.limits)
        return Answer(
            encode(SelectReply.of(select(trajectories, fleet, by=request.by)))
        )

    def health(self) -> Answer:
        """Return the state of the server."""
        return Answer(encode(self._health()))

    def _chosen(self, names: Sequence[str] | None) -> list[PermissibleSpace]:
        if names is None:
            return list(self.fleet.values())
        # Repeated names would make a small request arbitrarily much work.
        if len(set(names)) < len(names):
            raise InvalidMessage(
                Problem("vehicles", "a name stands twice", "each name once")
            )
        return [self._space(name, f"vehicles[{i}]") for i, name in enumerate(names)]

    def _space(self, name: str, where: str = "vehicle") -> PermissibleSpace:
        try:
            return self.fleet[name]
        except KeyError:
            known = ", ".join(list(self.fleet)[:20]) or "none"
            raise InvalidMessage(
                Problem(where, repr(name)[:80], f"known are {known}"),
                code="unknown_vehicle",
            ) from None


def check_size(n_bytes: int, limits: RequestLimits) -> None:
    """Raise InvalidMessage with code ``too_large`` if a payload is above the limit."""
    if n_bytes > limits.max_bytes:
        raise InvalidMessage(
            Problem("payload", f"{n_bytes} bytes", f"at most {limits.max_bytes}"),
            code="too_large",
        )


def error_reply(error: Exception) -> ErrorReply:
    """Return what to tell the caller about an exception.

    An error that was not raised on purpose is logged with its traceback; the caller
    learns nothing of the insides.
    """
    match error:
        case InvalidMessage():
            code = error.code
        case InvalidTrajectory():
            code = "invalid_trajectory"
        case InvalidVehicle():
            code = "invalid_vehicle"
        case InvalidInput():
            code = "invalid_input"
        case _:
            _log.error("request failed", exc_info=error)
            return ErrorReply(
                code="internal", message="the server failed; its log says why"
            )
    field = error.problems[0].where[:200] if error.problems else None
    return ErrorReply(code=code, message=str(error)[:_MAX_MESSAGE], field=field)


def _check_encoding(encoding: str) -> None:
    # A schema may follow: application/json;omniplan
    if encoding.partition(";")[0] not in _ENCODINGS:
        raise InvalidMessage(
            Problem("encoding", repr(encoding)[:80], f"{JSON} is needed"),
            code="wrong_encoding",
        )
