"""Reeds-Shepp words: they lead to the goal, and the shortest is OMPL's."""

from __future__ import annotations

import math

import hypothesis.strategies as st
import numpy as np
from hypothesis import given

from omniplan.planning.moves import Move
from omniplan.planning.reeds_shepp import words
from omniplan.sampling.ompl_bindings import base, bounds_of

PLACES = st.floats(-6, 6)
HEADINGS = st.floats(-math.pi, math.pi)


@given(PLACES, PLACES, HEADINGS)
def test_every_word_leads_to_the_goal(x: float, y: float, phi: float) -> None:
    turns, lengths = words(x, y, phi)
    assert len(turns) > 0
    for turn, length in zip(turns, lengths, strict=True):
        pose = np.zeros(3)
        for side, size in zip(turn.tolist(), length.tolist(), strict=True):
            pose = Move.along(pose, (size, 0.0, side * size)).goal
        np.testing.assert_allclose(pose[:2], [x, y], atol=1e-6)
        assert math.cos(pose[2] - phi) > 1 - 1e-12


def test_the_shortest_word_is_as_long_as_that_of_ompl() -> None:
    space = base.ReedsSheppStateSpace(1.0)
    space.setBounds(bounds_of((-20.0, -20.0, 20.0, 20.0)))
    start, goal = space.allocState(), space.allocState()
    start.setXY(0.0, 0.0)
    start.setYaw(0.0)
    random = np.random.default_rng(1)
    for _ in range(2000):
        x, y = (random.normal(size=2) * random.choice([0.3, 2.0, 6.0])).tolist()
        phi = float(random.uniform(-math.pi, math.pi))
        goal.setXY(x, y)
        goal.setYaw(phi)
        length = float(np.abs(words(x, y, phi)[1][0]).sum())
        assert abs(length - space.distance(start, goal)) < 1e-9


def test_words_come_in_order_of_length() -> None:
    _, lengths = words(0.5, -0.7, 2.0)
    assert (np.diff(np.abs(lengths).sum(axis=1)) >= 0).all()
