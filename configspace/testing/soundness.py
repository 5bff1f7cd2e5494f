"""What every space must keep: no answer "permitted" is wrong."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace.space import PermissibleSpace
from configspace.testing.bodies import rigid_body
from configspace.vehicle import Vehicle

__all__ = ["assert_sound"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def assert_sound(
    space: PermissibleSpace,
    vehicle: Vehicle,
    kappa_n: npt.ArrayLike,
    beta: npt.ArrayLike,
) -> None:
    """Fail unless the space promises nothing that the rigid-body formula forbids.

    Checks `v_max` and `contains` in both driving directions, and, if the space knows
    its vehicle, that clearly permitted configurations are not refused.

    Parameters
    ----------
    space : PermissibleSpace
        Of this vehicle, built or read from a data sheet.
    vehicle : Vehicle
    kappa_n : (...,) float, 1, [-2, 2]
    beta : (...,) float, rad

    Raises
    ------
    AssertionError
        Naming the first configuration that breaks the promise.
    """
    kappa_n, beta = np.broadcast_arrays(
        np.asarray(kappa_n, np.float64), np.asarray(beta, np.float64)
    )
    for reverse in (False, True):
        truth = rigid_body(vehicle, kappa_n, beta, reverse=reverse)
        promised = space.v_max(kappa_n, beta, reverse=reverse)
        _fail_where(
            truth.is_blocked & (promised > 0), "blocked but permitted", kappa_n, beta
        )
        too_fast = promised > truth.v_max * (1 + 1e-12)
        _fail_where(too_fast, "faster than permitted", kappa_n, beta)
        v_s = -promised if reverse else promised
        moves = (promised > 0) & np.isfinite(promised)
        held = space.contains(kappa_n, beta, v_s)
        _fail_where(moves & ~held, "v_max itself is refused", kappa_n, beta)
        over = v_s * (1 + 1e-9)
        taken = space.contains(kappa_n, beta, over)
        _fail_where(moves & taken, "more than v_max is taken", kappa_n, beta)
        if space.vehicle is not None:
            refused = truth.is_clear() & (truth.permitted > 0) & (promised <= 0)
            _fail_where(refused, "clearly permitted but refused", kappa_n, beta)


def _fail_where(
    wrong: BoolArray, what: str, kappa_n: FloatArray, beta: FloatArray
) -> None:
    if wrong.any():
        first = tuple(np.argwhere(wrong)[0])
        raise AssertionError(
            f"{what} at {int(wrong.sum())} of {wrong.size} configurations, first "
            f"kappa_n = {float(kappa_n[first])!r}, beta = {float(beta[first])!r}"
        )
