from __future__ import annotations

import pytest

from configspace import InvalidInput
from services.errors import InvalidMessage
from services.protocol.keys import Keys, Route

BAD_CHUNKS = ["", "a/b", "*", "a*", "$*", "a?b", "#", "@x", "ä", "a b", "a\n", "-a"]
ROUTES = {
    "omniplan/v1/hall-2/vehicles": Route("vehicles"),
    "omniplan/v1/hall-2/vehicles/agv.7": Route("vehicle", "agv.7"),
    "omniplan/v1/hall-2/spaces/agv.7": Route("space", "agv.7"),
    "omniplan/v1/hall-2/validate": Route("validate"),
    "omniplan/v1/hall-2/select": Route("select"),
    "omniplan/v1/hall-2/batches/validate": Route("batch_validate"),
    "omniplan/v1/hall-2/batches/twists": Route("batch_twists"),
    "omniplan/v1/hall-2/health": Route("health"),
}
CHANGES = {
    "omniplan/v1/hall-2/cancel/ab12": Route("cancel", "ab12"),
    "omniplan/v1/hall-2/register/agv.7": Route("register", "agv.7"),
    "omniplan/v1/hall-2/unregister/agv.7": Route("unregister", "agv.7"),
}


@pytest.mark.parametrize(("key", "route"), (ROUTES | CHANGES).items())
def test_keys_and_routes_are_each_others_inverse(key: str, route: Route) -> None:
    keys = Keys("hall-2")
    assert keys.of(route) == key
    assert keys.route(key) == route


def test_all_keys_of_a_fleet_can_be_routed_and_change_nothing() -> None:
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


def test_keys_among_servers_are_out_of_reach_of_wildcards() -> None:
    key = Keys("hall-2").sync("ab12", "digest")
    assert key == "omniplan/v1/hall-2/@sync/ab12/digest"
    with pytest.raises(InvalidMessage):
        Keys("hall-2").route(key)


@pytest.mark.parametrize("text", BAD_CHUNKS)
def test_no_event_token_or_sync_key_of_a_name_that_is_no_chunk(text: str) -> None:
    keys = Keys("default")
    for make in (keys.event, keys.online):
        with pytest.raises(InvalidInput, match="vehicle: "):
            make(text)
    if text != "*":
        with pytest.raises(InvalidInput, match="sync key: "):
            keys.sync("ab12", text)
