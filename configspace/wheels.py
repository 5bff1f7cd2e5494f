"""The kinds of wheels that a vehicle file may hold."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from configspace.vehicle_parts import (
    Acceleration,
    DegreeRate,
    Degrees,
    FileModel,
    Metres,
    RollerDegrees,
    Speed,
)

__all__ = [
    "Castor",
    "FixedWheel",
    "MecanumWheel",
    "OmniWheel",
    "SteerableWheel",
    "SteeredWheel",
    "Turntable",
    "Wheel",
]


class _PlacedWheel(FileModel):
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
