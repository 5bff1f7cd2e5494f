"""The client for asyncio: the same questions as coroutines."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Concatenate, ParamSpec, Self, TypeVar

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from configspace.errors import InvalidInput, Problem
from configspace.space import PermissibleSpace
from configspace.vehicle import Vehicle
from omniplan.choosing.requirements import Requirement
from omniplan.report import Ranking, Report
from omniplan.trajectory import Trajectory
from services.asking.batch_client import Progress
from services.asking.client import Client
from services.guarding.security import Security
from services.protocol.endpoint import DEFAULT_ENDPOINT
from services.protocol.messages import Health
from services.wire.exchange import Stop

__all__ = ["AsyncClient"]

P = ParamSpec("P")
T = TypeVar("T")


class AsyncClient:
    """Asks a server without holding up the event loop; use it with ``async with``.

    The names, values and errors are those of `Client`. A task that is cancelled cancels
    its question: the server is told and stops between two parts of its work.

    Parameters
    ----------
    endpoint, site, timeout, attempt_timeout, retry, security
        As for `Client`.
    max_concurrent : int, ≥ 1
        Questions under way at a time; more wait for their turn.
    """

    def __init__(
        self,
        endpoint: str | Sequence[str] = DEFAULT_ENDPOINT,
        *,
        site: str = "default",
        timeout: float = 10.0,
        attempt_timeout: float | None = None,
        retry: bool = True,
        security: Security | None = None,
        max_concurrent: int = 32,
    ) -> None:
        if max_concurrent < 1:
            raise InvalidInput(
                Problem("max_concurrent", f"{max_concurrent}", "at least 1")
            )
        self._client = Client(
            endpoint,
            site=site,
            timeout=timeout,
            attempt_timeout=attempt_timeout,
            retry=retry,
            security=security,
        )
        self._threads = ThreadPoolExecutor(max_concurrent, "omniplan-client")

    async def validate(
        self,
        trajectories: Sequence[Trajectory],
        vehicle: str,
        *,
        allow_unreachable: bool = False,
    ) -> tuple[Report, ...]:
        """Ask whether a vehicle can drive trajectories, see `Client.validate`."""
        return await self._run(
            Client.validate, trajectories, vehicle, allow_unreachable=allow_unreachable
        )

    async def select(
        self,
        trajectories: Sequence[Trajectory],
        vehicles: Sequence[str] | None = None,
        by: str = "duration",
        *,
        requirements: Sequence[Requirement | str] = (),
        allow_unreachable: bool = False,
        online_only: bool = False,
    ) -> tuple[Ranking, ...]:
        """Ask which vehicles can drive trajectories, see `Client.select`."""
        return await self._run(
            Client.select,
            trajectories,
            vehicles,
            by,
            requirements=requirements,
            allow_unreachable=allow_unreachable,
            online_only=online_only,
        )

    async def validate_many(
        self,
        trajectories: Sequence[Trajectory],
        vehicles: Sequence[str] | None = None,
        *,
        allow_unreachable: bool = False,
        progress: Progress | None = None,
        timeout: float | None = None,
    ) -> pa.Table:
        """Ask about many trajectories, see `Client.validate_many`.

        `progress` is called in the event loop.
        """
        return await self._run(
            Client.validate_many,
            trajectories,
            vehicles,
            allow_unreachable=allow_unreachable,
            progress=_in_loop(progress),
            timeout=timeout,
        )

    async def verdicts(
        self,
        trajectories: Sequence[Trajectory],
        vehicles: Sequence[str] | None = None,
        *,
        allow_unreachable: bool = False,
        progress: Progress | None = None,
        timeout: float | None = None,
    ) -> AsyncGenerator[pa.Table, None]:
        """Ask as `validate_many`, and yield the rows in parts as they come.

        Closing the generator, or cancelling its task, cancels what is left.
        """
        stop = Stop()
        parts = self._client.stoppable(stop).verdicts(
            trajectories,
            vehicles,
            allow_unreachable=allow_unreachable,
            progress=_in_loop(progress),
            timeout=timeout,
        )
        is_idle = False
        try:
            while True:
                is_idle = False
                rows = await self._in_thread(stop, lambda: next(parts, None))
                is_idle = True
                if rows is None:
                    return
                yield rows
        finally:
            stop.set()
            # A thread that is still within the generator ends it by itself.
            if is_idle:
                self._threads.submit(parts.close)

    async def check_twists(
        self,
        twists: npt.ArrayLike,
        vehicle: str,
        *,
        progress: Progress | None = None,
        timeout: float | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Ask which twists are permitted, see `Client.check_twists`."""
        return await self._run(
            Client.check_twists,
            twists,
            vehicle,
            progress=_in_loop(progress),
            timeout=timeout,
        )

    async def vehicles(self) -> tuple[str, ...]:
        """Return the names of the vehicles that the server knows."""
        return await self._run(Client.vehicles)

    async def vehicle(self, name: str) -> Vehicle:
        """Return a vehicle."""
        return await self._run(Client.vehicle, name)

    async def space(self, name: str) -> PermissibleSpace:
        """Return a vehicle's data sheet, see `Client.space`."""
        return await self._run(Client.space, name)

    async def health(self) -> Health:
        """Return the state of the server."""
        return await self._run(Client.health)

    async def register(
        self, vehicle: Vehicle, expected_version: str | None = None
    ) -> str:
        """Register a vehicle, see `Client.register`."""
        return await self._run(Client.register, vehicle, expected_version)

    async def unregister(self, name: str, expected_version: str | None = None) -> str:
        """Remove a registered vehicle, see `Client.unregister`."""
        return await self._run(Client.unregister, name, expected_version)

    async def wait_until_ready(self, timeout: float | None = None) -> None:
        """Wait until a server of the site can be asked, see `Client`."""
        await self._run(Client.wait_until_ready, timeout)

    async def close(self) -> None:
        """End the connection and all questions under way; more are errors."""
        await asyncio.to_thread(self._client.close)
        self._threads.shutdown(wait=False, cancel_futures=True)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.close()

    async def _run(
        self,
        question: Callable[Concatenate[Client, P], T],
        *args: P.args,
        **kwargs: P.kwargs,
    ) -> T:
        """Ask in a thread; a cancelled task ends the question."""
        stop = Stop()
        client = self._client.stoppable(stop)
        return await self._in_thread(stop, lambda: question(client, *args, **kwargs))

    async def _in_thread(self, stop: Stop, call: Callable[[], T]) -> T:
        loop = asyncio.get_running_loop()
        future = loop.run_in_executor(self._threads, call)
        try:
            return await future
        except asyncio.CancelledError:
            stop.set()
            raise


def _in_loop(progress: Progress | None) -> Progress | None:
    """Return a function for other threads that calls `progress` in this loop."""
    if progress is None:
        return None
    loop = asyncio.get_running_loop()

    def told(done: int, total: int) -> None:
        loop.call_soon_threadsafe(progress, done, total)

    return told
