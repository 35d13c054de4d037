"""A second mode that a record does not tell from the first: how far off it may make a point.

Two waves of k₁ and k₂, of amplitudes 1 − s and s, pass for one of k = k₁ + s(k₂ − k₁) over an
aperture that does not tell them apart. What is left of them is the bend of its logarithm,

    b = d² ln U/dx² = −(k₂ − k₁)² s(1 − s) = (k − k₁)(k − k₂),

so that one of both is within √|b| of k, for any s, complex too. A loss is no bend: it is a slope.
The same holds of ω and decay over time. A bend is believed where it is more than noise makes, at
one point or at its neighbours along the branch together. What bend may still be there unseen, of
its upper limit b at 95 %, is that of two waves of like strength 2√b apart: nearer ones pass for
one, whatever their strengths, within √b of the nearer.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used: they take a while
from numpy.typing import NDArray

from wavesim.readings.dispersion.sinusoids import Fit, exponentials, solve, transposed
from wavesim.records.windows import blackman_harris

Float = NDArray[Any]

# √|b| is a whole bar, and of noise on top.
_OF_BAR = 0.6
# The mean square of a bend over the noise's is believed from this on at one point, and at the
# points within so many steps from 1.1 + 2.5/√n on.
_ALONE, _STEPS, _FEWEST = 8.0, 10, 5
_KNOWN, _SURE = 1.1, 2.5
# Two modes closer than this part of the resolution are taken for one where nothing shows; what
# noise hides beyond that is part of the bar.
CLOSE = 0.3
# Half-width of a 95 % bar, and the quantile of a one-sided limit, in deviations.
_BAR, _ONE_SIDED = 1.96, 1.645
# Percentage of squares of complex normal numbers below their mean.
_MEAN = 63
# What is left above so many times the noise's power is the receivers' own.
_ALIKE = 3.0
# √720 times the phase error over the record that a simulated field's rounding leaves, rad.
_ROUNDING = 3e-10


@dataclass(frozen=True)
class Bends:
    """Bends at points, arrays of one shape.

    Attributes:
        size: |b|, square of the unit of k (or ω).
        noise: what noise makes of it, likewise.
        over: mean square over the noise's, –: 1 where there is nothing but noise.
    """

    size: Float
    noise: Float
    over: Float

    def take(self, which: Any) -> Bends:
        """Those at an index or mask."""
        return Bends(self.size[which], self.noise[which], self.over[which])

    def put(self, which: Any, others: Bends) -> Bends:
        """With others at an index or mask."""
        columns = [v.copy() for v in (self.size, self.noise, self.over)]
        for column, new in zip(columns, (others.size, others.noise, others.over), strict=True):
            column[which] = new
        return Bends(*columns)


@dataclass(frozen=True)
class Hidden:
    """What a second mode not told apart may do to points, arrays (m,), unit of k (or ω).

    Attributes:
        error: standard error, for what shows of it, or is taken into the bar.
        splitting: waves nearer to each other than this pass for one, which is then within half of
            it of one of them; ∞ where nothing tells.
    """

    error: Float
    splitting: Float


def worth(
    bends: Bends,
    value: Float,
    branch: NDArray[Any],
    step: NDArray[Any],
    cell: float,
    width: Float | float = 0.0,
    close: Float | float = CLOSE,
    alike: float = 1.0,
) -> Hidden:
    """What a second mode not told apart is worth.

    Args:
        bends: at the points.
        value: k (or ω), shape (m,).
        branch: of each, −1 for none, shape (m,).
        step: index of its ω (or k) in an even sequence, shape (m,).
        cell: the resolution 2π/X of k, or 2π/T of ω.
        width: of the line of each, decay or loss, shape (m,) or ().
        close: modes closer than this part of a cell are taken for one where nothing shows, –.
        alike: so many neighbouring steps have one noise, –.
    """
    bend = np.where(bends.over > _ALONE, bends.size, 0.0)
    pull = np.sqrt(bends.noise * _unseen(bends.over, 1.0))
    order = np.lexsort((value, step))
    apart = np.diff(value[order]) - np.broadcast_to(width, value.shape)[order[1:]]
    beside = np.flatnonzero((np.diff(step[order]) == 0) & (apart < cell))
    paired = np.zeros(len(value), bool)
    paired[order[beside]] = paired[order[beside + 1]] = True
    found = np.bincount(step)
    where = np.bincount(step, paired) > 0
    most = scipy.ndimage.maximum_filter1d(
        np.where(where, found, 0), 2 * _STEPS + 1, mode="constant"
    )
    # Where one more wave is seen, close to another, at a step nearby, noise may hide it here.
    hidden = ~paired & (found < most)[step]
    for number in np.unique(branch[branch >= 0]):
        own = np.flatnonzero((branch == number) & ~paired)
        if len(own) < _FEWEST:
            continue
        own = own[np.argsort(step[own], kind="stable")]
        many = min(len(own), 2 * _STEPS + 1)
        # The median: a few points at which another branch crosses are not all of them.
        over, usual = (
            scipy.ndimage.median_filter(v[own], many, mode="nearest")
            for v in (bends.over, bends.size)
        )
        sure = over > _KNOWN + _SURE / np.sqrt(many)
        bend[own] = np.where(sure, np.maximum(bend[own], usual), bend[own])
        usual = scipy.ndimage.percentile_filter(bends.over[own], _MEAN, many, mode="nearest")
        together = np.sqrt(bends.noise[own] * _unseen(usual, max(many / alike, 1.0)))
        pull[own] = np.where(hidden[own], pull[own], np.minimum(pull[own], together))
    # Of waves that noise hides, those closer are left out of the bar.
    left_out = np.where(hidden, 0.0, close) / 2 * cell
    size = np.where(np.isfinite(pull), pull, 0.0)
    told = np.sqrt(np.maximum(size**2 - left_out**2, 0.0))
    return Hidden(np.hypot(_OF_BAR * np.sqrt(bend), told / _BAR), 2 * pull)


def _unseen(over: Float, count: float) -> Float:
    """Bend over the noise's that its mean square at so many points does not rule out, at 95 %.

    Of a mean square 1 + λ of n points, of variance (1 + 2λ)/n, no more than 1.64 deviations low.
    """
    more, square = np.maximum(over, 1) - 1, _ONE_SIDED**2 / count
    return np.sqrt(more + square + np.sqrt(2 * more * square + square**2 + square))


def of_lines(
    channels: Float, row: NDArray[Any], omega: Float, interval: float, noise: Float
) -> Bends:
    """Bends of lines of series, over time, by three windows that overlap, 1/s².

    A sinusoid, decaying or not, goes from one window to the next by one factor, so that of the
    transforms Y₋, Y, Y₊ at its frequency, τ apart, b = ln(Y₋Y₊/Y²)/τ² is 0.

    Args:
        channels: y, shape (n, C, nt).
        row: which series each line is in, ascending, shape (m,).
        omega: of each line, shape (m,), rad/s.
        interval: Δt, s.
        noise: amplitude of noise at each, √Σ over the channels, shape (m,).
    """
    count = channels.shape[-1]
    lag = count // 6
    window = blackman_harris(count - 2 * lag)
    power = float(np.sum(window**2))
    near, far = (float(np.sum(window[d:] * window[:-d])) / power for d in (lag, 2 * lag))
    whole = blackman_harris(count)
    level = power / float(np.sum(whole**2)) * (whole.sum() / 2) ** 2 / channels.shape[1]
    size, hidden, over = np.zeros((3, len(row)))
    edges = np.flatnonzero(np.diff(row, prepend=-1, append=-1))
    for own in (slice(a, b) for a, b in itertools.pairwise(edges)):
        turn = np.exp(1j * np.outer(np.arange(len(window)), omega[own] * interval))
        series = channels[row[own.start]]
        Y = np.stack([(series[:, d : d + len(window)] * window) @ turn for d in (0, lag, 2 * lag)])
        Y = np.where(np.abs(Y) > 1e-100, Y, 1e-100)
        before, at, after = 1 / np.abs(Y)
        variance = level * noise[own] ** 2
        unsure = before**2 + after**2 + 4 * at**2
        unsure += 2 * far * before * after - 4 * near * (before + after) * at
        bend = np.abs(np.log(Y[0] * Y[2] / Y[1] ** 2)) ** 2
        weight = np.abs(Y[1]) ** 2 / np.sum(np.abs(Y[1]) ** 2, axis=0)
        unsure = np.maximum(variance * unsure, 1e-30)
        size[own] = np.sqrt(np.sum(weight * bend, axis=0))
        hidden[own] = np.sqrt(np.sum(weight * unsure, axis=0))
        over[own] = np.mean(bend / unsure, axis=0)
    return Bends(size / (lag * interval) ** 2, hidden / (lag * interval) ** 2, over)


def of_sinusoids(found: Fit, level: Float, scale: Float, weight: Float | None) -> Bends:
    """How far from straight the logarithm of each sinusoid is, and over what noise makes of that.

    The residual of each channel is laid through (p t + q t²) z. Of an amplitude a the logarithm
    bends by 2q/a, and the frequency is off from the common one by p/a, where channels hold two
    waves unequally.

    Args:
        found: the fit.
        level: variance of each channel's noise close to each sinusoid, shape (n, C, p).
        scale: of the channels, shape (C,).
        weight: of the samples, shape (N,), or None.

    Returns:
        |2q/a| + |p/a|², per sample²; what noise makes of the former; and the mean square of p and q
        over the noise's; shape (n, p).
    """
    n, p = found.omega.shape
    count = found.residual.shape[-1]
    t = np.linspace(-0.5, 0.5, count)
    bend, noise, over = np.zeros((3, n, p))
    square = scale[:, None] ** 2
    power = np.maximum(np.sum(np.abs(found.amplitude) ** 2 * square, axis=1), 1e-290)
    floor = _ROUNDING**2 * power.max(axis=1)
    for j in range(p):
        z = exponentials(found.omega[:, j : j + 1], found.decay[:, j : j + 1], count)
        z = np.concatenate([z, z * t, z * t**2], axis=1)
        if weight is not None:
            z = z * weight
        basis = np.concatenate([z.real, z.imag], axis=1)
        gram = basis @ transposed(basis)
        inverse = solve(gram, np.broadcast_to(np.eye(6), gram.shape))
        told = transposed(inverse @ (basis @ transposed(found.residual)))
        spread = np.diagonal(inverse, axis1=1, axis2=2)
        spread = np.maximum(spread[:, :3] + spread[:, 3:], 0)[:, None] * level[..., j, None]
        size = np.sum((told[..., :3] ** 2 + told[..., 3:] ** 2) * square, axis=1)
        chance = np.sum(spread * square, axis=1) + floor[:, None]
        bend[:, j] = 2 * np.sqrt(size[:, 2] / power[:, j]) + size[:, 1] / power[:, j]
        noise[:, j] = 2 * np.sqrt(chance[:, 2] / power[:, j])
        over[:, j] = (size[:, 1] / chance[:, 1] + size[:, 2] / chance[:, 2]) / 2
    return Bends(bend / count**2, noise / count**2, over)


def along(k: Any, x: Float) -> Any:
    """e^{ikx} about the middle of the receivers, shape (n, nx, m), of k (n, m) that is known."""
    turn = 1j * np.where(np.isfinite(k), k, 0)[:, None] * (x - x.mean())[:, None]
    return np.exp(np.clip(turn.real, -200, 200) + 1j * turn.imag)


def of_receivers(
    U: Any, x: Float, used: Any, k: Any, others: Any, level: Float
) -> tuple[Bends, NDArray[np.bool_]]:
    """Bends of one wave e^{ikx} at receivers of any places, beside others.

    Args:
        U: shape (n, nx).
        x: places, shape (nx,), m.
        used: receivers that count, shape (n, nx), bool.
        k: complex, shape (n,), rad/m.
        others: what else is part of the model, e^{−ikx} of what comes back, shape (n, nx, m).
        level: deviation of the noise, shape (n,).

    Returns:
        Their noise is what no bend explains, ∞ where no receiver is to spare; and where that is
        more than the record's own, as of receivers that differ from each other.
    """
    t = (x - x.mean()) / np.ptp(x)
    turn = along(k[:, None], x)[..., 0] * used
    basis = np.stack([turn, turn * t, turn * t**2], axis=-1)
    basis = np.concatenate([basis, others * used[..., None]], axis=-1)
    scale = np.maximum(np.linalg.norm(basis, axis=1, keepdims=True), 1e-290)
    basis = basis / scale
    inverse = np.linalg.pinv(basis)
    fit = (inverse @ np.where(used, U, 0)[..., None])[..., 0]
    left = np.where(used, U, 0) - (basis @ fit[..., None])[..., 0]
    spare = used.sum(axis=1) - basis.shape[-1]
    rest = np.sum(np.abs(left) ** 2, axis=1) / np.maximum(spare, 1)
    spread = np.sum(np.abs(inverse[:, 2]) ** 2, axis=1)
    amplitude = np.maximum(np.abs(fit[:, 0] / scale[:, 0, 0]), 1e-290)
    unit = 2 / np.maximum(amplitude * scale[:, 0, 2] * np.ptp(x) ** 2, 1e-290)
    noise = np.sqrt(np.maximum(spread, 1e-290) * np.maximum(np.maximum(rest, level**2), 1e-290))
    over = np.abs(fit[:, 2]) ** 2 / noise**2
    # What is off at all frequencies alike tells nothing more at many than at one.
    unlike = (rest > _ALIKE * level**2) & (spare > 0)
    over = np.where((spare > 0) & ~(unlike & (over < _ALONE)), over, 0.0)
    noise = np.where(spare > 0, unit * noise, np.inf)
    return Bends(unit * np.abs(fit[:, 2]), noise, over), unlike
