"""The support polygon: what a vehicle stands on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

__all__ = ["support_edges"]


def support_edges(
    contacts: Sequence[complex], point: complex, reach: float = 0.0
) -> Iterator[tuple[complex, float]]:
    """Yield the edges of the convex hull of the contacts.

    Parameters
    ----------
    contacts : sequence of complex, m
        Where the wheels stand, ``x + j y``.
    point : complex, m
        The point whose distances are asked for, such as the centre of gravity.
    reach : float, m, ≥ 0
        How far a wheel may stand from its contact; every edge is that much nearer.

    Yields
    ------
    normal : complex
        Unit vector to the inside.
    distance : float, m
        Of the point from the edge, positive inside.

    Raises
    ------
    ValueError
        If the contacts do not span an area or the point is not inside.
    """
    # Seen from the point, so that small distances keep their digits.
    corners = np.array([((w - point).real, (w - point).imag) for w in contacts])
    try:
        hull = ConvexHull(corners)
    except (QhullError, ValueError) as error:
        raise ValueError(
            "load: the wheels stand on one line, so nothing keeps the load from "
            "tipping; all wheels that carry, castors too, must be given"
        ) from error
    # Qhull writes outward normals: n x + e <= 0 inside. Facets may repeat.
    for nx, ny, e in np.unique(hull.equations, axis=0):
        distance = -e - reach
        if distance <= 0:
            raise ValueError(
                "load: the centre of gravity is not inside the polygon of the wheel "
                "contacts, so the vehicle tips where it stands"
            )
        yield complex(-nx, -ny), float(distance)
