"""Random vehicles and configurations, and what every space must keep: for tests.

Import this module in tests only: the strategies need hypothesis, which is imported
when one is asked for. Everything random comes from a passed `numpy.random.Generator`.
"""

from configspace.testing.bodies import RigidBody, rigid_body
from configspace.testing.kinds import ALL_KINDS, VEHICLE_KINDS, VehicleKind
from configspace.testing.places import random_configurations
from configspace.testing.random_vehicles import random_vehicle
from configspace.testing.soundness import assert_sound
from configspace.testing.strategies import configurations, grids, vehicles

__all__ = [
    "ALL_KINDS",
    "VEHICLE_KINDS",
    "RigidBody",
    "VehicleKind",
    "assert_sound",
    "configurations",
    "grids",
    "random_configurations",
    "random_vehicle",
    "rigid_body",
    "vehicles",
]
