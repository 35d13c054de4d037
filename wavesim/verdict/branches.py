"""What was recovered of an endless bar, put beside the plane-wave solver, branch by branch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wavesim.material.family import Block
from wavesim.material.scaling import judged_range
from wavesim.planewave.dispersion_relation import block_oscillations, driven_waves, wavenumber
from wavesim.readings.dispersion.branch_joining import SHORTEST_BRANCH
from wavesim.readings.dispersion.extract import Measured
from wavesim.readings.dispersion.spectrum import (
    ABOVE_CUT,
    FLOOR,
    LOBE_BINS,
    Ridge,
    Spectrum,
    analysed_from,
    spread_of_cut,
)
from wavesim.records.windows import blackman_harris
from wavesim.simulation.field import Field
from wavesim.sources import EXCITED, excitation

Float = NDArray[Any]

# A peak so far above the least that a spectrum is searched for is sure to be found.
_SURELY = 10.0
_SEEN = _SURELY * FLOOR
# Rates of decay at which the window is reckoned.
_FALLS = 257
# A wave is present where its branch was found at this part of the wavenumbers it is judged at.
_PRESENT = 0.9


@dataclass(frozen=True)
class Branch:
    """One branch of the theory with what was found of it.

    Attributes:
        name: LA, LO1, …
        k: wavenumbers at which it was found, rad/m.
        omega: found there, rad/s.
        omega_exact: of the plane-wave solver there, rad/s.
        judged: where it was excited, clear of its neighbours and within the judged range.
        expected: number of wavenumbers of the bar at which it is judged.
        loudness: its power over that of the strongest branch at the same k, the most where nothing
            else keeps it from being judged; 0 where there is no such k.
    """

    name: str
    k: Float
    omega: Float
    omega_exact: Float
    judged: NDArray[np.bool_]
    expected: int
    loudness: float = 1.0

    @property
    def error(self) -> Float:
        """|ω/ω_exact − 1| where judged."""
        return np.abs(self.omega / self.omega_exact - 1)[self.judged]

    @property
    def present(self) -> bool:
        """Whether it was found at nine tenths of the wavenumbers where it is judged, rounded down:
        of a few one may lack."""
        least = max(1, math.floor(_PRESENT * self.expected))
        return self.expected > 0 and int(self.judged.sum()) >= least


@dataclass(frozen=True)
class Held:
    """What was measured of one block, beside the theory.

    Attributes:
        measured: the measurement.
        branches: one for each branch of the theory.
        strays: ridges that belong to no branch.
        k_exact: plane-wave k(ω + iσ) at the frequencies of the attenuation, rad/m.
    """

    measured: Measured
    branches: list[Branch]
    strays: list[Ridge]
    k_exact: NDArray[np.complex128] | None


def tables(held: Sequence[Held]) -> dict[str, tuple[Any, str]]:
    """All arrays with their units, by their path in result.h5.

    Blocks of one sector share their axes: their powers add.
    """
    found: dict[str, tuple[Any, str]] = {}
    for h in held:
        group, spectrum = f"dispersion/{h.measured.block.sector}", h.measured.spectrum
        power = spectrum.power
        if f"{group}/power" in found:
            before = found[f"{group}/power"][0]
            size = min(before.shape[1], power.shape[1])
            power = np.hstack([before[:, :size] + power[:, :size], before[:, size:]])
        else:
            found[f"{group}/k"] = spectrum.k, "rad/m"
            found[f"{group}/omega"] = spectrum.omega, "rad/s"
        found[f"{group}/power"] = power, "relative to the strongest of its block"
        for branch in h.branches:
            path = f"{group}/branches/{branch.name}"
            found[f"{path}/k"] = branch.k, "rad/m"
            found[f"{path}/omega"] = branch.omega, "rad/s"
            found[f"{path}/omega_exact"] = branch.omega_exact, "rad/s"
            found[f"{path}/judged"] = branch.judged, "–"
        for number, stray in enumerate(h.strays):
            path = f"{group}/branches/unidentified {number + 1} of {h.measured.block.name}"
            found[f"{path}/k"] = stray.k, "rad/m"
            found[f"{path}/omega"] = stray.omega, "rad/s"
        curve = h.measured.attenuation
        if curve is not None and h.k_exact is not None:
            group = f"attenuation/{h.measured.block.sector}"
            found[f"{group}/omega"] = curve.omega, "rad/s"
            found[f"{group}/sigma"] = float(curve.sigma), "rad/s"
            meaning = "k at the complex frequency omega + i sigma (rad/s)"
            found[f"{group}/meaning"] = meaning, "–"
            found[f"{group}/k"] = curve.k, "rad/m"
            found[f"{group}/error"] = curve.error, "rad/m"
            found[f"{group}/k_exact"] = h.k_exact, "rad/m"
            found[f"{group}/distance"] = curve.distance, "m"
            found[f"{group}/level"] = curve.level, "dB"
    return found


def hold(field: Field, measured: Measured, k_range: tuple[float, float] | None = None) -> Held:
    """Put the theory beside the measurement of one block.

    A ridge is taken for the branch that it lies nearest to; a branch is judged where its
    frequency was excited, where it is driven so strongly that a spectrum shows it, where it stands
    the window's main lobe clear of its neighbours and of ω = 0, and its wavenumber is in
    the judged range; none where sources act as long as the record lasts.

    Args:
        field: the field.
        measured: of one block.
        k_range: judged wavenumbers, rad/m; k̄ = 0.02 to 0.5 where None.
    """
    k_range = k_range or judged_range(field.medium)
    block, found = measured.block, measured.spectrum
    exact = block_oscillations(field.medium, block, found.k)
    clear = _clear(exact, LOBE_BINS * found.bin)
    sources = [s for s in field.sources if s.field in block.fields]
    inside = (found.k >= k_range[0]) & (found.k <= k_range[1])
    covered = (excitation(sources, exact, found.k[:, None]) >= EXCITED) & (exact <= found.omega[-1])
    loudness = np.where(clear & covered, _seen(field, block, found.k), 0.0)
    judged = _long_enough(loudness >= _SEEN) & inside[:, None]
    if field.t[analysed_from(field)] < min(field.quiet_from, field.t[-1]):
        judged[:] = False  # what is driven all along has no frequencies of its own
    loudness *= inside[:, None]
    branches = []
    nyquist = np.pi / field.interval
    # What does not swing once in the record is no wave: losses let strains creep.
    swings = [r for r in measured.ridges if np.median(r.omega) >= found.bin]
    kept = [r for r in swings if not _folded(r, found, exact, nyquist)]
    owners = [_owners(ridge, found, exact) for ridge in kept]
    for number, name in enumerate(block.branches):
        points = sorted(
            (k, w)
            for ridge, own in zip(kept, owners, strict=True)
            if own is not None
            for k, w, one in zip(ridge.k, ridge.omega, own, strict=True)
            if one == number
        )
        k, omega = np.array([p[0] for p in points]), np.array([p[1] for p in points])
        at = np.searchsorted(found.k, k)
        branches.append(
            Branch(
                name,
                k,
                omega,
                exact[at, number],
                judged[at, number],
                int(judged[:, number].sum()),
                float(loudness[:, number].max()),
            )
        )
    strays = [
        ridge
        for ridge, own in zip(kept, owners, strict=True)
        if own is None and not _of_several(ridge, found, exact)
    ]
    curve = measured.attenuation
    k_exact = None
    if curve is not None:
        k_exact = wavenumber(field.medium, block.sector, curve.omega + 1j * curve.sigma)
    return Held(measured, branches, strays, k_exact)


def _seen(field: Field, block: Block, k: Float) -> Float:
    """Power of each branch in the spectrum over that of the strongest at its k, as the sources
    drive it and losses leave it, shape (n, branches)."""
    sources = [s for s in field.sources if s.field in block.fields]
    omega, size = driven_waves(field.medium, block, sources, k)
    t = field.t[analysed_from(field) :]
    window = blackman_harris(len(t))
    # What the window leaves of a wave goes with its decay alone, and smoothly.
    fall = np.linspace(0, max(float(-omega.imag.min()), 0.0), _FALLS)
    left = np.log(np.maximum(window @ np.exp(-np.outer(t, fall)), 1e-300))
    power = (size * np.exp(np.interp(-omega.imag, fall, left))) ** 2
    ends = [
        np.sum((size * np.exp(omega.imag * t[i])) ** 2, axis=1) * window[i] ** 2 for i in (0, -1)
    ]
    spread = spread_of_cut(sum(ends) / field.interval**2, omega.real, power)
    power = np.where(power > _SURELY * ABOVE_CUT * spread, power, 0.0)
    return np.asarray(power / np.maximum(power.max(axis=1, keepdims=True), 1e-300))


def _long_enough(shown: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Those of the wavenumbers, shape (n, branches), that make a branch with their neighbours."""
    length = min(SHORTEST_BRANCH, len(shown))
    runs = np.all(sliding_window_view(shown, length, axis=0), axis=-1)
    kept = np.zeros_like(shown)
    for shift in range(length):
        kept[shift : len(shown) - length + 1 + shift] |= runs
    return kept


