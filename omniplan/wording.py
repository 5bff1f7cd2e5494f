"""Reports in words: angles in degrees, one line per violation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omniplan.report import Ranking, Report, Violation

__all__ = ["describe", "refusal", "report_lines"]

_WHAT = {
    "STEER_RANGE": "steering angle",
    "SINGULAR": "the centre of rotation lies on the wheel, its speed is",
    "WHEEL_SPEED": "rolling speed",
    "SPEED": "speed",
    "REVERSE_SPEED": "speed backwards",
    "YAW_RATE": "yaw rate",
    "SINGULAR_ZONE": "steering needed for the guaranteed rates, as a share of its own",
    "TIPPING": "acceleration of the centre of gravity towards a side",
    "PARALLEL_WHEELS": "turning of a vehicle whose wheels all point alike",
    "LATERAL_ACCELERATION": "lateral acceleration",
    "FIXED_WHEEL": "sideways slip of a wheel that does not steer",
    "STEER_RATE": "steering rate",
    "STEER_ACCELERATION": "steering acceleration",
    "WHEEL_ACCELERATION": "change of the rolling speed",
    "ACCELERATION": "acceleration",
    "DECELERATION": "deceleration",
    "V_MAX": "share of v_max",
}


def describe(violation: Violation) -> str:
    """Return one line: wheel, limit, numbers, place.

    Parameters
    ----------
    violation : Violation
    """
    who = f"wheel {violation.wheel}: " if violation.wheel else ""
    return f"{who}{_numbers(violation)} {_place(violation)} [{violation.limit}]"


def _numbers(violation: Violation) -> str:
    if violation.limit == "RECONFIGURATION":
        return _standstill(violation)
    if violation.limit == "UNREACHABLE":
        return "permitted, but no way inside the space leads there from straight ahead"
    assert violation.value is not None
    if violation.limit == "STEER_RANGE" and violation.unit == "m/s":
        return "by the data sheet blocked: out of the steering range"
    what = _WHAT.get(violation.limit, violation.limit)
    value = quantity(violation.value, violation.unit)
    bound = quantity(violation.bound, violation.unit)
    if violation.limit == "SINGULAR":
        allowed = "must not be 0"
    elif violation.limit == "STEER_RANGE" and (
        (violation.value < violation.bound) == violation.is_proved
    ):  # a value that is only possible lies within the stop
        allowed = f"at least {bound} permitted"
    else:
        allowed = f"at most {bound} permitted"
    unproved = "" if violation.is_proved else "cannot be excluded: "
    return f"{unproved}{what} {value}, {allowed}"


def _standstill(violation: Violation) -> str:
    if violation.value is None:
        return "at rest the wheels find no way to their new angles inside the space"
    return (
        f"at rest the wheels need {violation.value:.2f} s to turn to their new angles "
        f"or to unwind, there are {violation.bound:.2f} s"
    )


def _place(violation: Violation) -> str:
    stretch = f"t = {violation.t:.2f} s"
    if violation.t_end - violation.t_start > 0.005:
        stretch += f" ({violation.t_start:.2f} to {violation.t_end:.2f} s)"
    where = (
        f", κ_n = {violation.kappa_n:+z.3f}, β = {math.degrees(violation.beta):+z.1f}°"
    )
    pose = ""
    if violation.pose is not None:
        x, y, theta = violation.pose
        pose = f", at x = {x:z.2f} m, y = {y:z.2f} m, θ = {math.degrees(theta):z.0f}°"
    return f"at {stretch}, row {violation.index}{pose}{where}"


def quantity(value: float, unit: str) -> str:
    """Return a value with its unit; angles in degrees."""
    if unit == "rad":
        return f"{math.degrees(value):.1f}°"
    if unit == "rad/s":
        return f"{math.degrees(value):.1f}°/s"
    if unit == "rad/s²":
        return f"{math.degrees(value):.0f}°/s²"
    if unit == "1":
        return f"{value:.3f}"
    return f"{value:.3f} {unit}"


def report_lines(report: Report, *, is_timed: bool = False) -> Iterator[str]:
    """Yield a report as lines of text.

    Parameters
    ----------
    report : Report
    is_timed : bool
        Whether it is of a path that was given its times by `fastest`.
    """
    verdict = "permitted" if report.valid else "not permitted"
    yield f"{report.trajectory} by {report.vehicle}: {verdict}"
    for kind in dict.fromkeys(v.limit for v in report.violations):
        same = [v for v in report.violations if v.limit == kind]
        more = f" and {len(same) - 1} more of this kind" if len(same) > 1 else ""
        yield f"  {describe(max(same, key=lambda v: v.excess))}{more}"
    for advice in report.advice:
        yield f"  advice: {advice.text}"
    if report.valid:
        yield (
            f"  {report.duration:.2f} s as {'timed' if is_timed else 'given'}, at best "
            f"{report.fastest_duration:.2f} s (factor {report.speed_factor:.2f}); "
            f"margin {report.margin:.1%} ({report.tightest})"
        )
    if report.not_judged:
        yield f"  not judged: {', '.join(report.not_judged)}"


def refusal(report: Report) -> str:
    """Return the most telling violation of a refused report in one line.

    Parameters
    ----------
    report : Report
        Not valid.
    """
    first = report.headline
    assert first is not None
    more = len(report.violations) - 1
    return describe(first) + (f" and {more} more" if more else "")


def ranking_lines(ranking: Ranking) -> Iterator[str]:
    """Yield a ranking as lines of text.

    Parameters
    ----------
    ranking : Ranking
    """
    yield f"{ranking.trajectory}, by {ranking.criterion}:"
    for place, candidate in enumerate(ranking.suitable, start=1):
        report = candidate.report
        yield (
            f"  {place}. {candidate.vehicle}: at best {report.fastest_duration:.2f} s, "
            f"margin {report.margin:.1%} ({report.tightest})"
        )
    for report in ranking.refused:
        yield f"  no {report.vehicle}: {refusal(report)}"
        for advice in report.advice:
            yield f"     advice: {advice.text}"
    for undrivable in ranking.undrivable:
        yield f"  no {undrivable.vehicle}: {undrivable}"
    for unfit in ranking.unfit:
        for short in unfit.shortfalls:
            yield f"  unfit {unfit.vehicle}: {short}"
