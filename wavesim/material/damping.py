"""Losses of a medium: one scalar law for all its stiffnesses, one for its inertias.

With exp(−iωt) every modulus is multiplied by m(ω) and every inertia by ι(ω),

    m(ω) = m_U [1 − Σ_l Y_l ω_l/(ω_l − iω)] − iωβ_d,      ι(ω) = 1 + iα/ω :

Rayleigh damping (mass- and stiffness-proportional) and a series of standard linear solids. As the
law is one for all, a lossy medium at ω is the lossless one at Ω(ω) = ω √(ι/m): plane waves have
k(ω) = k₀(Ω(ω)), and ω(k) solves Ω(ω) = ω₀(k). No jax.

Emmerich & Korn, Geophysics 52, 1252 (1987); Moczo & Kristek, Geophys. Res. Lett. 32, L01306 (2005).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.material.arguments import checked
from wavesim.material.dual import Dual, value_of

Complex = NDArray[np.complex128]

# Six decades take twenty relaxations, each a memory of every strain.
_WIDEST_BAND = 1e6


@checked
@dataclass(frozen=True)
class Damping:
    """A linear loss law.

    Args:
        mass: α, mass-proportional damping, 1/s, ≥ 0: an amplitude falls by exp(−αt/2).
        stiffness: β_d, stiffness-proportional damping, s, ≥ 0: Q = 1/(ωβ_d).
        unrelaxed: m_U, the modulus at ω → ∞ over the medium's own, –, > 0.
        rates: relaxation rates ω_l, rad/s, > 0.
        strengths: Y_l, –, ≥ 0, as many as rates; their sum is below 1, or the medium is
            unstable under slow deformation.
        made: (Q, band in Hz) of :func:`constant_quality`, where it was made by that.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    mass: float = 0.0
    stiffness: float = 0.0
    unrelaxed: float = 1.0
    rates: tuple[float, ...] = ()
    strengths: tuple[float, ...] = ()
    made: tuple[float, tuple[float, float]] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("mass", "stiffness"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} = {value:g}: must be finite and 0 or greater")
        if not (math.isfinite(self.unrelaxed) and self.unrelaxed > 0):
            raise ValueError(f"unrelaxed = {self.unrelaxed:g}: must be finite and greater than 0")
        if len(self.rates) != len(self.strengths):
            raise ValueError(
                f"strengths: {len(self.strengths)} given for {len(self.rates)} rates; give one each"
            )
        if any(not rate > 0 for rate in self.rates):
            raise ValueError(f"rates = {self.rates}: must all be greater than 0")
        if any(not strength >= 0 for strength in self.strengths) or sum(self.strengths) >= 1:
            raise ValueError(
                f"strengths = {self.strengths}: must be 0 or greater and sum to less than 1; take "
                "a higher quality factor"
            )

    def __bool__(self) -> bool:
        """Whether anything is lost."""
        return self.mass > 0 or self.stiffness > 0 or any(self.strengths)

    def modulus(self, omega: ArrayLike) -> Complex:
        """m(ω), by which every stiffness is multiplied.

        Args:
            omega: angular frequencies, real or complex, any shape, rad/s.
        """
        omega = np.asarray(omega, dtype=complex)
        relaxed = sum(
            y * rate / (rate - 1j * omega)
            for rate, y in zip(self.rates, self.strengths, strict=True)
        )
        return self.unrelaxed * (1 - relaxed) - 1j * omega * self.stiffness

    def inertia(self, omega: ArrayLike) -> Complex:
        """ι(ω), by which every inertia is multiplied; omega not 0 where mass > 0."""
        omega = np.asarray(omega, dtype=complex)
        return np.asarray(1 + 1j * self.mass / omega if self.mass else np.ones_like(omega))

    def lossless(self, omega: ArrayLike) -> Complex:
        """Ω(ω) = ω √(ι/m), rad/s, with Re Ω of the sign of Re ω."""
        omega = np.asarray(omega, dtype=complex)
        # Taken as two roots: each factor lies in the right half-plane for Re ω ≠ 0 and small loss.
        return np.asarray(omega * np.sqrt(self.inertia(omega)) / np.sqrt(self.modulus(omega)))

    def lossy(self, lossless: ArrayLike) -> Any:
        """ω of waves whose lossless frequency is ω₀: the root of ω² ι = ω₀² m(ω) that goes to ω₀.

        Newton's iteration from the root of the quadratic that a modulus frozen at ω₀ leaves,
        ω² + i(α + ω₀²β_d)ω = ω₀² m_r(ω₀). Where a wave is overdamped ω is imaginary, one of two.

        Args:
            lossless: ω₀, any shape, rad/s, ≥ 0.

        Returns:
            Shape of lossless, rad/s, complex with Im ω ≤ 0; 0 where ω₀ is, and ω₀ itself, real,
            without a law.
        """
        base = np.asarray(lossless, dtype=float)
        if self == UNDAMPED:
            return base
        square = base**2
        drag = self.mass + square * self.stiffness
        solid = self.modulus(base) + 1j * base * self.stiffness
        omega = -0.5j * drag + np.sqrt(square * solid - drag**2 / 4 + 0j)
        for _ in range(50):
            rate = -1j * self.stiffness - self.unrelaxed * sum(
                1j * y * own / (own - 1j * omega) ** 2
                for own, y in zip(self.rates, self.strengths, strict=True)
            )
            residue = omega**2 + 1j * self.mass * omega - square * self.modulus(omega)
            slope = 2 * omega + 1j * self.mass - square * rate
            step = residue / np.where(slope == 0, 1, slope)
            omega = omega - step
            if (np.abs(step) <= 1e-15 * np.abs(omega)).all():
                break
        return np.where(base == 0, 0, omega)

    def part(self, share: float) -> Damping:
        """The law with a share of its losses, 0 to 1: nothing is lost at 0."""
        return Damping(
            mass=share * self.mass,
            stiffness=share * self.stiffness,
            unrelaxed=1 + share * (self.unrelaxed - 1),
            rates=self.rates if share else (),
            strengths=tuple(share * y for y in self.strengths) if share else (),
        )


