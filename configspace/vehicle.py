"""What a vehicle file says: wheels, limits, reference point.

Keys are those of the file: SI units, degrees only in keys that end in ``_deg``.
Numbers derived from them (K, κ_g, the axle of a line-mobile vehicle) are computed in
`configspace.undercarriage`; use `load_vehicle` to read a file.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    model_validator,
)
from pydantic_core import PydanticCustomError

from configspace.support import support_edges
from configspace.undercarriage import (
    Mobility,
    WheelPlace,
    impossible_rates,
    mobility_of,
    skid_contacts,
)

__all__ = [
    "Castor",
    "FixedWheel",
    "Guaranteed",
    "Limits",
    "Load",
    "MecanumWheel",
    "OmniWheel",
    "SkidSteer",
    "SteerableWheel",
    "SteeredWheel",
    "Turntable",
    "Vehicle",
    "Wheel",
]

# Generous bounds whose only purpose is to catch millimetres, km/h and radians.
Metres: TypeAlias = Annotated[float, Field(ge=-100, le=100, allow_inf_nan=False)]
Height: TypeAlias = Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)]
Speed: TypeAlias = Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)]
Acceleration: TypeAlias = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Degrees: TypeAlias = Annotated[float, Field(ge=-36000, le=36000, allow_inf_nan=False)]
DegreeRate: TypeAlias = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
RollerDegrees: TypeAlias = Annotated[float, Field(ge=-80, le=80, allow_inf_nan=False)]
Curvature: TypeAlias = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]


class _Model(BaseModel):
    """Frozen, strict, no unknown keys."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False
    )


class _PlacedWheel(_Model):
    id: str = Field(min_length=1, max_length=64, description="unique within a vehicle")
    x: Metres = Field(description="contact point (steering axis), m, forward positive")
    y: Metres = Field(description="m, left positive")

    @property
    def position(self) -> complex:
        """Position in the file's frame as ``x + j y``, m."""
        return complex(self.x, self.y)


class _RollingWheel(_PlacedWheel):
    max_speed: Speed | None = Field(
        None, description="largest rolling speed, m/s; without it the wheel is passive"
    )
    max_acceleration: Acceleration | None = Field(
        None, description="largest change of the rolling speed, m/s²"
    )


class SteerableWheel(_RollingWheel):
    """What steered wheels and turntables share; α is measured from the x axis."""

    steering_range_deg: tuple[Degrees, Degrees] | None = Field(
        None, description="[least, largest] steering angle; without it it turns freely"
    )
    max_steering_rate_deg: DegreeRate | None = Field(None, description="degrees/s")
    max_steering_acceleration_deg: DegreeRate | None = Field(
        None, description="degrees/s²; judged for timed poses, else reports say so"
    )
    steering_coupling: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = Field(
        0.0,
        description="where rolling and steering share their motors: metres of rolling "
        "that one radian of steering costs, |u| + coupling |α̇| ≤ max_speed",
    )

    @model_validator(mode="after")
    def _range_is_ordered(self) -> Self:
        if self.steering_range_deg is not None:
            least, largest = self.steering_range_deg
            if least >= largest:
                raise PydanticCustomError(
                    "steering_range",
                    "steering_range_deg: the first angle must be less than the second",
                )
        return self

    @property
    def steering_range(self) -> tuple[float, float]:
        """Least and largest steering angle, rad; infinite where it turns freely."""
        if self.steering_range_deg is None:
            return (-math.inf, math.inf)
        least, largest = self.steering_range_deg
        return (math.radians(least), math.radians(largest))

    @property
    def offsets(self) -> tuple[float, ...]:
        """Signed lateral offset D of every wheel on the steering axis, m."""
        raise NotImplementedError

    @property
    def standing_steering_rate(self) -> float:
        """Largest |α̇| while the vehicle stands, rad/s; infinite if nothing bounds it.

        Steering rolls a wheel beside its axis and takes its share of coupled motors:
        ``|û| = |u - D (ω + α̇)|`` and ``|û| + coupling |α̇| ≤ max_speed`` leave
        ``(|D| + coupling) |α̇| ≤ max_speed`` at u = ω = 0 (spec/omni-curve §2, §4).
        """
        rate = math.inf
        if self.max_steering_rate_deg is not None:
            rate = math.radians(self.max_steering_rate_deg)
        taken = max(map(abs, self.offsets)) + self.steering_coupling
        if self.max_speed is not None and taken > 0:
            rate = min(rate, self.max_speed / taken)
        return rate


class SteeredWheel(SteerableWheel):
    """A steered standard wheel, on its steering axis or beside it."""

    type: Literal["steered"] = "steered"
    offset: Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)] = Field(
        0.0,
        description="lateral axle offset D, m; positive where the wheel stands left of "
        "the steering axis, seen along its rolling direction",
    )

    @property
    def offsets(self) -> tuple[float, ...]:
        """Signed lateral offset D, m."""
        return (self.offset,)


