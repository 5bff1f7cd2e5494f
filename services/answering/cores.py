"""How the cores are shared, so that small requests find one free.

Large requests are worked at side by side, each on its share of the cores: while one is
read, or its answer written, the kernels of another go on.
"""

from __future__ import annotations

import numba

__all__ = ["large_at_once", "share_cores"]


def large_at_once(workers: int, *, is_alone: bool) -> int:
    """Return how many large requests are worked at together.

    A worker stays for small ones, and so does a core while there are any.

    Parameters
    ----------
    workers : int
    is_alone : bool
        Whether no small request is about.
    """
    return max(1, min(workers - 1, _free(is_alone)))


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
        Large requests that are worked at together.
    """
    n_threads = max(1, _free(is_alone) // n_large) if is_large else 1
    if numba.get_num_threads() != n_threads:
        numba.set_num_threads(n_threads)


def _free(is_alone: bool) -> int:
    """Return how many cores large requests may take."""
    cores = int(numba.config.NUMBA_NUM_THREADS)
    return cores if is_alone else cores - 1
