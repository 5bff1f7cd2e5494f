from collections.abc import Callable

import pytest

import configspace
from configspace import InvalidInput, PermissibleSpace
from omniplan import Trajectory, select

SpaceOf = Callable[[str], PermissibleSpace]
NAMES = ("mecanum", "differential", "ackermann", "ift-four-steered")


@pytest.fixture
def fleet(space_of: SpaceOf) -> list[PermissibleSpace]:
    return [space_of(name) for name in NAMES]


def ahead(speed: float = 0.4, name: str = "ahead") -> Trajectory:
    return Trajectory.from_twists([0, 10], [[speed, 0, 0]] * 2, name=name)


def aside() -> Trajectory:
    return Trajectory.from_twists([0, 10], [[0, 0.4, 0]] * 2, name="aside")


def test_the_fastest_vehicle_comes_first(fleet: list[PermissibleSpace]) -> None:
    (ranking,) = select(ahead(), fleet)
    # Largest speeds ahead: 1.5, 1.2, 1.0 and 1.0 m/s.
    names = [candidate.vehicle for candidate in ranking.suitable]
    assert names[:2] == ["ackermann", "mecanum"]
    assert sorted(names[2:]) == ["differential", "ift-four-steered"]
    scores = [candidate.score for candidate in ranking.suitable]
    assert scores == sorted(scores)
    assert scores[:3] == pytest.approx([4 / 1.5, 4 / 1.2, 4.0], rel=2e-3)
    assert ranking.best is ranking.suitable[0]
    assert ranking.refused == ()
    assert (ranking.trajectory, ranking.criterion) == ("ahead", "duration")


def test_by_margin_the_largest_margin_comes_first(
    fleet: list[PermissibleSpace],
) -> None:
    (ranking,) = select(ahead(), fleet, by="margin")
    margins = [candidate.report.margin for candidate in ranking.suitable]
    assert margins == sorted(margins, reverse=True)
    assert ranking.criterion == "margin"
    assert ranking.best is not None
    assert ranking.best.score == -ranking.best.report.margin


def test_who_cannot_is_refused_with_the_reason(fleet: list[PermissibleSpace]) -> None:
    (ranking,) = select(aside(), fleet)
    assert {c.vehicle for c in ranking.suitable} == {"mecanum", "ift-four-steered"}
    refused = {report.vehicle: report for report in ranking.refused}
    assert set(refused) == {"differential", "ackermann"}
    for report in refused.values():
        assert any(v.limit == "FIXED_WHEEL" for v in report.violations)


def test_nobody_can(fleet: list[PermissibleSpace]) -> None:
    (ranking,) = select(ahead(speed=9.0), fleet)
    assert ranking.best is None
    assert ranking.suitable == ()
    assert len(ranking.refused) == 4


def test_one_ranking_per_trajectory_in_their_order(
    fleet: list[PermissibleSpace],
) -> None:
    rankings = select((ahead(name=f"{i}") for i in range(3)), fleet[:1])
    assert [ranking.trajectory for ranking in rankings] == ["0", "1", "2"]
    assert select([], fleet) == ()


def test_the_order_of_the_fleet_does_not_matter(fleet: list[PermissibleSpace]) -> None:
    (one,), (other,) = select(ahead(), fleet), select(ahead(), fleet[::-1])
    assert one.suitable == other.suitable


def test_data_sheets_can_be_ranked(fleet: list[PermissibleSpace]) -> None:
    sheets = [configspace.parse_space(configspace.dump_space(space)) for space in fleet]
    (known,), (published,) = select(ahead(), fleet), select(ahead(), sheets)
    assert {c.vehicle for c in published.suitable} <= {
        c.vehicle for c in known.suitable
    }
    assert published.best is not None
    assert published.best.vehicle == "ackermann"


def test_an_unknown_criterion_is_refused(fleet: list[PermissibleSpace]) -> None:
    with pytest.raises(InvalidInput, match=r"by: 'price'.*duration, margin"):
        select(ahead(), fleet, by="price")


def test_an_empty_fleet_and_names_that_repeat_are_refused(
    fleet: list[PermissibleSpace],
) -> None:
    with pytest.raises(InvalidInput, match="at least one vehicle"):
        select(ahead(), [])
    with pytest.raises(InvalidInput, match="mecanum twice"):
        select(ahead(), [fleet[0], fleet[1], fleet[0]])
