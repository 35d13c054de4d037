"""When the signal comes to each receiver: too early, from within, too fast, round a ring."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.quiet import Rest, fine_noise
from wavesim.records.faults.unfit_receivers import Waves, along_line

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# A record begins inside its signal where its first samples are this many times the noise, and this
# part of the peak.
_ABOVE, _PART = 4.0, 2e-3
_WITHOUT_REST = 0.4
_FIRST = 3
# So many frames that are exactly still are no chance, beside noise of this part of the peak, of
# which this part at least is white.
_MUTED, _NO_NOISE, _WHITE = 8, 1e-6, 0.3
_BLOCKS = 8
_STEADY, _HISS, _LOUDER = 3.0, 2.0, 8.0
_ARRIVED = 0.2
BEGINS = {
    "begins inside": "the record begins inside the signal",
    "muted": "signals are muted into the wave",
}
# No wave is slower, m/s, or faster but light, from the slowest of it to its phase in waveguides.
SLOWEST, FASTEST, _LIGHT = 0.1, 2e4, (1e7, 1e9)
# A source is within where two arms leave less than this part of what one line leaves (squares).
_BETTER = 0.05
# The last receiver and the first are neighbours where the step between them is as large as those
# between others, in this range of power; they are not where it is so many times the largest.
_ALIKE, _NEVER = (0.05, 2.0), 3.0
# Told by so many loud frequencies, the highest so far above the lowest, at which waves are long:
# neighbours differ by this part of two that know nothing of each other.
_SEAMS, _SPAN, _LONG, _LOUD = 3, 1.5, 0.3, 0.01
_FEWEST_ROUND = 8
# … and that are there, with this part of the mean power.
_THERE = 0.01
# Phases jump between two sides of so many receivers or more, where that leaves this part of what
# waves without the jump do, that this part of all at least, and the mean cosine of what is over is
# 1 but for this, and so many times the noise; phases are tried so many, at first every other, of
# each so many frequencies one, at so many places first; then so many between two of them.
SIDE, _JUMPS, _LEAST, _SURE, _OF_NOISE, _FINE, _EACH, _PLACES = 3, 0.1, 2e-3, 0.1, 4.0, 16, 3, 64
_BETWEEN = 8


def muted_until(component: Float, quantum: Float) -> NDArray[np.int64]:
    """The first frame of each receiver that is not exactly still beside noise behind, as where all
    before the wave was set to 0, shape (nx,); 0 where it is not still, or nothing tells noise.

    Args:
        component: u, shape (nt, nx), finite.
        quantum: least step of each, shape (nx,).
    """
    moves = component != component[0]
    first = np.where(moves.any(axis=0), moves.argmax(axis=0), 0)
    for j in np.flatnonzero(first >= _MUTED):
        v = component[first[j] :, j]
        still = min(np.array_split(v, _BLOCKS), key=np.std)
        # A signal that rises from nothing beside none has kinks, but no noise when it has passed.
        noise = float(np.std(still)) if fine_noise(still) > _WHITE * np.std(still) else 0.0
        if noise <= max(quantum[j], _NO_NOISE * float(np.abs(v).max())):
            first[j] = 0
    return np.where(first >= _MUTED, first, 0)


def begun(component: Float, rest: Rest, muted: NDArray[np.int64] | None = None) -> Mask:
    """Receivers at which the signal is there already when the record begins, or from the first
    frame on that is not muted, shape (nx,)."""
    nx = component.shape[1]
    muted = np.zeros(nx, int) if muted is None else muted
    within = np.zeros(nx, bool)
    steady = np.zeros(nx, bool)
    for j in range(nx):
        v = component[muted[j] :, j]
        blocks = np.array([np.sqrt(np.mean(b**2)) for b in np.array_split(v, _BLOCKS)])
        steady[j] = blocks.max() < _STEADY * max(blocks.min(), 1e-300)
        noise = fine_noise(v)
        head = float(np.sqrt(np.mean(v[:_FIRST] ** 2)))
        # Where no rest was seen at the start, less is needed to doubt it.
        part = 1.0 if rest.onset[j] else _WITHOUT_REST
        # What is as loud in the first part as it ever is in the quietest is noise, of any colour.
        hiss = blocks[0] < _HISS * blocks.min()
        noise = max(noise, float(blocks.min()) if hiss else 0.0)
        least = part * max(_ABOVE * noise, _PART * float(np.abs(v).max()))
        within[j] = head > max(least, _ABOVE * _rumble(v, blocks))
    # Alike from beginning to end beside channels that are not, it is nothing but noise.
    if not steady.all():
        within &= ~steady
    return within


def _rumble(v: Float, blocks: Float) -> float:
    """Noise of any colour: what goes on alike long after a far louder signal; 0 where none does.

    Args:
        v: one channel, shape (nt,).
        blocks: root mean square of its eighths.
    """
    quarters = np.sqrt(np.mean(blocks.reshape(4, -1) ** 2, axis=1))[2:]
    late, slope = float(quarters.max()), float(np.sum(np.diff(v) ** 2))
    alike = late < _STEADY * quarters.min()
    if not alike or np.abs(v).max() < _LOUDER * late or slope == 0:
        return 0.0
    # Within a signal the next crest is less than a period away, 2π over the mean ω by power.
    period = 2 * np.pi * float(np.sqrt(np.sum(v**2) / slope))
    return late if np.argmax(np.abs(v) > _ABOVE * late) > period else 0.0


def arrivals(component: Float, t: Float, rest: Rest) -> Float:
    """When a fifth of the energy that a channel shows above its noise has come, and the middle of
    it in time, shape (2, nx), s; NaN where none stands out."""
    result = np.full((2, component.shape[1]), np.nan)
    for j in np.flatnonzero(rest.onset > 0):
        power = component[:, j] ** 2
        power[: rest.onset[j]] = 0
        power[power < (_ABOVE * rest.noise[j]) ** 2] = 0
        energy = np.cumsum(power)
        if energy[-1] > 0:
            first = t[int(np.argmax(energy >= _ARRIVED * energy[-1]))]
            result[:, j] = first, t[0] + np.sum((t - t[0]) * power) / energy[-1]
    return result


def source_within(x: Float, arrival: Float) -> float | None:
    """Where a source stands among the receivers, by the earliest arrivals, m; None if nowhere."""
    seen = np.isfinite(arrival)
    x, arrival = x[seen], arrival[seen]
    # What all hear at once, as a step of their supply, comes from nowhere among them.
    if len(x) < 5 or not np.ptp(arrival) > 1e-9 * np.abs(arrival).max():
        return None
    one = np.polyfit(x, arrival, 1, full=True)[1]
    line = float(one[0]) if len(one) else 0.0
    best: tuple[float, float] | None = None
    for place in np.linspace(x[1], x[-2], 8 * len(x)):
        if (x < place).sum() < 2 or (x > place).sum() < 2:
            continue
        away = np.abs(x - place)
        slope, level = np.polyfit(away, arrival, 1)
        left = float(np.sum((arrival - level - slope * away) ** 2))
        if slope > 0 and (best is None or left < best[0]):
            best = left, float(place)
    if best is None or best[0] > _BETTER * line or line <= 0:
        return None
    # To a tenth of the spacing.
    grain = float(np.median(np.diff(x))) / 10
    return round(best[1] / grain) * grain


def speed(x: Float, arrival: Float) -> float:
    """Speed at which the signal goes along the receivers, m/s; NaN where it can't be told."""
    seen = np.isfinite(arrival)
    if seen.sum() < 3:
        return float("nan")
    slope, level = np.polyfit(x[seen], arrival[seen], 1)
    left = arrival[seen] - level - slope * x[seen]
    error = np.std(left) / np.sqrt(seen.sum()) / np.std(x[seen])
    return float(1 / abs(slope)) if abs(slope) > 5 * error else float("nan")