UNDAMPED = Damping()


def constant_quality(
    quality: float, band: tuple[float, float], reference: float | None = None
) -> Damping:
    """A series of standard linear solids with Q = −Re m/Im m constant over a band.

    Rates are even in log ω over the band, three or more to a decade; strengths are the non-negative
    least squares of −Im m/Re m · Q = 1 over the band, which is linear in Y. Q is then constant to
    2 % for Q ≥ 10 (8 % at Q = 1.5). The modulus at the reference frequency is that of the medium:
    Re m(ω_ref) = 1.

    Args:
        quality: Q, –, > 1.
        band: lowest and highest frequency, Hz.
        reference: where phase velocity is the lossless one, Hz, ≥ 0; the band's geometric mean
            by default.

    Returns:
        The law; :func:`quality` tells what it makes of Q.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """
    from scipy.optimize import nnls

    low, high = band
    if not (math.isfinite(quality) and quality > 1):
        raise ValueError(f"quality_factor = {quality:g}: must be finite and greater than 1")
    if not 0 < low < high < math.inf:
        raise ValueError(
            f"quality_band = [{low:g}, {high:g}]: must be two frequencies, 0 < f1 < f2"
        )
    if high > _WIDEST_BAND * low:
        raise ValueError(
            f"quality_band = [{low:g}, {high:g}]: must span at most a factor of {_WIDEST_BAND:g}; "
            "take the band that the sources excite"
        )
    if reference is not None and not 0 <= reference < math.inf:
        raise ValueError(f"reference = {reference:g}: must be a frequency, 0 or greater")
    first, last = 2 * math.pi * low, 2 * math.pi * high
    count = max(2, math.ceil(3 * math.log10(last / first))) + 1
    rates = np.geomspace(first / 1.3, last * 1.3, count)
    omega = np.geomspace(first, last, 40 * count)
    x = omega[:, None] / rates
    # Q Im part = real part: Σ Y (Q x + 1)/(1 + x²) = 1, from m = 1 − Σ Y (1 + ix)/(1 + x²).
    matrix = (quality * x + 1) / (1 + x**2)
    strengths, _ = nnls(value_of(matrix), np.ones(len(omega)))
    at = 2 * math.pi * (math.sqrt(low * high) if reference is None else reference)
    used = strengths > 0
    own: Any = strengths[used].tolist()
    if isinstance(quality, Dual):  # a step of Newton's that is 0, but for what it carries
        A = matrix[:, used]
        At = A.transpose(1, 0)
        own = own + np.linalg.solve(At @ A, At @ (1 - A @ np.c_[own]))[:, 0]
    plain = Damping(rates=tuple(rates[used].tolist()), strengths=tuple(own))
    unrelaxed: Any = 1 / plain.modulus(at).real
    return Damping(
        unrelaxed=unrelaxed if isinstance(quality, Dual) else float(unrelaxed),
        rates=plain.rates,
        strengths=plain.strengths,
        made=(float(quality), (float(low), float(high))) if reference is None else None,
    )


def quality(damping: Damping, omega: ArrayLike) -> Any:
    """Q(ω) = −Re(m/ι)/Im(m/ι), –; infinite where nothing is lost.

    Args:
        damping: the law.
        omega: real angular frequencies, any shape, rad/s, > 0.
    """
    ratio = damping.modulus(omega) / damping.inertia(omega)
    with np.errstate(divide="ignore"):
        return np.where(ratio.imag == 0, np.inf, -ratio.real / ratio.imag)
