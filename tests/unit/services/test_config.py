from __future__ import annotations

import inspect
import json
from pathlib import Path

import pytest
from pydantic import ValidationError

import configspace
from configspace import InvalidInput
from services import Server
from services.operating.config import (
    ServiceConfig,
    load_config,
    service_schema,
    variables,
)
from services.operating.launch import registry_of, server_of
from services.protocol.messages import RequestLimits

FULL = """
fleet = ["vehicles", "mecanum", "more/one.yaml", "/abs/two.yaml"]
site = "hall-3"
listen = "tls/0.0.0.0:7447"
peers = ["tls/other:7447"]
workers = 4
stop_within = 5

[queue]
size = 10
bytes = 20_000_000

[limits]
max_bytes = 1_000_000
max_samples = 5000
max_batch_samples = 6000
max_time = 2.5

[log]
level = "debug"
format = "json"

[security]
ca = "ca.pem"
certificate = "server.pem"
key = "/etc/server.key"
planners = ["planner-1", "planner-2"]

[registration]
enabled = true
store = "store"
max_vehicles = 7
max_memory = 70000000
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "server.toml"
    path.write_text(FULL)
    return path


def wrong(
    text: str, tmp_path: Path, environment: dict[str, str] | None = None
) -> dict[str, str]:
    """Return the problems of a file and an environment, by their place."""
    path = tmp_path / "f.toml"
    path.write_text(text)
    with pytest.raises(InvalidInput) as caught:
        load_config(path, environment)
    return {
        p.where.removeprefix(f"{path}: "): f"{p.given}; {p.allowed}"
        for p in caught.value.problems
    }


def test_defaults_are_safe_and_those_of_a_server() -> None:
    config = load_config()
    assert config == ServiceConfig()
    assert config.listen == "tcp/127.0.0.1:7447"
    assert not config.registration.enabled
    assert not config.allow_insecure
    server = inspect.signature(Server.__init__).parameters
    limits = RequestLimits()
    for name, value in {
        "site": config.site,
        "listen": config.listen,
        "workers": config.workers,
        "queue_size": config.queue.size,
        "queue_bytes": config.queue.bytes,
        "max_bytes": config.limits.max_bytes,
        "max_samples": config.limits.max_samples,
        "max_batch_samples": config.limits.max_batch_samples,
        "max_time": config.limits.max_time,
        "stop_within": config.stop_within,
        "allow_insecure": config.allow_insecure,
    }.items():
        assert server[name].default == value, name
        assert getattr(limits, name, value) == value, name


def test_everything_can_be_said_in_a_file(file: Path) -> None:
    config = load_config(file)
    assert config.site == "hall-3"
    assert config.queue.size == 10
    assert config.limits.max_time == 2.5
    assert config.log.format == "json"
    assert config.security is not None
    assert config.security.planners == ("planner-1", "planner-2")
    assert config.registration.max_vehicles == 7
    assert config.registration.max_memory == 70_000_000


def test_paths_in_a_file_are_relative_to_its_folder(file: Path) -> None:
    config = load_config(file)
    folder = file.parent
    assert config.fleet == (
        # A name without a slash or a dot is one of the catalogue.
        "vehicles",
        "mecanum",
        f"{folder}/more/one.yaml",
        "/abs/two.yaml",
    )
    assert config.security is not None
    assert config.security.ca == folder / "ca.pem"
    assert config.security.key == Path("/etc/server.key")
    assert config.registration.store == folder / "store"


def test_the_environment_overrides_the_file_and_flags_override_both(
    file: Path,
) -> None:
    environment = {
        "OMNIPLAN_SITE": "hall-4",
        "OMNIPLAN_QUEUE_SIZE": "20",
        "OMNIPLAN_LIMITS_MAX_TIME": "3",
        "OMNIPLAN_REGISTRATION_ENABLED": "false",
        "OMNIPLAN_SECURITY_PLANNERS": "a, b,c",
        "OMNIPLAN_FLEET": "mecanum,differential",
        "OMNIPLAN_CACHE": "left/alone",
        "PATH": "left alone",
    }
    flags = {"site": "hall-5", "workers": None, "fleet": ["differential"]}
    config = load_config(file, environment, flags)
    assert config.site == "hall-5"
    assert config.queue.size == 20
    assert config.queue.bytes == 20_000_000
    assert config.limits.max_time == 3.0
    assert not config.registration.enabled
    assert config.security is not None
    assert config.security.planners == ("a", "b", "c")
    assert config.fleet == ("differential",)
    assert config.workers == 4
    assert load_config(file, environment).fleet == ("mecanum", "differential")


def test_every_entry_has_its_own_variable() -> None:
    known = variables()
    assert known["OMNIPLAN_SECURITY_FLEET_MANAGERS"] == "security.fleet_managers"
    assert len(set(known.values())) == len(known)
    in_schema = [
        name if "$ref" not in str(entry) else f"{name}.{inner}"
        for name, entry in service_schema()["properties"].items()
        for inner in (
            service_schema()["$defs"][f"{name.capitalize()}Config"]["properties"]
            if "$ref" in str(entry)
            else [""]
        )
    ]
    assert sorted(in_schema) == sorted(known.values())


def test_all_mistakes_are_reported_with_their_place(tmp_path: Path) -> None:
    text = """
    worker = 3
    site = "a/b"
    listen = "somewhere"
    [queue]
    size = "3"
    [log]
    level = "loud"
    [securty]
    ca = "x"
    [limits]
    max_time = inf
    """
    environment = {
        "OMNIPLAN_WORKERS": "99",
        "OMNIPLAN_LIMITS_MAX_BYTES": "many",
        "OMNIPLAN_QUEUE_LENGTH": "1",
    }
    problems = wrong(text, tmp_path, environment)
    assert set(problems) == {
        "OMNIPLAN_LIMITS_MAX_BYTES",
        "OMNIPLAN_QUEUE_LENGTH",
        "OMNIPLAN_WORKERS",
        "limits.max_time",
        "listen",
        "log.level",
        "queue.size",
        "securty",
        "site",
        "worker",
    }
    assert problems["worker"].startswith("unknown key; allowed are fleet, site")
    assert problems["OMNIPLAN_QUEUE_LENGTH"].startswith("unknown variable; known are")
    assert "OMNIPLAN_QUEUE_SIZE" in problems["OMNIPLAN_QUEUE_LENGTH"]
    assert problems["OMNIPLAN_WORKERS"].startswith("99;")
    assert "'debug'" in problems["log.level"]


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("[registration]\nenabled = true", "registration.store", "missing; a folder"),
        ("[queue]\nbytes = 100", "queue.bytes", "100; at least limits.max_bytes"),
        ("[security]\nca = 'a'", "security.key", "missing; needed"),
        ("fleet = 3", "fleet", "3; "),
        ("fleet = [1]", "fleet", "1; "),
        ("peers = ['x']", "peers", "'x'; tcp/HOST:PORT"),
        ("queue = 3", "queue", "3; "),
        ("workers = 2.5", "workers", "2.5; "),
        ("site = 2026-01-01", "site", "string"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, text: str, place: str, words: str) -> None:
    assert words in wrong(text, tmp_path)[place]


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    path = tmp_path / "f.toml"
    with pytest.raises(InvalidInput, match=r"f\.toml: No such file"):
        load_config(path)
    path.write_bytes(b"\xff")
    with pytest.raises(InvalidInput, match=r"f\.toml: no UTF-8"):
        load_config(path)
    path.write_text("a = \nb = 1")
    with pytest.raises(InvalidInput, match=r"f\.toml: .*line 1.*TOML"):
        load_config(path)


def test_a_flag_is_named_as_it_is_typed() -> None:
    with pytest.raises(InvalidInput, match="--log-level: 'loud'"):
        load_config(flags={"log.level": "loud"})


def test_a_configuration_cannot_be_changed() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        setattr(load_config(), "site", "x")  # noqa: B010


def test_the_schema_describes_every_entry() -> None:
    schema = service_schema()
    assert json.loads(json.dumps(schema)) == schema
    assert schema["additionalProperties"] is False
    for table in [schema, *schema["$defs"].values()]:
        for name, entry in table["properties"].items():
            assert "description" in entry or "$ref" in entry, name


def test_a_server_is_made_of_a_configuration(tmp_path: Path) -> None:
    space = configspace.build_space(
        configspace.load_vehicle("differential"), configspace.Grid(4, 8), cache=False
    )
    config = load_config(flags={"site": "x", "listen": "tcp/127.0.0.1:0"})
    with registry_of(config, [space]) as registry:
        server = server_of(config, registry)
        assert server.site == "x"
        assert server.vehicles == ("differential",)
        assert not registry.takes_registrations
    flags = {"registration.enabled": True, "registration.store": tmp_path / "store"}
    with registry_of(load_config(flags=flags), [space]) as registry:
        assert registry.takes_registrations
