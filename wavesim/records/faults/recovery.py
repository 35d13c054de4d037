"""A level that jumps at all channels at once, and returns: an amplifier after a trigger.

A charge amplifier, or one coupled by a capacitor, that a trigger's edge or a discharge has driven
off its level shows

    u(t) = b + A e^{-(t - t₀)/τ},    t > t₀,

with τ = RC and A of each channel's own; where it is held, τ = ∞, a step; t₀ may be before the
record begins. No wave comes to receivers at different places in one frame. The course is fitted to
what no wave has moved: before t₀, between it and the wave, and after that.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, TOLD, Finding, beside_peak, places
from wavesim.records.faults.steps import without_steps

Float = NDArray[Any]

# So many frames before it, and behind its rise of so many, tell a jump, of so many of their
# deviations; samples outside of the rise change by no more than this part of what they do in it.
_LEVEL, _RISE, _BEHIND, _JUMP, _CALM = 16, 3, 8, 10.0, 0.3
# So much of all channels jump.
_TOGETHER = 0.6
# Biweight (Beaton & Tukey, Technometrics 16, 147 (1974)): samples so many deviations off do not
# count; the scale comes down to that in so many rounds.
_OFF, _ROUNDS = 4.7, 24
# A course is one where so much of what follows, and of its first frames and its last eighth, lies
# within that.
_FOLLOWS, _ENDS = 0.3, 0.7
# One that the record begins in is off by this part of all that is there at first, and returns by
# 1/e or more within the record.
_OFF_FIRST = 0.05
# Rates from no return within so many records to one within so many frames.
_SLOWEST, _FASTEST, _RATES = 30.0, 8.0, 24


def without_recovery(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], quantum: Float, found: list[Finding]
) -> Float:
    """Values without the course of a level that jumps at all channels at once, in place.

    Args:
        values: shape (C, nt, nx), NaN where a sample is missing.
        t, x, labels: times, positions and names of the receivers.
        quantum: least step of each, shape (nx,).
        found: findings, added to.
    """
    for component in values:
        nt, nx = component.shape
        if nx < 2 or nt < 4 * _LEVEL:
            continue
        first, which = _jump(component, quantum)
        many = len(which) >= max(2, _TOGETHER * nx)
        courses = {j: _course(component[:, j], first, float(quantum[j])) for j in which if many}
        fitted = {j: one for j, one in courses.items() if one is not None}
        at = f"at t = {t[first]:.6g} s"
        if len(fitted) < max(2, _TOGETHER * len(which)):
            # Beneath the wave, of a few channels, or of each at another time.
            if not without_steps(component, t, x, labels, found) and many and first:
                where = places(x, which, labels)
                found.append(
                    Finding("level jumps", where, at, TOLD,
                            f"the level jumps {at} ({where}), and goes on neither constant nor as "
                            "one exponential, so that it stays beneath the wave: subtract a record "
                            "that the trigger alone makes, with the source off")
                )  # fmt: skip
            continue
        where, most, part = places(x, list(fitted), labels), 0.0, 0.0
        for j, (course, _, noise) in fitted.items():
            v = component[:, j]
            v -= course
            level, size = np.nanmedian(v), float(np.abs(course).max())
            if first:
                # Nothing moves while it rises but this.
                rise = np.arange(first - 1, first + _RISE)
                bad = rise[~(np.abs(v[rise] - v[: first - 1].mean()) <= _OFF * noise)]
                about = [rise[0] - 1, rise[-1] + 1]
                v[bad] = np.interp(bad, about, v[about])
            most = max(most, size)
            part = max(part, size / max(float(np.nanmax(np.abs(v - level))), 1e-300))
        rate = float(np.median([rate for _, rate, _ in fitted.values()]))
        goes = f"returns with τ = {(t[1] - t[0]) / rate:.3g} s" if rate > 0 else ""
        goes = "stays" if rate * (nt - first) < 1 / _SLOWEST else goes
        does = f"jumps {at} and {goes}" if first else f"is off when the record begins and {goes}"
        found.append(
            Finding("level jumps", where, f"{most:.3g}, {beside_peak(part)}", CURED,
                    f"the level {does}, as an amplifier's after a trigger, by up to {most:.3g} "
                    f"({beside_peak(part)}): taken out ({where})")
        )  # fmt: skip
    return values


def _jump(component: Float, quantum: Float) -> tuple[int, list[int]]:
    """The frame from which on most channels have another level, and which; where none is 0, and
    those that begin at another level than they end at."""
    from scipy.ndimage import maximum_filter1d, uniform_filter1d  # slow to import

    v = np.nan_to_num(component - np.nanmedian(component, axis=0))
    nt, nx = v.shape
    steps = np.abs(np.diff(v, axis=0))  # step i leads to frame i + 1
    mean = uniform_filter1d(v, _LEVEL, axis=0, origin=_LEVEL // 2 - 1)  # of the last so many
    square = uniform_filter1d(v**2, _LEVEL, axis=0, origin=_LEVEL // 2 - 1)
    noise = np.sqrt(np.maximum(square - mean**2, 0)) + 0.5 * quantum + 1e-9 * np.ptp(v, axis=0)
    at = np.arange(_LEVEL, nt - _RISE - _BEHIND)  # first frame of the rise
    level = np.median([v[at + _RISE + n] for n in range(3)], axis=0)
    off = np.abs(level - mean[at - 1]) > _JUMP * noise[at - 1]
    within = np.max([steps[at - 1 + n] for n in range(_RISE)], axis=0)
    before = maximum_filter1d(steps, _LEVEL, axis=0, origin=_LEVEL // 2 - 1)[at - 2]
    behind = np.max([steps[at + _RISE + n] for n in range(_BEHIND - 1)], axis=0)
    sharp = np.maximum(before, behind) < _CALM * within
    gaps = maximum_filter1d(np.isnan(component).astype(np.uint8), 2 * _LEVEL, axis=0)[at] > 0
    jumps = off & sharp & (steps[at - 1] > _CALM * within) & ~gaps
    count = jumps.sum(axis=1)
    if count.max(initial=0) >= max(2, _TOGETHER * nx):
        best = int(np.argmax(count))
        return int(at[best]), [int(j) for j in np.flatnonzero(jumps[best])]
    end = component[-max(_LEVEL, nt // 8) :] - np.nanmedian(component, axis=0)
    off = np.abs(v[:_BEHIND].mean(axis=0) - np.median(end, axis=0)) > _JUMP * (
        end.std(axis=0) + quantum
    )
    return 0, [int(j) for j in np.flatnonzero(off)]


def _course(v: Float, first: int, quantum: float) -> tuple[Float, float, float] | None:
    """What a channel's level does after its jump, A e^{-(t - t₀)/τ}, 1/τ per frame, and its noise;
    None where it does not follow that."""
    own = np.isfinite(v)
    own[max(first - 1, 0) : first + _RISE if first else 0] = False
    at = np.flatnonzero(own)
    after, late = at >= first, np.maximum(at - first, 0)
    end = at >= first + 7 * (len(v) - first) // 8
    head = v[at[~after]] if first else v[at[end]]
    if len(head) < _LEVEL // 2:
        return None
    noise = max(float(np.std(head)), quantum / np.sqrt(12), 1e-9 * float(np.ptp(v[own])))
    u = v[at] - head.mean()
    begin = u[after][:_BEHIND].mean()
    rates = np.geomspace(1 / _SLOWEST / len(v), 1 / _FASTEST, _RATES)
    scale = _OFF * noise + 0.1 * abs(begin)
    tried = [np.mean(np.minimum(np.abs(u - after * begin * np.exp(-g * late)), scale / 2))
             for g in rates]  # fmt: skip
    g, level, size = float(rates[int(np.argmin(tried))]), 0.0, float(begin)
    for _ in range(_ROUNDS):
        wave = after * np.exp(-g * late)
        left = u - level - size * wave
        weight = np.maximum(1 - (left / scale) ** 2, 0)
        columns = np.stack([np.ones(len(u)), wave, -size * late * wave], axis=1)
        change = np.linalg.lstsq(columns * weight[:, None], left * weight, rcond=None)[0]
        level, size = level + change[0], size + change[1]
        g = float(np.clip(g + change[2], 0.0, 2 * g + 1 / _SLOWEST / len(v)))
        scale = max(_OFF * noise, scale / 1.5)
    near = np.abs(u - level - after * size * np.exp(-g * late)) < _OFF * noise
    start = near[after][: _BEHIND if first else 2 * _LEVEL]
    follows = near[after].mean()
    # What has no wave besides is a signal itself.
    if min(start.mean(), near[end].mean()) < _ENDS or not _FOLLOWS < follows < 1:
        return None
    # What returns by less than that is a drift, or the foot of a wave.
    if not first and (g * len(v) < 1 or abs(size) < _OFF_FIRST * np.ptp(u)):
        return None
    frames = np.arange(len(v)) - first
    return np.where(frames >= 0, size * np.exp(-g * np.maximum(frames, 0)), 0.0), g, noise
