"""From request to reply, without zenoh: bytes in, bytes out.

Only ``register`` and ``unregister`` change anything: the registry.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence

from configspace.errors import InvalidInput, InvalidVehicle, Problem
from configspace.space import PermissibleSpace
from configspace.storage import dump_space
from omniplan import InvalidTrajectory, validate
from omniplan.choosing.fleet import ranked_by
from omniplan.report import Ranking
from services.answering.answers import Answer, Parts
from services.answering.batches import judge_twists, validate_batch
from services.answering.calls import Call
from services.errors import CallStopped, InvalidMessage, RegistrationRefused
from services.protocol.arrow import ARROW
from services.protocol.keys import Route
from services.protocol.messages import (
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
from services.registering.registration import change
from services.registering.registry import Registry

__all__ = ["SHEET", "Answer", "Handlers", "Parts", "check_size", "error_reply"]

SHEET = "application/octet-stream"
"""Encoding of a data sheet."""
# Without an encoding zenoh says zenoh/bytes: taken as what the key takes.
_UNNAMED = ("zenoh/bytes", "")
_BATCHES = ("batch_twists", "batch_validate")
_MAX_MESSAGE = 4000  # characters of an error reply: it may repeat what was sent

_log = logging.getLogger(__name__)


class Handlers:
    """Answers for a fleet.

    Parameters
    ----------
    registry : Registry
        The vehicles; each answer sees one state of it.
    health : callable
        Returns the state of the server.
    limits : RequestLimits, optional
    online : callable, optional
        Returns the names of the vehicles that are online; default none is.
    """

    def __init__(
        self,
        registry: Registry,
        health: Callable[[], Health],
        limits: RequestLimits | None = None,
        online: Callable[[], frozenset[str]] = frozenset,
    ) -> None:
        self.registry = registry
        self.limits = limits or RequestLimits()
        self._health = health
        self._online = online

    @property
    def fleet(self) -> Mapping[str, PermissibleSpace]:
        """The vehicles known now, by name; what is returned does not change."""
        return self.registry.fleet

    def answer(
        self,
        route: Route,
        payload: bytes = b"",
        encoding: str = "",
        call: Call | None = None,
    ) -> Answer | Parts:
        """Answer one request, at once or in parts.

        Parameters
        ----------
        route : Route
        payload : bytes
        encoding : str
            Encoding of the payload as zenoh names it.
        call : Call, optional
            The request under way; default one without a deadline.

        Raises
        ------
        InvalidInput
            If the request cannot be answered; see `error_reply`.
        """
        call = call or Call.local()
        check_size(len(payload), self.limits)
        if payload:
            _check_encoding(encoding, ARROW if route.verb in _BATCHES else JSON)
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
                return self.validate(payload, call)
            case "select":
                return self.select(payload, call)
            case "batch_validate":
                return validate_batch(payload, self._chosen, self.limits, call)
            case "batch_twists":
                return judge_twists(payload, self._chosen, self.limits, call)
            case "health":
                return self.health()
            case "register" | "unregister":
                return Answer(change(self.registry, route, payload))
            case "cancel":
                # A server answers it before it comes here.
                problem = Problem("key", "cancel", "there is nothing under way")
                raise InvalidMessage(problem, code="unknown_key")

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

    def validate(self, payload: bytes, call: Call) -> Parts:
        """Judge trajectories for one vehicle."""
        request = decode(ValidateRequest, payload)
        call.begin(request.request, request.deadline)
        space = self._space(request.vehicle)
        trajectories = trajectories_from(request.trajectories, self.limits)
        call.n_samples += sum(x.t.size for x in trajectories)
        reports = []
        allow = request.allow_unreachable
        for index, trajectory in enumerate(trajectories):
            if index:
                yield None
            reports.append(
                validate(
                    trajectory, space, allow_unreachable=allow, checkpoint=call.check
                )
            )
        return Answer(encode(ValidateReply.of(reports)))

    def select(self, payload: bytes, call: Call) -> Parts:
        """Rank the vehicles for trajectories."""
        request = decode(SelectRequest, payload)
        call.begin(request.request, request.deadline)
        fleet = self._chosen(request.vehicles)
        if request.online_only:
            fleet = _only(fleet, self._online())
        trajectories = trajectories_from(request.trajectories, self.limits)
        call.n_samples += sum(x.t.size for x in trajectories)
        ranked = ranked_by(
            fleet,
            request.by,
            requirements=request.requirements,
            allow_unreachable=request.allow_unreachable,
            checkpoint=call.check,
        )
        rankings: list[Ranking] = []
        for index, trajectory in enumerate(trajectories):
            if index:
                yield None
            rankings.append(ranked(trajectory))
        return Answer(encode(SelectReply.of(rankings)))

    def health(self) -> Answer:
        """Return the state of the server."""
        return Answer(encode(self._health()))

    def _chosen(self, names: Sequence[str] | None) -> list[PermissibleSpace]:
        fleet = self.fleet
        if names is None:
            return list(fleet.values())
        # Repeated names would make a small request arbitrarily much work.
        if len(set(names)) < len(names):
            raise InvalidMessage(
                Problem("vehicles", "a name stands twice", "each name once")
            )
        return [
            _space_of(fleet, name, f"vehicles[{i}]") for i, name in enumerate(names)
        ]

    def _space(self, name: str) -> PermissibleSpace:
        return _space_of(self.fleet, name, "vehicle")


def _space_of(
    fleet: Mapping[str, PermissibleSpace], name: str, where: str
) -> PermissibleSpace:
    try:
        return fleet[name]
    except KeyError:
        known = ", ".join(list(fleet)[:20]) or "none"
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
        case CallStopped():
            return ErrorReply(code=error.code, message=str(error))
        case RegistrationRefused():
            message = str(error)[:_MAX_MESSAGE]
            return ErrorReply(code=error.code, message=message, field=error.field)
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


def _only(
    fleet: Sequence[PermissibleSpace], online: frozenset[str]
) -> list[PermissibleSpace]:
    found = [space for space in fleet if space.name in online]
    if not found:
        problem = Problem("online_only", "no vehicle is online", "at least one")
        raise InvalidInput(problem)
    return found


def _check_encoding(encoding: str, needed: str) -> None:
    # A schema may follow: application/json;omniplan
    if encoding.partition(";")[0] not in (needed, *_UNNAMED):
        raise InvalidMessage(
            Problem("encoding", repr(encoding)[:80], f"{needed} is needed"),
            code="wrong_encoding",
        )
