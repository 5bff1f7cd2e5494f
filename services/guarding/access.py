"""Who may do what: zenoh's access control out of the names on certificates.

planner        asks questions, cancels its own, follows events, sees who is online
fleet manager  the same, and registers and removes vehicles
vehicle        says that it is online, under its own name
server         everything among servers

What is not allowed here is refused: a peer without a role is connected, is not heard
and hears nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import TypeAlias

from configspace.errors import InvalidInput, Problem
from services.errors import InvalidSecurity
from services.protocol.keys import Keys, checked_chunk

__all__ = ["Roles", "access_control", "servers_only"]

_Entry: TypeAlias = dict[str, object]

_LIVELINESS = ("liveliness_query", "declare_liveliness_subscriber")
_EVERY_MESSAGE = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    *_LIVELINESS,
)
# zenoh compares whole expressions: a query is allowed if one of these includes its key,
# so that "**" is refused where only "health" is allowed.
_QUESTIONS = (
    "batches/*",
    "cancel/*",
    "health",
    "select",
    "spaces/*",
    "validate",
    "vehicles",
    "vehicles/*",
)
_REGISTRATION = ("register/*", "unregister/*")
_PRESENCE = ("servers/*", "vehicles/*/online")
# "**" matches no chunk that begins with "@": what servers say among themselves.
_EVERYTHING = ("**", "@sync/**")


@dataclass(frozen=True)
class Roles:
    """The common names on the certificates of those who may do something.

    A name may stand in several roles; a name in none may do nothing.

    Raises
    ------
    InvalidSecurity
        If a name is empty or stands twice in a role, or if a vehicle's cannot be its
        id; all at once.
    """

    planners: tuple[str, ...] = ()
    """Ask, follow events and see who is online."""
    fleet_managers: tuple[str, ...] = ()
    """May also register and remove vehicles."""
    vehicles: tuple[str, ...] = ()
    """Say that they are online; the name is the vehicle's id."""
    servers: tuple[str, ...] = ()
    """Share what they know; clients that list some ask no other."""

    def __post_init__(self) -> None:
        problems: list[Problem] = []
        for field in fields(self):
            given = getattr(self, field.name)
            if isinstance(given, str):
                where = f"security.{field.name}"
                problems.append(Problem(where, repr(given), "a list of names"))
                continue
            # Frozen also where a list was given.
            object.__setattr__(self, field.name, tuple(given))
            problems += _problems(field.name, getattr(self, field.name))
        if problems:
            raise InvalidSecurity(problems)


def access_control(roles: Roles, keys: Keys) -> _Entry:
    """Return a server's ``access_control``: what the others may send and receive.

    Parameters
    ----------
    roles : Roles
    keys : Keys
        Of the site; below other sites nobody may do anything.

    Returns
    -------
    entry : dict
        As in zenoh's configuration; what no rule allows is denied.
    """
    # Flows as the server sees them: ingress is what the other one sends.
    rules = [
        _rule(keys, "ask", ("query",), "ingress", _QUESTIONS),
        _rule(keys, "answer", ("declare_queryable", "reply"), "egress", ("**",)),
        _rule(keys, "follow", ("declare_subscriber",), "ingress", ("events/**",)),
        _rule(keys, "events", ("put",), "egress", ("events/**",)),
        _rule(keys, "watch", _LIVELINESS, "ingress", _PRESENCE),
        _rule(keys, "presence", ("liveliness_token",), "egress", _PRESENCE),
        _rule(keys, "register", ("query",), "ingress", _REGISTRATION),
        _rule(keys, "store", ("put", "delete"), "ingress", ("vehicles/*",)),
        _rule(keys, "stored", ("declare_subscriber",), "egress", ("vehicles/*",)),
        _rule(keys, "who is online", _LIVELINESS, "egress", ("vehicles/*/online",)),
        _rule(keys, "among servers", _EVERY_MESSAGE, "both", _EVERYTHING),
    ]
    asking = ["ask", "answer", "follow", "events", "watch", "presence"]
    policies = [
        *_policy(roles.planners, asking),
        *_policy(roles.fleet_managers, [*asking, "register", "store", "stored"]),
        *_policy(roles.servers, ["among servers"]),
    ]
    for id in roles.vehicles:
        own = f"online {id}"
        token = (f"vehicles/{id}/online",)
        rules.append(_rule(keys, own, ("liveliness_token",), "ingress", token))
        policies += _policy([id], [own, "who is online"])
    names = {name for field in fields(roles) for name in getattr(roles, field.name)}
    return _deny_but(rules, sorted(names), policies)


def servers_only(servers: Sequence[str], keys: Keys) -> _Entry:
    """Return a client's ``access_control``: it talks to these servers, no other peer.

    Without it a client takes an answer from whoever has a certificate of the authority
    for the host that it connects to.
    """
    everything = _rule(keys, "everything", _EVERY_MESSAGE, "both", ("**",))
    return _deny_but([everything], servers, _policy(servers, ["everything"]))


def _rule(
    keys: Keys, id: str, messages: Sequence[str], flow: str, below: Sequence[str]
) -> _Entry:
    return {
        "id": id,
        "permission": "allow",
        "messages": list(messages),
        "flows": ["ingress", "egress"] if flow == "both" else [flow],
        "key_exprs": [f"{keys.root}/{key}" for key in below],
    }


def _policy(names: Iterable[str], rules: Sequence[str]) -> list[_Entry]:
    # zenoh refuses a policy for nobody.
    subjects = list(names)
    return [{"rules": list(rules), "subjects": subjects}] if subjects else []


def _deny_but(
    rules: Sequence[_Entry], names: Sequence[str], policies: Sequence[_Entry]
) -> _Entry:
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": list(rules),
        "subjects": [{"id": name, "cert_common_names": [name]} for name in names],
        "policies": list(policies),
    }


def _problems(role: str, names: Sequence[object]) -> list[Problem]:
    problems: list[Problem] = []
    for index, name in enumerate(names):
        where = f"security.{role}[{index}]"
        if not (isinstance(name, str) and name.strip()):
            problems.append(Problem(where, repr(name), "a common name"))
        elif name in names[:index]:
            problems.append(Problem(where, f"{name!r} again", "each name once"))
        elif role == "vehicles":
            try:
                checked_chunk(where, name)
            except InvalidInput as error:
                problems += error.problems
    return problems
