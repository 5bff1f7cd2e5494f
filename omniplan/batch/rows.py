"""The rows of `vehicle_judge` and `body_rows` over several parts at once, in numba.

The formulas are those of `chords`; here they are loops without branches over the lanes
of a scratch array, which the compiler turns into vector code. What they say is held
against `VehicleJudge.utilisation` in the tests.
"""
# mypy: disallow-untyped-decorators = False

from __future__ import annotations

import math
from typing import Any

import numpy as np

from omniplan.batch import beside, rolling, steering
from omniplan.batch.chords import HIGH, LOW, STANDS, body, change, chord, ends, reach
from omniplan.batch.kernel import kernel
from omniplan.batch.kinds import (
    ALONG,
    ANGLE,
    AT,
    BESIDE,
    BESIDE_GROWTH,
    BOUND,
    COMPONENT,
    COMPONENT_GROWTH,
    COUPLING,
    FREE,
    GROWTH,
    KIND,
    LATERAL,
    OFF_LINE,
    OFFSET,
    OWN_RANGE,
    PARALLEL,
    RANGE,
    RATE,
    SHARE,
    SIGN,
    SINGULAR,
    SLIP,
    SPEED,
    STEERING,
    SWING,
    TIPPING,
    YAW,
    ZONE,
)
from omniplan.batch.motions import LANES

__all__ = ["SETTLING", "evaluate"]

Array = Any  # numba infers the types; mypy cannot look into the kernels

OF_BODY = (SLIP, PARALLEL, BESIDE_GROWTH)
"""Kinds of rows that depend on the speed of the body, besides those about the
configuration."""
SETTLING = np.int64(2)
"""How exact angles are: see `evaluate`."""


@kernel()
def _within_free(s: Array) -> None:
    """Take off what is about the configuration, which is free while standing."""
    for k in range(LANES):
        low, high = s[LOW + k], s[HIGH + k]
        stands = s[STANDS + k] > 0.0
        s[LOW + k] = 0.0 if stands else low
        s[HIGH + k] = 0.0 if stands else high


@kernel()
def _gather(s: Array, is_free: float, most: Array, highs: Array) -> None:
    """Keep `HIGH` of every part, and the largest `LOW` and `HIGH` lane by lane.

    What is about the configuration is taken off where the vehicle stands. All in one
    loop: short ones are not made vector code.
    """
    for k in range(LANES):
        stays = (s[STANDS + k] > 0.0) & (is_free > 0.0)
        low, high = s[LOW + k], s[HIGH + k]
        low, high = (0.0 if stays else low), (0.0 if stays else high)
        a, b = most[k], most[LANES + k]
        most[k] = low if low > a else a
        most[LANES + k] = high if high > b else b
        highs[k] = high


