"""Kinds of rows and the columns of their table."""

from __future__ import annotations

SINGULAR = 0
"""The velocity of a steered wheel must not vanish."""
RANGE = 1
"""Its direction."""
RATE = 2
"""How fast it turns."""
SPEED = 3
"""The size of a velocity."""
COMPONENT = 4
"""One component of a velocity."""
SLIP = 5
"""One component against what the tolerances allow."""
GROWTH = 6
"""The change of a size: growth, decline or both."""
COMPONENT_GROWTH = 7
"""The change of a component."""
YAW = 8
"""The yaw rate."""
LATERAL = 9
"""The centripetal acceleration."""
TIPPING = 10
"""The acceleration towards an edge."""
PARALLEL = 11
"""The yaw rate against what the tolerances allow."""
BACKWARDS = 12
"""The size of a velocity while one component is negative."""
BESIDE = 13
"""What a wheel rolls beside its axis, or shares with steering."""
ZONE = 14
"""The steering rates that guaranteed rates ask for."""
SWING = 15
"""How fast the steering rate changes."""

BESIDE_GROWTH = 20
"""The change of what a wheel rolls beside its axis, or shares with steering."""

# Kinds of rows of a vehicle's own Omni-Curve-Parameters:
OWN_RANGE = 16
"""The direction of a velocity, to the last digit."""
STEERING = 17
"""What steering takes of a rolling speed, besides the share of driving."""
SHARE = 18
"""|v_n|."""
OFF_LINE = 19
"""How far β is from a constant."""

# Columns of the table of rows: kind; bound; 1 or -1 for a row of one representation
# only, else 0; whether it is about the configuration; a point (2), m; a direction (2);
# an angle, rad, or the side of a growth.
KIND, BOUND, SIGN, FREE, AT, ALONG, ANGLE = 0, 1, 2, 3, 4, 6, 8
# Of `BESIDE` and `BESIDE_GROWTH` instead of the direction: the offset and the share of
# steering, m; of `STEERING` both together.
OFFSET, COUPLING = 6, 7
# Of `ZONE` instead of the direction and the angle: the lever (2); the guaranteed rates
# per largest steering rate; what they ask for at a pole; whether β is bound to a line.
ZONE_ARM, ZONE_KAPPA, ZONE_BETA, ZONE_POLE, ZONE_LINE = 6, 8, 9, 10, 11
PARAMETERS = 12

RANGE_ERROR = 1e-7
"""How far the quick arc cosine may be off, rad."""
