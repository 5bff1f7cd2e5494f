from __future__ import annotations

import json

import pytest

import configspace
from omniplan import validate
from omniplan.report import Report
from omniplan.trajectory import Trajectory
from services.errors import InvalidMessage
from services.handlers import SHEET, Handlers
from services.keys import Route
from services.messages import Health, RequestLimits


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
        requests=0,
        errors=0,
        uptime=0.5,
    )
    return Handlers({"differential": space}, lambda: health, RequestLimits(10_000))


def test_what_can_be_read_needs_no_payload(
    handlers: Handlers, space: configspace.PermissibleSpace
) -> None:
    vehicles = handlers.answer(Route("vehicles"))
    assert json.loads(vehicles.payload) == {"vehicles": ["differential"]}
    vehicle = handlers.answer(Route("vehicle", "differential"))
    assert configspace.parse_vehicle(vehicle.payload.decode()) == space.vehicle
    sheet = handlers.answer(Route("space", "differential"))
    assert configspace.parse_space(sheet.payload).header == space.header
    assert sheet.encoding == SHEET
    assert json.loads(handlers.answer(Route("health")).payload)["uptime"] == 0.5


def test_a_vehicle_file_from_a_server_has_no_empty_keys(handlers: Handlers) -> None:
    assert b"null" not in handlers.answer(Route("vehicle", "differential")).payload


def test_validate_answers_as_the_call_does(
    handlers: Handlers, space: configspace.PermissibleSpace
) -> None:
    trajectory = Trajectory.from_poses([0, 1, 2], [[0.1 * x, 0, 0] for x in range(3)])
    message = {"vehicle": "differential", "trajectories": [trajectory.to_dict()]}
    answer = handlers.answer(Route("validate"), json.dumps(message).encode())
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
        handlers.answer(route, payload, encoding)
    assert caught.value.code == code
