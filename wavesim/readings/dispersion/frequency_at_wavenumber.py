"""ω(k) of a record: by harmonic inversion in time, or by Fourier transforms.

Receivers round a periodic bar hold its wavenumbers exactly. On a stretch the transform in space
is exact at every wavenumber while the waves have not come to its ends; where they have, harmonic
inversion is refused, and waves are told apart along the line instead (``waves_along_line.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft

from wavesim.readings.dispersion.branch_joining import join, scatter
from wavesim.readings.dispersion.harmonic_inversion import DYNAMIC_RANGE, invert
from wavesim.readings.dispersion.hidden_mode import CLOSE, Bends, of_lines, worth
from wavesim.readings.dispersion.noise_level import FLOOR_OVER_MEAN, continuum, leakage_of_gains
from wavesim.readings.dispersion.points import ALONE, BranchPoints
from wavesim.readings.dispersion.sinusoid_errors import Sinusoids
from wavesim.readings.dispersion.unread_receivers import put_in
from wavesim.readings.dispersion.waves_along_line import along_line, numbered
from wavesim.records.fitness import evened, live
from wavesim.records.record import Record, RecordError
from wavesim.records.windows import blackman_harris, hann

Float = NDArray[Any]

METHODS = ("harmonic", "fft", "auto")
# Part of the Nyquist frequency or wavenumber up to which a point counts.
_NYQUIST = 0.97
# Part of the record's largest value at the ends of a stretch above which waves have left it.
_AT_ENDS = 3e-3
# … looked for in so many stretches of time, above the noise's power and this part more.
_WINDOWS, _NOISE_ROOM = 16, 1.2
_WORKERS = 2
# Peaks of the FFT count above this part of the highest at their wavenumber (power), this many
# times the median of all frequencies, and of those close by.
_PEAK_FLOOR = 1e-8
_ABOVE_MEDIAN = 40.0
_ABOVE_CONTINUUM = 20.0
_PADDING = 2
# A wave weaker than this part of the record's strongest is rounding.
ROUNDING = 1e-12
_CYCLES = 1.0
# Noise above this part of a digitiser's step makes what rounding leaves random.
_HIDES = 0.6
# What leaks in beside a line shifts it by up to this part of a bin 2π/T, over their amplitudes.
_SHIFT = 0.5
# Half-width of the Blackman–Harris main lobe.
LOBE_BINS = 4
BROAD = (
    "no line stands out of what surrounds it: waves that are broad or random, or that other "
    "wavenumbers leak into"
)
RANDOM = (
    "its line is broad and random, as of thermal motion, and no sum of sinusoids: take --method fft"
)
# Part of the wavenumbers at which lines are random, of which on the whole record is.
_RANDOM = 0.2
CROWDED = (
    "too many waves near this frequency to tell from other receivers what bad ones lack: put those "
    "right"
)
MORE = "more waves than sought at this k"


def wavenumbers(record: Record) -> Float:
    """Wavenumbers 2πm/X of a record up to Nyquist, without 0, rad/m."""
    count = len(record.x)
    return np.asarray(2 * np.pi * np.arange(1, count // 2 + 1) / (count * record.spacing))


def series(record: Record, k_max: float | None = None) -> tuple[Float, Float]:
    """Transform in space: k (n,) and real and imaginary parts as channels, (n, 2C, nt).

        û(k, t) = Σ_x u(x, t) e^{−ikx}

    Args:
        record: with evenly spaced receivers.
        k_max: highest wavenumber wanted, rad/m.

    Raises:
        RecordError: the receivers are uneven, or hold fewer than three wavenumbers up to k_max.
    """
    if not record.even:
        raise RecordError(
            "receivers are not evenly spaced: ω at given k needs even spacing; measure k at given "
            "ω instead (wavesim attenuation, or method 'space')"
        )
    k = wavenumbers(record)
    kept = len(k) if k_max is None else int(np.searchsorted(k, k_max * (1 + 1e-9), side="right"))
    if kept < 3:
        raise RecordError(
            f"the receivers tell {kept} wavenumbers apart"
            + ("" if k_max is None else f" up to k_max = {k_max:.4g} rad/m")
            + f", multiples of {k[0]:.4g} rad/m: at least 3 are needed; cover a longer stretch, "
            "use more receivers, or measure k at given ω instead (wavesim attenuation)"
        )
    parts = []
    for values in record.values:
        hat = rfft(values, axis=1, workers=_WORKERS)[:, 1 : kept + 1]
        parts += [hat.real.T, hat.imag.T]
    return k[:kept], np.stack(parts, axis=1) / len(record.x)


def in_time(
    record: Record,
    k_max: float | None = None,
    method: str = "harmonic",
    omega_max: float | None = None,
    most: int = 12,
    dynamic_range: float = DYNAMIC_RANGE,
    damped: bool = True,
) -> BranchPoints:
    """Branch points of a record, ω and its error at each wavenumber; branches by continuity.

    Args:
        record: with evenly spaced receivers; only frames without a source are used.
        k_max: highest wavenumber wanted, rad/m; Nyquist where None.
        method: "harmonic", exact without noise and at the Cramér–Rao bound with it; "fft", the
            peaks of a windowed transform between its bins on a ring, and beams on a stretch; or
            "auto", harmonic where that is exact, and beams where waves leave the stretch.
        omega_max: highest frequency wanted, rad/s.
        most: most waves at one wavenumber, –.
        dynamic_range: weakest wave sought, over the strongest at its wavenumber, –; harmonic.
        damped: False holds every decay to 0; harmonic.

    Returns:
        The points, ascending in k and ω.

    Raises:
        RecordError: the record can't be used so; the message names the remedy.
        ValueError: no method has that name.
    """
    if method not in METHODS:
        raise ValueError(f"method = {method!r}: must be one of {', '.join(METHODS)}")
    quiet = live(evened(record).since(record.quiet_from))
    if method == "auto":
        method = chosen_method(quiet)
    if method == "fft" and not record.ring:
        return along_line(record if record.sources else quiet, k_max, omega_max)
    missing = quiet.missing if len(quiet.missing) and quiet.missing.any() else None

    def inverted(channels: Float, record: Record, first: int = 1) -> tuple[Sinusoids, Float, float]:
        leaks, per_bin = np.zeros((0, 0)), 1.0
        if missing is None and (record.leak.any() or record.quantum.any()):
            # By the window that inversion looks through, so that no side lobe is a wave.
            heights, per_bin = power(channels, hann)
            leaks = _leaks(record, heights, per_bin, first, hann)
        above = leaks if leaks.any() else None
        found = invert(channels, record.interval, most, dynamic_range, damped, missing, above)
        return found, leaks, per_bin

    if len(quiet.misfit) and quiet.misfit.any():
        quiet = put_in(quiet, lambda every, now: inverted(every, now, 0)[0])
    k, channels = series(quiet, k_max)
    cell = 2 * np.pi / (len(quiet.t) * quiet.interval)
    if method == "harmonic":
        if not record.ring:
            _check_ends(quiet)
        found, leaks, per_bin = inverted(channels, quiet)
        points, bends = _from_sinusoids(found, k), found.bends
        if leaks.any():
            at = np.round(points.omega * quiet.interval / per_bin).astype(int)
            error = _beside_leakage(points, found.series, at, leaks, cell)
            points = replace(points, error=error)
    else:
        points, bends = _from_peaks(channels, k, quiet)
    points = _judged(points, quiet, cell)
    if quiet.ring and (bad := int(quiet.misfit.sum())):
        crowd = np.sum(np.abs(points.omega[:, None] - points.omega) < cell, axis=1)
        points = points.refused(2 * crowd * bad > len(quiet.x) / 2, CROWDED)
    if omega_max is not None:
        low = points.omega <= omega_max
        points, bends = points.take(low), bends.take(low)
    points = widened(with_branches(points, k, cell), k)
    step = np.searchsorted(k, points.k * (1 - 1e-12))
    close = CLOSE if method == "harmonic" else 0.0
    hides = worth(bends, points.omega, points.branch, step, cell, points.decay, close)
    error = np.hypot(points.error, hides.error)
    points = replace(points, error=error, splitting=hides.splitting)
    if method == "fft":
        points = points.refused(points.branch < 0, ALONE)
    return numbered(_with_rounding(points, quiet).known())


def chosen_method(record: Record) -> str:
    """What "auto" comes to: "harmonic" where that is exact, else "fft"."""
    whole = record.ring or (record.even and not _at_ends(record)[1])
    return "harmonic" if whole else "fft"


def _with_rounding(points: BranchPoints, record: Record) -> BranchPoints:
    """Errors with what rounded times and positions leave open of their intervals."""
    if not (record.interval_error or record.spacing_error):
        return points
    part = points.omega * np.hypot(record.interval_error, record.spacing_error)
    return replace(points, error=np.hypot(points.error, part))


def with_branches(points: BranchPoints, k: Float, cell: float) -> BranchPoints:
    """The points with valid ones joined into branches over the wavenumbers k."""
    branch = np.full(len(points), -1)
    valid = np.flatnonzero(points.valid)
    step = np.searchsorted(k, points.k[valid] * (1 - 1e-12))
    branch[valid] = join(step, points.omega[valid], points.amplitude[valid], cell)
    return replace(points, branch=branch)


def widened(points: BranchPoints, k: Float) -> BranchPoints:
    """Errors no smaller than points scatter about their own branch."""
    error = points.error.copy()
    for branch in points.branches:
        own = np.flatnonzero(points.branch == branch)
        step = np.searchsorted(k, points.k[own] * (1 - 1e-12))
        more = scatter(step, points.omega[own], error[own])
        error[own] = np.hypot(error[own], more)
    return replace(points, error=error)


def _beside_leakage(points: BranchPoints, row: Any, at: Any, leaks: Float, cell: float) -> Float:
    """Errors with what leaks into a line from others close by, which shifts it by a part of a bin.

    Args:
        points: as found.
        row, at: where in leaks each is, shape (m,).
        leaks: power below which a peak may be another wavenumber's, shape (n, nω).
        cell: 2π/T, rad/s.
    """
    size = np.sqrt(leaks[row, np.clip(at, 0, leaks.shape[1] - 1)] / FLOOR_OVER_MEAN)
    part = size / np.maximum(points.amplitude, 1e-290)
    return np.hypot(points.error, _SHIFT * cell * np.minimum(part, 1))


def _from_sinusoids(found: Sinusoids, k: Float) -> BranchPoints:
    reason = np.where(found.resolved, "", "not told apart from a neighbour or from noise")
    settled = found.settled[found.series]
    # Where the lines of many wavenumbers are random, those that look alike are too.
    broad = found.broad[found.series] | (found.broad.mean() > _RANDOM)
    reason = np.where(found.resolved & ~settled, MORE, reason)
    reason = np.where(broad, RANDOM, reason)
    return BranchPoints(
        "harmonic",
        k[found.series],
        found.omega,
        found.decay,
        found.amplitude,
        found.omega_error,
        found.residual[found.series],
        reason == "",
        reason.astype(object),
        np.full(len(found.omega), -1),
    )


def _judged(points: BranchPoints, record: Record, cell: float) -> BranchPoints:
    """The validity rules that every method shares."""
    points = points.refused(points.omega < cell, "less than one period in the record: lengthen it")
    points = points.refused(
        points.omega > _NYQUIST * np.pi / record.interval,
        "at the Nyquist frequency: sample more often",
    )
    points = points.refused(
        points.amplitude < ROUNDING * points.amplitude.max(initial=0.0),
        "as weak as the rounding of the record's strongest wave",
    )
    if points.method == "fft":
        points = points.refused(
            points.omega < LOBE_BINS * cell, "in the window's main lobe about ω = 0: lengthen it"
        )
    nyquist = np.inf if record.lattice else _NYQUIST
    points = points.refused(
        points.k > nyquist * np.pi / record.spacing,
        "at the Nyquist wavenumber: space receivers closer",
    )
    return points


def _at_ends(record: Record) -> tuple[float, bool]:
    """What of the peak is at the ends of a stretch, and whether it is waves that leave it."""
    moving = record.values - record.values.mean(axis=1, keepdims=True)  # k = 0 is not used
    ends = moving[..., [0, -1]]
    peak = float(np.abs(moving).max())
    parts = np.array_split(ends**2, max(1, min(_WINDOWS, ends.shape[1] // 8)), axis=1)
    noise = record.noise**2
    # Of noise alone, the mean square of m samples scatters by √(2/m).
    loud = [
        float(part.mean()) > noise * (_NOISE_ROOM + 6 * np.sqrt(2 / part.size))
        + (_AT_ENDS * peak) ** 2
        for part in parts
    ]  # fmt: skip
    strongest = max(float(part.mean()) for part in parts)
    return float(np.sqrt(strongest)) / max(peak, 1e-290), any(loud)


def _check_ends(record: Record) -> None:
    """Refuse a stretch that waves have left."""
    part, left = _at_ends(record)
    if left:
        raise RecordError(
            f"waves reach the ends of the receivers ({100 * part:.2g} % of the peak there): ω at "
            "given k can't be had exactly; measure k at given ω (wavesim attenuation), or take "
            "--method fft, which is good to a part of the aperture's resolution"
        )


def power(channels: Float, shape: Callable[[int], Float] = blackman_harris) -> tuple[Float, float]:
    """Power Σ_c |∫ y_c w e^{iωt} dt|² over both directions, shape (n, nω), and ω per bin·Δt.

    Args:
        channels: of :func:`series`, shape (n, 2C, nt).
        shape: of the window w.
    """
    count = channels.shape[-1]
    padded = next_fast_len(_PADDING * count, real=True)
    window = shape(count)
    window = window * (2 / window.sum())
    total = np.zeros((len(channels), padded // 2 + 1))
    for c in range(channels.shape[1]):
        hat = rfft(channels[:, c] * window, padded, axis=-1, workers=_WORKERS)
        total += hat.real**2 + hat.imag**2
    return total, 2 * np.pi / padded


def _leaks(
    record: Record,
    heights: Float,
    per_bin: float,
    first: int = 1,
    shape: Callable[[int], Float] = blackman_harris,
) -> Float:
    """Power below which a peak may be none of its wavenumber's waves, shape (n, nω).

    It is another wavenumber's, where receivers differ, or of a digitiser: of a signal that repeats
    itself, and noise that does not hide the steps, what rounding leaves repeats itself too, and is
    lines at all wavenumbers, of the power q²/12 together.
    """
    density = 2 * np.pi / per_bin / len(record.t)
    if first == 1 and record.leak.any():
        # A hum that all hear alike is at k = 0.
        alike, _ = power(record.values.mean(axis=2)[None], shape)
        leaks = leakage_of_gains(np.concatenate([alike, heights]), record.leak, density, 0)[1:]
    else:
        leaks = leakage_of_gains(heights, record.leak, density, first)
    steps = record.quantum
    if steps.any() and record.noise < _HIDES * float(np.median(steps[steps > 0])):
        leaks = np.maximum(leaks, 2 * float(np.sum(steps**2)) / 12 / len(record.x) ** 2)
    return leaks


def _from_peaks(channels: Float, k: Float, record: Record) -> tuple[BranchPoints, Bends]:
    """Peaks of the windowed FFT, placed by a parabola through their logarithm.

    The error is half the difference between that and the middle of the peak by a parabola through
    the points two bins off: 0 for a lone sinusoid but for the window's shape, and more where
    another is near.
    """
    interval = record.interval
    heights, per_bin = power(channels)
    logarithm = np.log(np.maximum(heights, 1e-300))
    middle = logarithm[:, 2:-2]
    peak = (middle > logarithm[:, 1:-3]) & (middle >= logarithm[:, 3:-1])
    floor = np.log(_PEAK_FLOOR) + logarithm.max(axis=1, keepdims=True)
    noise = np.log(_ABOVE_MEDIAN) + np.median(logarithm, axis=1, keepdims=True)
    density = 2 * np.pi / per_bin / channels.shape[-1]
    local = continuum(heights, density, channels.shape[1])
    leaks = _leaks(record, heights, per_bin)
    stands = heights > np.maximum(_ABOVE_CONTINUUM * local, leaks)
    loud = peak & (middle > np.maximum(floor, noise))
    line = loud & stands[:, 2:-2]
    # Where no line stands out, the loudest of what there is, to say so of.
    hump = np.where(loud & ~line.any(axis=1, keepdims=True), middle, -np.inf)
    only = np.zeros_like(line)
    only[np.arange(len(hump)), hump.argmax(axis=1)] = np.isfinite(hump.max(axis=1))
    row, at = np.nonzero(line | only)
    broad = only[row, at]
    at = at + 2
    near, top = _vertex(*(logarithm[row, at + d] for d in (-1, 0, 1)))
    far, _ = _vertex(*(logarithm[row, at + d] for d in (-2, 0, 2)))
    snr = local[row, at] / np.exp(top)
    error = np.sqrt((near - 2 * far) ** 2 / 4 + _SHAPE**2 + 4 * snr) * per_bin / interval
    total = heights.sum(axis=1)[row]
    lobe = sum(heights[row, np.clip(at + d, 0, heights.shape[1] - 1)] for d in range(-8, 9))
    explained = np.bincount(row, lobe / total, len(k))
    found = BranchPoints(
        "fft",
        k[row],
        (at + near) * per_bin / interval,
        np.zeros(len(row)),
        np.exp(top / 2),
        error,
        np.clip(1 - explained, 0, 1)[row],
        ~broad,
        np.where(broad, BROAD, "").astype(object),
        np.full(len(row), -1),
    )
    cell = 2 * np.pi / (len(record.t) * interval)
    found = replace(found, error=_beside_leakage(found, row, at, leaks, cell))
    beside = np.sqrt(local[row, at] + _SIDE_LOBE * heights.max(axis=1)[row])
    return found, of_lines(channels, row, found.omega, interval, beside)


# Error of the parabola through the logarithm of a Blackman–Harris peak padded twice, in its bins.
_SHAPE = 2e-3
# Power of the window's side lobes, over the line's.
_SIDE_LOBE = 1e-9


def _vertex(left: Float, middle: Float, right: Float) -> tuple[Float, Float]:
    bend = left - 2 * middle + right
    bend = np.where(bend < 0, bend, -1e-300)
    shift = np.clip(0.5 * (left - right) / bend, -1, 1)
    return shift, middle - 0.25 * (left - right) * shift


__all__ = ["METHODS", "in_time", "power", "series", "wavenumbers", "with_branches"]
