from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

import configspace
from omniplan import select, validate
from omniplan.report import Ranking, Report
from omniplan.trajectory import Trajectory
from services.answering.answers import Answer
from services.answering.calls import Call, Calls
from services.answering.handlers import SHEET, Handlers, error_reply
from services.errors import CallStopped, InvalidMessage
from services.protocol.keys import Route, Verb
from services.protocol.messages import Health, RequestLimits
from services.registering.registry import Registry


@pytest.fixture(scope="module")
def space() -> configspace.PermissibleSpace:
    vehicle = configspace.load_vehicle("differential")
    return configspace.build_space(vehicle, configspace.Grid(40, 72), cache=False)


@pytest.fixture
def handlers(space: configspace.PermissibleSpace) -> Handlers:
    health = Health(
        version="1",
        instance="a",
        vehicles=1,
        queue_length=0,
        queue_size=1,
        queue_bytes=0,
        running=0,
        requests=0,
        errors=0,
        uptime=0.5,
        sheet_bytes=0,
    )
    return Handlers(Registry([space]), lambda: health, RequestLimits(10_000))


def final(handlers: Handlers, *request: Any) -> Answer:
    """Return the last part of an answer, or the only one."""
    answer = handlers.answer(*request)
    while not isinstance(answer, Answer):
        try:
            next(answer)
        except StopIteration as end:
            answer = end.value
    return answer


def test_what_can_be_read_needs_no_payload(
    handlers: Handlers, space: configspace.PermissibleSpace
) -> None:
    vehicles = final(handlers, Route("vehicles"))
    assert json.loads(vehicles.payload) == {"vehicles": ["differential"]}
    vehicle = final(handlers, Route("vehicle", "differential"))
    assert configspace.parse_vehicle(vehicle.payload.decode()) == space.vehicle
    sheet = final(handlers, Route("space", "differential"))
    assert configspace.parse_space(sheet.payload).header == space.header
    assert sheet.encoding == SHEET
    assert json.loads(final(handlers, Route("health")).payload)["uptime"] == 0.5


def test_a_vehicle_file_from_a_server_has_no_empty_keys(handlers: Handlers) -> None:
    assert b"null" not in final(handlers, Route("vehicle", "differential")).payload


def test_validate_answers_as_the_call_does(
    handlers: Handlers, space: configspace.PermissibleSpace
) -> None:
    trajectory = Trajectory.from_poses([0, 1, 2], [[0.1 * x, 0, 0] for x in range(3)])
    message = {"vehicle": "differential", "trajectories": [trajectory.to_dict()]}
    answer = final(handlers, Route("validate"), json.dumps(message).encode())
    (report,) = json.loads(answer.payload)["reports"]
    assert Report.from_dict(report) == validate(trajectory, space)


@pytest.mark.parametrize(
    ("route", "payload", "encoding", "code"),
    [
        (Route("validate"), b"", "", "invalid_message"),
        (Route("validate"), b"{}", "", "invalid_message"),
        (Route("validate"), b"{}", "text/plain", "wrong_encoding"),
        (Route("select"), b"[" * 10_001, "", "too_large"),
        (Route("health"), b"{}", "", "invalid_message"),
        (Route("space", "nobody"), b"", "", "unknown_vehicle"),
    ],
)
def test_what_cannot_be_answered_has_its_code(
    handlers: Handlers, route: Route, payload: bytes, encoding: str, code: str
) -> None:
    with pytest.raises(InvalidMessage) as caught:
        final(handlers, route, payload, encoding)
    assert caught.value.code == code


def test_select_judges_requirements_as_the_call_does(
    handlers: Handlers, space: configspace.PermissibleSpace
) -> None:
    trajectory = Trajectory.from_poses([0, 1, 2], [[0.1 * x, 0, 0] for x in range(3)])
    message = {"trajectories": [trajectory.to_dict()], "requirements": ["crab 90 deg"]}
    answer = final(handlers, Route("select"), json.dumps(message).encode())
    (ranking,) = json.loads(answer.payload)["rankings"]
    expected = select(trajectory, [space], requirements=["crab 90 deg"])
    assert (Ranking.from_dict(ranking),) == expected
    assert ranking["unfit"][0]["shortfalls"][0]["limit"] == "FIXED_WHEEL"


