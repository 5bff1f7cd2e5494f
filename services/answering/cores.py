"""How many cores one chunk of work may take, so that small requests find one free."""

from __future__ import annotations

import numba

__all__ = ["large_at_once", "share_cores"]


def large_at_once(workers: int) -> int:
    """Return how many large requests are worked at together.

    A worker stays for small ones, and so does a core.
    """
    return max(1, min(workers - 1, _n_cores() - 1))


def share_cores(is_large: bool, is_alone: bool, n_large: int) -> None:
    """Set how many threads the parallel kernels take in the thread that calls.

    Parameters
    ----------
    is_large : bool
        Whether the chunk belongs to a large request. A small one takes one thread:
        it has too little to do for more.
    is_alone : bool
        Whether no small request is about: then nothing needs to be left free.
    n_large : int, ≥ 1
        Large requests that may be worked at together.
    """
    cores = _n_cores()
    free = cores if is_alone else cores - 1
    n_threads = max(1, free // n_large) if is_large else 1
    if numba.get_num_threads() != n_threads:
        numba.set_num_threads(n_threads)


def _n_cores() -> int:
    return int(numba.config.NUMBA_NUM_THREADS)
