"""Straight motions of OMPL against the table of a vehicle.

States are read by `StateSpace.serialize`, which writes all numbers of a state at once:
that is quicker than asking for them one by one.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from omniplan.sampling.kernels import is_move_permitted

__all__ = ["lines_permitted"]

FloatArray = npt.NDArray[np.float64]

_NUMBERS = 3 * ctypes.sizeof(ctypes.c_double)
"""Bytes of a serialized state of SE(2): x, y and the heading."""


def lines_permitted(
    state_space: Any,
    table: FloatArray,
    others: Callable[[Any, Any, Any], bool] | None,
) -> Callable[[Any, Any, Any], bool]:
    """Return the method that holds straight motions against the vehicle's table.

    The kernel reads both poses from the first numbers of a copy of the table. A copy is
    taken from the stock for every call and given back: threads do not meet in it.

    Parameters
    ----------
    state_space : OMPL state space
        SE(2).
    table : (n,) float
        Of `PermittedIntervals`.
    others : callable, optional
        Asked with the same arguments after a yes.
    """
    write = state_space.serialize
    judge = is_move_permitted

    def made() -> tuple[Any, Any, FloatArray]:
        own = table.copy()
        address = own.ctypes.data
        return _capsule(address), _capsule(address + _NUMBERS), own

    stock = [made()]
    take, give = stock.pop, stock.append

    def check_motion(validator: Any, first: Any, second: Any) -> bool:
        try:
            place = take()
        except IndexError:  # all are in use by other threads
            place = made()
        at_first, at_second, own = place
        write(at_first, first)
        write(at_second, second)
        answer: bool = judge(own)
        give(place)
        if answer and others is not None:
            return others(validator, first, second)
        return answer

    return check_motion


def _capsule(address: int) -> Any:
    """Return a C pointer as nanobind takes it for ``void *``."""
    make = ctypes.pythonapi.PyCapsule_New
    make.restype = ctypes.py_object
    make.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    return make(address, b"nb_handle", None)
