"""What a vehicle file says: wheels, limits, reference point.

Keys are those of the file: SI units, degrees only in keys that end in ``_deg``.
Numbers derived from them (K, κ_g, the axle of a line-mobile vehicle) are computed in
`configspace.undercarriage`; use `load_vehicle` to read a file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Annotated

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from configspace.support import support_edges
from configspace.undercarriage import (
    Mobility,
    WheelPlace,
    impossible_rates,
    mobility_of,
    skid_contacts,
)
from configspace.vehicle_parts import (
    Curvature,
    FileModel,
    Guaranteed,
    Limits,
    Load,
    Point,
    SkidSteer,
)
from configspace.wheels import (
    Castor,
    FixedWheel,
    MecanumWheel,
    OmniWheel,
    SteerableWheel,
    SteeredWheel,
    Turntable,
    Wheel,
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


class Vehicle(FileModel):
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
