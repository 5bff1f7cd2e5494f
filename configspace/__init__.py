"""What one vehicle can do: its permissible configuration space.

The public names are here; everything is described in SI units and radians, with x
forward, y left and counter-clockwise angles positive.
"""

import logging

from configspace.build import build_space
from configspace.classification import Classification, classify
from configspace.clearance import ClearanceMap, clearance_map, path_clearance
from configspace.constraints import steering_residual
from configspace.drives import DriveContact, DriveSpeeds, drive_contacts, drive_speeds
from configspace.equivalence import cross_pole, equivalent, representations
from configspace.errors import (
    CacheError,
    InvalidInput,
    InvalidVehicle,
    OmniplanError,
    Problem,
)
from configspace.exact import exact_reason, exact_v_max
from configspace.forward import (
    twist_from_drives,
    twist_from_pair,
    twist_from_wheels,
)
from configspace.gradients import wheel_gradients
from configspace.grid import Grid
from configspace.kinematics import wheel_directions, wheel_states
from configspace.limits import Reason
from configspace.manoeuvrability import (
    ManoeuvrabilityIndex,
    dexterity,
    manoeuvrability_index,
)
from configspace.omni_curve import from_twist, to_twist
from configspace.rates import RatePolytope, rate_polytope
from configspace.rotation_centre import SingularPoint, icr, icr_of, singular_points
from configspace.space import PermissibleSpace
from configspace.spherical import (
    angular_distance,
    energy_length,
    from_spherical,
    sphere_point,
    to_spherical,
)
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
    "Classification",
    "ClearanceMap",
    "DriveContact",
    "DriveSpeeds",
    "Grid",
    "InvalidInput",
    "InvalidVehicle",
    "ManoeuvrabilityIndex",
    "OmniplanError",
    "PermissibleSpace",
    "Problem",
    "RatePolytope",
    "Reason",
    "SingularPoint",
    "Vehicle",
    "angular_distance",
    "build_space",
    "catalog",
    "classify",
    "clearance_map",
    "cross_pole",
    "dexterity",
    "drive_contacts",
    "drive_speeds",
    "dump_space",
    "energy_length",
    "equivalent",
    "exact_reason",
    "exact_v_max",
    "from_spherical",
    "from_twist",
    "icr",
    "icr_of",
    "load_space",
    "load_vehicle",
    "manoeuvrability_index",
    "parse_space",
    "parse_vehicle",
    "path_clearance",
    "rate_polytope",
    "representations",
    "singular_points",
    "sphere_point",
    "steering_residual",
    "to_spherical",
    "to_twist",
    "twist_from_drives",
    "twist_from_pair",
    "twist_from_wheels",
    "vehicle_from_data",
    "vehicle_schema",
    "wheel_directions",
    "wheel_gradients",
    "wheel_states",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())
