"""ω(k) of a record: by harmonic inversion in time, or by Fourier transforms.

Receivers round a periodic bar hold its wavenumbers exactly. On a stretch the transform in space
is exact at every wavenumber while the waves have not come to its ends; where they have, harmonic
inversion is refused, and waves are told apart along the line instead (``waves_along_line.py``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from wavesim.readings.dispersion.branch_joining import SHORTEST_BRANCH, join, scatter
from wavesim.readings.dispersion.fft_peaks import (
    LOBE_BINS,
    WORKERS,
    beside_leakage,
    leaks_of,
    peaks,
    power,
)
from wavesim.readings.dispersion.folding import FOLDED, TURNED, mirrored_branches, turned_in_turn
from wavesim.readings.dispersion.harmonic_inversion import DYNAMIC_RANGE, invert
from wavesim.readings.dispersion.hidden_mode import CLOSE, worth
from wavesim.readings.dispersion.noise_level import leaked
from wavesim.readings.dispersion.nyquist_crossing import TOO_SELDOM, across_nyquist
from wavesim.readings.dispersion.points import ALONE, BranchPoints
from wavesim.readings.dispersion.sinusoid_errors import Sinusoids, of_moving_lines
from wavesim.readings.dispersion.unlike_receivers import check_no_part_is_unlike, check_one_kind
from wavesim.readings.dispersion.unread_receivers import put_in
from wavesim.readings.dispersion.waves_along_line import along_line, numbered
from wavesim.records.fitness import evened, live
from wavesim.records.record import Record, RecordError
from wavesim.records.windows import hann

Float = NDArray[Any]

METHODS = ("harmonic", "fft", "auto")
# Part of the Nyquist frequency or wavenumber up to which a point counts.
_NYQUIST = 0.97
# Part of the record's largest value at the ends of a stretch above which waves have left it.
_AT_ENDS = 3e-3
# … looked for in so many stretches of time, above the noise's power and this part more.
_WINDOWS, _NOISE_ROOM = 16, 1.2
# A wave weaker than this part of the record's strongest is rounding.
ROUNDING = 1e-12
_CYCLES = 1.0
RANDOM = (
    "its line is broad and random, as of thermal motion, and no sum of sinusoids: take --method fft"
)
# Part of the wavenumbers at which no more than the waves sought must be there.
_SETTLED = 0.8
# Part of the wavenumbers at which lines are random, of which on the whole record is.
_RANDOM = 0.2
CROWDED = (
    "too many waves near this frequency to tell from other receivers what bad ones lack: put those "
    "right"
)
MOVES = (
    "its frequency moves while it is recorded, as of a specimen that warms, softens or is driven "
    "beyond its linear range: take a shorter part of the record"
)
MORE = "more waves than sought at this k"
LEAKED = (
    "at the frequency of a far stronger wave of another wavenumber, as many are: receivers that "
    "differ in gain, place or clock show it, or a ring that is not the same all round"
)


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
        hat = rfft(values, axis=1, workers=WORKERS)[:, 1 : kept + 1]
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

    def inverted(channels: Float, record: Record, first: int = 1) -> tuple[Sinusoids, Any, float]:
        leaks, per_bin = (np.zeros(0), np.zeros(0)), 1.0
        if missing is None:
            # By the window that inversion looks through, so that no side lobe is a wave.
            heights, per_bin = power(channels, hann)
            leaks = leaks_of(record, heights, per_bin, first, hann)

        def above(floor: Float) -> Sinusoids:
            return invert(channels, record.interval, most, dynamic_range, damped, missing, floor)

        found = above(leaks[0])
        if found.settled.mean() < _SETTLED and leaks[1].any():
            # More leak in than are sought.
            found = above(np.maximum(*leaks))
        return found, leaks, per_bin

    if len(quiet.misfit) and quiet.misfit.any():
        quiet = put_in(quiet, lambda every, now: inverted(every, now, 0)[0])
    k, channels = series(quiet, k_max)
    cell = 2 * np.pi / (len(quiet.t) * quiet.interval)
    if method == "harmonic":
        if not record.ring:
            _check_ends(quiet)
        found, (leaks, lines), per_bin = inverted(channels, quiet)
        points, bends = _from_sinusoids(found, k), found.bends
        points = points.refused(of_moving_lines(found, cell), MOVES)
        if len(leaks):
            at = np.clip(np.round(points.omega * quiet.interval / per_bin), 0, len(leaks) - 1)
            at = at.astype(int)
            points = replace(points, error=beside_leakage(points, at, leaks, cell))
            points = points.refused(points.amplitude**2 < np.maximum(leaks, lines)[at], LEAKED)
    else:
        points, bends = peaks(channels, k, quiet)
    points = _judged(points, quiet, cell)
    if quiet.ring and (bad := int(quiet.misfit.sum())):
        crowd = np.sum(np.abs(points.omega[:, None] - points.omega) < cell, axis=1)
        points = points.refused(2 * crowd * bad > len(quiet.x) / 2, CROWDED)
    step = np.searchsorted(k, points.k * (1 - 1e-12))
    if record.ring:
        lines = step + 1, points.omega, points.amplitude, points.error, cell
        if not record.lattice:  # two sites of a cell are of two kinds by right
            check_one_kind(*lines, len(record.x))
        check_no_part_is_unlike(*lines)
    if len(points) and record.leak is not None:
        echo = leaked(step, points.omega, points.amplitude, points.error, cell, bool(quiet.leak))
        points = points.refused(echo, LEAKED)
    if omega_max is not None:
        low = points.omega <= omega_max
        points, bends = points.take(low), bends.take(low)
    points = widened(with_branches(points, k, cell), k)
    every = with_branches(points, k, cell, shortest=1).branch
    known = every, points.k, points.omega
    points = points.refused(across_nyquist(*known, np.pi / quiet.interval, cell), TOO_SELDOM)
    if not record.lattice:
        mirrored = mirrored_branches(*known, record.spacing)
        points = points.refused(mirrored, FOLDED)
    if record.ring and turned_in_turn(*known, record.spacing):
        points = points.refused(np.ones(len(points), bool), TURNED)
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


def with_branches(
    points: BranchPoints, k: Float, cell: float, shortest: int = SHORTEST_BRANCH
) -> BranchPoints:
    """The points with valid ones joined into branches over the wavenumbers k."""
    branch = np.full(len(points), -1)
    valid = np.flatnonzero(points.valid)
    step = np.searchsorted(k, points.k[valid] * (1 - 1e-12))
    branch[valid] = join(step, points.omega[valid], points.amplitude[valid], cell, shortest)
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


def _from_sinusoids(found: Sinusoids, k: Float) -> BranchPoints:
    # A sum of many may run away, whose sinusoids are none.
    numbers = found.omega, found.decay, found.amplitude, found.omega_error
    whole = np.isfinite(numbers).all(axis=0)
    omega, decay, amplitude, error = np.where(whole, numbers, np.array([0, 0, 0, np.inf])[:, None])
    reason = np.where(found.resolved & whole, "", "not told apart from a neighbour or from noise")
    settled = found.settled[found.series]
    # Where the lines of many wavenumbers are random, those that look alike are too.
    broad = found.broad[found.series] | (found.broad.mean() > _RANDOM)
    reason = np.where(found.resolved & whole & ~settled, MORE, reason)
    reason = np.where(broad, RANDOM, reason)
    return BranchPoints(
        "harmonic",
        k[found.series],
        omega,
        decay,
        amplitude,
        error,
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
    # Of noise alone, the mean square of m samples scatters by √(2/m). Signals up to the Nyquist
    # frequency look like noise, but not where all is quiet.
    quiet = (float(part.mean()) / max(1 - 4 * np.sqrt(2 / part.size), 0.1) for part in parts)
    noise = min(record.noise**2, *quiet)
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
