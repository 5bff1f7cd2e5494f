"""The configuration of a server: a TOML file, the environment, the command line.

Each overrides the one before. Unknown keys are errors, also in the environment, and all
mistakes are reported at once, each with the place where it was made.
"""

from __future__ import annotations

import copy
import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeAlias, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from configspace.errors import InvalidInput, Problem
from services.operating.logs import LogFormat, LogLevel
from services.protocol.endpoint import DEFAULT_ENDPOINT, Endpoint
from services.protocol.keys import checked_chunk
from services.registering.registry import MAX_MEMORY

__all__ = [
    "LimitsConfig",
    "LogConfig",
    "QueueConfig",
    "RegistrationConfig",
    "SecurityConfig",
    "ServiceConfig",
    "load_config",
    "service_schema",
    "variables",
]

PREFIX = "OMNIPLAN_"
OTHERS = ("OMNIPLAN_CACHE", "OMNIPLAN_CONFIG")
"""Variables of ours that are no entry of the configuration."""
MIB = 2**20

Data: TypeAlias = dict[str, Any]
Names: TypeAlias = Annotated[tuple[str, ...], Field(strict=False)]


def _site(text: str) -> str:
    return _worded(lambda: checked_chunk("site", text))


def _endpoint(text: str) -> str:
    return _worded(lambda: str(Endpoint.parse("endpoint", text)))


def _worded(check: Any) -> str:
    """Run a check; an error of ours becomes one of pydantic, without its place."""
    try:
        return str(check())
    except InvalidInput as error:
        allowed = error.problems[0].allowed
        raise PydanticCustomError(
            "not_allowed", "{allowed}", {"allowed": allowed}
        ) from (error)


FilePath: TypeAlias = Annotated[Path, Field(strict=False)]
Address: TypeAlias = Annotated[str, AfterValidator(_endpoint)]


class _Table(BaseModel):
    """Frozen, strict, no unknown keys."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )


class QueueConfig(_Table):
    """How much may wait."""

    size: Annotated[int, Field(ge=1)] = 64
    """Requests that may wait, half of them large; more are answered ``busy``."""
    bytes: Annotated[int, Field(ge=1)] = 64 * MIB
    """Large requests that wait or are worked at, together."""


class LimitsConfig(_Table):
    """What one request may be."""

    max_bytes: Annotated[int, Field(ge=1, le=32 * MIB)] = 8 * MIB
    """Largest payload."""
    max_samples: Annotated[int, Field(ge=1)] = 100_000
    """Samples of all trajectories together."""
    max_batch_samples: Annotated[int, Field(ge=1)] = 1_000_000
    """Likewise in a request of arrays."""
    max_time: Annotated[float, Field(gt=0)] = 60.0
    """Time for a request from its arrival, s."""


class LogConfig(_Table):
    """The log, on standard error."""

    level: LogLevel = "info"
    """What is less is left out; requests are ``info``."""
    format: LogFormat = "text"
    """``text`` for people, ``json`` for programs."""


class SecurityConfig(_Table):
    """Certificates, and who may do what by the common names of theirs."""

    ca: FilePath
    """PEM file of the authority whose certificates are trusted."""
    certificate: FilePath
    """PEM file of the server's certificate."""
    key: FilePath
    """PEM file of its key."""
    planners: Names = ()
    """Who may ask."""
    fleet_managers: Names = ()
    """Who may ask and register vehicles."""
    vehicles: Names = ()
    """Who may say that they are online, under their own names."""
    servers: Names = ()
    """Other servers of the site."""


class RegistrationConfig(_Table):
    """Vehicles that clients register."""

    enabled: bool = False
    """Whether they may."""
    store: FilePath | None = None
    """Folder that keeps them; needed where registration is enabled."""
    max_vehicles: Annotated[int, Field(ge=1)] = 1000
    """How many, at most."""
    max_memory: Annotated[int, Field(ge=1)] = MAX_MEMORY
    """What their data sheets may take together, bytes."""

    @model_validator(mode="after")
    def _has_store(self) -> RegistrationConfig:
        if self.enabled and self.store is None:
            allowed = "a folder, since registration is enabled"
            raise _at("store", "missing", allowed)
        return self