class Turntable(SteerableWheel):
    """A turntable (Drehschemel) with two wheels on one axle, left and right of it."""

    type: Literal["turntable"] = "turntable"
    track: Annotated[float, Field(gt=0, le=10, allow_inf_nan=False)] = Field(
        description="distance of the two wheels, m"
    )

    @property
    def offsets(self) -> tuple[float, ...]:
        """Signed lateral offsets of the two wheels, m."""
        return (self.track / 2, -self.track / 2)


class FixedWheel(_RollingWheel):
    """A fixed standard wheel; it makes the vehicle line-mobile."""

    type: Literal["fixed"] = "fixed"
    heading_deg: Degrees = Field(0.0, description="rolling direction δ")

    @property
    def heading(self) -> float:
        """Rolling direction δ, rad."""
        return math.radians(self.heading_deg)


class _RollerWheel(_PlacedWheel):
    max_speed: Speed = Field(description="largest rolling speed, m/s")
    max_acceleration: Acceleration | None = Field(None, description="m/s²")
    heading_deg: Degrees = Field(0.0, description="rolling direction δ")

    @property
    def heading(self) -> float:
        """Rolling direction δ, rad."""
        return math.radians(self.heading_deg)


class MecanumWheel(_RollerWheel):
    """A Mecanum wheel: rollers at an angle to the axle."""

    type: Literal["mecanum"] = "mecanum"
    roller_deg: RollerDegrees = Field(
        description="angle γ from the rolling direction to the driven direction; ±45"
    )

    @property
    def roller(self) -> float:
        """Roller angle γ, rad."""
        return math.radians(self.roller_deg)


class OmniWheel(_RollerWheel):
    """An omni wheel: a Mecanum wheel with γ = 0."""

    type: Literal["omni"] = "omni"

    @property
    def roller(self) -> float:
        """Roller angle γ, rad: 0."""
        return 0.0


class Castor(_PlacedWheel):
    """A passive castor: carries load, constrains nothing."""

    type: Literal["castor"] = "castor"


Wheel: TypeAlias = Annotated[
    SteeredWheel | Turntable | FixedWheel | MecanumWheel | OmniWheel | Castor,
    Field(discriminator="type"),
]


class Limits(_Model):
    """Limits of the whole vehicle; a missing limit is no limit."""

    max_speed: Speed | None = Field(None, description="speed of K, m/s")
    max_reverse_speed: Speed | None = Field(
        None, description="speed of K where v_n < 0, m/s; max_speed holds as well"
    )
    max_yaw_rate_deg: DegreeRate | None = Field(None, description="|ω|, degrees/s")
    max_lateral_acceleration: Acceleration | None = Field(
        None, description="centripetal acceleration |v ω|, m/s²"
    )
    lateral_acceleration_at: Literal["reference", "center_of_gravity"] = Field(
        "reference", description="the point whose centripetal acceleration is meant"
    )
    max_acceleration: Acceleration | None = Field(
        None, description="increase of the speed of K, m/s²"
    )
    max_deceleration: Acceleration | None = Field(
        None, description="decrease of the speed of K, m/s²"
    )


Point: TypeAlias = tuple[Metres, Metres]


class Load(_Model):
    """Mass and centre of gravity of vehicle and payload together."""

    mass: Annotated[float, Field(gt=0, le=1e7, allow_inf_nan=False)] | None = Field(
        None, description="kg, for people: it cancels out of tipping"
    )
    center_of_gravity: tuple[Metres, Metres, Height] = Field(
        description="(x, y, z), m, in the file's frame; z above the ground"
    )
    tipping_factor: Annotated[float, Field(ge=1, le=100, allow_inf_nan=False)] = Field(
        1.0, description="safety factor on the accelerations"
    )


class Guaranteed(_Model):
    """Change rates that every permitted configuration must offer."""

    kappa_rate: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = Field(
        0.0, description="|dκ_n/dt|, 1/s"
    )
    beta_rate_deg: Annotated[float, Field(ge=0, le=1e5, allow_inf_nan=False)] = Field(
        0.0, description="|dβ/dt|, degrees/s"
    )


class SkidSteer(_Model):
    """A skid-steered vehicle, modelled as a differential drive."""

    effective_track: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] = Field(
        description="track of the differential drive that turns alike, m"
    )


