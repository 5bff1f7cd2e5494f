"""The bars of the service, each as a ratio within one run.

    python benchmarks/bench_service.py [--queries 2000] [--samples 1000000]

A server (`omniplan serve`), a bare zenoh echo and this client are three processes on
loopback. Small queries alternate with echoes that carry as many bytes both ways,
batches over the service with the same call within this process. It prints JSON.
Small queries beside a batch are in `bench_service_load.py`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import zenoh  # noqa: TID251 - what the service is compared with
from served import PER_TRAJECTORY, VEHICLE, served, wave

import configspace
import omniplan
from services import Client
from services.protocol.keys import Keys, Route
from services.protocol.messages import Health, ValidateReply, ValidateRequest, encode

ECHO = """
import json, sys, threading
import zenoh
config = zenoh.Config()
for key, value in json.loads(sys.argv[1]).items():
    config.insert_json5(key, json.dumps(value))
session = zenoh.open(config)
def answer(query):
    size = int(str(query.selector.parameters) or 0)
    query.reply("echo", b"x" * size)
session.declare_queryable("echo", answer)
print("ready", flush=True)
threading.Event().wait()
"""


def entries(**more: object) -> dict[str, object]:
    """Return zenoh's configuration: as that of the service."""
    off = ("scouting/multicast", "scouting/gossip", "transport/shared_memory")
    return {"mode": "peer", **{f"{name}/enabled": False for name in off}, **more}


@contextlib.contextmanager
def echo() -> Iterator[Callable[[bytes | None, int], None]]:
    """Yield a function that sends bytes to a bare zenoh peer and gets so many back."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    listen = {"listen/endpoints": [endpoint], "connect/endpoints": []}
    command = [sys.executable, "-c", ECHO, json.dumps(entries(**listen))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        config = zenoh.Config()
        connect = {"listen/endpoints": [], "connect/endpoints": [endpoint]}
        for key, value in entries(**connect).items():
            config.insert_json5(key, json.dumps(value))
        session = zenoh.open(config)

        def ask(payload: bytes | None, size: int) -> None:
            # As the client asks: what comes first is taken.
            none = zenoh.ConsolidationMode.NONE
            channel = session.get(f"echo?{size}", payload=payload, consolidation=none)
            reply = next(iter(channel))
            assert reply.ok is not None
            assert len(reply.ok.payload.to_bytes()) == size

        while True:  # until the queryable is known
            with contextlib.suppress(StopIteration):
                next(iter(session.get("echo?1")))
                break
        yield ask
        session.close()  # type: ignore[no-untyped-call]
        process.kill()


def elapsed(call: Callable[[], object]) -> float:
    """Return how long a call takes, s."""
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def alternated(
    calls: dict[str, Callable[[], object]], n: int
) -> dict[str, list[float]]:
    """Return the times of calls that take turns, s."""
    for call in calls.values():
        call()
    found: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(n):
        for name, call in calls.items():
            found[name].append(elapsed(call))
    return found


def small(client: Client, ask_echo: Callable[[bytes | None, int], None], n: int) -> Any:
    """Measure small queries against echoes of the same size."""
    motion = wave(20, "short")
    vehicles = len(b'{"vehicles":["mecanum"]}')
    health = client.health()
    asked = encode(ValidateRequest.of([motion], VEHICLE))
    reports = client.validate([motion], VEHICLE)
    answered = len(encode(ValidateReply.of(reports)))
    space = configspace.build_space(configspace.load_vehicle(VEHICLE))
    cases: dict[str, tuple[Callable[[], object], bytes | None, int]] = {
        Keys("default").of(Route("vehicles")): (client.vehicles, None, vehicles),
        Keys("default").of(Route("health")): (client.health, None, size_of(health)),
        Keys("default").of(Route("validate")): (
            lambda: client.validate([motion], VEHICLE),
            asked,
            answered,
        ),
    }
    result: dict[str, Any] = {}
    for key, (call, payload, size) in cases.items():
        name = key.rpartition("/")[2]
        calls: dict[str, Callable[[], object]] = {
            "query": call,
            "echo": lambda payload=payload, size=size: ask_echo(payload, size),  # type: ignore[misc]
        }
        if payload is not None:
            calls["in_process"] = lambda: omniplan.validate(motion, space)
        times = alternated(calls, n)
        result[name] = {}
        # The tenth that other work on the machine has disturbed least, and half.
        for q in (10, 50):
            at = {kind: float(np.percentile(x, q)) for kind, x in times.items()}
            result[name] |= {f"{kind}_p{q}_ms": 1e3 * at[kind] for kind in at}
            result[name][f"ratio_p{q}"] = at["query"] / at["echo"]
    return result


def size_of(health: Health) -> int:
    return len(encode(health))


def batches(
    client: Client, ask_echo: Callable[[bytes | None, int], None], samples: int, n: int
) -> Any:
    """Measure batches over the service against those within this process."""
    space = configspace.build_space(configspace.load_vehicle(VEHICLE))
    motions = [wave(PER_TRAJECTORY, f"{i}") for i in range(samples // PER_TRAJECTORY)]
    rng = np.random.default_rng(0)
    twists = rng.normal(0.0, 0.3, (samples, 3)).astype(np.float32)
    pairs: dict[str, dict[str, Callable[[], object]]] = {
        "validate_many": {
            "service": lambda: client.validate_many(motions, [VEHICLE]),
            "in_process": lambda: omniplan.validate_many(motions, [space]),
        },
        "check_twists": {
            "service": lambda: client.check_twists(twists, VEHICLE),
            "in_process": lambda: omniplan.check_twists(twists, space),
            # The least that sending them takes; a bit comes back for each.
            "echo": lambda: ask_echo(twists.tobytes(), samples // 8),
        },
    }
    result = {}
    for name, calls in pairs.items():
        times = alternated(calls, n)
        best = {kind: min(values) for kind, values in times.items()}
        median = {kind: float(np.median(values)) for kind, values in times.items()}
        result[name] = {
            **{
                f"{kind}_samples_per_s": samples / value for kind, value in best.items()
            },
            "ratio_of_best": best["in_process"] / best["service"],
            "ratio_of_medians": median["in_process"] / median["service"],
        }
    return result


def main() -> None:
    """Measure and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--queries", type=int, default=2000)
    parser.add_argument("--samples", type=int, default=10**6)
    parser.add_argument("--rounds", type=int, default=7, help="of each batch")
    options = parser.parse_args()
    result: dict[str, Any] = {"load_before": os.getloadavg()[0]}
    with (
        served() as (endpoint, _),
        echo() as ask_echo,
        Client(endpoint, timeout=120.0) as client,
    ):
        client.wait_until_ready()
        result["small"] = small(client, ask_echo, options.queries)
        result["batches"] = batches(client, ask_echo, options.samples, options.rounds)
    result["load_after"] = os.getloadavg()[0]
    json.dump(result, sys.stdout, indent=2)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
