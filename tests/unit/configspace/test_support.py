import math

import numpy as np
import pytest

import configspace
from configspace.support import support_edges

SQUARE = [1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j]


def test_edges_of_a_square_point_inwards() -> None:
    edges = dict(support_edges(SQUARE, 0.25 + 0j))
    assert len(edges) == 4
    for normal, distance in edges.items():
        assert abs(normal) == pytest.approx(1)
        assert distance == pytest.approx(1 + (0.25 * normal.conjugate()).real)


def test_contacts_within_the_polygon_and_repeated_ones_change_nothing() -> None:
    more = [*SQUARE, *SQUARE, 0.3 + 0.2j, 1 + 0j, 0j]
    one, other = (
        sorted(support_edges(contacts, 0.1j), key=lambda edge: np.angle(edge[0]))
        for contacts in (SQUARE, more)
    )
    np.testing.assert_allclose(one, other, atol=1e-15)


def test_distances_are_exact_near_an_edge() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        a, b, c = (complex(*rng.uniform(-1, 1, 2)) for _ in range(3))
        along = (b - a) / abs(b - a)
        inwards = 1j * along if ((c - a) / along).imag > 0 else -1j * along
        height = ((c - a) * inwards.conjugate()).real
        if height < 0.05:
            continue
        point = (a + b) / 2 + 1e-4 * (c - (a + b) / 2)
        distance = min(d for _, d in support_edges([a, b, c], point))
        expected = ((point - a) * inwards.conjugate()).real
        assert distance == pytest.approx(expected, abs=2e-15)


@pytest.mark.parametrize(
    "contacts",
    [[0j], [0j, 1 + 0j], [0j, 1 + 0j, 2 + 0j], [1j, 1j, 1j], [0j, 0.1 + 0.1j, 1 + 1j]],
)
def test_contacts_on_one_line_carry_nothing(contacts: list[complex]) -> None:
    with pytest.raises(ValueError, match="one line"):
        list(support_edges(contacts, 0j))


@pytest.mark.parametrize("point", [1 + 0j, 1 + 1j, 1.0001 + 0j, -5 + 0j])
def test_the_point_must_be_inside(point: complex) -> None:
    with pytest.raises(ValueError, match="not inside"):
        list(support_edges(SQUARE, point))


def test_a_polygon_far_from_the_origin_is_the_same() -> None:
    far = 80 - 60j
    near = dict(support_edges(SQUARE, 0.2j))
    away = dict(support_edges([w + far for w in SQUARE], far + 0.2j))
    for normal, distance in away.items():
        match = min(near, key=lambda n: abs(n - normal))
        assert abs(match - normal) < 1e-13
        assert distance == pytest.approx(near[match], abs=1e-12)
    assert math.isclose(sum(near.values()), sum(away.values()), abs_tol=1e-12)


def test_a_wheel_beside_its_axis_makes_every_edge_nearer() -> None:
    def vehicle(offset: float, y: float) -> configspace.Vehicle:
        wheels = [
            {"id": f"{a}{b}", "type": "steered", "x": a, "y": b, "max_speed": 1}
            | {"offset": offset}
            for a in (0.5, -0.5)
            for b in (0.5, -0.5)
        ]
        load = {"center_of_gravity": [0, y, 0.5]}
        data = {"name": "v", "wheels": wheels, "load": load}
        return configspace.vehicle_from_data(data)

    plain, beside = vehicle(0.0, 0.0), vehicle(-0.1, 0.0)
    assert sorted(d for _, d in plain.tipping_edges) == pytest.approx([0.5] * 4)
    assert sorted(d for _, d in beside.tipping_edges) == pytest.approx([0.4] * 4)
    with pytest.raises(configspace.InvalidVehicle, match="centre of gravity"):
        vehicle(0.3, -0.3)
