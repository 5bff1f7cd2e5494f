from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services import InvalidSecurity, Roles
from services.guarding.access import access_control, servers_only
from services.protocol.keys import Keys

KEYS = Keys("hall-3")
ROLES = ("planners", "fleet_managers", "vehicles", "servers")
names = st.lists(st.from_regex(r"[a-z][a-z0-9-]{0,8}", fullmatch=True), unique=True)


def allowed(entry: dict[str, object], name: str) -> set[tuple[str, str, str]]:
    """Return (message, flow, key) of everything that a name may, rule by rule."""
    config: dict[str, Any] = json.loads(json.dumps(entry))
    rules = {rule["id"]: rule for rule in config["rules"]}
    subjects = {
        subject["id"]
        for subject in config["subjects"]
        if name in subject["cert_common_names"]
    }
    return {
        (message, flow, key)
        for policy in config["policies"]
        if subjects & set(policy["subjects"])
        for rule in (rules[id] for id in policy["rules"])
        for message in rule["messages"]
        for flow in rule["flows"]
        for key in rule["key_exprs"]
    }


@given(planners=names, fleet_managers=names, vehicles=names, servers=names)
def test_whatever_the_roles_the_rest_is_denied_and_all_is_below_the_site(
    planners: list[str],
    fleet_managers: list[str],
    vehicles: list[str],
    servers: list[str],
) -> None:
    roles = Roles(
        tuple(planners), tuple(fleet_managers), tuple(vehicles), tuple(servers)
    )
    entry: Any = access_control(roles, KEYS)
    assert (entry["enabled"], entry["default_permission"]) == (True, "deny")
    assert all(rule["permission"] == "allow" for rule in entry["rules"])
    assert all(
        key.startswith("omniplan/v1/hall-3/")
        for rule in entry["rules"]
        for key in rule["key_exprs"]
    )
    # zenoh refuses repeated ids, and policies for nobody or of unknown rules.
    for kind in ("rules", "subjects"):
        ids = [one["id"] for one in entry[kind]]
        assert len(set(ids)) == len(ids)
    assert all(policy["subjects"] and policy["rules"] for policy in entry["policies"])
    listed = {*planners, *fleet_managers, *vehicles, *servers}
    for name in listed:
        assert allowed(entry, name)
    assert allowed(entry, "nobody-listed") == set()
    # Without a wildcard as subject: every subject is one name.
    assert all(subject["cert_common_names"] for subject in entry["subjects"])
    only_planners = set(planners) - {*fleet_managers, *vehicles, *servers}
    for name in only_planners:
        sent = {
            message for message, flow, _ in allowed(entry, name) if flow != "egress"
        }
        assert not sent & {"put", "delete", "reply", "declare_queryable"}
        assert "liveliness_token" not in sent
    for name in set(vehicles) - {*planners, *fleet_managers, *servers}:
        sent_by = {
            (message, key)
            for message, flow, key in allowed(entry, name)
            if flow == "ingress"
        }
        assert sent_by == {
            ("liveliness_token", f"omniplan/v1/hall-3/vehicles/{name}/online")
        }


def test_a_name_in_two_roles_may_what_both_may() -> None:
    both = access_control(Roles(planners=("a",), vehicles=("a",)), KEYS)
    planner = access_control(Roles(planners=("a",)), KEYS)
    vehicle = access_control(Roles(vehicles=("a",)), KEYS)
    assert allowed(both, "a") == allowed(planner, "a") | allowed(vehicle, "a")


def test_a_client_that_lists_servers_hears_no_other() -> None:
    entry: Any = servers_only(("server-1",), KEYS)
    assert entry["default_permission"] == "deny"
    assert allowed(entry, "server-1")
    assert allowed(entry, "planner-1") == set()


def test_roles_keep_tuples_of_what_was_given() -> None:
    given: Any = ["a", "b"]
    roles = Roles(planners=given)
    given.append("c")
    assert roles.planners == ("a", "b")


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("",), r"\[0\]: ''; a common name"),
        (("a", " "), r"\[1\]: ' '; a common name"),
        ((3,), r"\[0\]: 3; a common name"),
        (("a", "a"), r"\[1\]: 'a' again; each name once"),
        ("planner", ": 'planner'; a list of names"),
    ],
)
def test_a_role_names_what_cannot_be_meant(role: str, given: Any, words: str) -> None:
    with pytest.raises(InvalidSecurity, match=rf"security\.{role}{words}"):
        Roles(**{role: given})


@pytest.mark.parametrize("name", ["a/b", "*", "**", "@sync", "a b", "-", "x" * 65])
def test_a_vehicles_name_is_one_chunk_of_a_key(name: str) -> None:
    with pytest.raises(InvalidSecurity, match=r"security\.vehicles\[1\]"):
        Roles(vehicles=("agv-7", name))


def test_all_problems_are_named_at_once() -> None:
    with pytest.raises(InvalidSecurity) as caught:
        Roles(planners=("",), vehicles=("a/b", "c", "c"))
    assert [problem.where for problem in caught.value.problems] == [
        "security.planners[0]",
        "security.vehicles[0]",
        "security.vehicles[2]",
    ]
