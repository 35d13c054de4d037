"""Complex k at each frequency of a record, from few receivers, by an exponential window.

Weighted by exp(−σt) a record ends, whatever still rings, and its transform is the field at the
complex frequency ω + iσ, which between the receivers, where no source is, is made of waves
exp(±ikx) with the medium's roots k(ω + iσ), in bands and gaps alike. Receivers may stand anywhere,
and the waves that an end sends back are part of the model.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.damped_transform import damped_transform, truncation
from wavesim.readings.dispersion.branch_joining import join
from wavesim.readings.dispersion.coming_round import coming_back, with_coming_back
from wavesim.readings.dispersion.direction_of_travel import GROWS, against_travel, runs_on, slowness
from wavesim.readings.dispersion.folding import FOLDED, OR_BOTH_WAYS, folded_branches
from wavesim.readings.dispersion.halves_of_line import with_unlike_halves
from wavesim.readings.dispersion.hidden_mode import Bends, along, of_receivers, worth
from wavesim.readings.dispersion.line_fit import unknowns
from wavesim.readings.dispersion.noise_level import excited_frequencies, noise_variance
from wavesim.readings.dispersion.phase_beam import highest_wavenumber
from wavesim.readings.dispersion.points import CUT, BranchPoints
from wavesim.readings.dispersion.simplest_waves import EXCESS, MORE, UNLIKE, line_fits, simplest
from wavesim.readings.dispersion.spreading import spreads
from wavesim.readings.dispersion.unequal_gains import CALIBRATED, with_unequal_gains
from wavesim.readings.pulse.first_break import envelope
from wavesim.records.faults.quiet import beside_mutes, frames_at_rest
from wavesim.records.record import Record, RecordError

Float = NDArray[Any]

# σT where there is no noise, and the least. With noise of a part n of the peak ln(1/n) + 4 serves:
# the truncation is then below the noise, and no more of the record is given away.
DAMPING = 18.0
_LEAST_DAMPING = 8.0
_BELOW_NOISE = 4.0
# Receivers count where their amplitude is this many times the truncation error exp(−σT), and the
# noise.
_ABOVE_TRUNCATION = 30.0
_ABOVE_NOISE = 3.0
_LARGEST_ERROR = 0.5
_NYQUIST = 0.97
# Fewer points, of less than this part of the power heard, or any of less than that, are no wave
# where the rest is none; nor any where this part of it is several waves that receivers are too few
# to tell; gains leave less.
_FEW, _OF_POWER, _FAINT, _OF_SEVERAL, _OF_GAINS = 5, 0.2, 0.03, 0.1, 3e-3
# Where so many frequencies show more than one mode, a record holds several.
_SEVERAL = 2
# Part of the Nyquist frequency up to which what lies beyond is not folded in.
_BAND = 0.8
# A pulse's band is where its power is this part of its most.
_LOUD = 0.01
# A record weighted down to this part at its end does not break off.
_ENDED = 1e-3
# Noise at the beginning is within so many of its deviations. A receiver counts where what it shows
# there, and its slope over so many frames, is no more than this part of ωU.
_OF_NOISE, _FIRST, _BEGUN = 5.5, 2, 0.1
# Modes closer than this part of 2π/X are taken for one where nothing shows; by receivers that
# differ from each other those closer than that.
_CLOSE, _CLOSE_UNLIKE = 0.6, 0.1
# Part of a ring, from its source on, in which receivers are used.
_PART_OF_RING = 0.125


def in_space(
    record: Record,
    omega: Float,
    damping: float | None = None,
    pairs: int = 1,
    component: int | None = None,
    clear: float = 0.0,
    k_max: float | None = None,
    spreading: float = 0.0,
    gain_error: float = CALIBRATED,
) -> BranchPoints:
    """Complex k at given frequencies; branches joined by continuity of |k|.

    Args:
        record: from before the source began on (u = 0 at its start).
        omega: real frequencies, ascending, shape (n,), rad/s.
        damping: σT of the exponential window, –; more cuts how far decay is seen, less leaves
            more of the record's end; by the record's noise where None.
        pairs: most pairs ±k sought at one frequency, 1 or 2, –.
        component: which of the record's; the strongest where None.
        clear: distance to keep from sources, m.
        k_max: largest |k| believed, rad/m; larger ones are refused.
        spreading: p of amplitudes that fall as r^−p with the distance r from the source besides
            their loss: 0 for plane waves, ½ for cylindrical, 1 for spherical ones, –.
        gain_error: standard deviation of the receivers' gains, relative; bars hold it, or what
            three receivers or more show of it, if that is less, –.

    Returns:
        The points, n for each pair; those that can't be measured are there with the reason.

    Raises:
        RecordError: frames, receivers clear of sources, or the source of what spreads are missing.
    """
    if len(record.missing) and record.missing.any():
        raise RecordError(
            f"{record.missing.sum()} frames are missing: the exponential window needs them all; "
            "fill them, or use the part before the first one"
        )
    if np.iscomplexobj(omega):
        raise RecordError("omega: must be real, rad/s; damping says what its imaginary part is")
    omega = np.atleast_1d(np.asarray(omega, float))
    for key, well, allowed in (
        ("omega", not len(omega) or (omega > 0).any(), "frequencies above 0 (rad/s)"),
        ("omega", len(omega), "one frequency (rad/s) at least"),
        ("damping", damping is None or damping > 0, "greater than 0"),
        ("pairs", pairs in (1, 2), "1 or 2"),
        ("component", component is None or 0 <= component < len(record.values),
         f"0 to {len(record.values) - 1}"),
    ):  # fmt: skip
        if not well:
            raise RecordError(f"{key} = {locals()[key]}: must be {allowed}")
    if component is None:
        component = int(np.argmax(np.abs(record.values).max(axis=(1, 2))))
    receivers, x, stretch = line_without_source(record, clear)
    values = record.values[component][:, receivers]
    # The window begins where something moves, so that it weighs no more noise than it must.
    rest = frames_at_rest(whole := values)
    quiet = values[:rest].std(axis=0) if rest else 0.0
    record = record.since(record.t[rest])
    values = record.values[component][:, receivers]
    # Seconds of the epoch are doubles a quarter of a microsecond apart; their interval is not.
    t = record.interval * np.arange(len(record.t))
    deviation = replace(record, values=values[None], x=x).noise
    if damping is None:
        part = deviation / max(np.abs(values).max(), 1e-290)
        damping = float(np.clip(_BELOW_NOISE - np.log(part + 1e-290), _LEAST_DAMPING, DAMPING))
    sigma = damping / float(t[-1])
    U = damped_transform(values, t, omega, sigma)
    everywhere = np.abs(damped_transform(record.values[component], t, omega, sigma)).max(axis=1)
    left_out = truncation(everywhere, omega, sigma, damping)
    noise = _noise(record, values, receivers, omega, sigma)
    # What is there at the beginning acts as a source does: ∂ ln U/∂x = ik + (dk/dω) u₀/U.
    begun = np.maximum(np.abs(values[0]) - _OF_NOISE * np.maximum(deviation, quiet), 0)
    # … or, where it passes through 0 there, by its slope.
    slope = np.abs(values[_FIRST] - values[0]) / (_FIRST * record.interval)
    slope -= _OF_NOISE * np.maximum(deviation, quiet) * np.sqrt(2) / (_FIRST * record.interval)
    begun = np.hypot(begun, np.maximum(slope, 0) / omega[:, None])
    quantum, size = record.receivers(receivers).quantum, np.maximum(np.abs(U), 1e-290)
    edges = beside_mutes(whole, quantum, sigma * record.interval, rest)
    cut = begun / size / omega[:, None] > _BEGUN
    unsure = np.hypot(begun, edges) / size / omega[:, None]
    if spreading:
        along = np.abs(x - _nearest(record, x)) ** spreading
        U, middle = U * along, float(np.sqrt(np.mean(along**2)))
        left_out, noise = left_out * middle, noise * middle
    used = np.abs(U) > np.maximum(_ABOVE_TRUNCATION * left_out, _ABOVE_NOISE * noise)[:, None]
    used &= ~cut
    spread = "" if spreading or record.ring else spreads(U, x, used, _nearest(record, x, None))
    if not record.ring:
        used |= (used.sum(axis=1) < len(x))[:, None] & (
            ~cut & (np.abs(U) > _ABOVE_TRUNCATION * left_out[:, None])
        )
    heard = np.asarray(used.any(axis=0))
    heard |= heard.sum() < 2  # what is heard nowhere makes no spacing shorter
    U, x, used, unsure = U[:, heard], x[heard], used[:, heard], unsure[:, heard]
    fits = line_fits(U, x, used, pairs)
    level = np.hypot(left_out, noise)
    # What comes round a ring is a wave of its own only where there are receivers to tell it by.
    back = coming_back(fits[0][2].k[:, 0], x, stretch) * np.sqrt(np.mean(np.abs(U) ** 2, axis=1))
    level = np.where(used.sum(axis=1) > unknowns(1, True), level, np.hypot(level, back))
    points, chosen = simplest(fits, used, omega + 1j * sigma, level)
    step = np.repeat(np.arange(len(omega)), [fits[c][0] for c in chosen])
    mostly = cut.mean(axis=1)[step] > 0.5
    points = replace(points, reason=np.where(mostly & ~points.valid, CUT, points.reason))
    begun = np.sum(unsure * used, axis=1) / np.maximum(used.sum(axis=1), 1)
    points = replace(points, error=np.hypot(points.error, begun[step] * np.abs(points.k)))
    models = [fits[c] for c in chosen]
    points = with_coming_back(points, x, stretch, [model[:2] for model in models])
    points = _judged(points, np.zeros(0) if record.lattice else x, k_max)
    high = points.omega.real > _BAND * np.pi / record.interval
    reason = np.where(high, "near the Nyquist frequency: sample more often", points.reason)
    points = replace(points, valid=points.valid & ~high, reason=reason)
    points = points.refused(points.valid & bool(spread), spread)
    part = np.hypot(record.spacing_error, record.interval_error) * np.abs(points.k)
    points = replace(points, error=np.hypot(points.error, part))
    points = _with_hidden(_with_branches(points, omega), U, x, used, level, models)
    if not record.ring:
        points = with_unlike_halves(points, U, x, used, level, models)
        points = with_unequal_gains(points, U, x, used, level, models, gain_error)
    points = _with_branches(points.known(), omega)
    # A loss that may be none tells no direction.
    turned = (points.k.real < 0) & (points.k.imag < points.bar)
    seen, points = points, replace(points, k=np.where(turned, -points.k.real + 0j, points.k))
    beyond = grows = np.zeros(len(points), bool)
    gap = np.pi / highest_wavenumber(x)
    if not record.ring:
        size = np.stack([envelope(one) for one in values[:, heard].T], axis=1)
        late = slowness(size, t, x, 2 * np.pi / float(np.median(points.omega.real)))
        beyond, grows = against_travel(seen, late, models)
        loudest = values[:, [int(np.argmax(np.sum(values**2, axis=0)))]]
        band = excited_frequencies(loudest, record.interval, part=_LOUD)
        beyond |= runs_on(seen, late, gap, float(np.ptp(band)))
    if not record.lattice:
        known = points.branch, points.k.real, points.omega.real
        why = FOLDED if len(x) > 2 else OR_BOTH_WAYS
        points = points.refused(folded_branches(*known, gap, beyond), why)
    return _with_branches(_enough(points.refused(grows, GROWS), U * used, models), omega)


def _enough(points: BranchPoints, heard: Any, models: Any) -> BranchPoints:
    """Refuse a few points where nearly all that was heard, (nω, nx), is none, as the loudest is;
    and all of receivers too few to tell two modes, where a good part of it is more than one."""
    step = np.repeat(np.arange(len(heard)), [pairs for pairs, _, _ in models])
    power, none = np.sum(np.abs(heard) ** 2, axis=1), ~points.valid
    read, several = np.unique(step[~none]), np.isin(points.reason, (MORE, UNLIKE))
    several &= points.residual > _OF_GAINS
    told, rest = power[read].sum(), power[np.setdiff1d(step[several & none], read)].sum()
    few = len(read) < min(_FEW, len(heard) / 2) and told < _OF_POWER * power.sum()
    refused = few or told < _FAINT * rest
    if heard.shape[1] <= unknowns(2, False):
        many = power[np.unique(step[several])].sum() > _OF_SEVERAL * power.sum()
        refused, none = refused or many, several if many else none
    if not refused:
        return points
    return points.refused(points.valid, points.reason[np.argmax(power[step] * none)])


def _with_hidden(
    points: BranchPoints, U: Any, x: Float, used: Any, level: Float, models: Any
) -> BranchPoints:
    """Errors with what a second wave leaves, where one was laid through the receivers."""
    omega, sigma = np.unique(points.omega.real), float(points.omega.imag.max(initial=0.0))
    step = np.repeat(np.arange(len(U)), [pairs for pairs, _, _ in models])
    nil = np.zeros(len(points))
    bends, close = Bends(nil, nil + np.inf, nil), nil + _CLOSE
    for both in (False, True):
        rows = np.flatnonzero([model[:2] == (1, both) for model in models])
        own = np.flatnonzero(np.isin(step, rows))
        if len(rows):
            # The bend is that of the stronger wave, whichever way it runs.
            back = [models[i][2].backward[i, 0] > models[i][2].forward[i, 0] for i in rows]
            k = np.where(back, -points.k[own], points.k[own])
            returning = along(-k[:, None] * both, x)[..., : int(both)]
            told, unlike = of_receivers(U[rows], x, used[rows], k, returning, level[rows])
            bends = bends.put(own, told)
            close[own[unlike]] = _CLOSE_UNLIKE
    # A mode that shows at some frequencies is there at others, where it may not.
    several = step[(points.reason == MORE) | (bends.over > 2 * EXCESS)]
    if len(np.unique(several)) >= _SEVERAL:
        close[:] = 0.0
    cell = 2 * np.pi / float(np.ptp(x))
    alike = max(1.0, 2 * np.pi * sigma / float(np.median(np.diff(omega)))) if len(U) > 1 else 1.0
    hides = worth(bends, points.k.real, points.branch, step, cell, points.k.imag, close, alike)
    return replace(points, error=np.hypot(points.error, hides.error), splitting=hides.splitting)


def _nearest(record: Record, x: Float, default: float | None = np.nan) -> Any:
    """The source that is nearest to a line, m."""
    sources = np.array(record.sources, float)
    if len(sources):
        away = np.abs(sources[:, None] - x[[0, -1]]).min(axis=1)
        return float(sources[int(away.argmin())])
    if default is None:
        return None
    raise RecordError(
        "waves that spread do so from a source, and none is named: give --source, its position in m"
    )


def line_without_source(record: Record, clear: float) -> tuple[NDArray[np.int64], Float, float]:
    """Receivers of the longest stretch without a source, their positions along it, and its length.

    Positions are from its source on, and its length is finite, on a ring.
    """
    stretch = np.inf
    sound = ~record.misfit if len(record.misfit) else np.ones(len(record.x), bool)
    x, sources = record.x, np.sort(np.array(record.sources, float))
    if record.ring and len(sources):
        length = record.aperture
        gaps = np.diff(np.concatenate([sources, [sources[0] + length]]))
        start = sources[int(np.argmax(gaps))]
        along = np.mod(x - start, length)
        reach = clear + _PART_OF_RING * gaps.max()
        keep = np.flatnonzero(sound & (along > clear) & (along <= reach))
        keep = keep[np.argsort(along[keep])]
        chosen, at, stretch = keep, along[keep], float(gaps.max())
    else:
        edges = np.concatenate([[-np.inf], sources, [np.inf]])
        groups = [
            np.flatnonzero(sound & (x > low + clear) & (x < high - clear))
            for low, high in itertools.pairwise(edges)
        ]
        chosen = max(groups, key=len)
        at = x[chosen]
    if len(chosen) < 2:
        raise RecordError(
            f"{len(chosen)} receivers stand on one side of the sources and {clear:g} m clear of "
            "them: at least 2 are needed, 3 where waves run both ways; add receivers there"
        )
    return chosen, at, stretch


def _noise(record: Record, values: Float, receivers: Any, omega: Float, sigma: float) -> Float:
    """Standard deviation of the noise in U, √(Σ e^{−2σt}) Δt times its own, shape (nω,)."""
    quantum = record.quantum[receivers] if len(record.quantum) else 0.0
    variance = noise_variance(values, record.interval, omega, quantum)
    count = len(values)
    window = np.exp(-sigma * record.interval * np.arange(count))
    # Noise that goes with the signal, of a clock that shivers, is where the window is high.
    high = np.abs(np.fft.rfft(values * window[:, None], axis=0))[-max(4, count // 20) : -1] ** 2
    variance = np.maximum(
        variance * np.sum(window**2), np.median(high, axis=0) / np.log(2) * (window[-1] < _ENDED)
    )
    return np.asarray(np.sqrt(np.median(variance, axis=1)) * record.interval)


def _judged(points: BranchPoints, x: Float, k_max: float | None) -> BranchPoints:
    points = points.refused(
        ~(points.error < _LARGEST_ERROR * np.abs(points.k)), "the error bar is as large as k"
    )
    if len(x):
        points = points.refused(
            np.abs(points.k.real) > _NYQUIST * highest_wavenumber(x),
            "at the receivers' Nyquist wavenumber: space them closer, or, where they are one at "
            "each cell of a crystal or a chain, whose gaps stand there, give --lattice",
        )
    if k_max is not None:
        points = points.refused(np.abs(points.k) > k_max, "above k_max")
    return points


def _with_branches(points: BranchPoints, omega: Float) -> BranchPoints:
    branch = np.full(len(points), -1)
    own = np.flatnonzero(points.valid)
    if len(own):
        size = np.abs(points.k[own])
        step = np.searchsorted(omega, points.omega[own].real * (1 - 1e-12))
        branch[own] = join(step, size, points.amplitude[own], np.median(size) / 4, shortest=1)
    return replace(points, branch=branch)
