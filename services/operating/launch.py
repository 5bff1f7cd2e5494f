"""From a configuration to a server."""

from __future__ import annotations

import gc
from collections.abc import Sequence

import numpy as np

import configspace
import omniplan
from configspace.space import PermissibleSpace
from omniplan.batch.lookup import CHUNK
from services.answering.server import Server
from services.guarding.security import Roles, Security
from services.operating.config import ServiceConfig
from services.registering.registry import Registry

__all__ = ["registry_of", "server_of", "settle", "warm_up"]


def registry_of(config: ServiceConfig, fleet: Sequence[PermissibleSpace]) -> Registry:
    """Return the vehicles of a server; close it after the server.

    Without a store nothing can be registered. With one, what is in it is served, also
    where registration is off by now.

    Parameters
    ----------
    config : ServiceConfig
    fleet : sequence of PermissibleSpace
        The vehicles that ``config.fleet`` names.

    Raises
    ------
    InvalidInput
        If two vehicles have one name, or a name that fits no key.
    StoreError
        If the store cannot be used.
    """
    given = config.registration
    if given.store is None:
        return Registry(fleet)
    return Registry.open(
        fleet,
        given.store,
        registration=given.enabled,
        max_vehicles=given.max_vehicles,
        max_memory=given.max_memory,
    )


def server_of(config: ServiceConfig, registry: Registry) -> Server:
    """Return the server that a configuration describes, not yet started.

    Parameters
    ----------
    config : ServiceConfig
    registry : Registry
        See `registry_of`.

    Raises
    ------
    InvalidInput
        If an address or a certificate cannot be used.
    """
    limits, queue = config.limits, config.queue
    return Server(
        site=config.site,
        listen=config.listen,
        workers=config.workers,
        queue_size=queue.size,
        queue_bytes=queue.bytes,
        max_bytes=limits.max_bytes,
        max_samples=limits.max_samples,
        max_batch_samples=limits.max_batch_samples,
        max_time=limits.max_time,
        stop_within=config.stop_within,
        security=_security(config),
        allow_insecure=config.allow_insecure,
        registry=registry,
        peers=config.peers,
    )


def warm_up(fleet: Sequence[PermissibleSpace]) -> None:
    """Do every kind of work once, so that no request waits for kernels to be compiled.

    numba keeps what it compiles (``NUMBA_CACHE_DIR``): from the second start on this
    takes a second or two.

    Parameters
    ----------
    fleet : sequence of PermissibleSpace
        Of each sort of vehicle one is taken.
    """
    vehicle = configspace.load_vehicle("differential")
    configspace.build_space(vehicle, configspace.Grid(4, 8), cache=False)
    sorts = {(s.line_beta is None, s.is_translating): s for s in fleet}
    t = [0.0, 1.0, 2.0, 3.0]
    rows = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.02, 0.0, 0.0], [0.03, 0.0, 0.0]]
    motions = [
        omniplan.Trajectory.from_poses(t, rows, name="poses"),
        omniplan.Trajectory.from_twists(t, rows, name="twists"),
    ]
    for space in sorts.values():
        for motion in motions:
            omniplan.select(motion, [space])
        omniplan.validate_many(motions, [space])
        for kind in (np.float32, np.float64):
            for n in (1, CHUNK + 1):
                omniplan.check_twists(np.zeros((n, 3), dtype=kind), space)


def settle() -> None:
    """Tell Python's garbage collector to look no more at what has been loaded so far.

    Each of its full runs holds all threads; over the objects of the loaded libraries
    one takes 0.2 s to 0.4 s, and reading one large request starts several.
    """
    gc.collect()
    gc.freeze()


def _security(config: ServiceConfig) -> Security | None:
    given = config.security
    if given is None:
        return None
    roles = Roles(
        planners=given.planners,
        fleet_managers=given.fleet_managers,
        vehicles=given.vehicles,
        servers=given.servers,
    )
    return Security(given.ca, given.certificate, given.key, roles)
