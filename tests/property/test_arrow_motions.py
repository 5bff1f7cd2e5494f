"""Trajectories and twists through Arrow and back: nothing is lost, nothing is added."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import configspace
from configspace import InvalidInput, Vehicle
from omniplan import InvalidTrajectory, Trajectory
from omniplan.trajectory import Form
from services.protocol.arrow import read_table, write_table
from services.protocol.arrow_motions import (
    TWIST,
    table_of_trajectories,
    table_of_twists,
    trajectories_in,
    twists_in,
)

VEHICLE = configspace.load_vehicle("ift-four-steered")
NAMES = st.text(
    st.characters(codec="utf-8").filter(str.isprintable), min_size=1, max_size=20
).filter(lambda name: not name.startswith("#"))
FORMS: list[Form] = ["poses", "twists", "omni_curve"]


@st.composite
def motions(draw: st.DrawFn, name: str, form: Form) -> Trajectory:
    n = draw(st.integers(2, 6))
    steps = draw(st.lists(st.floats(1e-3, 10.0), min_size=n, max_size=n))
    t = np.cumsum(steps)
    values = st.floats(-1.0, 1.0)
    samples = draw(arrays.arrays(np.float64, (n, 3), elements=values))
    if form == "omni_curve":
        # v_n keeps its sign, so that it need not be 0 in between.
        kappa_n, beta, v_n = samples[:, 0], samples[:, 1], abs(samples[:, 2])
        return Trajectory.from_omni_curve(t, kappa_n, beta, v_n, VEHICLE, name=name)
    point = draw(st.sampled_from([(0.0, 0.0), (0.25, -0.5)]))
    if form == "twists":
        return Trajectory.from_twists(t, samples, name=name, reference_point=point)
    samples[:, 2] += draw(st.floats(-20.0, 20.0))
    samples[:, 2] = np.where(
        abs(np.diff(samples[:, 2], prepend=samples[0, 2])) < math.pi / 2,
        samples[:, 2],
        samples[0, 2],
    )
    step = np.abs(np.diff(samples[:, 2]))
    if step.size and step.max() > math.pi / 2:
        samples[:, 2] = samples[0, 2]
    return Trajectory.from_poses(t, samples, name=name, reference_point=point)


@st.composite
def batches(draw: st.DrawFn) -> list[Trajectory]:
    form = draw(st.sampled_from(FORMS))
    names = draw(st.lists(NAMES, min_size=1, max_size=5, unique=True))
    return [draw(motions(name, form)) for name in names]


def through_arrow(table: pa.Table) -> pa.Table:
    return read_table(write_table(table, b"{}"), table.num_rows)


def equal(one: Trajectory, other: Trajectory, vehicle: Vehicle | None) -> bool:
    return (
        (one.name, one.form) == (other.name, other.form)
        and one.reference_point == other.reference_point
        and np.array_equal(one.t, other.t)
        and np.array_equal(one.samples, other.samples)
        and other.vehicle == vehicle
    )


@given(batches())
def test_trajectories_come_back_equal_to_the_last_digit(
    batch: list[Trajectory],
) -> None:
    vehicle = VEHICLE if batch[0].form == "omni_curve" else None
    table = through_arrow(table_of_trajectories(batch))
    back = list(trajectories_in(table, vehicle))
    assert len(back) == len(batch)
    assert all(equal(a, b, vehicle) for a, b in zip(batch, back, strict=True))


@given(batches(), st.randoms(use_true_random=False))
def test_rows_may_be_cut_into_pieces_and_names_may_be_plain(
    batch: list[Trajectory], random: object
) -> None:
    vehicle = VEHICLE if batch[0].form == "omni_curve" else None
    table = table_of_trajectories(batch)
    plain = table.set_column(0, "trajectory", table["trajectory"].cast(pa.string()))
    pieces = [plain.slice(i, 1) for i in range(plain.num_rows)]
    for written in (plain, pa.concat_tables(pieces)):
        back = list(trajectories_in(through_arrow(written), vehicle))
        assert all(equal(a, b, vehicle) for a, b in zip(batch, back, strict=True))


@given(
    arrays.arrays(
        st.sampled_from([np.float32, np.float64]),
        st.tuples(st.integers(0, 20), st.just(3)),
        elements=st.floats(-1e3, 1e3, width=32),
    )
)
def test_twists_come_back_equal_in_their_precision(
    twists: npt.NDArray[np.float32],
) -> None:
    back = twists_in(through_arrow(table_of_twists(twists)))
    assert back.dtype == twists.dtype
    np.testing.assert_array_equal(back, twists)


def table(**columns: object) -> pa.Table:
    return pa.table(columns)


POSES = {"t": [0.0, 1.0], "x": [0.0, 0.1], "y": [0.0, 0.0], "theta": [0.0, 0.0]}


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({**POSES, "v": [0, 0]}, "unknown column 'v'"),
        ({**POSES, "t": [0.0, None]}, "row 1, t: no value"),
        ({**POSES, "t": ["a", "b"]}, "column t: string; numbers"),
        ({**POSES, "t": [0.0, 0.0]}, "rows 0 to 1.*row 1, t"),
        ({**POSES, "x": [0.0, math.nan]}, "row 1, x: nan"),
        ({**POSES, "trajectory": ["a", "b"]}, "row 0.*1 sample"),
        ({**POSES, "trajectory": ["a", None]}, "row 1, trajectory: no value"),
        ({**POSES, "trajectory": [1, 2]}, "column trajectory: int64; texts"),
        ({**POSES, "trajectory": ["#", "#"]}, "name: '#'"),
        ({key: np.zeros(0) for key in POSES}, "no rows"),
        ({key: POSES[key] for key in "xy"} | {"theta": [0.0, 0.0]}, "no times"),
        ({"t": [0.0, 1.0], "kappa_n": [0.0, 0.0], "beta": [0, 0], "v_n": [0, 0]},
         "of no vehicle"),
    ],
)  # fmt: skip
def test_tables_that_are_no_trajectories_are_refused_with_their_place(
    columns: dict[str, object], words: str
) -> None:
    with pytest.raises(InvalidInput, match=words):
        list(trajectories_in(table(**columns), None))


def test_a_name_that_is_null_in_the_dictionary_is_refused() -> None:
    names = pa.DictionaryArray.from_arrays(pa.array([0, 0]), pa.array([None], "string"))
    with pytest.raises(InvalidInput, match="trajectory"):
        list(trajectories_in(table(**POSES, trajectory=names), None))


def test_a_long_name_is_not_repeated_for_every_row() -> None:
    long = "x" * (1 << 20)
    n = 10_000
    owner = pa.DictionaryArray.from_arrays(np.zeros(n, np.int32), pa.array([long]))
    columns = {key: np.arange(n, dtype=np.float64) for key in POSES}
    before = pa.total_allocated_bytes()
    with pytest.raises(InvalidTrajectory, match="1 to 200 characters"):
        list(trajectories_in(table(**columns, trajectory=owner), None))
    assert pa.total_allocated_bytes() - before < 8 * len(long)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"vx": [0.0], "vy": [0.0]}, "columns vx, vy; vx, vy, omega"),
        ({"vx": [0.0], "vy": [0.0], "omega": [math.inf]}, r"twists\[0\], omega: inf"),
        ({"vx": [0.0], "vy": [0.0], "omega": ["a"]}, "column omega: string"),
        ({"vx": [0.0], "vy": [None], "omega": [0.0]}, "row 0, vy|column vy: null"),
    ],
)
def test_tables_that_are_no_twists_are_refused(
    columns: dict[str, object], words: str
) -> None:
    with pytest.raises(InvalidInput, match=words):
        twists_in(table(**columns))


def test_whole_numbers_are_twists_too() -> None:
    columns = {name: pa.array([1, 2], pa.int8()) for name in TWIST}
    assert twists_in(pa.table(columns)).tolist() == [[1.0] * 3, [2.0] * 3]


def test_what_is_no_list_of_twists_is_refused() -> None:
    for twists in ([[1, 2]], [1, 2, 3], "abc", [[None, 1, 2]]):
        with pytest.raises(InvalidInput, match="twists"):
            twists_in(table_of_twists(twists))  # type: ignore[arg-type]
