"""Points held against the truth of the record that they came from: found, missed, false, errors.

For points of this program and of any other, which are waves by the rule of ``own_waves``; a point
of no wave is false. A wave is missed where it is in the record and no point within half of 2π/X of
its k is its own.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.beam import highest_wavenumber
from wavesim.readings.dispersion.frequency_at_wavenumber import chosen_method
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.records.record import Record, RecordError
from wavesim.verdict.recovered_points import own_waves, present_waves
from wavesim.verdict.truth import Truth, truth_of

Float = NDArray[Any]

_BARS = 3.0
# A wave that leaves a line is in it where it is above this part of the strongest.
_HEARD = 0.03
# An attenuation's point is the truth's within this part of k, or three of its bars.
_OF_K = 0.05
_NYQUIST = 0.97


@dataclass(frozen=True)
class Score:
    """How points stand against the truth.

    Attributes:
        points: valid points that the truth tells of.
        present: waves in the record, one for each wavenumber and branch; for attenuation the
            frequencies at which there is a wave.
        found, missed: of these.
        false: points of no wave.
        median_error, largest_error: |Δω|/ω or, of attenuation, |Δk|/|k|, of the points that are
            a wave's, –; None without any.
        within_bars: part of all points whose 95 % bar holds the truth; None where no errors are
            given.
        untold: valid points of which the truth says nothing (gaps, beyond its wavenumbers).
    """

    points: int
    present: int
    found: int
    missed: int
    false: int
    median_error: float | None
    largest_error: float | None
    within_bars: float | None
    untold: int

    def row(self) -> dict[str, Any]:
        """Plain, for JSON."""
        return asdict(self)

    def said(self) -> str:
        """One line."""
        text = (
            f"Against the truth: {self.found} of {self.present} waves found, {self.missed} missed; "
            f"{self.false} of {self.points} points false"
        )
        if self.median_error is not None:
            text += f"; error {self.median_error:.1e} (median), {self.largest_error:.1e} (largest)"
        if self.within_bars is not None:
            text += f"; {100 * self.within_bars:.0f} % within 95 % bars"
        return text + (f"; {self.untold} points where it says nothing" if self.untold else "")


def score(record: Record, points: BranchPoints, k_max: float | None = None) -> Score:
    """Hold points against the truth that a record carries.

    Args:
        record: a synthetic one (``ws.synthesize``, or read from its file).
        points: of it; those not valid do not count. Errors that are NaN are not given.
        k_max: highest wavenumber at which waves are missed, rad/m; the truth's, or the receivers'
            Nyquist wavenumber, where None.

    Raises:
        RecordError: the record carries no truth.
    """
    truth = truth_of(record)
    own = points.take(points.valid & np.isfinite(points.k) & np.isfinite(points.omega))
    if points.in_space:
        return _in_space(truth, own, points)
    return _in_time(truth, own, record, k_max)


def _in_time(truth: Truth, own: BranchPoints, record: Record, k_max: float | None) -> Score:
    quiet = record if record.sources and not record.ring else record.since(record.quiet_from)
    cell = 2 * np.pi / (len(quiet.t) * quiet.interval)
    waves = truth.omega(own.k)
    told = np.isfinite(waves).any(axis=1)
    untold, own, waves = int((~told).sum()), own.take(told), waves[told]
    branch, off = own_waves(own, waves, cell)
    hit = branch >= 0
    present_k, present = _present(truth, quiet, k_max)
    spacing = np.pi / quiet.aperture
    found = np.zeros(present.shape, bool)
    for b in range(truth.branches):
        mine = np.sort(own.k[hit & (branch == b)])
        if len(mine):
            near = np.abs(present_k[:, None] - mine).min(axis=1) <= spacing * (1 + 1e-9)
            found[:, b] = near & present[:, b]
    return Score(
        len(own), int(present.sum()), int(found.sum()), int((present & ~found).sum()),
        int((~hit).sum()), *_errors(off[hit] / np.abs(own.omega[hit])),
        _within(off, own.bar), untold,
    )  # fmt: skip


def _present(truth: Truth, record: Record, k_max: float | None) -> tuple[Float, Any]:
    """Wavenumbers 2πm/X and which waves are there."""
    nyquist = np.inf if record.lattice else _NYQUIST * highest_wavenumber(record.x)
    top = min(k_max or np.inf, float(truth.k[-1]), nyquist, np.pi / record.spacing)
    step = 2 * np.pi / record.aperture
    k = step * np.arange(1, int(top / step * (1 + 1e-9)) + 1)
    waves = truth.omega(k)
    cell = 2 * np.pi / (len(record.t) * record.interval)
    top_omega = _NYQUIST * np.pi / record.interval
    seen = (waves.real > cell) & (waves.real < top_omega) & np.isfinite(waves)
    if not len(k):
        return k, seen
    if chosen_method(record) == "harmonic" and record.even and len(k) >= 3:
        strength = present_waves(record, waves, float(k[-1]))
        return k, seen & (strength[: len(k)] > 1)
    # Of a line that waves leave: what of each frequency is heard along it.
    frequency = 2 * np.pi * np.fft.rfftfreq(len(record.t), record.interval)
    size = np.abs(np.fft.rfft(record.values[0], axis=0)).mean(axis=1)
    heard = np.interp(np.nan_to_num(waves.real), frequency, size) > _HEARD * size[1:].max()
    return k, seen & heard & (k > 2 * np.pi / record.aperture)[:, None]


def _in_space(truth: Truth, own: BranchPoints, every: BranchPoints) -> Score:
    exact = truth.wavenumber(own.omega)
    told = np.isfinite(exact)
    untold, own, exact = int((~told).sum()), own.take(told), exact[told]
    # A record does not say which way is forward.
    off = np.minimum(np.abs(own.k - exact), np.abs(own.k + exact))
    hit = off <= np.fmax(_OF_K * np.abs(exact), _BARS * own.bar)
    asked = np.unique(every.omega)
    there = np.unique(asked[np.isfinite(truth.wavenumber(asked))])
    found = int(np.isin(there, own.omega[hit]).sum())
    return Score(
        len(own), len(there), found, len(there) - found, int((~hit).sum()),
        *_errors(off[hit] / np.abs(exact[hit])), _within(off, own.bar), untold,
    )  # fmt: skip


def _errors(error: Float) -> tuple[float | None, float | None]:
    return (float(np.median(error)), float(error.max())) if len(error) else (None, None)


def _within(off: Float, bar: Float) -> float | None:
    given = np.isfinite(bar)
    return float(np.mean(off[given] <= bar[given])) if given.any() else None


def points_of(k: Any, omega: Any, error: Any = None, valid: Any = None) -> BranchPoints:
    """Points that another program found.

    Args:
        k: wavenumbers, shape (m,), rad/m; complex for attenuation, with Im k > 0.
        omega: angular frequencies, shape (m,), rad/s; for complex k the frequency ω, or ω + iσ.
        error: standard errors of ω (rad/s) or, of complex k, of its modulus (rad/m); None: none.
        valid: which count; all where None.

    Raises:
        RecordError: the arrays are not of one length.
    """
    k, omega = np.atleast_1d(np.asarray(k)), np.atleast_1d(np.asarray(omega))
    n = len(k)
    bars = np.full(n, np.nan) if error is None else np.atleast_1d(np.asarray(error, float))
    counts = np.ones(n, bool) if valid is None else np.atleast_1d(np.asarray(valid, bool))
    if not len(omega) == len(bars) == len(counts) == n:
        raise RecordError(
            f"k of {n}, omega of {len(omega)}, error of {len(bars)} entries: must be as many"
        )
    space = np.iscomplexobj(k)
    return BranchPoints(
        "space" if space else "given", k if space else np.abs(k),
        omega.astype(complex) if space else np.abs(omega),
        np.zeros(n), np.ones(n), bars, np.zeros(n), counts,
        np.where(counts, "", "not counted").astype(object), np.full(n, -1),
    )  # fmt: skip