def _listed(value: object) -> object:
    """Take one text for a list of one."""
    return (value,) if isinstance(value, str) else value


class ServiceConfig(_Table):
    """All that ``omniplan serve`` can be told; every entry has a safe default."""

    fleet: Annotated[Names | None, BeforeValidator(_listed)] = None
    """Folders, files or catalogue names of the vehicles; default the catalogue."""
    site: Annotated[str, AfterValidator(_site)] = "default"
    """Chunk of the keys that tells places apart."""
    listen: Address = DEFAULT_ENDPOINT
    """``tcp/HOST:PORT``, or ``tls/HOST:PORT`` with security."""
    allow_insecure: bool = False
    """Listen without security also where other machines reach it."""
    peers: Annotated[tuple[Address, ...], Field(strict=False)] = ()
    """Where the other servers of the site listen."""
    workers: Annotated[int, Field(ge=1, le=64)] = 3
    """Threads that answer; of two or more, one is kept for small requests."""
    stop_within: Annotated[float, Field(ge=0)] = 10.0
    """Time for requests to finish when the server is stopped, s."""
    queue: QueueConfig = QueueConfig()
    limits: LimitsConfig = LimitsConfig()
    log: LogConfig = LogConfig()
    security: SecurityConfig | None = None
    """Without it everybody who reaches the address may ask."""
    registration: RegistrationConfig = RegistrationConfig()

    @model_validator(mode="after")
    def _fits(self) -> ServiceConfig:
        if self.queue.bytes < self.limits.max_bytes:
            allowed = f"at least limits.max_bytes, {self.limits.max_bytes}"
            raise _at("queue.bytes", str(self.queue.bytes), allowed)
        return self


def load_config(
    path: str | Path | None = None,
    environment: Mapping[str, str] | None = None,
    flags: Mapping[str, object] | None = None,
) -> ServiceConfig:
    """Return the configuration of a server.

    Parameters
    ----------
    path : path, optional
        TOML file; paths within it are relative to its folder.
    environment : mapping of str to str, optional
        Variables such as ``OMNIPLAN_QUEUE_SIZE``, see `variables`; several names or
        addresses are separated by commas. Other variables are left alone, unknown ones
        that begin with ``OMNIPLAN_`` are errors.
    flags : mapping of str to object, optional
        Values by their place, such as ``queue.size``; None is left out.

    Raises
    ------
    InvalidInput
        With every mistake and where it was made.
    """
    data: Data = {}
    sources: dict[str, str] = {}
    problems: list[Problem] = []
    if path is not None:
        data = _rooted(_read(Path(path)), Path(path).absolute().parent)
        sources = {place: f"{path}: {place}" for place, _ in _leaves(data)}
    known = variables()
    for name, text in sorted((environment or {}).items()):
        if name in known:
            _set(data, known[name], _parsed(known[name], text))
            sources[known[name]] = name
        elif name.startswith(PREFIX) and name not in OTHERS:
            allowed = f"known are {', '.join([*known, *OTHERS])}"
            problems.append(Problem(name, "unknown variable", allowed))
    for place, value in (flags or {}).items():
        if value is not None:
            _set(data, place, value)
            sources[place] = f"--{place.replace('.', '-').replace('_', '-')}"
    try:
        config = ServiceConfig.model_validate(data)
    except ValidationError as error:
        problems += [_problem(item, sources) for item in error.errors()]
    if problems:
        raise InvalidInput(problems, "configuration of the server")
    return config


def variables() -> dict[str, str]:
    """Return the variables of the environment, each with the place it stands for.

    ``OMNIPLAN_QUEUE_SIZE`` is ``queue.size``.
    """
    return {PREFIX + p.replace(".", "_").upper(): p for p in _places(ServiceConfig)}


def service_schema() -> Data:
    """Return the JSON Schema of the configuration."""
    schema = ServiceConfig.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _read(path: Path) -> Data:
    try:
        return tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        reason = error.strerror or str(error)
        problem = Problem(str(path), reason, "a TOML file that can be read")
    except UnicodeDecodeError:
        problem = Problem(str(path), "no UTF-8", "a TOML file that can be read")
    except tomllib.TOMLDecodeError as error:
        problem = Problem(str(path), str(error), "TOML is needed")
    raise InvalidInput(problem, "configuration of the server")


