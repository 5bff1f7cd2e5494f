"""Small queries to a server while it works at a batch of 10⁷ samples.

Run it by itself: ``python benchmarks/bench_service_load.py [--samples 10000000]``. The
server, the client of small queries and the client of the batch are three processes. It
prints latency quantiles of small queries without and beside the batch, the samples per
second of the batch beside them and alone, and the load of the machine.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable
from multiprocessing.synchronize import Event
from typing import Any

import numpy as np
from served import PER_TRAJECTORY, VEHICLE, served, wave

from services import Client

SMALL_EVERY = 0.01  # s


def ask_small(endpoint: str, seconds: float, stop: Event | None) -> dict[str, Any]:
    """Ask at a steady pace; return latencies in ms, from when each was due."""
    short = wave(20, "short")
    found: dict[str, list[float]] = {"vehicles": [], "validate": []}
    with Client(endpoint, timeout=30.0) as client:
        client.wait_until_ready()
        questions: dict[str, Callable[[], object]] = {
            "vehicles": client.vehicles,
            "validate": lambda: client.validate([short], VEHICLE),
        }
        for question in questions.values():
            question()
        began = time.perf_counter()
        due = began
        index = 0
        while (due - began < seconds) if stop is None else not stop.is_set():
            due += SMALL_EVERY
            time.sleep(max(0.0, due - time.perf_counter()))
            name = list(questions)[index % 2]
            index += 1
            asked = time.perf_counter()
            questions[name]()
            # A question that is asked late because the one before was answered late
            # has waited, too.
            since = min(due, asked)
            found[name].append(1e3 * (time.perf_counter() - since))
            due = max(due, time.perf_counter() - SMALL_EVERY)
    return {
        name: {
            "n": len(values),
            **{f"p{q}": float(np.percentile(values, q)) for q in (50, 90, 99)},
            "max": max(values),
        }
        for name, values in found.items()
    }


def ask_large(kind: str, endpoint: str, samples: int) -> float:
    """Ask a batch; return its samples per second."""
    with Client(endpoint, timeout=600.0) as client:
        client.wait_until_ready()
        if kind == "json":
            chunk = [wave(PER_TRAJECTORY, f"{i}") for i in range(5)]
            began = time.perf_counter()
            for _ in range(samples // (5 * PER_TRAJECTORY)):
                client.validate(chunk, VEHICLE)
        elif kind == "trajectories":
            n = samples // PER_TRAJECTORY
            motions = [wave(PER_TRAJECTORY, f"{i}") for i in range(n)]
            began = time.perf_counter()
            client.validate_many(motions, [VEHICLE])
        else:
            random = np.random.default_rng(0)
            twists = random.normal(0.0, 0.3, (samples, 3)).astype(np.float32)
            began = time.perf_counter()
            client.check_twists(twists, VEHICLE)
        return samples / (time.perf_counter() - began)


def small_process(
    endpoint: str, stop: Event, ready: Event, found: multiprocessing.SimpleQueue[Any]
) -> None:
    """Ask small questions until it is told to stop."""
    ready.set()
    found.put(ask_small(endpoint, 0.0, stop))


def measure(kind: str, endpoint: str, samples: int) -> dict[str, Any]:
    """Return what small queries meet beside one kind of batch."""
    context = multiprocessing.get_context("spawn")
    stop, ready = context.Event(), context.Event()
    found = context.SimpleQueue()
    process = context.Process(
        target=small_process, args=(endpoint, stop, ready, found), daemon=True
    )
    process.start()
    ready.wait()
    beside = ask_large(kind, endpoint, samples)
    stop.set()
    small = found.get()
    process.join()
    alone = ask_large(kind, endpoint, samples)
    return {"small": small, "samples_per_s": beside, "alone": alone}


def main() -> None:
    """Measure and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=10**7)
    parser.add_argument(
        "--kinds", nargs="+", default=["json", "trajectories", "twists"]
    )
    options = parser.parse_args()
    with served() as (endpoint, server):
        results: dict[str, Any] = {
            "load": os.getloadavg()[0],
            "quiet": ask_small(endpoint, 5.0, None),
        }
        for kind in options.kinds:
            results[kind] = measure(kind, endpoint, options.samples)
            results[kind]["load"] = os.getloadavg()[0]
        with Client(endpoint) as client:
            results["health"] = client.health().model_dump()
        server.terminate()
        results["exit_code"] = server.wait(30)
    json.dump(results, sys.stdout, indent=2)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
