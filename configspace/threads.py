"""Whether kernels may run in several threads at once.

Compiled kernels that release Python's global lock let other threads work meanwhile,
such as a server that answers small questions beside large ones. But two parallel
kernels at once are allowed on numba's threading layers tbb and omp only; the third,
workqueue, ends the process. Where no other is there, the lock keeps them apart.
"""

from __future__ import annotations

import importlib

import numba

__all__ = ["RELEASES_LOCK"]


def _has_safe_layer() -> bool:
    """Return whether the layer that numba will choose allows several threads."""
    chosen = numba.config.THREADING_LAYER
    if chosen in ("workqueue", "forksafe"):  # which may be workqueue
        return False
    if chosen in ("tbb", "omp", "safe", "threadsafe"):
        return True  # or numba refuses to start
    for name in numba.config.THREADING_LAYER_PRIORITY:
        if name == "workqueue":
            return False
        try:
            # A layer whose library is not installed cannot be imported.
            importlib.import_module(f"numba.np.ufunc.{name}pool")
        except ImportError:
            continue
        return True
    return False


RELEASES_LOCK: bool = _has_safe_layer()
"""For ``nogil`` of every kernel that is parallel or runs long."""
