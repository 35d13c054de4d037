"""Points held against the truth of the record that they came from: found, missed, false, errors.

For points of this program and of any other, which are waves by the rule of ``own_waves``; a point
of no wave is false. A wave is missed where it is in the record and no point within half of 2π/X of
its k is its own. Between the wavenumbers at which a truth is given ω² is interpolated: an even,
smooth function of k, where ω itself has a corner at k = 0.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used: they take a while
from numpy.typing import NDArray

from wavesim.readings.dispersion.frequency_at_wavenumber import chosen_method
from wavesim.readings.dispersion.phase_beam import highest_wavenumber
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.records.record import Record, RecordError
from wavesim.verdict.recovered_points import own_waves, present_waves

Float = NDArray[Any]
Complex = NDArray[np.complex128]

# Of the spline through ω² at real k.
_DEGREE_AT_REAL_K = 7
# A polynomial that is continued to complex k is fitted over so many times its imaginary part.
_REACH = 2.5
_DEGREE = 10
_STEPS = 30
# What two degrees differ by, over k, where the continuation is believed.
_AGREE = 1e-4
_BARS = 3.0
# A wave that leaves a line is in it where it is above this part of the strongest.
_HEARD = 0.03
# An attenuation's point is the truth's within this part of k, or three of its bars.
_OF_K = 0.05
_NYQUIST = 0.97
TRUTH_ARRAYS = (
    "arrays truth_k (n,), rad/m, ascending from 0, and truth_omega (n, branches), rad/s, ω − iγ "
    "where waves decay, to the record's values (times, receivers), t (s) and x (m)"
)


@dataclass(frozen=True)
class Truth:
    """ω of each branch over k, as a record carries it.

    Attributes:
        k: from 0 on, even, shape (n,), rad/m.
        waves: ω, complex ω − iγ where waves decay, shape (n, branches), rad/s.
    """

    k: Float
    waves: Any

    @property
    def branches(self) -> int:
        """How many there are."""
        return int(self.waves.shape[1])

    def _mirrored(self) -> tuple[Float, Any]:
        inner = self.k > 0
        k = np.concatenate([-self.k[inner][::-1], self.k])
        return k, np.concatenate([self.waves[inner][::-1], self.waves]) ** 2

    def omega(self, k: Float) -> Any:
        """ω of each branch at k of shape (m,), rad/m; NaN beyond what is given; (m, branches)."""
        nodes, squares = self._mirrored()
        degree = min(_DEGREE_AT_REAL_K, (len(nodes) - 2) | 1)
        spline = scipy.interpolate.make_interp_spline(nodes, squares, degree)
        found = spline(np.clip(k, nodes[0], nodes[-1]))
        root = np.sqrt(found.astype(complex))
        root = np.where(root.real < 0, -root, root)
        outside = (np.abs(k) > self.k[-1] * (1 + 1e-9))[:, None]
        root = np.where(outside, np.nan, root)
        return root if np.iscomplexobj(self.waves) else root.real

    def wavenumber(self, omega: Complex) -> Complex:
        """k of the branch that passes near each ω + iσ, shape (m,); NaN where none does.

        Inside a gap the truth at real k says nothing.
        """
        found = [self._root(w) for w in np.asarray(omega, complex)]
        return np.array(found, complex)

    def _root(self, omega: complex) -> complex:
        best = complex(np.nan, np.nan)
        nodes, squares = self._mirrored()
        for branch in range(self.branches):
            real = self.waves[:, branch].real
            if not real.min() < omega.real < real.max():
                continue
            at = int(np.argmin(np.abs(real - omega.real)))
            slope = np.gradient(real, self.k)[at]
            if not slope:
                continue
            start = complex(self.k[at] + (omega - real[at]) / slope)
            reach = max(_REACH * abs(start.imag), 16 * (self.k[1] - self.k[0]))
            near = np.abs(nodes - start.real) <= reach
            roots = [
                _newton(nodes[near], squares[near, branch], omega**2, start, degree)
                for degree in (_DEGREE - 2, _DEGREE)
            ]
            if abs(roots[0] - roots[1]) < _AGREE * abs(roots[1]):
                best = roots[1]
        return best


def _newton(nodes: Float, values: Any, target: complex, start: complex, degree: int) -> complex:
    middle, scale = float(nodes.mean()), float(np.ptp(nodes)) / 2
    fit = np.polynomial.Polynomial(
        np.polynomial.polynomial.polyfit((nodes - middle) / scale, values, degree)
    )
    slope = fit.deriv()
    z = (start - middle) / scale
    for _ in range(_STEPS):
        step = (fit(z) - target) / slope(z)
        z -= step
        if abs(step) < 1e-14 * (1 + abs(z)):
            break
    return complex(middle + scale * z) if abs(z) < 2 else complex(np.nan, np.nan)


def truth_of(record: Record) -> Truth:
    """The truth that a record carries.

    Raises:
        RecordError: it carries none.
    """
    answer = record.answer or {}
    if "k" not in answer or "omega" not in answer:
        raise RecordError(f"carries no truth: add {TRUTH_ARRAYS}, or make one with wavesim "
                          "synthesize FILE.npz; as .csv it has none")  # fmt: skip
    k, omega = np.asarray(answer["k"], float), np.asarray(answer["omega"])
    omega = omega[:, None] if omega.ndim == 1 else omega
    ascends = k.ndim == 1 and len(k) > 1 and k[0] >= 0 and (np.diff(k) > 0).all()
    ascends &= np.isfinite(omega).all()
    if not ascends or omega.ndim != 2 or omega.shape[0] != len(k):
        raise RecordError(
            f"truth_k of shape {k.shape} and truth_omega of shape {omega.shape}: must be finite, "
            f"{TRUTH_ARRAYS}"
        )
    return Truth(k, omega)


@dataclass(frozen=True)
class Score:
    """How points stand against the truth.

    Attributes:
        points: valid points that the truth tells of.
        present: waves in the record, one for each wavenumber and branch; for attenuation the
            frequencies at which there is a wave.
        found, missed: of these.
        false: points of no wave.
        median_error, error_95, largest_error: |Δω|/ω or, of attenuation, |Δk|/|k|, of the points
            that are a wave's, the median, what 95 % are below, the largest, –; None without any.
        within_bars: part of all points whose 95 % bar holds the truth; None where no errors are
            given.
        untold: valid points of which the truth says nothing (gaps, beyond its wavenumbers).
        branches: of each branch of the truth, from 1 (of attenuation one for all), its waves
            present and found, the frequencies they span and those between which they are missed,
            Hz, and its points with their errors.
        each: points that the truth tells of, columns of one length: k (rad/m), omega (rad/s),
            branch (0 of false ones), off (rad/s; of attenuation rad/m) and bar, half of the 95 %.
    """

    points: int
    present: int
    found: int
    missed: int
    false: int
    median_error: float | None
    error_95: float | None
    largest_error: float | None
    within_bars: float | None
    untold: int
    branches: tuple[dict[str, Any], ...] = ()
    each: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    def row(self) -> dict[str, Any]:
        """Plain, for JSON, without the points."""
        return {name: one for name, one in asdict(self).items() if name != "each"}

    def said(self) -> str:
        """One line."""
        text = (
            f"Against the truth: {self.found} of {self.present} waves found, {self.missed} missed; "
            f"{self.false} of {self.points} points false"
        )
        if self.median_error is not None:
            text += f"; error {self.median_error:.1e} (median), {self.error_95:.1e} (95 % below), "
            text += f"{self.largest_error:.1e} (largest)"
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
    omega = truth.omega(present_k).real
    return _scored(own, branch, off, np.abs(own.omega), omega, present, found, untold)


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
    found = np.isin(there, own.omega[hit])[:, None]
    branch, present = np.where(hit, 0, -1), np.ones(found.shape, bool)
    omega = there.real[:, None]
    return _scored(own, branch, off, np.abs(exact), omega, present, found, untold)


def _scored(
    own: BranchPoints, branch: Any, off: Float, size: Float, omega: Float, present: Any, found: Any,
    untold: int,
) -> Score:  # fmt: skip
    """The score of points, each with its branch (−1: false), how far off it is, and of what size.

    Args:
        omega: of the waves, ascending in k or frequency, shape (n, branches), rad/s; of these
        present, found: which are in the record, and which are a point's, the same shape.
    """
    rows = []
    for b in range(omega.shape[1]):
        there, mine = present[:, b], branch == b
        f = omega[:, b] / (2 * np.pi)
        lost = np.flatnonzero(there & ~found[:, b])
        runs = np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1) if len(lost) else []
        median, most, _ = _errors((off / size)[mine])
        rows.append({
            "branch": b + 1,
            "frequencies_Hz": [float(f[there].min()), float(f[there].max())] if there.any() else [],
            "present": int(there.sum()), "found": int((found[:, b] & there).sum()),
            "missed_Hz": [[float(f[run].min()), float(f[run].max())] for run in runs],
            "points": int(mine.sum()), "median_error": median, "error_95": most,
            "within_bars": _within(off[mine], own.bar[mine]),
        })  # fmt: skip
    hit = branch >= 0
    each = {"k": own.k, "omega": own.omega, "branch": branch + 1, "off": off, "bar": own.bar}
    return Score(
        len(own), int(present.sum()), int(found.sum()), int((present & ~found).sum()),
        int((~hit).sum()), *_errors((off / size)[hit]), _within(off, own.bar), untold,
        tuple(rows), each,
    )  # fmt: skip


def _errors(error: Float) -> tuple[float | None, float | None, float | None]:
    """The median, what 95 % are below, and the largest."""
    if not len(error):
        return None, None, None
    return float(np.median(error)), float(np.quantile(error, 0.95)), float(error.max())


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
