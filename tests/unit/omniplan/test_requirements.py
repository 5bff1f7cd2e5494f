import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configspace import InvalidInput
from omniplan.choosing.requirements import (
    PHRASES,
    WAYS,
    Crab,
    FitsWithin,
    NoMirroring,
    PassableBackwards,
    Payload,
    Radius,
    Requirement,
    Speed,
    TurnOnTheSpot,
    Way,
    parse_requirement,
)


def sizes(high: float) -> st.SearchStrategy[float]:
    return st.floats(1e-3, high)


ways: st.SearchStrategy[Way] = st.sampled_from(WAYS)
requirements: st.SearchStrategy[Requirement] = st.one_of(
    st.builds(TurnOnTheSpot, st.just(0.0) | sizes(10)),
    st.builds(Crab, sizes(3.14), st.just(0.0) | sizes(50)),
    st.builds(Radius, sizes(1e3), st.just(0.0) | sizes(50), ways),
    st.builds(Speed, sizes(50), ways),
    st.builds(Payload, sizes(1e6)),
    st.builds(FitsWithin, sizes(100), sizes(100)),
    st.builds(NoMirroring),
    st.builds(PassableBackwards),
)


@given(requirements)
def test_every_requirement_is_read_back_from_its_phrase(asked: Requirement) -> None:
    back = parse_requirement(str(asked))
    assert type(back) is type(asked)
    for name, value in vars(asked).items():
        same = value if isinstance(value, str) else pytest.approx(value, rel=1e-11)
        assert getattr(back, name) == same
    assert str(back) == str(asked)


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("turn-on-the-spot", TurnOnTheSpot()),
        ("Turn on the spot at 90°/s", TurnOnTheSpot(math.pi / 2)),
        ("crab ±90° at .5m/s", Crab(math.pi / 2, 0.5)),
        ("crab 180 deg", Crab(math.pi)),
        ("  radius 0.8m at 1 m / s, backwards ", Radius(0.8, 1.0, "backwards")),
        ("speed 1.5 m/s both-ways", Speed(1.5, "both ways")),
        ("payload 5e2kg", Payload(500.0)),
        ("footprint 1.2m x0.8 m", FitsWithin(1.2, 0.8)),
        ("no-mirroring", NoMirroring()),
        ("passable-backwards", PassableBackwards()),
    ],
)
def test_spelling_is_free(text: str, asked: Requirement) -> None:
    assert parse_requirement(text) == asked


@pytest.mark.parametrize(
    "text",
    [
        "",
        "fly",
        "crab",
        "crab 90",
        "radius 1 ft",
        "speed 1.5",
        "payload -5 kg",
        "crab ²deg",
    ],
)
def test_what_is_no_phrase_is_refused_with_all_that_are(text: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        parse_requirement(text)
    for phrase in PHRASES:
        assert phrase in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("crab 181 deg", "crab: angle"),
        ("radius 0 m", "radius: 0.0; a number from 1e-06"),
        ("speed 101 m/s", "speed: 101.0"),
        ("payload 0 kg", "payload: mass"),
    ],
)
def test_values_out_of_range_are_refused(text: str, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        parse_requirement(text)


def test_nan_and_unknown_ways_are_refused() -> None:
    with pytest.raises(InvalidInput, match="nan"):
        Payload(math.nan)
    with pytest.raises(InvalidInput, match="one of forwards, backwards, both ways"):
        Speed(1.0, "sideways")  # type: ignore[arg-type]
