"""Facts about a vehicle's space, for people."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from rich.table import Table

from configspace import PermissibleSpace
from configspace.kernels import BLOCKED, FREE

__all__ = ["inspect_space", "inspection_table"]


def inspect_space(space: PermissibleSpace) -> dict[str, Any]:
    """Return key figures of a space as plain data.

    Parameters
    ----------
    space : PermissibleSpace

    Returns
    -------
    facts : dict
        ``mobility``, ``kappa_g`` (1/m), ``reference`` (m), ``permitted_share`` (of the
        cells; mixed ones not counted), ``mixed_share``, ``speeds`` (m/s) for straight
        ahead, backwards, sideways and turning on the spot (there ω in rad/s), and
        ``smallest_radius`` (m) of K driving forwards with β as straight ahead.
    """
    state = space.tables.state
    line = space.line_beta
    ahead = line if line is not None else 0.0
    kappa = np.linspace(0, 2, 2001)
    radii = []
    for side in (1, -1):
        permitted = np.flatnonzero(space.v_max(side * kappa, ahead) > 0)
        sharpest = kappa[permitted[-1]] if permitted.size else 0.0
        radii.append(_radius(float(sharpest), space.kappa_g))
    spin = float(space.v_max(2.0, 0.0)) * space.kappa_g
    return {
        "name": space.name,
        "mobility": "all over the plane" if line is None else "along a line",
        "wheels": len(space.header.wheel_ids),
        "kappa_g": space.kappa_g,
        "reference": list(space.header.reference),
        "line_beta": line,
        "permitted_share": float((state == FREE).mean()),
        "blocked_share": float((state == BLOCKED).mean()),
        "speed_ahead": float(space.v_max(0.0, ahead)),
        "speed_backwards": float(space.v_max(0.0, ahead, reverse=True)),
        "speed_sideways": float(space.v_max(0.0, ahead + math.pi / 2)),
        "yaw_rate_on_the_spot": spin,
        "smallest_radius_left": radii[0],
        "smallest_radius_right": radii[1],
    }


def _radius(kappa_n: float, kappa_g: float) -> float | None:
    """Return the radius of K at a nominal curvature, m; None for straight on."""
    if kappa_n == 0:
        return None
    return 1 / (kappa_n * kappa_g) if kappa_n < 1 else (2 - kappa_n) / kappa_g


def inspection_table(name: str, facts: dict[str, Any]) -> Table:
    """Return the facts as a table.

    Parameters
    ----------
    name : str
    facts : dict
        Of `inspect_space`.
    """

    def metres(radius: float | None) -> str:
        return "only straight on" if radius is None else f"{radius:.3f} m"

    table = Table(title=name, show_header=False, title_justify="left")
    x, y = facts["reference"]
    for label, text in (
        ("moves", facts["mobility"]),
        ("wheels", str(facts["wheels"])),
        ("boundary curvature κ_g", f"{facts['kappa_g']:.4f} 1/m"),
        ("reference point K", f"({x:.3f}, {y:.3f}) m"),
        ("configurations permitted", f"{facts['permitted_share']:.2%}"),
        ("configurations blocked", f"{facts['blocked_share']:.2%}"),
        ("v_max straight ahead", f"{facts['speed_ahead']:.3f} m/s"),
        ("v_max straight back", f"{facts['speed_backwards']:.3f} m/s"),
        ("v_max sideways", f"{facts['speed_sideways']:.3f} m/s"),
        (
            "yaw rate on the spot",
            f"{math.degrees(facts['yaw_rate_on_the_spot']):.1f} °/s",
        ),
        ("smallest radius left", metres(facts["smallest_radius_left"])),
        ("smallest radius right", metres(facts["smallest_radius_right"])),
    ):
        table.add_row(label, text)
    return table