def of_no_wave(low: float, high: float, slowest: float = SLOWEST) -> str:
    """Why speeds are those of another unit of time or length, "" where they may be right.

    Args:
        low, high: from which speed to which, m/s; NaN where not known.
        slowest: that waves are taken to be, m/s.
    """
    fast = low > FASTEST and not (_LIGHT[0] < high and low < _LIGHT[1])
    if not (fast or high < slowest):
        return ""
    what = "faster than waves in any solid" if low < _LIGHT[1] else "faster than light"
    return (
        f"by its times and positions the signal goes at {low if fast else high:.3g} m/s, "
        f"{what if fast else 'slower than any wave'}: one of them is in another unit; say which "
        "with --time-unit or --position-unit"
    )


def comes_round(component: Float) -> bool | None:
    """Whether the last receiver and the first are neighbours, as round a ring; None if none knows.

    Args:
        component: u, shape (nt, nx), finite, of evenly spaced receivers.
    """
    count, nx = component.shape
    if nx < _FEWEST_ROUND:
        return None
    U = np.fft.rfft(component * np.hanning(count)[:, None], axis=0)
    power = np.mean(np.abs(U) ** 2, axis=1)
    steps = np.mean(np.abs(np.diff(U, axis=1)) ** 2, axis=1)
    own = (power > _LOUD * power.max(initial=0.0)) & (steps < 2 * _LONG * power)
    at = np.flatnonzero(own)
    # A tone has the same phase at both by chance.
    if len(at) < _SEAMS or at[-1] < _SPAN * at[0]:
        return None
    U, after = U[own], np.roll(U[own], -1, axis=1)
    # As far as there is anything at the two.
    there = np.sum((np.abs(U) ** 2 + np.abs(after) ** 2) / 2 / power[own, None], axis=0)
    step = np.sum(np.abs(after - U) ** 2 / np.maximum(steps[own, None], 1e-290), axis=0)
    step /= np.maximum(there, 1e-290)
    if _ALIKE[0] < step[-1] < _ALIKE[1]:
        return True
    loud = there[-1] > _THERE * own.sum()
    return False if loud and step[-1] > _NEVER * max(step[:-1].max(), 1.0) else None


