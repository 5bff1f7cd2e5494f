"""Reading vehicle files and the catalogue."""

from __future__ import annotations

import difflib
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from configspace.errors import InvalidVehicle, Problem
from configspace.files import reason_of
from configspace.undercarriage import impossible_rates
from configspace.vehicle import (
    Castor,
    FixedWheel,
    Guaranteed,
    Limits,
    Load,
    MecanumWheel,
    OmniWheel,
    SkidSteer,
    SteeredWheel,
    Turntable,
    Vehicle,
)

__all__ = [
    "catalog",
    "load_vehicle",
    "parse_vehicle",
    "parse_yaml",
    "vehicle_schema",
]

_WHEELS: dict[str, type[BaseModel]] = {
    "steered": SteeredWheel,
    "turntable": Turntable,
    "fixed": FixedWheel,
    "mecanum": MecanumWheel,
    "omni": OmniWheel,
    "castor": Castor,
}
_PARTS: dict[str, type[BaseModel]] = {
    "limits": Limits,
    "load": Load,
    "guaranteed": Guaranteed,
    "skid_steer": SkidSteer,
}


def catalog() -> tuple[str, ...]:
    """Return the names of the ready vehicles, sorted.

    Examples
    --------
    >>> "ift-four-steered" in catalog()
    True
    """
    folder = resources.files("configspace") / "catalog"
    return tuple(
        sorted(
            entry.name.removesuffix(".yaml")
            for entry in folder.iterdir()
            if entry.name.endswith(".yaml")
        )
    )


def load_vehicle(name: str | Path) -> Vehicle:
    """Read a vehicle.

    Parameters
    ----------
    name : str or Path
        A name of the `catalog`, or the path of a YAML or JSON file.

    Raises
    ------
    InvalidVehicle
        If there is no such vehicle or the file has mistakes; all are reported at once.

    Examples
    --------
    >>> round(load_vehicle("ift-four-steered").boundary_curvature, 4)
    4.1013
    """
    if isinstance(name, str) and name in catalog():
        text = (resources.files("configspace") / "catalog" / f"{name}.yaml").read_text(
            "utf-8"
        )
        return parse_vehicle(text, subject=f"catalogue vehicle {name}")
    path = Path(name)
    try:
        text = path.read_text("utf-8")
    except FileNotFoundError as error:
        near = difflib.get_close_matches(str(name), catalog(), n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        known = ", ".join(catalog())
        allowed = f"a path or a catalogue name ({known}){hint}"
        problem = Problem("vehicle", f"no file {name!s}", allowed)
        raise InvalidVehicle(problem) from error
    except (
        OSError,
        ValueError,
    ) as error:  # ValueError: not UTF-8, or a NUL in the name
        raise InvalidVehicle(
            Problem(
                "vehicle", f"{name!s}: {reason_of(error)}", "a readable UTF-8 text file"
            )
        ) from error
    return parse_vehicle(text, subject=f"vehicle file {path}")


def parse_vehicle(text: str, subject: str = "vehicle") -> Vehicle:
    """Return the vehicle described by YAML or JSON text.

    Raises
    ------
    InvalidVehicle
        With every mistake of the text, each with its path.
    """
    return vehicle_from_data(parse_yaml(text, subject), subject)


def vehicle_from_data(data: object, subject: str = "vehicle") -> Vehicle:
    """Return the vehicle described by plain data, as a message or file holds it."""
    if not isinstance(data, dict):
        given = "nothing" if data is None else _shorten(data)
        problem = Problem("the text", given, "a mapping with name and wheels is needed")
        raise InvalidVehicle(problem, subject)
    try:
        text = json.dumps(data, default=str)
    except (TypeError, ValueError, RecursionError) as error:
        problem = Problem("the text", str(error), "plain nested data is needed")
        raise InvalidVehicle(problem, subject) from error
    try:
        # JSON mode: lists are tuples, everything else stays strict.
        return Vehicle.model_validate_json(text)
    except ValidationError as error:
        raise InvalidVehicle(_problems(error.errors(), data), subject) from error


def vehicle_schema() -> dict[str, Any]:
    """Return the JSON Schema of vehicle files."""
    return Vehicle.model_json_schema()


class _Loader(yaml.SafeLoader):
    """YAML 1.1 without silently repeated keys and without aliases.

    A few hundred bytes of nested aliases stand for gigabytes.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Return the next node, or raise on an alias."""
        if self.check_event(yaml.AliasEvent):
            event: Any = self.peek_event()  # type: ignore[no-untyped-call]
            raise yaml.composer.ComposerError(
                None, None, f"alias *{event.anchor} is not supported", event.start_mark
            )
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Any:
        """Return the mapping, or raise on a repeated key."""
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, str) and key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {key!r} stands twice", key_node.start_mark
                )
            if isinstance(key, str):
                seen.add(key)
        return super().construct_mapping(node, deep)


def parse_yaml(text: str, subject: str) -> object:
    """Return the plain data of YAML or JSON text.

    Raises
    ------
    InvalidVehicle
        With the place of the first mistake.
    """
    try:
        return yaml.load(text, Loader=_Loader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}, column {mark.column + 1}" if mark else "text"
        reason = getattr(error, "problem", None) or str(error)[:200]
        problem = Problem(where, str(reason), "YAML or JSON is needed")
        raise InvalidVehicle(problem, subject) from error


