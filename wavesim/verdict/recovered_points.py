"""Recovered points held against two references, and how many waves were found, missed and false.

The exact relation of the grid (the plane-wave relation at the stencil's modified wavenumber) is
what a simulated record obeys: against it stands the error of extraction alone. Against the
continuum stands the whole error. A laboratory record has the second reference only.

Which waves are present is asked of the record itself: the reference's frequencies are fitted to
it, amplitudes alone unknown, and a wave is present where its amplitude is more than 1e-6 of the
strongest at that wavenumber and stands above the noise. This is the only place where a known
curve meets the record, and no method of extraction sees it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.assignment import assigned
from wavesim.readings.dispersion.frequency_at_wavenumber import ROUNDING, series
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.readings.dispersion.sinusoids import exponentials, transposed
from wavesim.records.record import Record
from wavesim.records.relations import Complex, Relation
from wavesim.records.windows import hann

Float = NDArray[Any]

PRESENT = 1e-6
# A wave is present where its amplitude is this many times its standard error.
_ABOVE_NOISE = 8.0
# Series fitted at once.
_AT_ONCE = 64
# A point is a wave's within so many bins 2π/T of it, its half-width γ, or so many of its bars.
_REACH_BINS = 0.5
_REACH_BARS = 3.0
# Wavenumbers nearer than this part are one.
_SAME = 1e-6


@dataclass(frozen=True)
class Matched:
    """Points at given k beside the waves of a reference.

    Attributes:
        names: of the waves.
        k: wavenumbers judged, shape (n,), rad/m.
        exact: ω of the continuum, shape (n, branches), rad/s.
        grid: ω of the reference that the record obeys, shape (n, branches), rad/s; the continuum
            where the record has no grid.
        present: where each wave is present, shape (n, branches).
        omega, bar: found and its 95 % bar, shape (n, branches), rad/s; NaN where not found.
        false_k, false_omega: valid points that belong to no wave.
        width: γ + 2π/T of each wave in the reference, how broad its peak is, shape (n, branches),
            rad/s.
    """

    names: tuple[str, ...]
    k: Float
    exact: Float
    grid: Float
    present: NDArray[np.bool_]
    omega: Float
    bar: Float
    false_k: Float
    false_omega: Float
    width: Float

    @property
    def found(self) -> NDArray[np.bool_]:
        """Where each present wave was found."""
        return self.present & np.isfinite(self.omega)

    @property
    def missed(self) -> NDArray[np.bool_]:
        """Where a present wave was not found."""
        return self.present & ~np.isfinite(self.omega)

    def error(self, continuum: bool) -> Float:
        """|ω/ω_reference − 1|, shape (n, branches); NaN where not found or not present."""
        reference = self.exact if continuum else self.grid
        return np.where(self.found, np.abs(self.omega / reference - 1), np.nan)

    def shift(self, continuum: bool) -> Float:
        """|ω − ω_reference| over the width, shape (n, branches); NaN as of :meth:`error`."""
        reference = self.exact if continuum else self.grid
        return np.where(self.found, np.abs(self.omega - reference) / self.width, np.nan)

    @property
    def coverage(self) -> Float:
        """Part of each wave's points whose 95 % bar holds the grid's ω, shape (branches,)."""
        within = np.abs(self.omega - self.grid) <= self.bar
        count = np.maximum(self.found.sum(axis=0), 1)
        return np.where(self.found.any(axis=0), (within & self.found).sum(axis=0) / count, np.nan)

    def rows(self) -> list[dict[str, Any]]:
        """One row for each wave: counts, and the largest and median error by reference."""
        rows = []
        errors = {"grid": self.error(False), "continuum": self.error(True)}
        for b, name in enumerate(self.names):
            row: dict[str, Any] = {
                "wave": name,
                "present": int(self.present[:, b].sum()),
                "found": int(self.found[:, b].sum()),
                "missed": int(self.missed[:, b].sum()),
            }
            for label, error in errors.items():
                own = error[:, b][np.isfinite(error[:, b])]
                row[f"median_{label}"] = float(np.median(own)) if len(own) else None
                row[f"largest_{label}"] = float(own.max()) if len(own) else None
            row["within_bar"] = float(self.coverage[b]) if row["found"] else None
            rows.append(row)
        return rows


def present_waves(record: Record, omega: Any, k_max: float, least: float = PRESENT) -> Float:
    """Amplitude of each wave over the larger of its detection limits, shape (n, branches).

    Args:
        record: the record.
        omega: ω of each wave at its wavenumbers, ω − iγ where it decays, (n, branches), rad/s.
        k_max: highest wavenumber, rad/m.
        least: weakest that counts, over the strongest at its wavenumber, –.

    Returns:
        Amplitude, as a Hann window sees it, over the largest of that part of the strongest at that
        k, 8 standard errors, and the rounding of the record's strongest wave: > 1 is present.
    """
    _, channels = series(record, k_max)
    count = len(record.t)
    kept = np.flatnonzero(~record.missing) if len(record.missing) else np.arange(count)
    window = hann(count)[kept]
    window /= window.sum()
    sizes, limits = np.zeros(omega.shape), np.zeros(omega.shape)
    waves = omega.shape[1]
    for first in range(0, len(omega), _AT_ONCE):
        at = slice(first, first + _AT_ONCE)
        own = omega[at] * record.interval
        z = exponentials(own.real, -own.imag, count, start=0.0)[..., kept]
        basis = transposed(np.concatenate([z.real, z.imag], axis=1))
        data = transposed(channels[at][..., kept])
        # Of B = Q R the inverse is R⁻¹ Qᵀ, as long in each of its rows as R⁻¹.
        q, r = np.linalg.qr(basis)
        inverse = np.linalg.pinv(r, rcond=1e-10)
        amplitudes = inverse @ (transposed(q) @ data)
        noise = np.mean((data - basis @ amplitudes) ** 2, axis=(1, 2))
        # What has died away early is seen by the less: by no more than a window has of it.
        fall = np.abs(z) @ window
        size, spread = (np.sqrt(np.sum(each**2, axis=2)) for each in (amplitudes, inverse))
        sizes[at] = np.hypot(size[:, :waves], size[:, waves:]) * fall
        error = np.hypot(spread[:, :waves], spread[:, waves:]) * fall
        error *= np.sqrt(noise * data.shape[2])[:, None]
        limits[at] = np.maximum(least * sizes[at].max(axis=1, keepdims=True), _ABOVE_NOISE * error)
    return np.asarray(sizes / np.maximum(limits, max(ROUNDING * sizes.max(), 1e-290)))


def own_waves(
    points: BranchPoints, waves: Float | Complex, cell: float
) -> tuple[NDArray[np.int64], Float]:
    """Which wave each point is, by the one rule that all of a verdict goes by.

    A point may be a wave that it is within half a bin 2π/T of, within its half-width γ, or within
    three of its own bars. At one wavenumber each wave counts once, and those that are nearest
    together go together; along a line, where points have k of their own, each is its nearest.

    Args:
        points: of a record, m of them.
        waves: ω − iγ of the waves at each point's k, shape (m, branches), rad/s; NaN where none is
            known.
        cell: 2π/T, rad/s.

    Returns:
        The wave of each point, -1 where it is of none, and how far the nearest is, rad/s, shape
        (m,) each.
    """
    every = np.asarray(waves, complex)
    distance = np.abs(every.real - points.omega[:, None])
    distance[~np.isfinite(distance)] = np.inf
    reach = np.fmax(_REACH_BINS * cell, -every.imag)
    reach = np.fmax(reach, _REACH_BARS * points.bar[:, None])
    cost = np.where(distance <= reach, distance / cell, 1e6)
    wave = np.full(len(points), -1)
    if not len(points):
        return wave, np.zeros(0)
    if points.method == "beam":
        nearest = cost.argmin(axis=1)
        wave = np.where(cost[np.arange(len(points)), nearest] < 1e6, nearest, -1)
        return wave, distance.min(axis=1)
    order = np.argsort(points.k, kind="stable")
    apart = np.diff(points.k[order]) > _SAME * points.k[order][1:]
    for group in np.split(order, np.flatnonzero(apart) + 1):
        rows, columns = assigned(cost[group])
        own = cost[group][rows, columns] < 1e6
        wave[group[rows[own]]] = columns[own]
    return wave, distance.min(axis=1)


def match(
    points: BranchPoints,
    record: Record,
    names: tuple[str, ...],
    exact: Relation,
    grid: Relation | None = None,
    k_range: tuple[float, float] | None = None,
    least: float = PRESENT,
) -> Matched:
    """Hold points at given k against a reference.

    Args:
        points: of the record.
        record: what they came from.
        names: of the waves, in the order of the relation's branches.
        exact: the continuum's relation.
        grid: the relation that the record obeys exactly, where it has another.
        k_range: wavenumbers judged, rad/m; all of the points' where None.
        least: weakest wave that counts as present, over the strongest at its wavenumber, –.

    Returns:
        What was found of which wave. Where waves decay it is Re ω that is held.
    """
    quiet = record.since(record.quiet_from)
    low, high = k_range or (0.0, float(points.k.max(initial=0.0)))
    k, _ = series(quiet, high)
    waves = np.asarray((grid or exact).omega(k))
    every, decay = waves.real, -waves.imag
    cell = 2 * np.pi / (len(quiet.t) * quiet.interval)
    seen = (every > cell) & (every < 0.97 * np.pi / quiet.interval)
    strength = present_waves(quiet, waves, high, least)
    inside = k >= low * (1 - 1e-9)
    k, every, seen, strength = k[inside], every[inside], seen[inside], strength[inside]
    decay = decay[inside]
    found = np.full(every.shape, np.nan)
    bar = np.full(every.shape, np.nan)
    valid = points.take(points.valid)
    at = np.abs(valid.k[:, None] - k).argmin(axis=1) if len(k) else np.zeros(len(valid), int)
    judged = np.abs(valid.k - k[at]) <= _SAME * k[at] if len(k) else np.zeros(len(valid), bool)
    valid, at = valid.take(judged), at[judged]
    wave, _ = own_waves(valid, every[at] - 1j * decay[at], cell)
    hit = wave >= 0
    found[at[hit], wave[hit]], bar[at[hit], wave[hit]] = valid.omega[hit], valid.bar[hit]
    return Matched(
        names,
        k,
        np.real(exact.omega(k)),
        every,
        (strength > 1) & seen,
        found,
        bar,
        valid.k[~hit],
        valid.omega[~hit],
        decay + cell,
    )


def match_along_line(
    points: BranchPoints, record: Record, names: tuple[str, ...], exact: Relation
) -> Matched:
    """Hold the waves along a line against a reference, each at its own k.

    Which waves are in the record and were not found is not asked.

    Args:
        points: of ``wavesim.readings.dispersion.waves_along_line``.
        record: what they came from.
        names: of the waves, in the order of the relation's branches.
        exact: the continuum's relation.
    """
    valid = points.take(points.valid)
    waves = np.asarray(exact.omega(valid.k)).reshape(len(valid), -1)
    wave, _ = own_waves(valid, waves, 2 * np.pi / (len(record.t) * record.interval))
    hit = np.flatnonzero(wave >= 0)
    found, bar = np.full(waves.shape, np.nan), np.full(waves.shape, np.nan)
    found[hit, wave[hit]], bar[hit, wave[hit]] = valid.omega[hit], valid.bar[hit]
    return Matched(
        names, valid.k, waves.real, waves.real, np.isfinite(found), found, bar, valid.k[wave < 0],
        valid.omega[wave < 0], -waves.imag + valid.error[:, None],
    )  # fmt: skip


@dataclass(frozen=True)
class MatchedInSpace:
    """Complex k at given ω beside the references.

    Attributes:
        points: as measured.
        exact: k of the continuum at their complex ω, shape (m,), rad/m.
        grid: k of the reference that the record obeys, shape (m,), rad/m.
    """

    points: BranchPoints
    exact: Complex
    grid: Complex

    def error(self, continuum: bool) -> Float:
        """|k − k_reference|/|k_reference|, shape (m,); NaN where not valid."""
        reference = self.exact if continuum else self.grid
        return np.where(self.points.valid, np.abs(self.points.k / reference - 1), np.nan)


def match_in_space(
    points: BranchPoints, exact: Relation, grid: Relation | None = None
) -> MatchedInSpace:
    """Hold complex k against a reference, at the complex frequencies where it was measured.

    Args:
        points: of ``wavesim.readings.dispersion.wavenumber_at_frequency.in_space``.
        exact: the continuum's relation.
        grid: the relation that the record obeys exactly, where it has another.
    """
    return MatchedInSpace(
        points, exact.wavenumber(points.omega), (grid or exact).wavenumber(points.omega)
    )
