"""The decorator of kernels that allocate nothing."""

from __future__ import annotations

import functools

from numba import njit

__all__ = ["kernel"]

kernel = functools.partial(njit, cache=True, _nrt=False)
"""`numba.njit` without allocation (numba's own name for that is ``_nrt``).

Otherwise a function counts references to all its array arguments when it begins and
ends, atomically, and the kernels for pairs spend nearly half of their time with that.
Inside such a function there is no ``np.empty`` and no assignment to slices; scratch
comes from outside. It may call functions that allocate.
"""
