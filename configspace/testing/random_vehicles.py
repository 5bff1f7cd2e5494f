"""Random vehicles of every kind, with every kind of limit."""

from __future__ import annotations

from typing import Any

import numpy as np

from configspace.testing.kinds import VEHICLE_KINDS, VehicleKind
from configspace.testing.undercarriages import (
    WHEELS,
    random_point,
    random_speed,
)
from configspace.vehicle import Vehicle
from configspace.vehicle_io import vehicle_from_data

__all__ = ["random_vehicle"]

_STANDS_ON: dict[VehicleKind, tuple[VehicleKind, ...]] = {
    "loaded": (*VEHICLE_KINDS, "offset", "turntable", "skid"),
    "guaranteed": ("steered", "mixed", "ackermann", "offset", "turntable"),
}


def random_vehicle(
    rng: np.random.Generator, kind: VehicleKind | None = None
) -> Vehicle:
    """Return a random vehicle whose speed is bounded everywhere.

    Parameters
    ----------
    rng : numpy.random.Generator
    kind : str, optional
        One of `ALL_KINDS`; default any of `VEHICLE_KINDS`.

    Examples
    --------
    >>> random_vehicle(np.random.default_rng(0), "mecanum").wheels[0].type
    'mecanum'
    """
    kind = kind or VEHICLE_KINDS[int(rng.integers(len(VEHICLE_KINDS)))]
    base: VehicleKind = kind
    if kind in _STANDS_ON:
        base = _STANDS_ON[kind][int(rng.integers(len(_STANDS_ON[kind])))]
    wheels, always_bounded = WHEELS[base](rng)
    for i in range(int(rng.integers(3))):
        x, y = random_point(rng)
        wheels.append({"id": f"castor-{i}", "type": "castor", "x": x, "y": y})
    order = rng.permutation(len(wheels))
    data: dict[str, Any] = {
        "name": f"random-{kind}",
        "wheels": [wheels[i] for i in order],
        "limits": _random_limits(rng, always_bounded),
    }
    if rng.random() < 0.4:
        data["reference_point"] = random_point(rng, 0.3)
    if rng.random() < 0.2:
        data["kappa_g"] = float(rng.uniform(0.5, 8.0))
    if base == "skid":
        data["skid_steer"] = {"effective_track": float(rng.uniform(0.3, 2.0))}
    if base == "synchro":
        data["synchro"] = True
    if kind == "loaded":
        _add_load(rng, data)
    if kind == "guaranteed" or (kind == "loaded" and rng.random() < 0.3):
        _add_guarantee(rng, data)
    _add_steering_accelerations(rng.spawn(1)[0], data)
    return vehicle_from_data(data)


def _add_steering_accelerations(rng: np.random.Generator, data: dict[str, Any]) -> None:
    """Limit how fast some vehicles may change their steering rates."""
    share = 0.7 if rng.random() < 0.25 else 0.0
    for wheel in data["wheels"]:
        if wheel["type"] in {"steered", "turntable"} and rng.random() < share:
            swing = float(10.0 ** rng.uniform(1.5, 3.5))
            wheel["max_steering_acceleration_deg"] = swing


def _add_load(rng: np.random.Generator, data: dict[str, Any]) -> None:
    """Put a load on the vehicle, with castors where the wheels do not carry it."""
    for wheel in data["wheels"]:
        wheel.pop("offset", None)  # it shrinks the polygon; `rigid_body` knows nothing
    for i in range(int(rng.integers(3, 5)) if len(data["wheels"]) < 3 else 1):
        x, y = random_point(rng)
        castor = {"id": f"carrier-{i}", "type": "castor", "x": x, "y": y}
        data["wheels"].append(castor)
    while True:
        contacts = np.array([(w["x"], w["y"]) for w in data["wheels"]])
        spread = np.linalg.svd(contacts - contacts.mean(axis=0), compute_uv=False)
        if spread[-1] > 0.1:
            break
        x, y = random_point(rng)
        name = f"carrier-{len(contacts)}"
        data["wheels"].append({"id": name, "type": "castor", "x": x, "y": y})
    share = 0.95 * rng.dirichlet(np.ones(len(contacts))) + 0.05 / len(contacts)
    x, y = (float(value) for value in share @ contacts)
    height = float(10.0 ** rng.uniform(-1.5, 0.5))
    data["load"] = {"center_of_gravity": [x, y, height]}
    if rng.random() < 0.5:
        data["load"]["tipping_factor"] = float(rng.uniform(1, 3))
    if rng.random() < 0.5:
        data["limits"]["max_lateral_acceleration"] = float(rng.uniform(0.2, 5.0))
        data["limits"]["lateral_acceleration_at"] = "center_of_gravity"


def _add_guarantee(rng: np.random.Generator, data: dict[str, Any]) -> None:
    """Guarantee change rates, and give the wheels that steer a rate of their own."""
    for wheel in data["wheels"]:
        if wheel["type"] in {"steered", "turntable"} and rng.random() < 0.9:
            wheel["max_steering_rate_deg"] = float(rng.uniform(40, 300))
    rates = {
        "kappa_rate": float(10.0 ** rng.uniform(-2, 0.3)),
        "beta_rate_deg": float(10.0 ** rng.uniform(-1, 1.7)),
    }
    if any(wheel["type"] == "fixed" for wheel in data["wheels"]):
        del rates["beta_rate_deg"]  # β is constant
    if data.get("synchro"):
        del rates["kappa_rate"]  # κ_n is 0
    for key in rng.choice(
        list(rates), int(rng.integers(1, len(rates) + 1)), replace=False
    ):
        data.setdefault("guaranteed", {})[str(key)] = rates[str(key)]


def _random_limits(rng: np.random.Generator, optional: bool) -> dict[str, float]:
    """Return limits; speed and yaw rate at least, unless they are `optional`."""

    def chosen(share: float) -> bool:
        return bool(rng.random() < share)

    limits: dict[str, float] = {}
    if not optional or chosen(0.4):
        limits["max_speed"] = random_speed(rng)
    if chosen(0.3):
        limits["max_reverse_speed"] = random_speed(rng)
    if not optional or chosen(0.3):
        limits["max_yaw_rate_deg"] = float(rng.uniform(20, 300))
    if chosen(0.3):
        limits["max_lateral_acceleration"] = float(rng.uniform(0.2, 5.0))
    return limits
