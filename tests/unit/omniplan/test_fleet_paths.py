"""Selection for paths: every vehicle drives them in its own time."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable

import pytest

import configspace
from configspace import PermissibleSpace
from omniplan import (
    NotDrivable,
    Path,
    Ranking,
    Report,
    Timing,
    TimingStatus,
    Trajectory,
    fastest,
    select,
    time_paths,
    validate,
)
from omniplan.choosing import fleet as fleet_module
from omniplan.choosing.fitness import FleetEntry
from omniplan.plots.verdicts import verdict_text, verdicts
from omniplan.wording import ranking_lines

SpaceOf = Callable[[str], PermissibleSpace]
NAMES = ("mecanum", "differential", "ackermann", "ift-four-steered")
LINE = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [4.0, 0.0, 0.0]]
ASIDE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]


@pytest.fixture
def fleet(space_of: SpaceOf) -> list[PermissibleSpace]:
    return [space_of(name) for name in NAMES]


def test_a_path_is_ranked_by_the_time_that_each_vehicle_needs(
    fleet: list[PermissibleSpace],
) -> None:
    path = Path.from_poses(LINE, name="line")
    (ranking,) = select(path, fleet)
    assert ranking.trajectory == "line"
    assert len(ranking.suitable) == len(NAMES)
    spaces = {space.name: space for space in fleet}
    for candidate in ranking.suitable:
        own = fastest(path, spaces[candidate.vehicle])
        assert candidate.score == own.duration
        assert candidate.report.duration == own.duration
        assert candidate.report.fastest_duration == own.duration
        assert candidate.report.valid
    scores = [candidate.score for candidate in ranking.suitable]
    assert scores == sorted(scores)
    assert scores[0] < scores[-1]


def test_a_cap_of_the_path_is_not_driven_past(fleet: list[PermissibleSpace]) -> None:
    path = Path.from_poses(LINE, max_speed=0.1)
    (ranking,) = select(path, fleet)
    for candidate in ranking.suitable:
        assert candidate.score > 40.0
        assert candidate.report.speed_factor == 1.0


def test_who_has_no_timing_is_refused_with_place_limit_and_numbers(
    fleet: list[PermissibleSpace],
) -> None:
    path = Path.from_poses(ASIDE, name="aside")
    (ranking,) = select(path, fleet)
    assert {c.vehicle for c in ranking.suitable} == {"mecanum", "ift-four-steered"}
    assert ranking.refused == ()
    undrivable = {one.vehicle: one for one in ranking.undrivable}
    assert set(undrivable) == {"differential", "ackermann"}
    one = undrivable["differential"]
    assert one.status == TimingStatus.BLOCKED.value
    assert one.fault is not None
    assert one.fault.limit == "FIXED_WHEEL"
    assert one.fault.wheel in {"left", "right"}
    assert one.fault.u == pytest.approx(1.0)
    assert one.fault.pose == pytest.approx((1.0, 0.0, 0.0))
    for part in (
        "blocked",
        f"wheel {one.fault.wheel}",
        "90.0°",
        "1.00 m along",
        "FIXED_WHEEL",
    ):
        assert part in str(one)
    assert sum(str(one) in line for line in ranking_lines(ranking)) == 1


def test_a_ranking_of_a_path_survives_json(fleet: list[PermissibleSpace]) -> None:
    (ranking,) = select(Path.from_poses(ASIDE), fleet)
    assert ranking.undrivable
    data = json.loads(json.dumps(ranking.to_dict()))
    assert Ranking.from_dict(data) == ranking
    del data["undrivable"]  # as of a trajectory, from an older server
    assert Ranking.from_dict(data).undrivable == ()


def test_a_data_sheet_alone_is_no_reason_to_say_nothing_of_the_others(
    fleet: list[PermissibleSpace],
) -> None:
    sheet = configspace.parse_space(configspace.dump_space(fleet[0]))
    vehicles: list[FleetEntry] = [("known", fleet[0]), ("sheet", sheet)]
    (ranking,) = select(Path.from_poses(LINE), vehicles)
    assert [c.vehicle for c in ranking.suitable] == ["known"]
    (one,) = ranking.undrivable
    assert (one.vehicle, one.fault) == ("sheet", None)
    assert str(one).startswith("vehicle not known: a data sheet alone")


def test_vehicles_of_one_type_are_timed_once(
    fleet: list[PermissibleSpace], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def counted(
        paths: Iterable[Path], space: PermissibleSpace, *, allow_unreachable: bool
    ) -> tuple[Timing, ...]:
        asked.append(space.name)
        return time_paths(paths, space, allow_unreachable=allow_unreachable)

    monkeypatch.setattr(fleet_module, "time_paths", counted)
    pairs: list[FleetEntry] = [(f"{i}", fleet[i // 2]) for i in range(4)]
    (ranking,) = select(Path.from_poses(ASIDE), pairs)
    assert asked == ["mecanum", "differential"]
    assert [c.vehicle for c in ranking.suitable] == ["0", "1"]
    assert [one.vehicle for one in ranking.undrivable] == ["2", "3"]


def test_paths_and_trajectories_may_be_mixed(fleet: list[PermissibleSpace]) -> None:
    slow = Trajectory.from_poses([0, 60, 120], LINE, name="slow")
    path, timed = select([Path.from_poses(LINE), slow], fleet[:1])
    assert path.best is not None
    assert timed.best is not None
    assert timed.best.report.duration == 120.0
    assert path.best.report.duration < 10.0


def test_requirements_and_other_criteria_hold_for_paths(
    fleet: list[PermissibleSpace],
) -> None:
    path = Path.from_poses(ASIDE)
    (ranking,) = select(path, fleet, by="margin", requirements=["speed 1.1 m/s"])
    assert {one.vehicle for one in ranking.unfit} == {
        "differential",
        "ift-four-steered",
    }
    assert [one.vehicle for one in ranking.undrivable] == ["ackermann"]
    assert ranking.best is not None
    assert ranking.best.score == -ranking.best.report.margin

    def jerky(report: Report) -> float:
        return -report.top_speed

    (ranking,) = select(path, fleet, by=jerky)
    assert [c.score for c in ranking.suitable] == sorted(
        -c.report.top_speed for c in ranking.suitable
    )


def test_the_picture_of_verdicts_has_a_cell_for_every_refusal(
    fleet: list[PermissibleSpace],
) -> None:
    sheet = configspace.parse_space(configspace.dump_space(fleet[0]))
    vehicles: list[FleetEntry] = [*fleet, ("sheet", sheet)]
    (ranking,) = select(Path.from_poses(ASIDE), vehicles)
    cells = verdicts([ranking])
    assert {name for name, _ in cells} == {*NAMES, "sheet"}
    assert verdict_text(cells["differential", 0]).startswith("fixed wheel\n")
    assert verdict_text(cells["sheet", 0]) == "vehicle not known"


def test_what_select_refuses_fastest_refuses_too(
    fleet: list[PermissibleSpace],
) -> None:
    path = Path.from_poses(ASIDE)
    with pytest.raises(NotDrivable, match="FIXED_WHEEL"):
        fastest(path, fleet[1])
    assert validate(fastest(path, fleet[0]), fleet[0]).valid
