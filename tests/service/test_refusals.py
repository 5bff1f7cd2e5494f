"""Whatever is sent is answered; the server lives and nothing has changed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest
from loopback import Ask

import configspace
import omniplan
from services import Client, InvalidMessage, RemoteError, Server
from services.errors import CODES
from services.wire.exchange import Reply

pytestmark = pytest.mark.service


def refusal(replies: list[Reply]) -> dict[str, Any]:
    """Return the only reply, which is an error."""
    (reply,) = replies
    assert reply.is_error
    assert reply.encoding == "application/json"
    error: dict[str, Any] = json.loads(reply.payload)
    assert set(error) == {"code", "message", "field"}
    assert error["code"] in CODES
    return error


@pytest.fixture(autouse=True)
def server_is_unchanged_afterwards(
    server: Server, ask: Ask, validate_message: bytes
) -> Iterator[None]:
    before = [ask(key)[0] for key in ("vehicles", "vehicles/differential")]
    yield
    assert [ask(key)[0] for key in ("vehicles", "vehicles/differential")] == before
    (answer,) = ask("validate", validate_message)
    assert not answer.is_error


def changed(message: bytes, **values: object) -> bytes:
    return json.dumps({**json.loads(message), **values}).encode()


MALFORMED: dict[str, Callable[[bytes], bytes | None]] = {
    "nothing": lambda message: None,
    "truncated": lambda message: message[:-10],
    "trailing": lambda message: message + b"}",
    "NaN": lambda message: message.replace(b"0.2", b"NaN", 1),
    "infinite": lambda message: message.replace(b"0.2", b"-Infinity", 1),
    "no UTF-8": lambda message: b"\xff\xfe" + message,
    "zeros": lambda message: b"\0" * 1000,
    "deep": lambda message: b"[" * 100_000 + b"]" * 100_000,
    "list": lambda message: b"[]",
    "null": lambda message: b"null",
    "long number": lambda message: message.replace(b"0.2", b"9" * 5000, 1),
    "unknown key": lambda message: changed(message, speed=1),
    "vehicle a number": lambda message: changed(message, vehicle=3),
    "vehicle null": lambda message: changed(message, vehicle=None),
    "trajectories a mapping": lambda message: changed(message, trajectories={}),
    "a trajectory is a number": lambda message: changed(message, trajectories=[1]),
}


@pytest.mark.parametrize("spoil", MALFORMED.values(), ids=MALFORMED)
def test_a_malformed_message_is_refused(
    ask: Ask, validate_message: bytes, spoil: Callable[[bytes], bytes | None]
) -> None:
    error = refusal(ask("validate", spoil(validate_message)))
    assert error["code"] == "invalid_message"


TRAJECTORIES: dict[str, tuple[dict[str, object], str]] = {
    "one sample": ({"t": [0], "poses": [[0, 0, 0]]}, "at least two"),
    "no samples": ({"t": [], "poses": []}, "shape"),
    "texts": ({"t": ["a", "b"], "poses": [[0, 0, 0]] * 2}, "row 0, t"),
    "time stands still": ({"t": [1, 1], "poses": [[0, 0, 0]] * 2}, "row 1, t"),
    "too large": ({"t": [0, 1], "poses": [[0, 0, 0], [0, 1e400, 0]]}, ""),
    "null": ({"t": [0, 1], "poses": [[0, 0, 0], [0, None, 0]]}, "row 1, y"),
    "two forms": ({"t": [0, 1], "poses": [], "twists": []}, "exactly one"),
    "ragged": ({"t": [0, 1], "poses": [[0, 0, 0], [0, 0]]}, "different lengths"),
    "jump": ({"t": [0, 1], "poses": [[0, 0, 0], [0, 0, 3]]}, "row 1, theta"),
    "unknown key": ({"t": [0, 1], "poses": [[0, 0, 0]] * 2, "v": 1}, "unknown key v"),
}


@pytest.mark.parametrize(
    ("trajectory", "words"), TRAJECTORIES.values(), ids=TRAJECTORIES
)
@pytest.mark.parametrize("verb", ["validate", "select"])
def test_an_unusable_trajectory_is_refused_with_its_place(
    ask: Ask, verb: str, trajectory: dict[str, object], words: str
) -> None:
    good = {"t": [0, 1], "poses": [[0, 0, 0], [0.1, 0, 0]]}
    message: dict[str, object] = {"trajectories": [good, trajectory]}
    if verb == "validate":
        message["vehicle"] = "differential"
    payload = json.dumps(message).replace("Infinity", "1e400").encode()
    error = refusal(ask(verb, payload))
    assert error["code"] == "invalid_trajectory"
    assert error["field"].startswith("trajectories[1]")
    assert words in error["message"]


def test_a_number_with_too_many_digits_is_refused_as_the_trajectorys_fault(
    ask: Ask,
) -> None:
    trajectory = {"t": [0, 1], "poses": [[0, 0, 0], [0, 10**400, 0]]}
    message = {"vehicle": "differential", "trajectories": [trajectory]}
    error = refusal(ask("validate", json.dumps(message).encode()))
    assert error["code"] == "invalid_trajectory"


def test_an_unusable_vehicle_inside_a_trajectory_is_refused(ask: Ask) -> None:
    trajectory = {"t": [0, 1], "omni_curve": [[0, 0, 0.1]] * 2, "vehicle": {"name": 3}}
    message = {"vehicle": "differential", "trajectories": [trajectory]}
    error = refusal(ask("validate", json.dumps(message).encode()))
    assert error["code"] == "invalid_vehicle"


def test_all_mistakes_of_a_message_are_named_at_once(ask: Ask) -> None:
    error = refusal(ask("select", b'{"by": "beauty", "vehicles": 3, "more": 1}'))
    for word in ("by", "vehicles", "more: unknown key", "trajectories: missing"):
        assert word in error["message"]


def test_too_large_a_payload_is_refused_before_it_is_read(
    ask: Ask, server: Server
) -> None:
    error = refusal(ask("validate", b"[" * (8 * 2**20 + 1)))
    assert error["code"] == "too_large"
    assert "at most 8388608" in error["message"]


def test_the_size_limit_can_be_set(
    fleet: Sequence[configspace.PermissibleSpace],
    trajectories: Sequence[omniplan.Trajectory],
) -> None:
    with (
        Server(fleet, listen="tcp/127.0.0.1:0", max_bytes=100) as server,
        Client(server.endpoint) as client,
    ):
        with pytest.raises(RemoteError) as caught:
            client.validate(trajectories, "differential")
        assert caught.value.code == "too_large"
        assert client.vehicles()


def test_too_many_samples_are_refused(
    fleet: Sequence[configspace.PermissibleSpace],
    trajectories: Sequence[omniplan.Trajectory],
) -> None:
    with (
        Server(fleet, listen="tcp/127.0.0.1:0", max_samples=11) as server,
        Client(server.endpoint) as client,
    ):
        with pytest.raises(RemoteError, match="12 samples") as caught:
            client.select(trajectories)
        assert (caught.value.code, caught.value.field) == ("too_large", "trajectories")
        assert client.select(trajectories[:2])


@pytest.mark.parametrize("encoding", ["application/cbor", "text/plain", "zenoh/string"])
def test_another_encoding_is_refused(
    ask: Ask, validate_message: bytes, encoding: str
) -> None:
    error = refusal(ask("validate", validate_message, encoding))
    assert error["code"] == "wrong_encoding"


@pytest.mark.parametrize(
    "encoding", ["application/json", "application/json;v1", "zenoh/bytes"]
)
def test_json_is_taken_under_its_name_or_without_any(
    ask: Ask, validate_message: bytes, encoding: str
) -> None:
    (answer,) = ask("validate", validate_message, encoding)
    assert not answer.is_error


@pytest.mark.parametrize(
    "key", ["servers/x", "nothing", "vehicles/a/b", "spaces", "health/x", "vehicles/-"]
)
def test_an_unknown_key_is_refused_rather_than_left_unanswered(
    ask: Ask, key: str
) -> None:
    error = refusal(ask(key))
    assert error["code"] == "unknown_key"
    assert "vehicles/{id}" in error["message"]


def test_a_payload_where_none_is_taken_is_refused(ask: Ask) -> None:
    assert refusal(ask("health", b"{}"))["code"] == "invalid_message"


def test_an_unknown_vehicle_is_refused_and_the_known_ones_named(
    client: Client, trajectories: Sequence[omniplan.Trajectory]
) -> None:
    questions: dict[str, Callable[[], object]] = {
        "vehicle": lambda: client.validate(trajectories, "nobody"),
        "vehicles[1]": lambda: client.select(trajectories, ["differential", "nobody"]),
    }
    for field, question in questions.items():
        with pytest.raises(RemoteError, match="ift-four-steered") as caught:
            question()
        assert (caught.value.code, caught.value.field) == ("unknown_vehicle", field)
    for get in (client.vehicle, client.space):
        with pytest.raises(RemoteError, match="nobody"):
            get("nobody")


def test_a_vehicle_named_twice_is_refused(
    client: Client, trajectories: Sequence[omniplan.Trajectory]
) -> None:
    with pytest.raises(RemoteError, match="twice") as caught:
        client.select(trajectories, ["differential", "differential"])
    assert caught.value.code == "invalid_message"


def test_a_selection_among_no_vehicles_is_refused(
    client: Client, trajectories: Sequence[omniplan.Trajectory]
) -> None:
    with pytest.raises(RemoteError) as caught:
        client.select(trajectories, [])
    assert caught.value.code == "invalid_input"


def test_an_unknown_criterion_is_not_even_sent(
    client: Client, server: Server, trajectories: Sequence[omniplan.Trajectory]
) -> None:
    before = server.health().requests
    with pytest.raises(InvalidMessage, match=r"by: 'beauty'; .*or 'manoeuvrability'"):
        client.select(trajectories, by="beauty")
    assert server.health().requests == before


def test_a_failure_of_the_server_is_logged_and_not_shown(
    client: Client,
    trajectories: Sequence[omniplan.Trajectory],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("secret of the insides")

    with monkeypatch.context() as patch:
        patch.setattr("services.answering.handlers.validate", broken)
        with pytest.raises(RemoteError) as caught:
            client.validate(trajectories, "differential")
    assert caught.value.code == "internal"
    assert "secret" not in str(caught.value)
    assert "secret of the insides" in caplog.text
