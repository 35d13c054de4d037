"""From a field to ω(k): windowed 2D FFT, ridges between the bins, branches by continuity.

Nothing here knows the dispersion relation: the ridges are the peaks of the spectrum, and branches
are peaks joined from one wavenumber to the next.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import Block
from wavesim.readings.dispersion.branch_joining import join
from wavesim.records.windows import blackman_harris, fast_length
from wavesim.simulation.field import MOST_WAVENUMBERS, Field

Float = NDArray[Any]

# 4-term Blackman–Harris: side lobes at −92 dB, main lobe of ±4 bins (Harris, Proc. IEEE 66, 51
# (1978)). A peak counts above −80 dB of the strongest at its wavenumber.
LOBE_BINS = 4
# Of an analysis, in time.
_FEWEST_FRAMES = 32
FLOOR = 1e-8
_PADDING = 8
# … above what rounding leaves of the strongest of all,
_ROUNDING = 1e-26
# … and so far above what the record's ends spread of the strongest, in power.
ABOVE_CUT = 100.0
# Frames are read, and wavenumbers transformed, so many at a time that they fit into these bytes.
_AT_ONCE = 64e6


@dataclass(frozen=True)
class Spectrum:
    """Power of one block's motion over wavenumber and frequency.

    Attributes:
        k: wavenumbers, shape (nk,), rad/m.
        omega: angular frequencies, even, shape (nω,), rad/s.
        power: shape (nk, nω), relative to the strongest entry.
        bin: frequency resolution 2π/T of the record, rad/s.
        cut: what the jumps at the record's ends, which the window leaves, spread over ω: power
            times the squared distance from a line, shape (nk,), (rad/s)²; none where None.
        strongest: largest power at each k, of frequencies that are not kept as well, shape (nk,);
            of those kept where None.
    """

    k: Float
    omega: Float
    power: Float
    bin: float
    cut: Float | None = None
    strongest: Float | None = None


@dataclass(frozen=True)
class Ridge:
    """One branch recovered from a spectrum.

    Attributes:
        k: wavenumbers at which it was found, ascending, rad/m.
        omega: its frequency there, rad/s.
        power: height of its peak there, relative to the spectrum's strongest.
    """

    k: Float
    omega: Float
    power: Float


def analysed_from(field: Field) -> int:
    """First frame of the analysis: the first without a source, if that leaves enough of them."""
    quiet = int(np.searchsorted(field.t, field.quiet_from))
    return quiet if quiet <= len(field.t) - _FEWEST_FRAMES else 0


def spectrum(field: Field, block: Block, k_max: float, omega_max: float | None = None) -> Spectrum:
    """2D FFT of a block's components: exact in space on a periodic bar, windowed in time.

        P(|k|, ω) = Σ_components Σ_±k |∫∫ q w(t) e^{−i(kx−ωt)} dx dt|²

    Args:
        field: the field.
        block: one of its blocks.
        k_max: highest wavenumber wanted, rad/m.
        omega_max: highest frequency wanted, rad/s; the Nyquist frequency of the frames where None.

    Returns:
        The spectrum, at the wavenumbers that the bar holds (of more than 2048 up to k_max at every
        second, third, …), padded eightfold in time.

    Raises:
        ValueError: the bar holds fewer than three wavenumbers up to k_max.
    """
    k = field.bar.wavenumbers
    count = int(np.searchsorted(k, k_max, side="right"))
    if count < 3:
        raise ValueError(
            f"k_max = {k_max:.4g} rad/m: the bar of {field.bar.length:.4g} m holds only multiples "
            f"of {k[1]:.4g} rad/m; raise k_max or lengthen the bar"
        )
    first = analysed_from(field)
    frames = len(field.t) - first
    window = blackman_harris(frames)
    padded = fast_length(_PADDING * frames)
    omega = 2 * np.pi * np.arange(padded // 2 + 1) / (padded * field.interval)
    kept = len(omega)
    if omega_max is not None:
        kept = min(kept, int(np.searchsorted(omega, omega_max, side="right")) + 1)
    taken = slice(0, count, -(-count // MOST_WAVENUMBERS))
    k = k[taken]
    power, cut, beyond = np.zeros((len(k), kept)), np.zeros(len(k)), np.zeros(len(k))
    width = max(1, int(_AT_ONCE / (32 * padded)))
    for in_space in _in_space(field, block, first, taken):
        in_space *= window
        cut += (np.abs(in_space[:, [0, -1]]) ** 2).sum(axis=1)
        for low in range(0, len(k), width):
            in_time = np.abs(np.fft.fft(in_space[low : low + width], padded)) ** 2
            power[low : low + width] += in_time[:, :kept]
            power[low : low + width, 1:] += in_time[:, : padded - kept : -1]
            if kept < len(omega):
                beyond[low : low + width] += in_time[:, kept : padded - kept + 1].max(axis=1)
    strongest = max(power.max(), 1e-300)
    cut /= strongest * field.interval**2
    power /= strongest
    own = np.maximum(power.max(axis=1), beyond / strongest)
    return Spectrum(k, omega[:kept], power, 2 * np.pi / (frames * field.interval), cut, own)


def _in_space(field: Field, block: Block, first: int, taken: slice) -> NDArray[np.complex128]:
    """Fourier coefficients over x of a block's components, shape (components, wavenumbers, frames).

    Args:
        field: the field.
        block: one of its blocks.
        first: frame to begin with.
        taken: which of the bar's wavenumbers.
    """
    count, frames = len(field.bar.wavenumbers[taken]), len(field.t)
    components = len(block.macro + block.micro)
    found = np.empty((components, count, frames - first), complex)
    rows = max(1, int(_AT_ONCE / (16 * components * field.bar.cells)))
    for low in range(first, frames, rows):
        some = slice(low, min(low + rows, frames))
        for at, (values, _) in enumerate(field.components(block, some)):
            found[at, :, low - first : some.stop - first] = np.fft.rfft(values, axis=1)[:, taken].T
    return found


def peaks(found: Spectrum, index: int) -> tuple[Float, Float]:
    """Frequencies and heights of the peaks at one wavenumber, by a parabola through log power.

    A wave that loses much within the record is loud where the window begins: the jump there
    spreads over all frequencies, and what it makes is no peak of a wave.

    Args:
        found: the spectrum.
        index: of the wavenumber.

    Returns:
        Frequencies (rad/s), ascending, and power at the peaks.
    """
    height = np.log(np.maximum(found.power[index], 1e-300))
    strongest = height.max()
    if found.strongest is not None:
        strongest = max(strongest, np.log(max(found.strongest[index], 1e-300)))
    least = max(strongest + np.log(FLOOR), np.log(_ROUNDING))
    left, middle, right = height[:-2], height[1:-1], height[2:]
    # A plateau, as of nothing at all, is no peak.
    top = (middle >= left) & (middle >= right) & (left + right < 2 * middle) & (middle >= least)
    left, middle, right, at = left[top], middle[top], right[top], np.flatnonzero(top) + 1
    shift = 0.5 * (left - right) / (left - 2 * middle + right)
    top = np.exp(middle - 0.25 * (left - right) * shift)
    omega = found.omega[0] + (at + shift) * (found.omega[1] - found.omega[0])
    if found.cut is not None and len(top):
        real = top >= ABOVE_CUT * spread_of_cut(found.cut[index], omega, top)
        omega, top = omega[real], top[real]
    return omega, top


def spread_of_cut(cut: Any, omega: Float, power: Float) -> Float:
    """Power at each peak of what the record's ends spread of a stronger one.

    Args:
        cut: as of :class:`Spectrum`, shape (…).
        omega, power: of the peaks, shape (…, m).
    """
    away = np.abs(omega[..., :, None] - omega[..., None, :])
    away = np.where(power[..., None, :] > power[..., :, None], away, np.inf)
    return np.asarray(np.asarray(cut)[..., None] / np.maximum(away.min(axis=-1), 1e-300) ** 2)


def ridges(found: Spectrum) -> list[Ridge]:
    """Branches of a spectrum: its peaks, joined over k (``branch_joining.py``).

    Args:
        found: the spectrum.

    Returns:
        The branches, ascending in their median frequency.
    """
    parts = [peaks(found, index) for index in range(1, len(found.k))]
    step = np.repeat(np.arange(1, len(found.k)), [len(omega) for omega, _ in parts])
    omega, power = (np.concatenate(part) for part in zip(*parts, strict=True))
    branch = join(step, omega, np.sqrt(np.maximum(power, 1e-300)), found.bin)
    own = [branch == number for number in range(branch.max(initial=-1) + 1)]
    return [Ridge(found.k[step[one]], omega[one], power[one]) for one in own]