# YAML 1.1 takes 1e-1, as JSON writers put it, for a text.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\.[0-9]+([eE][-+]?[0-9]+)?|[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+)$"),
    list("-+.0123456789"),
)


def _problems(errors: list[ErrorDetails], data: dict[Any, Any]) -> Iterator[Problem]:
    """Word all errors, and the conflicts that pydantic looks for only at the end."""
    wheels = data.get("wheels")
    for error in errors:
        if error["type"] == "conflicts":
            yield from (Problem(*each) for each in error["ctx"]["conflicts"])
        # Wheels with mistakes are dropped, which pydantic reports as too few.
        elif not (
            error["type"] == "too_short" and error["loc"] == ("wheels",) and wheels
        ):
            yield _problem(error)
    if any(error["type"] == "conflicts" for error in errors):
        return
    footprint = data.get("footprint")
    if isinstance(footprint, list) and 0 < len(footprint) < 3:
        given = f"{len(footprint)} points"
        yield Problem("footprint", given, "a polygon needs at least three points")
    if isinstance(wheels, list):
        told = {e["loc"][1] for e in errors if e["type"] == "steering_range"}
        yield from _turned_ranges(wheels, told)
        yield from _conflicts([w for w in wheels if isinstance(w, dict)], data)


def _turned_ranges(wheels: list[Any], told: set[int | str]) -> Iterator[Problem]:
    """Yield steering ranges that pydantic leaves out where a wheel has other mistakes.

    What it has told itself is not told again.
    """
    for index, wheel in enumerate(wheels):
        limits = wheel.get("steering_range_deg") if isinstance(wheel, dict) else None
        if index in told or not isinstance(limits, list) or len(limits) != 2:
            continue
        if all(type(x) in (int, float) for x in limits) and limits[0] >= limits[1]:
            where = f"wheels[{index}].steering_range_deg"
            allowed = "the first angle must be less than the second"
            yield Problem(where, _shorten(limits), allowed)


def _conflicts(wheels: list[dict[Any, Any]], data: dict[Any, Any]) -> Iterator[Problem]:
    """Yield the conflicts that can be told while other values are mistaken."""
    ids = [w["id"] for w in wheels if isinstance(w.get("id"), str)]
    repeated = ", ".join(name for name, count in Counter(ids).items() if count > 1)
    if repeated:
        yield Problem("wheels", f"id {repeated}", "is used more than once")
    rates = data.get("guaranteed")
    if isinstance(rates, dict):
        kappa_rate, beta_rate = (
            value if isinstance(value, int | float) else 0.0
            for value in (rates.get("kappa_rate"), rates.get("beta_rate_deg"))
        )
        places = [(str(w.get("id", "?")), str(w.get("type"))) for w in wheels]
        is_synchro = data.get("synchro") is True
        for each in impossible_rates(places, is_synchro, kappa_rate, beta_rate):
            yield Problem(*each)


def _without_tags(location: tuple[int | str, ...]) -> Iterator[int | str]:
    """Yield a location without the wheel type that pydantic puts after the index."""
    for i, part in enumerate(location):
        if not (i == 2 and location[0] == "wheels" and part in _WHEELS):
            yield part


def _problem(error: ErrorDetails) -> Problem:
    """Word one pydantic error: where, given, allowed."""
    location = _without_tags(error["loc"])
    where = "".join(
        f"[{part}]" if isinstance(part, int) else f".{part}" for part in location
    ).lstrip(".")
    given = error.get("input")
    shown = "missing" if error["type"] == "missing" else _shorten(given)
    match error["type"]:
        case "extra_forbidden":
            return Problem(where, "unknown key", _suggestion(error))
        case "missing":
            return Problem(where, "missing", "must be given")
        case "too_short" if where == "wheels":
            return Problem(where, "none", "at least one is needed")
        case "union_tag_invalid":
            kind = given.get("type") if isinstance(given, dict) else given
            allowed = f"one of {', '.join(_WHEELS)}"
            return Problem(f"{where}.type", _shorten(kind), allowed)
        case "union_tag_not_found":
            allowed = f"must be given: one of {', '.join(_WHEELS)}"
            return Problem(f"{where}.type", "missing", allowed)
        case "steering_range":
            head, _, rest = error["msg"].partition(": ")
            prefix = f"{where}." if where else ""
            return Problem(prefix + head, rest, "see docs/vehicle-file.md")
        case _:
            return Problem(where or "vehicle", shown, _lower_first(error["msg"]))


def _lower_first(text: str) -> str:
    return text[:1].lower() + text[1:]


def _shorten(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _suggestion(error: ErrorDetails) -> str:
    allowed = list(_allowed_keys(error["loc"]))
    unknown = str(error["loc"][-1])
    close = difflib.get_close_matches(unknown, allowed, n=1, cutoff=0.6)
    hint = f"did you mean {close[0]}? " if close else ""
    return f"{hint}allowed are {', '.join(allowed)}"


def _allowed_keys(location: tuple[int | str, ...]) -> Iterator[str]:
    model: type[BaseModel] = Vehicle
    for part in location[:-1]:
        model = _WHEELS.get(str(part), _PARTS.get(str(part), model))
    fields: Mapping[str, object] = model.model_fields
    return iter(fields)
