"""Power laws through a series of pulse tests, V = a pᵇ: of its velocities, and of each wave in it.

Through the velocities goes a law that is robust against single ones that are off. Through all
packets of all records go the laws that waves obey, with one power for all waves of a specimen, of
which one is the direct wave's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]

# A record is set aside from this many deviations of the others on, and from this part of V.
_AWAY = 4.0
_LEAST = 0.03
FEWEST = 3
# So many others at least show whether a record is of their law, and this part may be of none.
_OTHERS, _MOST_OFF = 4, 0.4


@dataclass(frozen=True)
class PowerLaw:
    """V = a pᵇ.

    Attributes:
        a, a_error: V at p = 1 in the parameter's unit, and its standard error, m/s.
        b, b_error: the power and its standard error, –.
        outliers: indices of what was set aside.
        scatter: root of the mean square of ln V about the law, without these, –.
    """

    a: float
    a_error: float
    b: float
    b_error: float
    outliers: tuple[int, ...]
    scatter: float


def power_law(p: Float, velocity: Float, noise: Float, common: Float) -> PowerLaw | None:
    """Fit the law to what is known of it.

    Args:
        p: the parameter, > 0, shape (n,).
        velocity: shape (n,), m/s; NaN where there is none.
        noise: standard error of each, independent of the others', over V, shape (n,), –.
        common: what the reading leaves open of each, the same way for all, over V, shape (n,), –.

    Returns:
        The law; None where fewer than three velocities at two values of p are known, or a value of
        p is not above 0. The errors hold the scatter, and what is open: its mean in a, its trend
        with p in b.
    """
    own = np.isfinite(velocity) & (velocity > 0)
    if own.sum() < FEWEST or not (p > 0).all() or np.ptp(p[own]) == 0:
        return None
    x, y = np.log(p), np.log(np.where(own, velocity, 1.0))
    kept = own.copy()
    for _ in range(len(p)):
        b, a = np.polyfit(x[kept], y[kept], 1)
        off = np.abs(y - a - b * x)
        level = 1.4826 * float(np.median(off[kept]))
        worst = int(np.argmax(np.where(kept, off, -1.0)))
        # With the worst one out, the others must agree much better than it does with them.
        limit = max(_AWAY * level, _LEAST, 2 * float(np.nan_to_num(noise[worst])))
        if off[worst] <= limit or kept.sum() <= max(FEWEST, 0.6 * own.sum()):
            break
        kept[worst] = False
    n, centre = int(kept.sum()), float(x[kept].mean())
    spread = float(np.sum((x[kept] - centre) ** 2))
    scatter = float(np.sqrt(np.sum(off[kept] ** 2) / max(n - 2, 1)))
    each = max(scatter, float(np.sqrt(np.mean(np.nan_to_num(noise[kept]) ** 2))))
    open_b = abs(float(np.sum((x[kept] - centre) * common[kept]) / spread))
    open_a = float(np.hypot(np.mean(common[kept]), centre * open_b))
    b_error = float(np.hypot(each / np.sqrt(spread), open_b))
    a_error = np.exp(a) * np.sqrt(each**2 * (1 / n + centre**2 / spread) + open_a**2)
    aside = tuple(int(i) for i in np.flatnonzero(own & ~kept))
    return PowerLaw(float(np.exp(a)), float(a_error), float(b), b_error, aside, scatter)


def off_the_law(p: Float, velocity: Float, error: Float) -> Float:
    """How far a record is off a smooth law of the others, in ln V, shape (n,); 0 where it is not.

    It is off where the law V = a pᵇ of the others, robust against what else is off, and the line
    between its two neighbours both lie outside its 95 % bar, and four times farther than the others
    scatter. (A law that bends, as where soil yields, leaves its records near the line of their
    neighbours.)

    Args:
        p: the parameter, > 0, shape (n,).
        velocity, error: and its standard error, shape (n,), m/s; NaN where there is none.
    """
    from scipy.stats import theilslopes  # slow to import, and only a series needs it

    own = np.isfinite(velocity) & (velocity > 0)
    x, y = np.log(p), np.log(np.where(own, velocity, 1.0))
    bar = 1.96 * error / velocity
    result = np.zeros(len(x))
    kept = np.flatnonzero(own)
    kept = kept[np.argsort(x[kept], kind="stable")]
    while len(kept) > _OTHERS and np.sum(result > 0) < int(_MOST_OFF * own.sum()):
        off, limit = np.zeros((2, len(kept)))
        for i, k in enumerate(kept):
            others = np.delete(kept, i)
            if np.ptp(x[others]) == 0:
                continue
            slope, middle, *_ = theilslopes(y[others], x[others])
            left = y[others] - middle - slope * x[others]
            a, b = others[min(max(i, 1), len(others) - 1) - 1 :][:2]
            part = (x[k] - x[a]) / (x[b] - x[a]) if x[b] > x[a] else 0.5
            by_law = abs(y[k] - middle - slope * x[k])
            off[i] = min(by_law, abs(y[k] - y[a] - part * (y[b] - y[a])))
            limit[i] = max(_AWAY * 1.4826 * float(np.median(np.abs(left))), _LEAST, bar[k])
        worst = int(np.argmax(off - limit))
        if not off[worst] > limit[worst]:
            break
        result[kept[worst]] = off[worst]
        kept = np.delete(kept, worst)
    return result


# Lines: of more packets than this only some are tried, two records of it are this part of the range
# of ln p apart, a power is likely from here on, and two lines are this far apart in ln t.
_MOST_CANDIDATES, _FAR, _LEAST_PRIOR, _DISTINCT, _MOST_LINES = 160, 0.3, 0.1, 0.1, 6
# A power that is foreseen does not hold where no line of it has the direct waves of this part of
# the records, and one of another power, so far from it as one standard deviation, of that part:
# what stands still in fewer is crosstalk.
_BORNE_OUT, _OF_ALL, _ANY_POWER = 0.5, 0.8, 0.4
# A record that ends before a wave says neither for it nor against it: this much.
_UNSEEN = 0.5
# A packet should be seen where noise hides only what is smaller by this.
_WELL_SEEN = 0.6


@dataclass(frozen=True)
class Line:
    """A wave through a series: ln t = y at each record, by packets that lie on one power law.

    Attributes:
        y: shape (n,), t in s less the delay.
        packet: which of the record's packets it is, shape (n,); -1 where none is.
        likely: mean over the records that show it, and could show the likeliest line's, of how
            likely it is the direct one, over that one's there.
        ended: whether a record shows none of it as it ends before, shape (n,).
    """

    y: Float
    packet: NDArray[np.int64]
    likely: float
    ended: NDArray[np.bool_]


def lines(
    times: Sequence[Float],
    likely: Sequence[Float],
    p: Float,
    foreseen: Float,
    away: Float,
    slope: tuple[float, float],
    sizes: Sequence[Float],
    hidden: Float,
    last: Float,
) -> list[Line]:
    """Waves that obey a power law of their own through a series, the likeliest direct one first.

    Each record alone may show several packets that could be the direct one; which it is, is the
    same in all. Through each two packets of different records goes a line of ln t over ln p; it
    scores what the packets on it are likely to be, each record once.

    Args:
        times: of each record's packets, s less the delay.
        likely: of each, how likely it is the direct one.
        p: the parameter, > 0, shape (n,).
        foreseen: ln t up to a constant, shape (n,).
        away: how far a packet may be off its line, in ln t, shape (n,).
        slope: the mean and the standard deviation of the power that is left beside ``foreseen``.
        sizes: of the packets, over the largest of their record.
        hidden: size up to which noise hides a packet in each record, shape (n,).
        last: until when each record shows a packet, as ``times`` count, shape (n,).

    Returns:
        The lines; none where no power law is borne out by half of the records.
    """
    n = len(times)
    record = np.repeat(np.arange(n), [len(own) for own in times])
    if len(set(record.tolist())) < FEWEST or not (p > 0).all() or np.ptp(p) == 0:
        return []
    place = np.concatenate([np.arange(len(own)) for own in times])
    x = np.log(p)
    y = np.log(np.concatenate(list(times))) - foreseen[record]
    w = np.concatenate(list(likely))
    reach = away[record]
    own = np.arange(len(y))[:: -(-len(y) // _MOST_CANDIDATES)]
    i, j = (own[k] for k in np.triu_indices(len(own), 1))
    far = np.abs(x[record[i]] - x[record[j]]) > _FAR * np.ptp(x)
    i, j = i[far], j[far]
    b = (y[i] - y[j]) / (x[record[i]] - x[record[j]])
    a = y[i] - b * x[record[i]]
    near = np.abs(b - slope[0]) < max(slope[1], _ANY_POWER) * np.sqrt(-2 * np.log(_LEAST_PRIOR))
    a, b = a[near], b[near]
    prior = np.exp(-(((b - slope[0]) / slope[1]) ** 2) / 2)
    prior = np.where(prior > _LEAST_PRIOR, prior, 0.0)
    starts = np.flatnonzero(np.r_[True, np.diff(record) > 0])
    end = np.log(np.maximum(last, 1e-12)) - foreseen

    def scores(a: Float, b: Float) -> Float:
        """What each record says for lines, shape (lines, records that show anything)."""
        off = (y - a[:, None] - b[:, None] * x[record]) / reach
        shown = np.maximum.reduceat(np.maximum(0.0, 1 - off**2) * w, starts, axis=1)
        later = a[:, None] + b[:, None] * x[record[starts]] > end[record[starts]]
        return np.maximum(shown, _UNSEEN * later)

    def line(a: float, b: float, first: tuple[Float, Float] | None) -> tuple[Line, Float]:
        off = np.abs(y - a - b * x[record]) / reach
        packet, weight = np.full(n, -1), np.zeros(n)
        for low, high in zip(starts, [*starts[1:], len(y)], strict=True):
            at = low + int(np.argmax(np.maximum(0.0, 1 - off[low:high] ** 2) * w[low:high]))
            if off[at] < 1:
                packet[record[at]], weight[record[at]] = place[at], w[at]
        ended = (a + b * x > end) & (packet < 0)
        there, before = (weight, ended) if first is None else first
        # A record that ends before the first does not show which of them it is.
        seen = (packet >= 0) & ~before
        likely = float(weight[seen].sum() / max(there[seen].sum(), 1e-12)) if seen.any() else 0.0
        return Line(a + b * x + foreseen, packet, likely, ended), weight

    if not len(a):
        return []
    parts = np.array_split(np.arange(len(a)), max(1, len(a) // 2000))
    each = np.concatenate([scores(a[k], b[k]).sum(axis=1) for k in parts])
    best = int(np.argmax(each * prior))
    if each[best] < _BORNE_OUT * len(starts) or not prior[best]:
        # What is likely the direct wave in most records lies on no line of a power that is
        # foreseen: soil that yields, or does not, has others.
        any_power = int(np.argmax(each * np.exp(-(((b - slope[0]) / _ANY_POWER) ** 2) / 2)))
        if each[any_power] >= _OF_ALL * len(starts):
            best = any_power
        elif not prior[best]:
            return []
    own_a, own_b = float(a[best]), float(b[best])
    first, weight = line(own_a, own_b, None)
    if (first.packet >= 0).sum() < max(FEWEST, 0.5 * (n - first.ended.sum())):
        return []
    found = [first]
    # Waves of one specimen grow with the same power: the others lie beside the first.
    beside = y - own_b * x[record]
    w = np.where(np.abs(beside - own_a) < reach, 0.0, w)
    total = scores(beside, np.full(len(beside), own_b)).sum(axis=1)
    apart = max(_DISTINCT, float(np.median(away)))
    free = np.abs(beside - own_a) > apart
    while free.any() and len(found) < _MOST_LINES:
        at = float(beside[int(np.argmax(np.where(free, total, -1.0)))])
        other, _ = line(at, own_b, (weight, first.ended))
        seen = np.flatnonzero(other.packet >= 0)
        size = (
            float(np.median([sizes[k][other.packet[k]] for k in seen.tolist()]))
            if len(seen)
            else 0.0
        )
        # Where noise hides it, that it is not seen says nothing.
        if len(seen) >= max(min(2, n - 2), n / 4, 0.5 * np.sum(hidden < _WELL_SEEN * size)):
            found.append(other)
        free &= np.abs(beside - at) > apart
    return found
