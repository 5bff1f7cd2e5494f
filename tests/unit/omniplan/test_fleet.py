from collections.abc import Callable

import pytest

import configspace
from configspace import InvalidInput, PermissibleSpace
from omniplan import FleetVehicle, Ranking, Report, Trajectory, select
from omniplan.choosing import fleet as fleet_module
from omniplan.choosing.fitness import FleetEntry
from omniplan.validation import validate

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


def test_vehicles_of_one_type_are_judged_once(
    fleet: list[PermissibleSpace], monkeypatch: pytest.MonkeyPatch
) -> None:
    mecanum, differential = fleet[:2]
    judged: list[str] = []

    def counted(trajectory: Trajectory, space: PermissibleSpace, **how: bool) -> Report:
        judged.append(space.name)
        return validate(trajectory, space, allow_unreachable=how["allow_unreachable"])

    monkeypatch.setattr(fleet_module, "validate", counted)
    again = configspace.build_space(
        configspace.load_vehicle("mecanum"), mecanum.grid, cache=False
    )
    many: list[FleetEntry] = [
        ("m1", mecanum),
        FleetVehicle("m2", again, 50.0),
        differential,
    ]
    (ranking,) = select(aside(), many)
    assert sorted(judged) == ["differential", "mecanum"]
    assert [c.vehicle for c in ranking.suitable] == ["m1", "m2"]
    assert [c.report.vehicle for c in ranking.suitable] == ["m1", "m2"]
    assert [report.vehicle for report in ranking.refused] == ["differential"]


def test_a_sheet_and_its_vehicle_are_two_types(fleet: list[PermissibleSpace]) -> None:
    sheet = configspace.parse_space(configspace.dump_space(fleet[0]))
    (ranking,) = select(ahead(), [("known", fleet[0]), ("sheet", sheet)])
    known, published = ranking.suitable
    assert (known.vehicle, published.vehicle) == ("known", "sheet")
    assert published.report.not_judged


def test_what_is_unfit_is_not_judged_and_says_why(
    fleet: list[PermissibleSpace],
) -> None:
    (ranking,) = select(
        ahead(), fleet, requirements=["crab 90 deg", "speed 1.1 m/s", "no mirroring"]
    )
    assert [c.vehicle for c in ranking.suitable] == ["mecanum"]
    assert ranking.refused == ()
    unfit = {one.vehicle: one.shortfalls for one in ranking.unfit}
    assert set(unfit) == {"differential", "ackermann", "ift-four-steered"}
    assert [one.limit for one in unfit["differential"]] == [
        "FIXED_WHEEL",
        "FIXED_WHEEL",
        "WHEEL_SPEED",
    ]
    assert Ranking.from_dict(ranking.to_dict()) == ranking


def test_a_way_that_is_not_passable_backwards_is_unfit(
    fleet: list[PermissibleSpace],
) -> None:
    fast = ahead(speed=0.9)  # the ackermann vehicle drives 0.8 m/s backwards
    (ranking,) = select(fast, fleet, requirements=["passable backwards"])
    (one,) = ranking.unfit
    assert one.vehicle == "ackermann"
    assert one.shortfalls[0].limit == "REVERSE_SPEED"
    assert len(ranking.suitable) == 3


def test_a_criterion_of_ones_own_ranks(fleet: list[PermissibleSpace]) -> None:
    def slowest(report: Report) -> float:
        return report.speed_factor

    (ranking,) = select(ahead(), fleet, by=slowest)
    factors = [candidate.report.speed_factor for candidate in ranking.suitable]
    assert factors == sorted(factors)
    assert ranking.criterion == "slowest"
    with pytest.raises(InvalidInput, match="gives NaN for"):
        select(ahead(), fleet, by=lambda _: float("nan"))


def test_among_equals_the_larger_margin_wins(fleet: list[PermissibleSpace]) -> None:
    (ranking,) = select(ahead(), fleet, by=lambda _: 0.0)
    margins = [candidate.report.margin for candidate in ranking.suitable]
    assert margins == sorted(margins, reverse=True)


def test_requirements_that_cannot_be_read_are_refused(
    fleet: list[PermissibleSpace],
) -> None:
    with pytest.raises(InvalidInput, match=r"requirements\[0\], phrase: 'fly'"):
        select(ahead(), fleet, requirements=["fly"])
