"""Signals at receivers on a layered bar, by the inverse transform of its exact response."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.layered.cross_section import limit
from wavesim.layered.source_loads import (
    acts_of,
    body_loads,
    check_within,
    end_drives,
    held_back,
)
from wavesim.layered.stack import Load, Stack, check_ends, density, returned, waves_at_ends
from wavesim.layered.star_product import inner, nothing, star, times
from wavesim.material.arguments import shown
from wavesim.material.family import Block, weights
from wavesim.material.layers import Layers
from wavesim.material.scaling import Scales
from wavesim.planewave.band_edges import keeps_gradient
from wavesim.planewave.eigenproblem import solve, spectral_form

_WRAP = 1e-11
_SMALL = 1e-10
# A source whose spectrum has not fallen by this many times its band is cut there.
_FURTHEST = 30.0


class BeyondNumbersError(ValueError):
    """A spectrum at ω + iσ over- or underflows."""


@dataclass(frozen=True)
class Contour:
    """Where a signal is evaluated in the frequency domain.

    Attributes:
        omega: ω_j + iσ_w, shape (N,), rad/s.
        step: Δω, rad/s.
        lowpass: top and width of the low-pass of initial values, rad/s; None without.
    """

    omega: Any
    step: float
    lowpass: tuple[float, float] | None

    def signal(self, spectrum: Any, t: Any) -> Any:
        """u(t) from U(ω_j + iσ_w), shape (..., N): shape (..., nt)."""
        weighted = spectrum * (self.step / math.pi)
        weighted[..., 0] *= 0.5
        if self.lowpass is None:
            return self._sum(weighted, t)
        from scipy.special import erfc

        top, width = self.lowpass
        z = self.omega
        weighted = weighted * (erfc((z - top) / width) * erfc((-z - top) / width) / 4)
        return self._sum(weighted, t) + self._sum(weighted, -np.asarray(t))

    def _sum(self, weighted: Any, t: Any) -> Any:
        """Re Σ_j w_j exp(−i(ω_j + iσ_w)t); by FFT for times that divide the period evenly."""
        period = max(2 * (len(t) - 1), 1)
        place = t * (period * self.step / (2 * math.pi))
        if np.abs(place - np.rint(place)).max() <= 1e-9:
            blocks = -(-len(self.omega) // period)
            padded = np.zeros((*weighted.shape[:-1], blocks * period), dtype=complex)
            padded[..., : len(self.omega)] = weighted
            # To these times alike are frequencies that lie a whole number of turns apart.
            folded = padded.reshape(*weighted.shape[:-1], blocks, period).sum(axis=-2)
            sums = np.fft.fft(folded)[..., np.rint(place).astype(int) % period]
            return (sums * np.exp(self.omega[0].imag * t)).real
        parts = []
        chunk = max(1, 2_000_000 // len(self.omega))
        for start in range(0, len(t), chunk):
            phase = np.exp(-1j * np.multiply.outer(self.omega, t[start : start + chunk]))
            parts.append((weighted @ phase).real)
        return np.concatenate(parts, axis=-1)


def _top(spectrum: Callable[[Any], Any], band: float, sigma: float) -> float:
    omega = band * np.linspace(0, _FURTHEST, 3001) + 1j * sigma
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.abs(spectrum(omega))
    if not 0 < size.max() < np.inf:
        raise BeyondNumbersError(
            "duration: is so short beside what a source sends that its spectrum at ω + iσ is "
            "beyond numbers; lengthen the run"
        )
    return float(omega[min(np.flatnonzero(size > _SMALL * size.max()).max() + 1, 3000)].real)


def contour(duration: float, sources: Sequence[Any], initial: Sequence[float]) -> Contour:
    """Frequencies for a record.

    A record of length T is had from a period T_p = 2T of the signal times exp(−σ_w t), with
    exp(−σ_w T_p) = 1e-11: what comes round from later is below that, and what rounding leaves grows
    by exp(σ_w T) = 3e5 at most. The sum runs over ω_j = jΔω, Δω = 2π/T_p, up to where every
    source's spectrum has fallen for good below 1e-10 of its peak.

    An initial value makes a signal begin with a step, whose spectrum falls as 1/ω alone. As it
    starts at rest the signal is even about t = 0, and smooth, if it goes on to t < 0: with c(t)
    what is had from t > 0 alone, low-passed, u(t) = c(t) + c(−t), exact for what the low-pass
    leaves alone.

    Args:
        duration: last time asked for, s, > 0.
        sources: those with a pulse, with ``spectrum`` and ``band``.
        initial: for each initial value, the highest angular frequency it sets in motion, rad/s.

    Raises:
        BeyondNumbersError: a spectrum is no number there.
    """
    period = 2 * duration
    sigma = -math.log(_WRAP) / period
    step = 2 * math.pi / period
    tops = [_top(source.spectrum, source.band, sigma) for source in sources]
    lowpass = None
    if initial:
        # erfc rises from 1e-16 of its step to 1 − 1e-16 within 6 widths on either side; it is
        # blind to the period if a width is some steps.
        top = max([*initial, *tops])
        width = max(0.05 * top, 20 * step)
        lowpass = (top + 6 * width, width)
        tops = [top + 12 * width]
    count = max(64, math.ceil(max(tops) / step) + 1)
    return Contour(step * np.arange(count) + 1j * sigma, step, lowpass)


# With losses initial values are followed to so many times the fastest wave that they make.
_BEYOND = 4.0


def signals(
    layers: Layers,
    left: str,
    right: str,
    sources: Sequence[Any],
    receivers: Mapping[str, float],
    t: ArrayLike,
    gradient: bool | None = None,
) -> dict[str, dict[str, Any]]:
    """What receivers record, from rest or from initial values at t = 0.

    The response at ω + iσ_w is exact but for graded layers, which are good to 1e-10; the inverse
    transform leaves 1e-9 of the largest value, for sources whose spectrum falls that far; of an
    initial value with losses 1e-5 at t = 0 itself.

    Args:
        layers: the bar.
        left, right: its ends, of wavesim.material.layers.ENDS.
        sources: with field, position, amplitude, width, spectrum(ω), band, and drive if not "body".
        receivers: positions by name, m, from 0 to L.
        t: times ≥ 0, shape (nt,), s.
        gradient: whether Γ is kept; None lets planewave.gradient_share > 1e-9 of a layer decide.

    Returns:
        {receiver: {field: shape (nt,)}} of all fields of the blocks that are driven, SI.

    Raises:
        ValueError: an end, a receiver, a source or a layer is not admissible; the message names it.
            So is a Gaussian that stands out over an end by six widths, and an initial value in
            layers that differ in stiffness damping.
    """
    times_ = np.atleast_1d(np.asarray(t, dtype=float))
    sources = list(sources)
    if not sources:
        raise ValueError("sources = []: at least one source is needed")
    for one in sources:
        if not hasattr(one, "spectrum"):
            raise ValueError(f"sources: {shown(one)} is no source; give such as Ricker(…)")
    if times_.min() < 0 or not times_.max() > 0:
        raise ValueError("t: must be ≥ 0, and reach beyond 0")
    kept = keeps_gradient(layers, gradient)
    grid = contour_of(layers, sources, float(times_.max()))
    found = field_spectra(layers, left, right, sources, receivers, grid.omega, kept)
    return {
        name: {field: grid.signal(values, times_) for field, values in fields.items()}
        for name, fields in found.items()
    }


def contour_of(layers: Layers, sources: Sequence[Any], duration: float) -> Contour:
    """Frequencies for what sources send through a bar in a time, s."""
    pulses = [source for source in sources if acts_of(source) != "initial"]
    initial = [source for source in sources if acts_of(source) == "initial"]
    # With losses an odd derivative of the signal jumps at t = 0, and more is above any frequency.
    beyond = _BEYOND if layers.lossy else 1.0
    return contour(duration, pulses, [beyond * _fastest(layers, source) for source in initial])


def _fastest(layers: Layers, source: Any) -> float:
    """Highest ω that an initial value sets in motion: that of k = 6.5/w, 1e-9 of its peak."""
    return max(
        float(np.sqrt(solve(spectral_form(m, block), np.array([k])).squares.real.max()))
        / m.time_scale
        for m in layers.media
        for block in m.family.excited([source.field])
        for k in [6.5 / source.width * m.length_scale]
    )


def field_spectra(
    layers: Layers,
    left: str,
    right: str,
    sources: Sequence[Any],
    receivers: Mapping[str, float],
    omega: ArrayLike,
    gradient: bool,
) -> dict[str, dict[str, Any]]:
    """Spectra ∫ u e^{iωt} dt of the fields at receivers: as :func:`signals`, at given ω.

    Args:
        omega: ω, shape (N,), complex with Im ω ≥ 0, not 0, rad/s.

    Returns:
        {receiver: {field: shape (N,)}}, the field's unit times s.
    """
    check_ends(left, right)
    for name, x in receivers.items():
        if not 0 <= x <= layers.length:
            raise ValueError(f"receiver {name!r} at {x:g} m: must be in 0 to {layers.length:g} m")
    check_within(layers, sources, left == "periodic")
    omega = np.atleast_1d(np.asarray(omega, dtype=complex))
    found: dict[str, dict[str, Any]] = {name: {} for name in receivers}
    family = layers.first.family
    for block in family.excited([source.field for source in sources]):
        values = _block_spectra(layers, left, right, sources, receivers, omega, gradient, block)
        for name, fields in values.items():
            for field, spectrum in fields.items():
                found[name][field] = found[name].get(field, 0) + spectrum
    return found


def _block_spectra(
    layers: Layers,
    left: str,
    right: str,
    sources: Sequence[Any],
    receivers: Mapping[str, float],
    omega: Any,
    gradient: bool,
    block: Block,
) -> dict[str, dict[str, Any]]:
    travels = gradient or bool(block.macro)
    stack = Stack(layers, block, omega, gradient)
    ring = left == "periodic"
    loads = body_loads(stack, sources, ring)
    if not travels:
        return {
            name: _still(stack, loads, x, held_back(stack, sources, ring, x))
            for name, x in receivers.items()
        }
    n, count = len(stack.impedance), len(omega)
    nodes, pieces = stack.pieces(tuple(receivers.values()), loads)
    before, after = [nothing(count, n)], [nothing(count, n)]
    for one in pieces:
        before.append(star(before[-1], one))
    for one in reversed(pieces):
        after.append(star(one, after[-1]))
    after.reverse()
    entering = waves_at_ends(
        before[-1], returned(stack, left, right), end_drives(stack, sources, left, right)
    )
    found = {}
    for name, x in receivers.items():
        j = nodes.index(x)
        a, b = inner(before[j], after[j], entering[:, :n], entering[:, n:])
        root = np.sqrt(stack.impedance)
        held = held_back(stack, sources, ring, x)
        found[name] = _fields(stack, loads, x, (a + b) / root, (a - b) * root, held)
    return found


def named(block: Block, phi: Any, B: Any, units: Scales) -> dict[str, Any]:
    """Fields in SI from a block's components, (N, p) and (N, b)."""
    values = np.concatenate([phi * units.macro, B * units.micro], axis=1)
    values = values @ weights(block.macro + block.micro, block.fields)
    return {name: values[:, i] for i, name in enumerate(block.fields)}


