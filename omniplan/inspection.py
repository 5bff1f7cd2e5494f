"""Facts about a vehicle's space, for people."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from configspace import (
    PermissibleSpace,
    classify,
    manoeuvrability_index,
    singular_points,
)
from configspace.kernels import BLOCKED, MIXED
from configspace.topology import summary

__all__ = ["inspect_space", "inspection_table"]


def inspect_space(space: PermissibleSpace) -> dict[str, Any]:
    """Return key figures of a space as plain data.

    Parameters
    ----------
    space : PermissibleSpace

    Returns
    -------
    facts : dict
        ``mobility``; with a known vehicle ``class`` (δ_m, δ_s, δ_M) and its name,
        ``icr`` (how the centre of rotation may move) and ``singular_points``;
        ``kappa_g`` (1/m), ``reference`` (m); shares of the configurations that are
        permitted, blocked, mixed and of certain components; ``manoeuvrability``: the
        bounds of `manoeuvrability_index` and the speed they refer to (m/s); v_max (m/s)
        straight ahead, backwards and sideways, ω on the spot (rad/s), and the smallest
        radii of K (m) to the left and right with β as straight ahead, None for straight
        on only.
    """
    ahead = space.line_beta or 0.0
    hangs = summary(space)
    index = manoeuvrability_index(space)
    facts: dict[str, Any] = {
        "name": space.name,
        "mobility": _mobility(space),
        "wheels": len(space.header.wheel_ids),
        "kappa_g": space.kappa_g,
        "reference": list(space.header.reference),
        "line_beta": space.line_beta,
        "permitted_share": sum(hangs.shares),
        "blocked_share": float((space.tables.state == BLOCKED).mean()),
        "mixed_share": float((space.tables.state == MIXED).mean()),
        "components": hangs.n_certain,
        "unreachable_share": hangs.unreachable,
        "manoeuvrability": asdict(index),
        "speed_ahead": float(space.v_max(0.0, ahead)),
        "speed_backwards": float(space.v_max(0.0, ahead, reverse=True)),
        "speed_sideways": float(space.v_max(0.0, ahead + math.pi / 2)),
        "yaw_rate_on_the_spot": float(space.v_max(2.0, 0.0)) * space.kappa_g,
        "smallest_radius_left": _smallest_radius(space, ahead, 1),
        "smallest_radius_right": _smallest_radius(space, ahead, -1),
    }
    if space.vehicle is not None:
        kind = classify(space.vehicle)
        facts["class"] = [kind.delta_m, kind.delta_s, kind.delta_M]
        facts["class_name"], facts["icr"] = kind.name, kind.rule
        facts["singular_points"] = [
            {
                "wheel": space.header.wheel_ids[point.wheel],
                "kappa_n": point.kappa_n,
                "beta": point.beta,
            }
            for point in singular_points(space.vehicle)
        ]
    return facts


def _mobility(space: PermissibleSpace) -> str:
    if space.is_translating:
        return "in every direction, without turning"
    return "all over the plane" if space.line_beta is None else "along a line"


def _smallest_radius(space: PermissibleSpace, beta: float, side: int) -> float | None:
    """Return the smallest radius of K on the way from straight ahead, m."""
    kappa = np.linspace(0, 2, 2001)
    blocked = np.flatnonzero(space.v_max(side * kappa, beta) == 0)
    last = int(blocked[0]) - 1 if blocked.size else kappa.size - 1
    if last <= 0:
        return None
    kappa_n = float(kappa[last])
    if kappa_n < 1:
        return 1 / (kappa_n * space.kappa_g)
    return (2 - kappa_n) / space.kappa_g


def inspection_table(name: str, facts: dict[str, Any]) -> Table:
    """Return the facts as a table.

    Parameters
    ----------
    name : str
    facts : dict
        Of `inspect_space`.
    """

    def metres(radius: float | None) -> str:
        return "straight on only" if radius is None else f"{radius:.3f} m"

    x, y = facts["reference"]
    lines = [("moves", facts["mobility"]), ("wheels", str(facts["wheels"]))]
    if "class" in facts:
        degrees = ", ".join(map(str, facts["class"]))
        lines += [
            ("class (δ_m, δ_s, δ_M)", f"({degrees}), {facts['class_name']}"),
            ("centre of rotation", facts["icr"]),
        ]
    lines += [
        ("boundary curvature κ_g", f"{facts['kappa_g']:.4f} 1/m"),
        ("reference point K", f"({x:.3f}, {y:.3f}) m"),
        ("configurations permitted", f"{facts['permitted_share']:.2%}"),
        ("… in components", f"{facts['components']}"),
        ("… not connected with straight on", f"{facts['unreachable_share']:.2%}"),
        ("configurations blocked", f"{facts['blocked_share']:.2%}"),
        ("… in cells that a border cuts", f"{facts['mixed_share']:.2%}"),
        ("manoeuvrability index", _index_text(facts)),
        ("v_max straight ahead", f"{facts['speed_ahead']:.3f} m/s"),
        ("v_max straight back", f"{facts['speed_backwards']:.3f} m/s"),
        ("v_max sideways", f"{facts['speed_sideways']:.3f} m/s"),
        (
            "yaw rate on the spot",
            f"{math.degrees(facts['yaw_rate_on_the_spot']):.1f} °/s",
        ),
        ("smallest radius left", metres(facts["smallest_radius_left"])),
        ("smallest radius right", metres(facts["smallest_radius_right"])),
    ]
    if facts.get("singular_points"):
        lines.append(("singular points", _singular_text(facts["singular_points"])))
    table = Table(title=name, show_header=False, title_justify="left")
    for label, text in lines:
        table.add_row(label, text)
    return table


def _index_text(facts: dict[str, Any]) -> str:
    """Return both shares, from below, and what they are shares of."""
    index = facts["manoeuvrability"]
    if index["dimension"] == 2:
        of = "all motions"
    elif facts["line_beta"] is None:
        of = "the motions without turning"
    else:
        of = "the motions along its line"
    return (
        f"{index['share']:.2%} of {of}\n"
        f"{index['speed_share']:.2%} weighted by speed, {index['v_ref']:.3f} m/s is 1"
    )


def _singular_text(points: list[dict[str, Any]]) -> str:
    """Return the first singular points as lines."""
    shown = []
    for point in points[:8]:
        beta = point["beta"]
        side = "any β" if beta is None else f"β = {math.degrees(beta):+.1f}°"
        shown.append(f"{point['wheel']}: κ_n = {point['kappa_n']:+.3f}, {side}")
    if len(points) > len(shown):
        shown.append(f"and {len(points) - len(shown)} more")
    return "\n".join(shown)