def _clear(exact: Float, distance: float) -> NDArray[np.bool_]:
    """Where each branch is this far from its neighbours and from its mirror at −ω."""
    mirrored = np.concatenate([-exact[:, :1], exact, np.full((len(exact), 1), np.inf)], axis=1)
    gap = np.diff(mirrored, axis=1)
    return np.asarray((gap[:, :-1] >= distance) & (gap[:, 1:] >= distance))


def _owners(ridge: Ridge, found: Spectrum, exact: Float) -> NDArray[np.int64] | None:
    """Number of the branch each point of a ridge is of; None if another is nearly as near as the
    nearest to all of it.

    Where branches avoid each other a ridge may go straight on from one to the other: a point
    within a bin of another branch, and out of reach of the ridge's own, is that one's.
    """
    at = np.searchsorted(found.k, ridge.k)
    distance = np.abs(exact[at] - ridge.omega[:, None])
    middle = np.median(distance, axis=0)
    order = np.argsort(middle)
    if len(order) > 1 and middle[order[0]] > 0.5 * middle[order[1]]:
        return None
    nearest = distance.argmin(axis=1)
    elsewhere = distance[:, order[0]] > LOBE_BINS * found.bin
    elsewhere &= distance.min(axis=1) <= found.bin
    return np.where(elsewhere, nearest, order[0])


