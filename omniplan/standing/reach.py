"""Pieces of a motion in another component of the space than straight ahead."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace, Reason
from configspace.angles import wrap
from configspace.omni_curve import curvature_of_ratio
from omniplan.judging.proof import Parts, Piece
from omniplan.judging.rows import Judge

__all__ = ["configurations", "is_apart"]

FloatArray = npt.NDArray[np.float64]


def is_apart(
    parts: Parts, piece: Piece, sign: int, judge: Judge, space: PermissibleSpace
) -> bool:
    """Return whether a piece is for sure in another component than straight ahead.

    A permitted piece is continuous, so it stays in the component that any of its
    configurations lies in. It is apart if one is, for sure, and none is connected, for
    sure; what the cells leave undecided counts as connected.

    Parameters
    ----------
    parts : Parts
        Decided.
    piece : Piece
    sign : {-1, 1}
        The representation.
    judge : Judge
    space : PermissibleSpace
    """
    kappa_n, beta = configurations(parts, sign, judge, space, piece)
    if space.is_reachable(kappa_n, beta).any():
        return False
    return bool((space.reason(kappa_n, beta) & Reason.UNREACHABLE).any())


def configurations(
    parts: Parts, sign: int, judge: Judge, space: PermissibleSpace, piece: Piece
) -> tuple[FloatArray, FloatArray]:
    """Return the configurations at the ends of all parts of a piece.

    Parameters
    ----------
    parts : Parts
    sign : {-1, 1}
    judge : Judge
    space : PermissibleSpace
    piece : Piece

    Returns
    -------
    kappa_n : (2 m,) float, 1, [-2, 2]
    beta : (2 m,) float, rad
        Of a line-mobile vehicle its constant, wherever it is meant.
    """
    e, rows = parts.enclosure, slice(piece.first, piece.last + 1)
    own = sign * np.tile(e.sign[rows], 2)
    omega = own * np.concatenate([e.omega0[rows], e.omega1[rows]])
    v = own * np.concatenate([e.v0[rows], e.v1[rows]])
    body = v + 1j * omega * judge.reference
    beta, line = np.angle(body), space.line_beta
    if line is not None:
        off = np.abs(wrap(beta - line))
        if not judge.needs_configuration:  # nothing steers: v_s has either sign
            omega = np.where(off > np.pi / 2, -omega, omega)
            beta = np.full(beta.shape, line)
        else:  # what slips a little is on the line
            beta = np.where(off < np.pi / 4, line, beta)
    kappa_n = curvature_of_ratio(np.abs(body), omega / judge.kappa_g)
    if space.is_translating:
        kappa_n = np.zeros_like(kappa_n)
    return np.clip(kappa_n, -2, 2), beta