class Vehicle(_Model):
    """One vehicle type. Build one with `load_vehicle`."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9._-]{0,63}$")
    description: str = Field("", max_length=2000)
    source: str = Field("", max_length=2000, description="where the numbers come from")
    reference_point: Point | None = Field(
        None, description="K in the file's frame, m; default the origin"
    )
    kappa_g: Curvature | None = Field(
        None, description="boundary curvature, 1/m; default as in section 3.2"
    )
    footprint: tuple[Point, ...] = Field((), description="polygon, m, in file's frame")
    wheels: tuple[Wheel, ...] = Field(min_length=1, max_length=1000)
    limits: Limits = Limits()
    load: Load | None = None
    max_payload: Annotated[float, Field(gt=0, le=1e7, allow_inf_nan=False)] | None = (
        Field(None, description="largest payload, kg; bounds no motion, for choosing")
    )
    guaranteed: Guaranteed | None = None
    skid_steer: SkidSteer | None = Field(
        None, description="all fixed wheels form two sides that skid as they turn"
    )
    synchro: bool = Field(
        False, description="synchro drive: all steered wheels always point alike"
    )

    @model_validator(mode="after")
    def _is_consistent(self) -> Vehicle:
        conflicts = list(self._conflicts())
        if conflicts:
            text = "; ".join(f"{where}: {given}" for where, given, _ in conflicts)
            raise PydanticCustomError(
                "conflicts", "{text}", {"text": text, "conflicts": conflicts}
            )
        return self

    def _conflicts(self) -> Iterator[tuple[str, str, str]]:
        """Yield what does not fit together: where, what is given, what is allowed."""
        more = "see docs/vehicle-file.md"
        repeated = [i for i, n in Counter(w.id for w in self.wheels).items() if n > 1]
        if repeated:
            yield "wheels", f"id {', '.join(repeated)} is used more than once", more
        at_load = self.limits.lateral_acceleration_at == "center_of_gravity"
        if at_load and self.load is None:
            text = "center_of_gravity, but no load says where it is"
            yield "limits.lateral_acceleration_at", text, more
        if 0 < len(self.footprint) < 3:
            yield "footprint", "a polygon needs at least three points", more
        if self.guaranteed is not None:
            yield from impossible_rates(
                [(w.id, w.type) for w in self.wheels],
                self.synchro,
                self.guaranteed.kappa_rate,
                self.guaranteed.beta_rate_deg,
            )
        try:
            # Both raise ValueError where the wheels or the load do not fit.
            mobility, _ = self.mobility, self.tipping_edges
        except ValueError as error:
            where, _, given = str(error).partition(": ")
            yield where, given, more
            return
        if self.kappa_g is None and self._farthest(mobility) == 0:
            text = (
                "all wheels stand at the reference point, so the boundary curvature "
                "must be given (1/m)"
            )
            yield "kappa_g", text, more

    @cached_property
    def tipping_edges(self) -> tuple[tuple[complex, float], ...]:
        """Edges the load may tip over: inward normals, distances of its centre, m.

        A wheel beside its steering axis stands somewhere around it, so its largest
        offset is taken off every distance. Empty where no load is given.
        """
        if self.load is None:
            return ()
        x, y, _ = self.load.center_of_gravity
        offsets = [abs(w.offset) for w in self.wheels if isinstance(w, SteeredWheel)]
        places = [wheel.position for wheel in self.wheels]
        return tuple(support_edges(places, complex(x, y), max(offsets, default=0.0)))

    @cached_property
    def contacts(self) -> tuple[complex, ...]:
        """Where each wheel meets the ground or steers, in the file's frame, m.

        Those of a skid-steered vehicle are the two wheels of the differential drive
        that stands for it.
        """
        if self.skid_steer is None:
            return tuple(wheel.position for wheel in self.wheels)
        return skid_contacts(self._places(), self.skid_steer.effective_track)

    def _places(self) -> list[WheelPlace]:
        return [
            WheelPlace(
                id=w.id,
                type=w.type,
                position=w.position,
                heading=getattr(w, "heading", 0.0),
                driven=getattr(w, "max_speed", None) is not None,
            )
            for w in self.wheels
        ]

    @cached_property
    def mobility(self) -> Mobility:
        """Reference point K and which β or κ_n the vehicle is bound to."""
        x, y = self.reference_point or (0.0, 0.0)
        places = [
            replace(place, position=contact)
            for place, contact in zip(self._places(), self.contacts, strict=True)
        ]
        return mobility_of(places, complex(x, y), synchro=self.synchro)

    @property
    def reference(self) -> complex:
        """Reference point K in the file's frame, m."""
        return self.mobility.reference

    @cached_property
    def boundary_curvature(self) -> float:
        """Boundary curvature κ_g, 1/m, as given or by section 3.2 of the paper."""
        return self.kappa_g or 1.0 / self._farthest(self.mobility)

    def _farthest(self, mobility: Mobility) -> float:
        """Return |w_i*| of the wheel with the largest |w_i| / u_lim,i."""
        rolling = [w for w in self.wheels if not isinstance(w, Castor)]
        arms = [
            abs(contact - mobility.reference)
            for wheel, contact in zip(self.wheels, self.contacts, strict=True)
            if not isinstance(wheel, Castor)
        ]
        speeds = [w.max_speed for w in rolling]
        by_speed = not any(isinstance(w, MecanumWheel | OmniWheel) for w in rolling)
        weights = [
            arm / (u if by_speed and u is not None else 1.0)
            if u is not None or not by_speed or not any(speeds)
            else 0.0
            for arm, u in zip(arms, speeds, strict=True)
        ]
        if not any(weights):  # all that are driven stand at K
            weights = arms
        return arms[max(range(len(arms)), key=weights.__getitem__)]
