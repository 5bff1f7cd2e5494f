"""Requests to the service, few of them sound, most nearly so; and publications."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
from loopback import Trajectories
from mutations import Rng, choose, other_arrow, other_bytes, other_json

import configspace
import omniplan
from services.protocol.arrow import ARROW
from services.protocol.messages import JSON

ROOT = "omniplan/v1/default"
FIXED = ["ift-four-steered", "differential"]
"""The vehicles that the server is started with."""
MAX_BYTES = 2**17
"""What the server takes in one request."""


@dataclass(frozen=True)
class Question:
    """One request, or something that is published."""

    kind: str
    key: str
    payload: bytes | None = None
    encoding: str = JSON

    @property
    def verb(self) -> str:
        return self.key.removeprefix(f"{ROOT}/").partition("?")[0]

    @property
    def is_answered(self) -> bool:
        """Whether a server owes an answer: it is asked one concrete key of the site."""
        path = self.key.partition("?")[0]
        is_ours = path.startswith(f"{ROOT}/") and path.isascii()
        return self.kind == "ask" and is_ours and not set("*@$") & set(path)


@dataclass
class Source:
    """Makes questions: few are sound, most are nearly so."""

    rng: Rng
    trajectories: Trajectories
    vehicle: dict[str, Any] = field(init=False)
    motions: list[dict[str, Any]] = field(init=False)
    table: pa.Table = field(init=False)
    twists: pa.Table = field(init=False)

    def __post_init__(self) -> None:
        cart = configspace.load_vehicle("mecanum")
        self.vehicle = json.loads(cart.model_dump_json(exclude_none=True))
        t = [0.0, 0.5, 1.5, 2.0]
        rows = [[0.3, 0.0, 0.1], [0.3, 0.0, 0.4], [0.2, 0.0, 0.0], [0.1, 0.0, 0.0]]
        curve = [[0.2, 0.1, 0.3], [0.2, 0.2, 0.3], [0.1, 0.2, 0.3], [0.1, 0.1, 0.3]]
        kappa_n, beta, v_n = np.transpose(curve)
        agv = configspace.load_vehicle(FIXED[0])
        more = (
            omniplan.Trajectory.from_twists(t, rows, name="twists"),
            omniplan.Trajectory.from_omni_curve(
                t, kappa_n, beta, v_n, agv, name="curve"
            ),
        )
        known = [*self.trajectories, *more]
        self.motions = [json.loads(json.dumps(one.to_dict())) for one in known]
        names = pa.array([x.name for x in self.trajectories for _ in x.t])
        poses = np.concatenate([x.samples for x in self.trajectories]).T
        columns = {"t": np.concatenate([x.t for x in self.trajectories])}
        columns |= dict(zip(("x", "y", "theta"), poses, strict=True))
        owner = names.dictionary_encode()
        self.table = pa.table({"trajectory": owner, **columns})
        speeds = np.random.default_rng(5).normal(0.0, 0.5, (60, 3))
        self.twists = pa.table(dict(zip(("vx", "vy", "omega"), speeds.T, strict=True)))

    def next(self) -> Question:
        makers: list[tuple[float, Callable[[], Question]]] = [
            (0.24, self._validate),
            (0.12, self._select),
            (0.16, self._batch_validate),
            (0.14, self._batch_twists),
            (0.10, self._register),
            (0.03, self._unregister),
            (0.07, self._publication),
            (0.10, self._odd_key),
            (0.04, self._wrong_encoding),
        ]
        shares = [share for share, _ in makers]
        return makers[int(self.rng.choice(len(makers), p=shares))][1]()

    def _is_sound(self) -> bool:
        return bool(self.rng.random() < 0.05)

    def _json(self, verb: str, data: Any) -> Question:
        sound = self._is_sound()
        payload = json.dumps(data).encode() if sound else other_json(self.rng, data)
        return Question("ask", f"{ROOT}/{verb}", payload)

    def _some(self) -> list[dict[str, Any]]:
        n = int(self.rng.integers(1, 3))
        return [choose(self.rng, self.motions) for _ in range(n)]

    def _validate(self) -> Question:
        name = choose(self.rng, FIXED)
        return self._json("validate", {"vehicle": name, "trajectories": self._some()})

    def _select(self) -> Question:
        data: dict[str, Any] = {"trajectories": self._some(), "vehicles": FIXED}
        data["by"] = choose(self.rng, ["duration", "margin", "manoeuvrability"])
        if self.rng.random() < 0.3:
            data["requirements"] = ["crab 90 deg at 0.5 m/s", "speed 0.4 m/s both ways"]
        if self.rng.random() < 0.2:
            data |= {"request": "a", "deadline": 20.0, "allow_unreachable": True}
        return self._json("select", data)

    def _arrow(self, verb: str, table: pa.Table, data: Any) -> Question:
        payload = other_arrow(self.rng, table, data)
        return Question("ask", f"{ROOT}/batches/{verb}", payload, ARROW)

    def _batch_validate(self) -> Question:
        return self._arrow("validate", self.table, {"vehicles": FIXED})

    def _batch_twists(self) -> Question:
        return self._arrow("twists", self.twists, {"vehicle": choose(self.rng, FIXED)})

    def _cart(self, name: str) -> bytes:
        """Return a vehicle file, a sound one with one of few contents."""
        file = {**self.vehicle, "name": name}
        if self.rng.random() < 0.15:
            file["description"] = f"version {self.rng.integers(3)}"
            return json.dumps(file).encode()
        return other_json(self.rng, file)

    def _register(self) -> Question:
        name = choose(self.rng, ["asked-0", "asked-1", "asked-2", FIXED[1]])
        file = self._cart(name)
        data: dict[str, Any] = {"vehicle": file.decode(errors="replace")}
        if self.rng.random() < 0.5:
            with contextlib.suppress(ValueError, RecursionError):
                data["vehicle"] = json.loads(file)
        if self.rng.random() < 0.3:
            data["expected_version"] = "absent"
        payload = json.dumps(data).encode()
        if self.rng.random() < 0.3:
            payload = other_bytes(self.rng, payload)
        return Question("ask", f"{ROOT}/register/{name}", payload)

    def _unregister(self) -> Question:
        name = choose(self.rng, ["asked-0", "asked-1", "never", FIXED[0]])
        data = {"expected_version": choose(self.rng, [None, "absent", "7-0", "x"])}
        return self._json(f"unregister/{name}", data)

    def _publication(self) -> Question:
        name = choose(self.rng, ["put-0", "put-1", FIXED[0], "*", "**"])
        if self.rng.random() < 0.15:
            return Question("erase", f"{ROOT}/vehicles/{name}")
        if self.rng.random() < 0.6:
            file = self._cart(name)
            return Question("put", f"{ROOT}/vehicles/{name}", file, self._encoding())
        record = {"id": name, "version": "1-00000000000000aa", "vehicle": "{}"}
        keys = ["@sync/rogue/changed", "events/vehicles/put-0", "servers/rogue"]
        keys += ["validate", "vehicles", "health", "**", "@sync/*/changed", "x/y"]
        payload = other_json(self.rng, {"records": [record]})
        return Question("put", f"{ROOT}/{choose(self.rng, keys)}", payload)

    def _odd_key(self) -> Question:
        rng = self.rng
        keys = ["vehicles", "health", "spaces/*", "vehicles/*", "**", "*", "*/*"]
        keys += ["vehicles/..", "spaces/../../etc/passwd", "spaces/%2e%2e", "batches/*"]
        keys += ["@sync/*/digest", "@sync/*/records", "@sync/**", "cancel/*", "x" * 300]
        keys += ["cancel/a", "register/*", "unregister/*", "unregister/asked-*/x"]
        keys += ["health?a=1;b=2", "vehicles/differential?_anyke", "spaces/none", "é"]
        keys += ["vehicles/dif$*", "validate/x", "events/**", "a/b/c/d/e", "servers/*"]
        key = str(choose(rng, keys))
        if rng.random() < 0.3:
            key = other_bytes(rng, key.encode()).decode(errors="replace")
        root = choose(rng, [ROOT] * 8 + ["omniplan/v1/*", "omniplan/*/default", "**"])
        payload = None
        if rng.random() < 0.4:
            payload = other_json(rng, {"names": FIXED, "state": "x", "versions": {}})
        return Question("ask", f"{root}/{key}", payload)

    def _encoding(self) -> str:
        # Above 255 bytes zenoh panics where they are sent, not where they arrive.
        known = [JSON, ARROW, "zenoh/bytes", "text/plain", f"{JSON};x", "", "x" * 250]
        return str(choose(self.rng, [*known, "application/json ", "é\u0001", "a;b;c"]))

    def _wrong_encoding(self) -> Question:
        asked = self._validate() if self.rng.random() < 0.5 else self._batch_twists()
        payload = asked.payload
        if self.rng.random() < 0.2:
            payload = b" " * (MAX_BYTES + 1)
        return Question("ask", asked.key, payload, self._encoding())