def _rooted(data: Data, folder: Path) -> Data:
    """Return what a file says, with its relative paths seen from its folder."""
    rooted = copy.deepcopy(data)
    for table, key in (
        ("security", "ca"),
        ("security", "certificate"),
        ("security", "key"),
        ("registration", "store"),
    ):
        within = rooted.get(table)
        if isinstance(within, dict) and isinstance(within.get(key), str):
            within[key] = str(folder / within[key])
    fleet = _listed(rooted.get("fleet"))
    if isinstance(fleet, list | tuple):
        rooted["fleet"] = [_entry(item, folder) for item in fleet]
    return rooted


def _entry(item: object, folder: Path) -> object:
    """Return an entry of a fleet; a catalogue name has neither a slash nor a dot."""
    if isinstance(item, str) and item and ("/" in item or "." in item):
        return str(folder / item)
    return item


def _places(model: type[BaseModel], before: str = "") -> Iterator[str]:
    """Yield the places of all entries: ``site``, ``queue.size``."""
    for name, field in model.model_fields.items():
        table = _table_of(field.annotation)
        if table is None:
            yield before + name
        else:
            yield from _places(table, f"{before}{name}.")


def _table_of(annotation: Any) -> type[_Table] | None:
    for kind in (annotation, *get_args(annotation)):
        if isinstance(kind, type) and issubclass(kind, _Table):
            return kind
    return None


def _annotation(place: str) -> Any:
    """Return the type of an entry."""
    model: type[BaseModel] = ServiceConfig
    *tables, last = place.split(".")
    for name in tables:
        table = _table_of(model.model_fields[name].annotation)
        assert table is not None  # `_places` has gone the same way
        model = table
    return model.model_fields[last].annotation


def _parsed(place: str, text: str) -> object:
    """Return what a variable says; what is no number stays text and is refused."""
    annotation = _annotation(place)
    if "tuple[" in str(annotation):
        return [part.strip() for part in text.split(",") if part.strip()]
    if annotation in (int, float, bool):
        try:
            return json.loads(text)
        except ValueError:
            return text
    return text


def _set(data: Data, place: str, value: object) -> None:
    *tables, last = place.split(".")
    for name in tables:
        within = data.setdefault(name, {})
        if not isinstance(within, dict):  # refused by the model
            return
        data = within
    data[last] = value


def _leaves(data: Data, before: str = "") -> Iterator[tuple[str, object]]:
    for name, value in data.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{before}{name}.")
        else:
            yield before + name, value


def _at(place: str, given: str, allowed: str) -> PydanticCustomError:
    """Return an error of a whole table that names the place within it."""
    context = {"place": place, "given": given, "allowed": allowed}
    return PydanticCustomError("not_allowed", "{allowed}", context)


def _problem(error: ErrorDetails, sources: Mapping[str, str]) -> Problem:
    context = error.get("ctx", {})
    parts = [str(part) for part in error["loc"]]
    parts += [str(context["place"])] if "place" in context else []
    place = ".".join(parts)
    given_at = _source(place, sources)
    if error["type"] == "extra_forbidden":
        return Problem(given_at, "unknown key", f"allowed are {_siblings(parts)}")
    if error["type"] == "missing":
        return Problem(given_at, "missing", "needed")
    given = str(context.get("given", repr(error["input"])[:60]))
    message = error["msg"]
    return Problem(given_at, given, message[:1].lower() + message[1:])


def _source(place: str, sources: Mapping[str, str]) -> str:
    """Return where a value was given: itself, its list, or something in its table."""
    if place in sources:
        return sources[place]
    above = place.rpartition(".")[0]
    if above in sources:
        return sources[above]
    for known, source in sources.items():
        if known.startswith(f"{place}.") and source.endswith(known):
            return source.removesuffix(known) + place
    return place


def _siblings(parts: list[str]) -> str:
    model: type[BaseModel] = ServiceConfig
    for name in parts[:-1]:
        field = model.model_fields.get(name)
        table = None if field is None else _table_of(field.annotation)
        model = table or model
    return ", ".join(model.model_fields)
