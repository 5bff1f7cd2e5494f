"""What one vehicle can do: its permissible configuration space.

The public names are here; everything is described in SI units and radians, with x
forward, y left and counter-clockwise angles positive.
"""

import logging

from configspace.build import build_space
from configspace.errors import (
    CacheError,
    InvalidInput,
    InvalidVehicle,
    OmniplanError,
    Problem,
)
from configspace.exact import exact_reason, exact_v_max
from configspace.grid import Grid
from configspace.kinematics import wheel_directions, wheel_states
from configspace.limits import Reason
from configspace.omni_curve import from_twist, to_twist
from configspace.space import PermissibleSpace
from configspace.storage import dump_space, load_space, parse_space
from configspace.vehicle import Vehicle
from configspace.vehicle_io import (
    catalog,
    load_vehicle,
    parse_vehicle,
    vehicle_from_data,
    vehicle_schema,
)

__all__ = [
    "CacheError",
    "Grid",
    "InvalidInput",
    "InvalidVehicle",
    "OmniplanError",
    "PermissibleSpace",
    "Problem",
    "Reason",
    "Vehicle",
    "build_space",
    "catalog",
    "dump_space",
    "exact_reason",
    "exact_v_max",
    "from_twist",
    "load_space",
    "load_vehicle",
    "parse_space",
    "parse_vehicle",
    "to_twist",
    "vehicle_from_data",
    "vehicle_schema",
    "wheel_directions",
    "wheel_states",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())
