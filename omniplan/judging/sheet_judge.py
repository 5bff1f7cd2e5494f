"""Judging by the tables of a data sheet alone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from configspace import PermissibleSpace
from configspace.kernels import FREE
from configspace.omni_curve import curvature_of_ratio
from omniplan.judging.chords import Chord, along, ends_moving, off_line, size, speed_of
from omniplan.judging.rows import Bounds, Row, Tolerances, WindingWheel
from omniplan.motion import Enclosure

__all__ = ["SheetJudge"]

FloatArray = npt.NDArray[np.float64]


class SheetJudge:
    """Judges by the tables of a data sheet alone; mixed cells count as blocked."""

    def __init__(
        self, space: PermissibleSpace, tolerances: Tolerances, *, is_own: bool
    ) -> None:
        self._space = space
        self._tolerances = tolerances
        self._is_own = is_own
        self.kappa_g = space.kappa_g
        self.reference = complex(*space.header.reference)
        self.wheel_ids = space.header.wheel_ids
        self.needs_configuration = space.line_beta is None
        # A table knows of directions, not of angles: the cut of a range of more than
        # a full turn stays blocked.
        self.winding_wheels: tuple[WindingWheel, ...] = ()
        rows = [
            Row("BLOCKED", -1, 0.0, "m/s", "none", True),
            Row("V_MAX", -1, 1.0, "1", "speed"),
        ]
        if space.line_beta is not None:
            sine = math.sin(tolerances.slip_angle)
            rows.append(Row("FIXED_WHEEL", -1, sine, "1", "none"))
        self.rows: tuple[Row, ...] = tuple(rows)

    def utilisations(self, part: Enclosure, signs: Sequence[int]) -> dict[int, Bounds]:
        """Return low and high utilisation, (m, rows), of every representation."""
        return {sign: self.utilisation(part, sign) for sign in signs}

    def utilisation(self, part: Enclosure, sign: int) -> Bounds:
        """Return low and high utilisation, (m, rows), of representation `sign`."""
        own = sign * part.sign
        body = Chord.of(part, self.reference)
        line = self._space.line_beta
        entries: list[Bounds] = []
        if line is not None and not self._is_own:
            # The representation with β on the line: v_s has the sign of the motion.
            forward = (body.a + body.b) * np.exp(-1j * line)
            own = np.where(forward.real < 0, -1.0, 1.0)
        kappa, beta, speed = self._box(part, body, own)
        if self._is_own:
            v_low, v_high = np.maximum(part.scale0, part.scale1), part.scale_high
        else:
            v_low = np.maximum(speed[0] * part.scale0, speed[1] * part.scale1)
            v_high = speed[2] * part.scale_high
        state, v_max = np.empty(own.shape, np.uint8), np.empty(own.shape)
        for mask, reverse in ((own > 0, False), (own <= 0, True)):
            state[mask], v_max[mask] = self._space.box(
                kappa[0][mask],
                kappa[1][mask],
                *(b[mask] for b in beta),
                reverse=reverse,
            )
        free = state == FREE
        exact = self._at_ends(part, body, own)
        floor = -1.0 if self._is_own else self._tolerances.standstill
        moving = ends_moving(part, body, self.kappa_g, floor)
        blocked_end = ((exact[0] <= 0) & (moving[0] > 0)) | (
            (exact[1] <= 0) & (moving[1] > 0)
        )
        entries.append(
            (np.where(blocked_end, np.inf, 0.0), np.where(free, 0.0, np.inf))
        )
        if self._is_own:
            entries.append((v_low, v_high))
        else:
            with np.errstate(divide="ignore", invalid="ignore"):
                low = np.maximum(
                    *(
                        np.where(e > 0, s * f / e, 0.0)
                        for s, f, e in zip(
                            speed[:2], (part.scale0, part.scale1), exact, strict=True
                        )
                    )
                )
                high = np.where(free, v_high / v_max, 0.0)
            entries.append((low, np.maximum(high, low)))
        if line is not None:
            entries.append(
                off_line(body, own, line)
                if self._is_own
                else self._slip(part, body, line)
            )
        low, high = (np.stack(column, axis=1) for column in zip(*entries, strict=True))
        return low, high

    def _at_ends(
        self, part: Enclosure, body: Chord, own: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return v_max by the table at both ends."""
        ends = []
        for v, omega in ((body.a, part.omega0), (body.b, part.omega1)):
            p, q = np.abs(v), own * omega / self.kappa_g
            kappa = np.clip(curvature_of_ratio(p, q), -2, 2)
            beta = np.angle(own * v)
            if self._space.line_beta is not None:
                beta = np.full_like(p, self._space.line_beta)
            bound = self._space.v_max(kappa, beta)
            reverse = self._space.v_max(kappa, beta, reverse=True)
            ends.append(np.where(own < 0, reverse, bound))
        return ends[0], ends[1]

    def _box(
        self, part: Enclosure, body: Chord, own: FloatArray
    ) -> tuple[Bounds, Bounds, tuple[FloatArray, FloatArray, FloatArray]]:
        """Return the box in (κ_n, β) that a part stays in, and its speeds."""
        spread = part.dt**2 / 8 * part.omega_ddot / self.kappa_g
        q0, q1 = (own * w / self.kappa_g for w in (part.omega0, part.omega1))
        q_low, q_high = np.minimum(q0, q1) - spread, np.maximum(q0, q1) + spread
        # κ_n grows with q; with p it shrinks towards 0.
        p_far, p_near = body.far, body.near
        low = curvature_of_ratio(np.where(q_low >= 0, p_far, p_near), q_low)
        high = curvature_of_ratio(np.where(q_high >= 0, p_near, p_far), q_high)
        lost, more = body.near <= 0, body.spread()
        start = np.angle(own * body.a)
        end = start + np.angle(body.b * body.a.conj())
        beta_low = np.where(lost, -np.pi, np.minimum(start, end) - more)
        beta_high = np.where(lost, np.pi, np.maximum(start, end) + more)
        v0 = np.maximum(np.abs(body.a), np.abs(q0))
        v1 = np.maximum(np.abs(body.b), np.abs(q1))
        v_high = np.maximum(body.far, np.maximum(np.abs(q_low), np.abs(q_high)))
        return (
            (np.clip(low, -2, 2), np.clip(high, -2, 2)),
            (beta_low - 1e-12, beta_high + 1e-12),
            (v0, v1, v_high),
        )

    def _slip(self, part: Enclosure, body: Chord, line: float) -> Bounds:
        aside = along(body, np.exp(-1j * (line + math.pi / 2)))
        allowed = [
            np.maximum(
                math.sin(self._tolerances.slip_angle) * v, self._tolerances.slip_speed
            )
            for v in speed_of(part, body, self.kappa_g)
        ]
        low, high = size(aside)
        return low / allowed[1], high / allowed[0]
