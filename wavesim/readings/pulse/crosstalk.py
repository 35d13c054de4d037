"""Crosstalk: what comes with the sent pulse, at once and whatever the distance.

It is the pulse v(t) through coupling that forgets soon, so that before any wave has come

    u(t) = Σ_j a_j φ_j(t),   φ = dv/dt, v, and dv/dt followed by exp(−t/τ) at some τ,

and a few a_j, fitted to the longest beginning that they explain, take it out of the rest, on which
a wave may lie. Receivers along a line hear the same of it at once, as only waves move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from wavesim.records.windows import moving_mean

Float = NDArray[np.float64]
Filter = Callable[[Float], Float]

# Decays that are tried, in periods, and the beginnings, in periods too.
_DECAYS = (0.12, 0.4, 1.3)
_SHORTEST, _STEP, _BEYOND = 0.7, 0.125, 1.5
# A beginning is explained where each quarter of a period of it leaves no more than so many
# deviations of the noise, or this part of the crosstalk; the rest must be foretold as well.
_LEFT, _PART, _FORETOLD = 2.0, 0.05, 0.15
# What is sent is smoothed over this part of a period, as a digitiser's steps have a rate,
# and as it was recorded, as it may begin at once.
_SMOOTH = 0.03
# What comes to all receivers within this part of a period comes at once; it is over at this part of
# its peak.
_ALIKE, _ENDED = 0.025, 0.15
# … and has this part of its power in common.
_TOGETHER = 0.8
# It has died away at this part of its peak, or of a wave that comes after it. After what was sent
# it falls all the while: what rises by this factor is a wave.
_OVER, _RISEN = 0.1, 2.0


def modelled(
    t: Float,
    sent: Float,
    received: Float,
    start: float,
    length: float,
    period: float,
    noise: float,
    band: Filter,
) -> tuple[Float, float] | None:
    """Crosstalk by what was sent: it at all times, and until when it explains what was received.

    Args:
        t: even times, shape (nt,), s.
        sent: v, without its base, shape (nt,).
        received: u, without its offset, shape (nt,).
        start, length: when v begins and how long it lasts, s.
        period: of the central frequency, s.
        noise: standard deviation of ``band(received)`` before the start.
        band: filter that leaves what counts as signal; linear, shifts no phase.

    Returns:
        (crosstalk, shape (nt,), time after the start up to which nothing else is there, s); None
        where the beginning is no such crosstalk.
    """
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    basis = _basis(t, sent, start, length, period)
    seen, u = np.stack([band(row) for row in basis]), band(received)
    first = int(np.searchsorted(t, start - 0.25 * period))
    begin = int(np.searchsorted(t, start))
    quarter = max(4, int(period / 4 / dt))
    found = None
    for span in np.arange(_SHORTEST * period, length + _BEYOND * period, _STEP * period):
        stop = int(np.searchsorted(t, start + span))
        if stop >= len(t) or stop - begin < 4 * len(basis):
            continue
        own = seen[:, first:stop]
        a = np.linalg.lstsq(own.T, u[first:stop], rcond=1e-6)[0]
        left = u[first:stop] - a @ own
        peak = float(np.abs(a @ own).max())
        whole = slice(quarter // 2, len(left) - quarter + quarter // 2 + 1)
        over = moving_mean(left**2, quarter)[whole]
        if float(over.max()) > max(_LEFT * noise, _PART * peak) ** 2:
            break
        found = a, span, own, left
    if found is None:
        return None
    a, span, own, left = found
    # Neighbouring samples hang together over an eighth of a period or so.
    variance = max(float(np.var(left)), noise**2) * max(1.0, period / 8 / dt)
    normal = np.linalg.pinv(own @ own.T, rcond=1e-12)
    foretold = np.sqrt(variance * np.einsum("in,ij,jn->n", seen, normal, seen))
    if float(foretold.max()) > max(2 * noise, _FORETOLD * float(np.abs(a @ own).max())):
        return None
    return a @ basis, float(span)


def _basis(t: Float, sent: Float, start: float, length: float, period: float) -> Float:
    """φ, each of peak 1, shape (6, nt)."""
    from scipy.ndimage import gaussian_filter1d  # slow to import, and only a reading needs it
    from scipy.signal import lfilter

    dt = float(t[-1] - t[0]) / (len(t) - 1)
    lasts = (t >= start - dt) & (t <= start + length + dt)
    plain = np.where(lasts, sent, 0.0)
    v = gaussian_filter1d(plain, max(_SMOOTH * period / dt, 0.5))
    rate = np.gradient(v)
    rows = [np.gradient(plain), rate, v]
    rows += [lfilter([1.0], [1.0, -np.exp(-dt / (tau * period))], rate) for tau in _DECAYS]
    return np.stack([row / (float(np.abs(row).max()) or 1.0) for row in rows])


def at_once(
    rows: Sequence[Float], dt: float, period: float, noise: float, heard: float
) -> tuple[int, int, bool] | None:
    """The first that receivers along a line hear, where all hear it at once: no wave does that.

    Args:
        rows: signals of the receivers by position, shape (nt,) each.
        dt, period: of the samples, and of the central frequency, s.
        noise: standard deviation of one.
        heard: of these deviations it stands out.

    Returns:
        (first sample, the one after the last, whether it is over by then); None where what comes
        first comes to each at a time of its own, or a single receiver hears it first.
    """
    each = np.array([u - _level(u) for u in rows])
    width = max(3, int(0.5 * period / dt))
    power = moving_mean(np.mean(each**2, axis=0), width)
    together = moving_mean(np.mean(each, axis=0) ** 2, width)
    begun = np.flatnonzero(power > heard**2 * noise**2)
    same = begun[together[begun] > _TOGETHER * power[begun]]
    if not len(same) or same[0] > begun[0] + width:
        return None
    broken = np.flatnonzero(np.diff(same) > 1)
    first, stop = int(same[0]), int(same[broken[0] if len(broken) else -1]) + 1
    if stop - first < width:
        return None
    own = each[:, first:stop]
    mean = own.mean(axis=0)
    rate = np.gradient(mean)
    # How late each is, to first order of its own size.
    size = own @ mean / (mean @ mean)
    late = -((own - size[:, None] * mean) @ rate) / (rate @ rate) / size
    if not (np.abs(late) <= max(1.0, _ALIKE * period / dt)).all():
        return None
    peak = float(np.abs(mean).max())
    after = np.abs(each[:, stop : stop + width]).max() if stop < each.shape[1] else 0.0
    return first, stop, bool(after <= max(_ENDED * peak, 2 * heard * noise))


def _level(u: Float) -> float:
    """Where a signal rests: its median, or that of its beginning, about which it stays closer for a
    quarter of its time, as one whose wave leaves a long tail."""
    levels = float(np.median(u)), float(np.median(u[: max(8, len(u) // 50)]))
    return min(levels, key=lambda level: float(np.percentile(np.abs(u - level), 25)))


def falls(size: Float, peak: float, heard: float) -> tuple[int, int, bool]:
    """How crosstalk's envelope falls.

    Args:
        size: the envelope from where crosstalk may fall, shape (n,).
        peak: of the crosstalk.
        heard: what stands out of the noise.

    Returns:
        (samples until it has died away, or is least before something rises; until something rises;
        whether it has died away before).
    """
    lowest = np.minimum.accumulate(size)
    rises = int(np.append(np.flatnonzero(size > _RISEN * lowest), len(size))[0])
    largest = float(size[rises:].max(initial=0.0)) or peak
    ends = np.flatnonzero(size[:rises] < max(_OVER * min(peak, largest), heard))
    return int(ends[0]) if len(ends) else int(np.argmin(size[:rises])), rises, bool(len(ends))
