from __future__ import annotations

import math

import pytest

from configspace import InvalidInput
from omniplan.choosing.requirements import Crab
from omniplan.choosing.shortfalls import Shortfall, Unfit
from omniplan.report import Candidate, Ranking, Report, Violation
from omniplan.trajectory import Trajectory
from services.errors import InvalidMessage
from services.protocol.messages import (
    ErrorReply,
    RequestLimits,
    SelectReply,
    SelectRequest,
    ValidateReply,
    ValidateRequest,
    VehiclesReply,
    decode,
    encode,
    trajectories_from,
)


@pytest.fixture
def report() -> Report:
    """One with every number JSON has no sign for."""
    violation = Violation(
        limit="SPEED",
        wheel=None,
        value=math.inf,
        bound=1.0,
        unit="m/s",
        index=0,
        t=0.0,
        t_start=0.0,
        t_end=0.1,
        kappa_n=1 / 3,
        beta=-0.1,
        pose=(0.1, 0.2, 1e-300),
        is_proved=True,
    )
    return Report(
        vehicle="agv",
        trajectory="Förderstrecke 7",
        valid=False,
        violations=(violation,),
        margin=-math.inf,
        tightest="SPEED",
        duration=1.5,
        speed_factor=0.0,
        fastest_duration=None,
        top_speed=0.1,
        top_yaw_rate=0.0,
        advice=(),
        interpolation="spline",
        not_judged=(),
    )


def test_reports_and_rankings_survive_json_unchanged(report: Report) -> None:
    short = Shortfall("payload 5 kg", "", 5.0, None, "kg", None, None)
    ranking = Ranking(
        "x",
        "margin",
        (Candidate("agv", 0.1, report),),
        (report,),
        (Unfit("cart", (short,)),),
    )
    reports = decode(ValidateReply, encode(ValidateReply.of([report, report])))
    assert reports.values() == (report, report)
    rankings = decode(SelectReply, encode(SelectReply.of([ranking])))
    assert rankings.values() == (ranking,)


def test_requests_survive_json_unchanged() -> None:
    trajectory = Trajectory.from_twists([0, 1 / 3], [[0.1, 0, 0]] * 2, name="a")
    validate = ValidateRequest.of([trajectory], "agv")
    select = SelectRequest.of([trajectory], ["agv"], "margin")
    assert decode(ValidateRequest, encode(validate)) == validate
    assert decode(SelectRequest, encode(select)) == select
    asked = SelectRequest.of([], None, "manoeuvrability", [Crab(0.5), "no-mirroring"])
    assert decode(SelectRequest, encode(asked)) == asked
    assert asked.requirements[1] == "no mirroring"
    (back,) = trajectories_from(validate.trajectories, RequestLimits())
    assert (back.t == trajectory.t).all()
    assert (back.samples == trajectory.samples).all()


def test_what_may_be_left_out_has_its_default() -> None:
    request = decode(SelectRequest, b'{"trajectories": []}')
    assert (request.vehicles, request.by) == (None, "duration")
    assert request.requirements == ()
    assert decode(ErrorReply, b'{"code": "busy", "message": "later"}').field is None


def test_reports_that_are_none_are_value_errors() -> None:
    with pytest.raises(ValueError, match="margin"):
        decode(ValidateReply, b'{"reports": [{"vehicle": "agv"}]}').values()


@pytest.mark.parametrize(
    ("payload", "words"),
    [
        (b'{"vehicles": ["a", 1]}', r"vehicles\[1\]: 1; "),
        (b'{"vehicles": "a"}', "vehicles: 'a'; "),
        (b'{"vehicles": [], "x": 1}', "x: unknown key; allowed are vehicles"),
        (b"{}", "vehicles: missing"),
        (b'{"vehicles": [NaN]}', "JSON without NaN"),
        (b'{"vehicles": [', "EOF"),
        (b"[" * 10**6, "recursion limit"),
        (b"3", "payload: 3"),
    ],
)
def test_what_does_not_fit_is_named(payload: bytes, words: str) -> None:
    with pytest.raises(InvalidMessage, match=words) as caught:
        decode(VehiclesReply, payload)
    assert caught.value.subject == "VehiclesReply"
    assert len(str(caught.value)) < 500


def test_not_more_than_twenty_mistakes_are_listed() -> None:
    payload = b'{"vehicles": [' + b"1," * 10_000 + b"1]}"
    with pytest.raises(InvalidMessage) as caught:
        decode(VehiclesReply, payload)
    assert len(caught.value.problems) == 20


@pytest.mark.parametrize(
    "limits", [{"max_bytes": 0}, {"max_bytes": 2**30}, {"max_samples": 0}]
)
def test_limits_outside_their_range_are_refused(limits: dict[str, int]) -> None:
    with pytest.raises(InvalidInput, match=next(iter(limits))):
        RequestLimits(**limits)


def test_more_than_a_hundred_requirements_are_refused() -> None:
    payload = b'{"trajectories": [], "requirements": [' + b'"no mirroring",' * 100
    with pytest.raises(InvalidMessage, match="requirements"):
        decode(SelectRequest, payload + b'"no mirroring"]}')


def test_requests_take_no_phrase_that_is_none() -> None:
    with pytest.raises(InvalidInput, match="phrase: 'fly'"):
        SelectRequest.of([], None, "duration", ["fly"])
