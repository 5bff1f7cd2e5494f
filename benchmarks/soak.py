"""Two servers under mixed load for minutes, killed again and again.

    python benchmarks/soak.py [--minutes 10] [--kill-every 20]

The servers are processes of `omniplan serve` with registration, each with its store.
Threads ask them everything, and compare every answer with that of the same call in
this process. It prints JSON: requests, latencies, what was lost or wrong, memory; the
exit code is 1 if anything was lost, wrong, or logged as an error, or memory has grown.

In the first half the servers are killed in turn: after a kill all load is at the other,
which is killed next. In the second half the first one lives on, with all the load, and
its memory is looked at.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import configspace
import omniplan
from omniplan.bench_cases import random_trajectories
from services import Client, Health, ServiceError
from services.registering.versions import Version

FLEET = ("ift-four-steered", "mecanum", "differential")
CONFIG = """
fleet = {fleet}
listen = "{listen}"
peers = ["{peer}"]
[log]
level = "warning"
format = "json"
[registration]
enabled = true
store = "{store}"
"""
TIMEOUT = 60.0  # s, for a question with all its attempts
PAUSE = 0.01  # s, between two questions of a thread
SLACK = 48 * 2**20
"""What the server that lives on may have grown by, bytes."""


class Process:
    """A server in a process of its own."""

    def __init__(self, folder: Path, index: int, endpoints: list[str]) -> None:
        config = folder / f"server-{index}.toml"
        text = CONFIG.format(
            fleet=json.dumps(FLEET),
            listen=endpoints[index],
            peer=endpoints[1 - index],
            store=folder / f"store-{index}",
        )
        config.write_text(text)
        command = [sys.executable, "-m", "omniplan.cli", "serve", "--json"]
        self.log = folder / f"server-{index}.log"
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                [*command, "--config", str(config)], stdout=subprocess.PIPE, stderr=log
            )

    def wait_until_ready(self) -> None:
        """Wait until it answers."""
        assert self._process.stdout is not None
        while self._process.stdout.readline() != b"}\n":
            if self._process.poll() is not None:
                raise SystemExit(f"a server has not started: {self.log.read_text()}")

    @property
    def memory(self) -> int:
        """What it holds in memory, bytes."""
        statm = Path(f"/proc/{self._process.pid}/statm").read_text("ascii")
        return int(statm.split()[1]) * resource.getpagesize()

    def end(self, number: signal.Signals) -> int:
        """Send a signal if it still runs, wait and return the exit code."""
        self._process.send_signal(number)
        code = self._process.wait(60)
        assert self._process.stdout is not None
        self._process.stdout.close()
        return code


class Answers:
    """What is asked, and what each answer must be: computed here, once."""

    def __init__(self) -> None:
        rng = np.random.default_rng(7)
        self.motions = random_trajectories(rng, 24)
        self.batch = self.motions[:6]
        self.twists = rng.normal(0.0, 0.6, (100_000, 3)).astype(np.float32)
        self.spaces = {
            name: configspace.build_space(configspace.load_vehicle(name))
            for name in FLEET
        }
        self.cart = configspace.load_vehicle("mecanum")
        fleet = list(self.spaces.values())
        self.reports = {
            (motion.name, name): omniplan.validate(motion, space)
            for motion in self.motions
            for name, space in self.spaces.items()
        }
        self.rankings = omniplan.select(self.motions, fleet)
        self.permitted = {
            name: omniplan.check_twists(self.twists, space)
            for name, space in self.spaces.items()
        }

    @cached_property
    def verdicts(self) -> list[dict[str, Any]]:
        """The rows of the batch, for all vehicles."""
        table = omniplan.validate_many(self.batch, list(self.spaces.values()))
        return list(table.to_pylist())


@dataclass
class Record:
    """What has happened; of all threads."""

    latencies: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    lost: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    def kinds(self) -> dict[str, Any]:
        """Return number and latencies of each kind of question."""
        return {
            kind: {
                "n": len(values),
                **{
                    f"p{q}_ms": round(1e3 * float(np.percentile(values, q)), 2)
                    for q in (50, 99)
                },
                "max_ms": round(1e3 * max(values), 1),
            }
            for kind, values in sorted(self.latencies.items())
        }


class Load:
    """A thread that asks one thing after the other."""

    def __init__(
        self, index: int, endpoints: list[str], answers: Answers, record: Record
    ) -> None:
        self._endpoints, self._answers, self._record = endpoints, answers, record
        self._random = random.Random(index)
        self.name = f"cart-{index}"
        self.newest = ""
        """Description of what was registered last; empty: it was removed."""
        self._version: Version | None = None
        self._n_changes = 0

    def run(self, is_over: threading.Event) -> None:
        """Ask until it is over."""
        kinds: list[tuple[str, int, Callable[[Client], bool]]] = [
            ("validate", 30, self._validate),
            ("select", 8, self._select),
            ("validate_many", 2, self._validate_many),
            ("check_twists", 4, self._check_twists),
            ("space", 8, self._space),
            ("vehicles", 15, self._vehicles),
            ("health", 10, self._health),
            ("register", 4, self._register),
            ("unregister", 1, self._unregister),
        ]
        weights = [weight for _, weight, _ in kinds]
        with Client(self._endpoints, timeout=TIMEOUT) as client:
            while not is_over.is_set():
                ((kind, _, ask),) = self._random.choices(kinds, weights)
                self._ask(kind, ask, client)
                is_over.wait(PAUSE)

    def _ask(self, kind: str, ask: Callable[[Client], bool], client: Client) -> None:
        began = time.perf_counter()
        try:
            is_right = ask(client)
        except ServiceError as error:
            self._record.lost.append(f"{kind}: {type(error).__name__}: {error}")
            return
        self._record.latencies[kind].append(time.perf_counter() - began)
        if not is_right:
            self._record.wrong.append(f"{kind} of {self.name}")

    def _name(self) -> str:
        return self._random.choice(FLEET)

    def _validate(self, client: Client) -> bool:
        name, motion = self._name(), self._random.choice(self._answers.motions)
        (report,) = client.validate([motion], name)
        return report == self._answers.reports[motion.name, name]

    def _select(self, client: Client) -> bool:
        index = self._random.randrange(len(self._answers.motions))
        (ranking,) = client.select([self._answers.motions[index]], FLEET)
        return ranking == self._answers.rankings[index]

    def _validate_many(self, client: Client) -> bool:
        table = client.validate_many(self._answers.batch, FLEET)
        return bool(table.to_pylist() == self._answers.verdicts)

    def _check_twists(self, client: Client) -> bool:
        name = self._name()
        permitted = client.check_twists(self._answers.twists, name)
        return np.array_equal(permitted, self._answers.permitted[name])

    def _space(self, client: Client) -> bool:
        name = self._name()
        expected = self._answers.spaces[name].header.fingerprint
        return client.space(name).header.fingerprint == expected

    def _vehicles(self, client: Client) -> bool:
        return client.vehicles()[: len(FLEET)] == FLEET

    def _health(self, client: Client) -> bool:
        health = client.health()
        bad = {"internal", "not_stored"}
        return not any(bad & set(key.codes) for key in health.keys.values())

    def _register(self, client: Client) -> bool:
        self._n_changes += 1
        text = f"change {self._n_changes}"
        file = {"name": self.name, "description": text}
        version = client.register(self._answers.cart.model_copy(update=file))
        self.newest = text
        return self._is_newer(version)

    def _unregister(self, client: Client) -> bool:
        if not self.newest:
            return True
        version = client.unregister(self.name)
        self.newest = ""
        return self._is_newer(version)

    def _is_newer(self, text: str) -> bool:
        old, self._version = self._version, Version.parse(text)
        return old is None or old < self._version


def free_endpoints() -> list[str]:
    with (
        socket.create_server(("127.0.0.1", 0)) as one,
        socket.create_server(("127.0.0.1", 0)) as other,
    ):
        return [f"tcp/127.0.0.1:{x.getsockname()[1]}" for x in (one, other)]


@contextlib.contextmanager
def running(loads: list[Load]) -> Iterator[None]:
    is_over = threading.Event()
    threads = [threading.Thread(target=x.run, args=(is_over,)) for x in loads]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        is_over.set()
        for thread in threads:
            thread.join()


def agree(endpoint: str, loads: list[Load]) -> bool:
    """Return whether a server comes to know what was registered last."""
    expected = {x.name: x.newest for x in loads if x.newest}
    until = time.monotonic() + 30
    with Client(endpoint, timeout=TIMEOUT) as client:
        while time.monotonic() < until:
            names = client.vehicles()[len(FLEET) :]
            known = {name: client.vehicle(name).description for name in names}
            if known == expected:
                return True
            time.sleep(0.1)
    return False


def errors_in(log: Path) -> list[str]:
    """Return the lines of a log that tell of an error."""
    lines = log.read_text("utf-8").splitlines()
    return [x for x in lines if '"level": "error"' in x or "Traceback" in x]


@contextlib.contextmanager
def started(folder: Path, endpoints: list[str]) -> Iterator[list[Process]]:
    """Yield the servers; those of the list run no longer afterwards."""
    servers = [Process(folder, i, endpoints) for i in range(len(endpoints))]
    try:
        for server in servers:
            server.wait_until_ready()
        yield servers
    finally:
        for server in servers:
            server.end(signal.SIGKILL)


def soak(folder: Path, seconds: float, kill_every: float, n: int) -> dict[str, Any]:
    """Run the load and return what has happened."""
    endpoints = free_endpoints()
    with started(folder, endpoints) as servers:
        return run(folder, endpoints, servers, seconds, kill_every, n)


def run(
    folder: Path,
    endpoints: list[str],
    servers: list[Process],
    seconds: float,
    kill_every: float,
    n: int,
) -> dict[str, Any]:
    """Ask the servers, kill and start them again, and return what has happened."""
    answers, record = Answers(), Record()
    loads = [Load(i, endpoints[:: 1 - 2 * (i % 2)], answers, record) for i in range(n)]
    memory: list[int] = []
    peaks = [0]
    n_kills = 0
    with running(loads):
        began = time.monotonic()
        next_kill = began + kill_every
        while (now := time.monotonic()) < began + seconds:
            is_first_half = now < began + seconds / 2
            if not is_first_half:
                memory.append(servers[0].memory)
            peaks[-1] = max(peaks[-1], *(server.memory for server in servers))
            if now >= next_kill:
                victim = (n_kills + 1) % 2 if is_first_half else 1
                servers[victim].end(signal.SIGKILL)
                servers[victim] = Process(folder, victim, endpoints)
                servers[victim].wait_until_ready()
                peaks.append(0)
                n_kills += 1
                next_kill += kill_every
            time.sleep(1.0)
    if not all(agree(endpoint, loads) for endpoint in endpoints):
        record.wrong.append("the servers do not know what was registered last")
    health = health_of(endpoints[0])
    exit_codes = [server.end(signal.SIGTERM) for server in servers]
    fifth = max(len(memory) // 5, 1)
    settled, last = np.median(memory[fifth : 2 * fifth]), np.median(memory[-fifth:])
    return {
        "seconds": seconds,
        "load": os.getloadavg(),
        "kills": n_kills,
        "requests": sum(len(values) for values in record.latencies.values()),
        "kinds": record.kinds(),
        "lost": record.lost,
        "wrong": record.wrong,
        "errors_in_logs": [x for server in servers for x in errors_in(server.log)],
        "exit_codes": exit_codes,
        "memory_mib": {
            "settled": round(float(settled) / 2**20, 1),
            "last": round(float(last) / 2**20, 1),
            "peak": round(max(memory) / 2**20, 1),
            "peaks_between_kills": [round(peak / 2**20, 1) for peak in peaks],
        },
        "has_grown": bool(last > settled + SLACK),
        "health": health.model_dump(),
    }


def health_of(endpoint: str) -> Health:
    """Return what a server says of itself."""
    with Client(endpoint, timeout=TIMEOUT) as client:
        return client.health()


def main() -> int:
    """Run and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--kill-every", type=float, default=20.0, help="seconds")
    parser.add_argument("--threads", type=int, default=6)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        result = soak(
            Path(folder), 60 * options.minutes, options.kill_every, options.threads
        )
    json.dump(result, sys.stdout, indent=2)
    sys.stdout.write("\n")
    bad = ("lost", "wrong", "errors_in_logs", "has_grown")
    return 1 if any(result[name] for name in bad) or any(result["exit_codes"]) else 0


if __name__ == "__main__":
    sys.exit(main())