def jump(
    U: Any, omega: Float, x: Float, noise: Float, waves_of: Waves | None = None
) -> tuple[int, bool, float] | None:
    """Where phases of all waves jump along a line, as from one card or cable to the next.

    Few waves are laid through the line with one side turned by a phase φ, whichever leaves least,
    and as loud as the other; the jump must be π at all frequencies, or ωτ.

    Args:
        U: field at m frequencies ω, shape (m, nx), amplitudes made as even as they fall off.
        omega: ω, shape (m,), rad/s.
        x: places, ascending, shape (nx,), m.
        noise: its part of the power, shape (m,), –.
        waves_of: lays few waves through receivers round a ring; where not given, they stand along a
            line.

    Returns:
        The last receiver before it, whether those behind are reversed, and τ by which they are
        late, s; None where there is none.
    """
    many = len(x)
    if many < 2 * SIDE:
        return None
    waves, good = waves_of or along_line(x), np.ones(many, bool)

    def left(first: int, turns: Float, each: int = 1) -> Float:
        """Part of the power with those from one on turned back, at each φ, or each ω its own."""
        behind = np.arange(many) >= first
        # Standing waves round a ring are not alike loud from one receiver to the next.
        beside = np.abs(U[:, first - 2 : first + 2])
        size = 1.0 if waves_of else np.median(beside[:, :2]) / np.median(beside[:, 2:])
        turns = turns.reshape(len(turns), -1, 1)
        V = U[::each] * np.where(behind, size * np.exp(-1j * turns), 1)
        V = V.reshape(-1, many)
        power = np.mean(np.abs(V) ** 2, axis=1)
        return np.asarray((waves(V, good)[1] / power).reshape(len(turns), -1))

    told = waves(U, good)[1] / np.mean(np.abs(U) ** 2, axis=1)
    if np.median(told) < _LEAST or np.median(told / noise) < _OF_NOISE:
        return None
    fine = np.arange(_FINE) * 2 * np.pi / _FINE

    def best(places: range, phases: Float) -> int:
        return min(places, key=lambda j: float(np.median(left(j, phases, _EACH).min(axis=0))))

    # A side that is a few receivers too long leaves little too.
    step, most = -(-many // _PLACES), many - SIDE
    first = best(range(SIDE, most + 1, step), fine[::2])
    first = best(range(max(first - step, SIDE), min(first + step, most) + 1), fine)
    seen = left(first, fine)
    about = fine[seen.argmin(axis=0)] + np.linspace(-fine[1], fine[1], _BETWEEN + 1)[:, None] / 2
    fine, seen = (
        np.vstack([np.broadcast_to(fine[:, None], seen.shape), about]),
        np.vstack([seen, left(first, about)]),
    )
    tells = seen.min(axis=0) < _JUMPS * seen[0]
    less = np.median(seen.min(axis=0)) < _JUMPS * np.median(seen[0])
    if not less or tells.sum() < SIDE:
        return None
    phase = np.take_along_axis(fine, seen.argmin(axis=0)[None], axis=0)[0, tells]
    omega = omega[tells]
    late = delay_of(phase, omega)
    turned = bool(np.mean(np.cos(phase)) < _SURE - 1)
    if not turned and np.mean(np.cos(phase - omega * late)) < 1 - _SURE:
        return None
    return first - 1, turned, late


def delay_of(phase: Float, omega: Float) -> float:
    """τ whose ωτ fits phases best, whole turns left open, s."""
    step = 0.25 / omega.max()
    reach = np.pi / max(float(np.median(np.diff(omega))), 1e-300)
    most = min(1000.0, np.floor(reach / step))
    tau = step * np.arange(-most, most + 1)
    match = np.exp(1j * phase) @ np.exp(-1j * np.outer(omega, tau))
    worth = match.real + 1e-3 * np.abs(match) - 1e-3 * len(omega) * np.abs(tau) / tau[-1]
    found = float(tau[np.argmax(worth)])
    left = np.angle(np.exp(1j * (phase - omega * found)))
    return found + float(np.sum(omega * left) / np.sum(omega**2))