def _of_several(ridge: Ridge, found: Spectrum, exact: Float) -> bool:
    """Whether a ridge is of branches too near each other to be told apart, which are not judged."""
    distance = np.abs(exact[np.searchsorted(found.k, ridge.k)] - ridge.omega[:, None])
    if distance.shape[1] < 2:
        return False
    apart = np.partition(distance, 1, axis=1)[:, :2].sum(axis=1)
    return bool(np.median(apart) <= LOBE_BINS * found.bin)


def _folded(ridge: Ridge, found: Spectrum, exact: Float, nyquist: float) -> bool:
    """Whether a ridge is a branch above the frames' Nyquist frequency, folded back."""
    there = exact[np.searchsorted(found.k, ridge.k)]
    back = np.abs(np.mod(there + nyquist, 2 * nyquist) - nyquist)
    off = np.where(there > nyquist, np.abs(back - ridge.omega[:, None]), np.inf)
    return bool(np.median(off, axis=0).min() <= found.bin)


def faint(held: Sequence[Held]) -> str | None:
    """Which branches no spectrum shows, as the sources drive them too weakly."""
    lost = [
        f"{h.measured.block.sector} {b.name} (−{-10 * math.log10(b.loudness):.0f} dB)"
        for h in held
        for b in h.branches
        if not b.expected and 0 < b.loudness < _SEEN
    ]
    if not lost:
        return None
    return (
        f"not judged, as the sources drive another branch so much more strongly: "
        f"{', '.join(lost)}; add a source nearer to it in frequency, or on another field"
    )
