"""What one vehicle can do: its permissible configuration space.

The public names are here; everything is described in SI units and radians, with x
forward, y left and counter-clockwise angles positive.
"""

import logging

from configspace.build import build_space
from configspace.classification import Classification, classify
from configspace.constraints import steering_residual
from configspace.equivalence import cross_pole, equivalent, representations
from configspace.errors import (
    CacheError,
    InvalidInput,
    InvalidVehicle,
    OmniplanError,
    Problem,
)
from configspace.exact import exact_reason, exact_v_max
from configspace.forward import twist_from_pair, twist_from_wheels
from configspace.gradients import wheel_gradients
from configspace.grid import Grid
from configspace.kinematics import wheel_directions, wheel_states
from configspace.limits import Reason
from configspace.omni_curve import from_twist, to_twist
from configspace.rates import RatePolytope, rate_polytope
from configspace.rotation_centre import SingularPoint, icr, icr_of, singular_points
from configspace.space import PermissibleSpace
from configspace.spherical import from_spherical, to_spherical
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
    "Grid",
    "InvalidInput",
    "InvalidVehicle",
    "OmniplanError",
    "PermissibleSpace",
    "Problem",
    "RatePolytope",
    "Reason",
    "SingularPoint",
    "Vehicle",
    "build_space",
    "catalog",
    "classify",
    "cross_pole",
    "dump_space",
    "equivalent",
    "exact_reason",
    "exact_v_max",
    "from_spherical",
    "from_twist",
    "icr",
    "icr_of",
    "load_space",
    "load_vehicle",
    "parse_space",
    "parse_vehicle",
    "rate_polytope",
    "representations",
    "singular_points",
    "steering_residual",
    "to_spherical",
    "to_twist",
    "twist_from_pair",
    "twist_from_wheels",
    "vehicle_from_data",
    "vehicle_schema",
    "wheel_directions",
    "wheel_gradients",
    "wheel_states",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())
