"""Transmission and reflection of a layered stretch between two half-spaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.layered.stack import Stack
from wavesim.layered.uniform_layer import Waves
from wavesim.material.family import travelling_block
from wavesim.material.layers import Layers
from wavesim.material.shown import Shown
from wavesim.planewave.band_edges import keeps_gradient

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, repr=False)
class Transmission(Shown):
    """Ratios of macro-field φ, or B of a block without one, and power coefficients at each ω.

    Reference planes are x = 0 (incident and reflected from the left, transmitted to the left) and
    x = L (the other three). Index 0 of the modes is the wave of the closed form k(ω).

    Attributes:
        omega: rad/s, shape (N,).
        T, R: transmitted and reflected over incident φ, from the left, shape (N,).
        T_back, R_back: the same from the right.
        power_T, power_R: energy flux transmitted and reflected over that incident, all modes that
            carry energy together, shape (N,); NaN where the incident wave carries none or ω is
            complex.
        power_T_back, power_R_back: the same from the right.
    """

    omega: Any
    T: Any
    R: Any
    T_back: Any
    R_back: Any
    power_T: Any
    power_R: Any
    power_T_back: Any
    power_R_back: Any

    def told(self) -> dict[str, str]:
        """Frequencies, and the least and the most that is transmitted."""
        power = np.asarray(self.power_T, float)
        told = {"frequencies": str(np.size(self.omega))}
        if np.isfinite(power).any():
            low, high = (10 * np.log10(f(power)) for f in (np.nanmin, np.nanmax))
            told["transmitted energy"] = f"{low:.1f} to {high:.1f} dB"
        return told

    def to_xarray(self) -> xarray.Dataset:
        """All ratios over omega (rad/s)."""
        import xarray

        ratios = {name: ("omega", value) for name, value in vars(self).items() if name != "omega"}
        return xarray.Dataset(ratios, {"omega": ("omega", self.omega, {"units": "rad/s"})})


def _apart(left: Any, right: Any) -> Any:
    """Matrices of the left and of the right end as one that couples neither to the other."""
    none = np.zeros_like(left)
    return np.block([[left, none], [none, right]])


def _primary(of: Waves) -> Any:
    """Index of the wave of the closed form: the one with the smallest |k|, shape (N,)."""
    return np.argmin(np.abs(of.k), axis=1)


def transmission(
    layers: Layers, sector: str, omega: ArrayLike, gradient: bool | None = None
) -> Transmission:
    """What a layered stretch lets through, between half-spaces of its first and its last medium.

    Args:
        layers: the stretch.
        sector: longitudinal, transverse2 or transverse3. Where Γ is kept a block of micro-fields
            alone too, inplane[23], inplane(23) or inplane(22-33): ratios are those of its field.
        omega: ω, shape (N,), real or complex with Im ω ≥ 0, not 0, rad/s.
        gradient: whether Γ is kept; None lets planewave.gradient_share > 1e-9 of a layer decide.

    Returns:
        Amplitude ratios and power coefficients, which sum to 1 without loss.

    Raises:
        ValueError: nothing travels in the sector, ω is 0 or has Im ω < 0, or Γ is singular where it
            is kept.
    """
    frequencies = np.atleast_1d(np.asarray(omega))
    growing = np.flatnonzero(frequencies.imag < 0)
    if len(growing):
        raise ValueError(
            f"omega = {frequencies[growing[0]]:g} rad/s: Im ω must not be below 0, as fields go as "
            "exp(−iωt) here; where yours go as exp(+jωt), give conj(ω) and take conj(T)"
        )
    kept = keeps_gradient(layers, gradient)
    block = travelling_block(layers.first.family, sector, kept)
    stack = Stack(layers, block, frequencies, kept)
    whole = stack.whole().whole
    left, right = stack.end_waves(False), stack.end_waves(True)
    n, rows = len(stack.impedance), np.arange(len(stack.scaled))
    # Waves that come in from the half-spaces and that go out into them: what they are of
    # (a at 0, b at L), which the stretch takes in, and of (b at 0, a at L), which it sends.
    come_in = _apart(left.v + left.f, right.mirror_v - right.mirror_f)
    come_back = _apart(left.v - left.f, right.mirror_v + right.mirror_f)
    go_in = _apart(left.mirror_v + left.mirror_f, right.v - right.f)
    go_out = _apart(left.mirror_v - left.mirror_f, right.v + right.f)
    amplitudes = np.linalg.solve(go_out - whole @ go_in, whole @ come_in - come_back)
    first, last = _primary(left), n + _primary(right)
    # Of the block's first field: as they come in, and as they go out.
    come = np.concatenate([left.v[:, 0], right.mirror_v[:, 0]], axis=1)
    go = np.concatenate([left.mirror_v[:, 0], right.v[:, 0]], axis=1)
    flux = np.concatenate(
        [np.sum((np.conj(w.f) * w.v).real, axis=1) for w in (left, right)], axis=1
    )
    carries = np.concatenate(
        [np.abs(w.k.imag) <= 1e-9 * np.abs(w.k) for w in (left, right)], axis=1
    )
    flux = np.where(carries & (np.asarray(omega, dtype=complex).imag == 0).reshape(-1, 1), flux, 0)

    def amplitude(to: Any, source: Any) -> Any:
        return amplitudes[rows, to, source] * go[rows, to] / come[rows, source]

    def power(side: slice, source: Any) -> Any:
        sent = np.abs(amplitudes[rows, side, source]) ** 2 * flux[:, side]
        incident = flux[rows, source]
        return np.where(
            incident > 0, sent.sum(axis=1) / np.where(incident > 0, incident, 1), np.nan
        )

    to_left, to_right = slice(0, n), slice(n, 2 * n)
    return Transmission(
        omega=stack.omega,
        T=amplitude(last, first),
        R=amplitude(first, first),
        T_back=amplitude(first, last),
        R_back=amplitude(last, last),
        power_T=power(to_right, first),
        power_R=power(to_left, first),
        power_T_back=power(to_left, last),
        power_R_back=power(to_right, last),
    )