def test_a_requirement_that_is_none_is_an_invalid_input(handlers: Handlers) -> None:
    message = b'{"trajectories": [], "requirements": ["fly"]}'
    with pytest.raises(configspace.InvalidInput) as caught:
        final(handlers, Route("select"), message)
    reply = error_reply(caught.value)
    assert reply.code == "invalid_input"
    assert reply.field == "requirements[0], phrase"


def test_unreachable_motions_are_permitted_where_asked_for(handlers: Handlers) -> None:
    message = {"vehicle": "differential", "trajectories": [], "allow_unreachable": 1}
    with pytest.raises(InvalidMessage, match="allow_unreachable"):
        final(handlers, Route("validate"), json.dumps(message).encode())
    message["allow_unreachable"] = True
    answer = final(handlers, Route("validate"), json.dumps(message).encode())
    assert json.loads(answer.payload) == {"reports": []}


def test_only_vehicles_that_are_online_are_compared_where_asked_for(
    space: configspace.PermissibleSpace, handlers: Handlers
) -> None:
    trajectory = Trajectory.from_poses([0, 1, 2], [[0.1 * x, 0, 0] for x in range(3)])
    message = {"trajectories": [trajectory.to_dict()], "online_only": True}
    payload = json.dumps(message).encode()
    with pytest.raises(configspace.InvalidInput, match="no vehicle is online"):
        final(handlers, Route("select"), payload)
    present = Handlers(
        Registry([space]),
        lambda: pytest.fail("nobody asks"),
        online=lambda: frozenset([space.name]),
    )
    answer = final(present, Route("select"), payload)
    (ranking,) = json.loads(answer.payload)["rankings"]
    assert [one["vehicle"] for one in ranking["suitable"]] == ["differential"]


def test_a_deadline_counts_from_the_arrival(handlers: Handlers) -> None:
    message = b'{"vehicle": "differential", "trajectories": [], "deadline": 1e-9}'
    with pytest.raises(CallStopped) as caught:
        final(handlers, Route("validate"), message)
    assert caught.value.code == "deadline_exceeded"


def test_a_request_cancelled_before_it_is_read_is_not_worked_at(
    handlers: Handlers,
) -> None:
    calls = Calls()
    calls.cancel("mine")
    message = b'{"vehicle": "differential", "trajectories": [], "request": "mine"}'
    with pytest.raises(CallStopped) as caught:
        final(handlers, Route("validate"), message, "", Call(calls, "validate"))
    assert caught.value.code == "cancelled"


@pytest.mark.parametrize("verb", ["validate", "select"])
def test_a_request_is_stopped_within_one_trajectory(
    handlers: Handlers, verb: Verb, monkeypatch: pytest.MonkeyPatch
) -> None:
    x = np.cumsum(np.random.default_rng(5).uniform(0.0, 0.2, 200))
    trajectory = Trajectory.from_poses(
        np.arange(200.0), np.stack([x, np.zeros(200), np.zeros(200)], axis=-1)
    )
    message: dict[str, object] = {"trajectories": [trajectory.to_dict()]}
    message |= {"vehicle": "differential"} if verb == "validate" else {}
    payload = json.dumps(message).encode()

    def checks(limit: float) -> int:
        """Return how often a call is looked at; stop it the last time."""
        call = Call.local()
        check, n = call.check, 0

        def counted() -> None:
            nonlocal n
            n += 1
            if n >= limit:
                call.stop("cancelled")
            check()

        monkeypatch.setattr(call, "check", counted)
        found = handlers.answer(Route(verb), payload, "", call)
        assert not isinstance(found, Answer)
        with pytest.raises(CallStopped if limit < math.inf else StopIteration):
            next(found)
        return n

    n = checks(math.inf)
    assert n >= 3
    # It ends where it is stopped: no more is done.
    for limit in (2, n):
        assert checks(limit) == limit
