"""What the parts of a vehicle file share, and those that are no wheels.

Keys are those of the file: SI units, degrees only in keys that end in ``_deg``.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "Acceleration",
    "Curvature",
    "DegreeRate",
    "Degrees",
    "FileModel",
    "Guaranteed",
    "Limits",
    "Load",
    "Metres",
    "Point",
    "RollerDegrees",
    "SkidSteer",
    "Speed",
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
Point: TypeAlias = tuple[Metres, Metres]


class FileModel(BaseModel):
    """Frozen, strict, no unknown keys."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False
    )


class Limits(FileModel):
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


class Load(FileModel):
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


class Guaranteed(FileModel):
    """Change rates that every permitted configuration must offer."""

    kappa_rate: Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)] = Field(
        0.0, description="|dκ_n/dt|, 1/s"
    )
    beta_rate_deg: Annotated[float, Field(ge=0, le=1e5, allow_inf_nan=False)] = Field(
        0.0, description="|dβ/dt|, degrees/s"
    )


class SkidSteer(FileModel):
    """A skid-steered vehicle, modelled as a differential drive."""

    effective_track: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] = Field(
        description="track of the differential drive that turns alike, m"
    )