@kernel()
def evaluate(
    s: Array, rows: Array, first: int, last: int, vehicle: Array, tolerances: Array,
    exact: int, chosen: Array, most: Array, highs: Array, block: int, blocks: int,
) -> None:  # fmt: skip
    """Write what rows first to last - 1 say of a block to its fields `LOW` and `HIGH`.

    All rows in one function: to hand arrays on takes longer than what is computed.

    Parameters
    ----------
    s : (ROOM,) float
        The enclosures are in its first fields.
    rows : (r, PARAMETERS) float
    first, last : int
    vehicle : (BODY,) float
        K in m, κ_g in 1/m.
    tolerances : (3,) float
        Standstill in m/s, sine of the slip angle, slip speed in m/s.
    exact : {0, 1, SETTLING}
        Whether angles are needed to the last digit: nowhere, everywhere, or only where
        a range may be left.
    chosen : (r,) float
        Which rows are meant by first to last - 1, unless `blocks` is 0.
    most : (r * 2 LANES,) float
        Gets the largest `LOW` and `HIGH` so far of every row, lane by lane.
    highs : (r * blocks * LANES,) float
        Gets `HIGH` of every row and part.
    block, blocks : int
        Which of how many blocks this is; of 0 nothing is kept.
    """
    at_x, at_y = vehicle[0], vehicle[1]
    has_body, has_ends, has_chord = False, False, False
    has_change, has_reach = False, False
    for i in range(first, last):
        r = int(chosen[i]) if blocks > 0 else i
        kind, bound = int(rows[r, KIND]), rows[r, BOUND]
        if not has_body and (rows[r, FREE] > 0.0 or kind in OF_BODY):
            body(s, vehicle[0], vehicle[1], vehicle[2], tolerances[0])
            at_x, at_y = vehicle[0], vehicle[1]
            has_body, has_ends, has_chord = True, True, True
            has_change, has_reach = False, False
        x, y = rows[r, AT], rows[r, AT + 1]
        if x != at_x or y != at_y:
            at_x, at_y = x, y
            has_ends, has_chord, has_change, has_reach = False, False, False, False
        a, b, angle = rows[r, ALONG], rows[r, ALONG + 1], rows[r, ANGLE]
        light = kind in (COMPONENT, COMPONENT_GROWTH, SLIP)
        if not light and not has_chord:
            chord(s, x, y)
            has_ends, has_chord = True, True
        if not has_ends:
            ends(s, x, y)
            has_ends = True
        sized = kind in (GROWTH, TIPPING, BESIDE, BESIDE_GROWTH)
        changes = sized or kind in (RATE, COMPONENT_GROWTH, STEERING)
        changes |= kind == OWN_RANGE or (kind == RANGE and exact > 0)
        if not has_change and changes:
            change(s, x, y)
            has_change = True
        if sized and not has_reach:
            reach(s)
            has_reach = True
        if kind == SINGULAR:
            steering.singular(s)
        elif kind == RANGE:
            if exact == SETTLING:
                steering.open_range(s, rows[r, SIGN], a, b, angle, bound)
            elif exact:
                steering.exact_range(s, rows[r, SIGN], angle, bound, -math.inf)
            else:
                steering.quick_range(s, rows[r, SIGN], a, b, bound)
        elif kind == RATE:
            steering.rate(s, x, y, bound)
        elif kind == SPEED:
            rolling.speed(s, bound)
        elif kind == COMPONENT:
            rolling.component(s, a, b, bound, 0)
        elif kind == SLIP:
            rolling.slip(s, a, b, tolerances[1], tolerances[2])
        elif kind == GROWTH:
            rolling.growth(s, angle, bound)
        elif kind == COMPONENT_GROWTH:
            rolling.component(s, a, b, bound, 1)
        elif kind == YAW:
            rolling.yaw(s, bound)
        elif kind == LATERAL:
            rolling.lateral(s, bound)
        elif kind == TIPPING:
            rolling.tipping(s, a, b, bound)
        elif kind == PARALLEL:
            rolling.parallel(s, vehicle[2], tolerances[1], tolerances[2])
        elif kind == BESIDE:
            steering.rate(s, x, y, 1.0)
            sign = 1.0 if rows[r, SIGN] >= 0.0 else -1.0
            beside.beside(s, rows[r, OFFSET], rows[r, COUPLING], sign, bound)
        elif kind == ZONE:
            steering.zone(s, rows[r], vehicle)
        elif kind == SWING:
            beside.swinging(s, x, y, bound)
        elif kind == BESIDE_GROWTH:
            rolling.growth(s, 0.0, bound)
            sign = 1.0 if rows[r, SIGN] >= 0.0 else -1.0
            beside.beside_growth(
                s, x, y, rows[r, OFFSET], rows[r, COUPLING], sign, bound
            )
        elif kind == OWN_RANGE:
            steering.exact_range(s, 1.0, angle, bound, -math.inf)
        elif kind == STEERING:
            steering.rate(s, x, y, 1.0)
            steering.steering(s, rows[r, OFFSET], bound)
        elif kind == SHARE:
            rolling.driven(s)
        elif kind == OFF_LINE:
            rolling.off_line(s, angle, bound)
        else:
            rolling.backwards(s, a, b, tolerances[0], bound)
        if blocks > 0:
            at, part = 2 * LANES * r, (r * blocks + block) * LANES
            _gather(
                s, rows[r, FREE], most[at : at + 2 * LANES], highs[part : part + LANES]
            )
        elif rows[r, FREE] > 0:
            _within_free(s)
