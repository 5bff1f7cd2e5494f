from __future__ import annotations

import pytest

from configspace import InvalidInput
from services.errors import InvalidMessage
from services.keys import Keys, Route

BAD_CHUNKS = ["", "a/b", "*", "a*", "$*", "a?b", "#", "@x", "ä", "a b", "a\n", "-a"]
ROUTES = {
    "omniplan/v1/hall-2/vehicles": Route("vehicles"),
    "omniplan/v1/hall-2/vehicles/agv.7": Route("vehicle", "agv.7"),
    "omniplan/v1/hall-2/spaces/agv.7": Route("space", "agv.7"),
    "omniplan/v1/hall-2/validate": Route("validate"),
    "omniplan/v1/hall-2/select": Route("select"),
    "omniplan/v1/hall-2/health": Route("health"),
}


@pytest.mark.parametrize(("key", "route"), ROUTES.items())
def test_keys_and_routes_are_each_others_inverse(key: str, route: Route) -> None:
    keys = Keys("hall-2")
    assert keys.of(route) == key
    assert keys.route(key) == route


def test_all_keys_of_a_fleet_can_be_routed() -> None:
    assert set(Keys("hall-2").all_of(["agv.7"])) == set(ROUTES)


@pytest.mark.parametrize("text", [*BAD_CHUNKS, "x" * 65])
def test_a_site_that_is_no_chunk_is_named(text: str) -> None:
    with pytest.raises(InvalidInput, match=r"site: .*1 to 64 letters"):
        Keys(text)


@pytest.mark.parametrize("text", BAD_CHUNKS)
def test_an_id_that_is_no_chunk_is_named(text: str) -> None:
    keys = Keys("default")
    with pytest.raises(InvalidInput, match="vehicle: "):
        keys.of(Route("vehicle", text))
    with pytest.raises(InvalidInput, match="instance: "):
        keys.server(text)


@pytest.mark.parametrize(
    "key",
    [
        "omniplan/v1/default",
        "omniplan/v1/default/plan",
        "omniplan/v1/default/spaces",
        "omniplan/v1/default/vehicles/a/b",
        "omniplan/v2/default/health",
        "omniplan/v1/other/health",
        "omniplan/v1/default/spaces/*",
    ],
)
def test_an_unknown_key_is_refused(key: str) -> None:
    with pytest.raises(InvalidMessage) as caught:
        Keys("default").route(key)
    assert caught.value.code == "unknown_key"
    assert "select" in str(caught.value)
