"""What stands in the hall, and whether a vehicle hits it.

Geometry is that of shapely (GEOS); shapely is imported in this package only.
"""

from omniplan.obstacles.checker import CollisionChecker
from omniplan.obstacles.hit import Hit
from omniplan.obstacles.obstacles import Obstacles
from omniplan.obstacles.sweep import Swept

__all__ = ["CollisionChecker", "Hit", "Obstacles", "Swept"]