def _double_force(stack: Stack, loads: Sequence[Load], x: float, p: int, X: Any) -> Any:
    """Π(x) on each micro-field, shape (N, b), of X (N, b, b)."""
    here = stack.section(stack.layers.layer_at(x), x)
    total = np.zeros_like(X, dtype=complex, shape=X.shape[:-1])
    for load in loads:
        at = x / stack.units.length
        if load.component < p:
            continue
        if load.width == 0:
            if abs(load.position - at) <= 1e-12 * max(at, 1.0):
                raise ValueError(
                    f"receiver at {x:g} m: there a point source makes the micro-field "
                    "infinite; give the source a width"
                )
            continue
        g = density(at, load.position, load.width)
        total[:, load.component - p] += g * load.on(here, stack.scaled)
    return total


def _fields(
    stack: Stack, loads: Sequence[Load], x: float, v: Any, f: Any, held: Any
) -> dict[str, Any]:
    p, omega = len(stack.block.macro), stack.scaled
    u = 1j * v / omega[:, None]
    if stack.kept:
        return named(stack.block, u[:, :p] + held[:, :p], u[:, p:] + held[:, p:], stack.units)
    here = stack.section(stack.layers.layer_at(x), x)
    local = limit(here, omega)
    pushed = _double_force(stack, loads, x, p, local.X)
    slope = (-f[:, 0] + np.sum(local.pX * pushed, axis=1)) / local.D
    B = local.Xp * slope[:, None] + times(local.X, pushed) / local.modulus[:, None]
    return named(stack.block, u + held[:, :p], B + held[:, p:], stack.units)


def _still(stack: Stack, loads: Sequence[Load], x: float, held: Any) -> dict[str, Any]:
    """A micro-field alone, without Γ: B = X Π/m where it is driven, and nowhere else."""
    here = stack.bare(stack.layers.layer_at(x), x)
    local = limit(here, stack.scaled)
    B = times(local.X, _double_force(stack, loads, x, 0, local.X)) / local.modulus[:, None]
    return named(stack.block, np.zeros((len(B), 0)), B + held, stack.units)
