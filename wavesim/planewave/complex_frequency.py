"""Plane waves of a medium with loss: complex ω at real k, and the ω of the lossless medium.

One law holds for all stiffnesses and one for all inertias (damping.py), so a lossy medium at ω
is the lossless one at Ω(ω) = ω √(ι/m): k(ω) = k₀(Ω(ω)), and ω(k) solves Ω(ω) = ω₀(k).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.material.damping import UNDAMPED, Damping
from wavesim.material.medium import Medium
from wavesim.planewave.eigenproblem import Complex


def seen(medium: Medium, omega: Any) -> Any:
    """Ω(ω), rad/s; ω itself, untouched, where the medium has no loss law."""
    if medium.damping == UNDAMPED:
        return omega
    felt = medium.damping.lossless(omega)
    return felt if medium.damping or np.iscomplexobj(omega) else felt.real


def damped(damping: Damping, lossless: ArrayLike) -> Complex:
    """ω of waves whose lossless frequency is ω₀: the root of ω² ι(ω) = ω₀² m(ω) that goes to ω₀.

    Newton's iteration from the root of the quadratic that a modulus frozen at ω₀ leaves,
    ω² + i(α + ω₀²β_d)ω = ω₀² m_r(ω₀). Where a wave is overdamped ω is imaginary, one of two.

    Args:
        damping: the law.
        lossless: ω₀, any shape, rad/s, ≥ 0.

    Returns:
        Shape of lossless, rad/s, Im ω ≤ 0; 0 where ω₀ is.
    """
    base = np.asarray(lossless, dtype=float)
    square = base**2
    drag = damping.mass + square * damping.stiffness
    solid = damping.modulus(base) + 1j * base * damping.stiffness
    omega = -0.5j * drag + np.sqrt(square * solid - drag**2 / 4 + 0j)
    for _ in range(50):
        rate = -1j * damping.stiffness - damping.unrelaxed * sum(
            1j * y * own / (own - 1j * omega) ** 2
            for own, y in zip(damping.rates, damping.strengths, strict=True)
        )
        residue = omega**2 + 1j * damping.mass * omega - square * damping.modulus(omega)
        slope = 2 * omega + 1j * damping.mass - square * rate
        step = residue / np.where(slope == 0, 1, slope)
        omega = omega - step
        if (np.abs(step) <= 1e-15 * np.abs(omega)).all():
            break
    return np.where(base == 0, 0, omega)
