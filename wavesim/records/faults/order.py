"""Receivers that do not stand in the order of their positions, by the signal that passes them.

A signal comes to receivers along a line later and later, or, from among them, to both sides, or to
one side late, as by another cable. Where in the order in which it comes its times are on a straight
line, and the field is few waves e^{ikx}, and in that of the positions neither is so, the receivers
do not stand where they are said to.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults.channels import TOGETHER, Mended, fall_off, strong_spectrum
from wavesim.records.faults.moveout import SIDE
from wavesim.records.faults.quiet import Rest
from wavesim.records.faults.unfit_receivers import along_line

Float = NDArray[Any]

# Three are on the way from a source among them in any order.
_FEWEST = 4
# Times are of this part of the receivers at least. Both they and the waves must leave less than
# this part of what they do in the order of positions: in records in order waves leave many times
# more, or times do. There the times must leave so many squares of what passes between neighbours.
_SEEN, _LESS, _STEP = 0.8, 0.5, 0.25
# … and this part of those that move come nearer to the line.
_NEARER = 0.8
# Receivers as far on either side of a source are put apart by this part of the line.
_APART = 1e-6
# A source is looked for at so many places for each receiver, and at so many, of which so many are
# likely; so many receivers are listed.
_PLACES, _MOST_PLACES, _LIKELY, _LISTED = 8, 512, 12, 8


def check_order(
    component: Float, t: Float, x: Float, rest: Rest, arrivals: Float, mended: Mended, fewest: int
) -> None:
    """Refuse receivers that stand in another order.

    Args:
        component: u, shape (nt, nx), finite, without offset.
        t, x: times, s, and places, ascending, m.
        rest: of the channels.
        arrivals: when the signal comes to each, by several measures, shape (m, nx), s; NaN where
            it is not seen.
        mended: what was done to the channels.
        fewest: of them that stand elsewhere; two can be put back.

    Raises:
        RecordError: so many do, with the order.
    """
    living = np.flatnonzero(~mended.out)
    for times in arrivals[:, mended.order]:
        own = living[np.isfinite(times[living])]
        if len(own) < max(_SEEN * len(living), _FEWEST):
            continue
        given = component[:, mended.order[own]] * mended.factor[own]
        order = _order_of_travel(times[own], x[own])
        moved = order != np.arange(len(order))
        if moved.sum() < max(fewest, 1):
            continue
        away = _from_likely_sources(times[own], x[own])
        if not few_waves_alone(given[:, order], given, t, x[own], rest, own, away):
            continue
        listed = ", ".join(str(j + 1) for j in mended.order[own][order][:_LISTED])
        raise RecordError(
            f"the signal comes to the receivers in the order {listed}"
            f"{', …' * (len(order) > _LISTED)} and passes them as a wave in that alone: they do "
            "not stand in the order of their positions; give these as they are with "
            "--positions X1,X2,…"
        )


def _order_of_travel(times: Float, x: Float) -> NDArray[np.int64]:
    """The order of arrivals, whichever way they go, where it leaves far less of a straight line in
    x than the order of positions does of any moveout that has one; that of positions elsewhere."""
    along = np.arange(len(x))
    order = np.argsort(times, kind="stable")
    order = min(order, order[::-1], key=lambda one: float(np.abs(one - along).sum()))
    if (order == along).all():
        return along
    left, slowness = _left(times[order], x[None])
    step = float(slowness[0]) * float(np.ptp(x)) / (len(x) - 1)
    given, apart = _from_a_source(times, x), _STEP * step**2
    # A late side comes evenly between the others by chance alone.
    given = given if float(left[0]) < apart else min(given, _with_a_late_side(times, x))
    if max(float(left[0]) / _LESS, apart) >= given:
        return along
    # One that is late or early by itself leaves the others in line, the same way.
    rest = [np.delete(np.stack([times, x]), j, axis=1) for j in range(len(x))]
    others = [_left(one[0], one[1][None]) for one in rest]
    one_off = min(
        (float(off[0]) for off, slow in others if slow[0] * slowness[0] > 0), default=given
    )
    if one_off < float(left[0]):
        return along
    # Where some are late or early by themselves, others make room for them.
    line = float(slowness[0]) * (x - x.mean())
    middle = float(np.median(times[order] - line))
    now, before = np.abs(times[order] - middle - line), np.abs(times - middle - line)[order]
    moved = order != np.arange(len(x))
    return order if np.mean(now[moved] < before[moved]) > _NEARER else along


def _from_a_source(times: Float, x: Float) -> float:
    """What arrivals from a source anywhere leave, by distance to both sides, Σ of squares, s²."""
    return float(_left(times, np.abs(x - _places(x)[:, None]))[0].min())


def _from_likely_sources(times: Float, x: Float) -> Float:
    """Distances to the places among the receivers that arrivals are most like coming from, times
    far off counting little, shape (n, nx), m."""
    away = np.abs(x - _places(x)[:, None])
    _, slope = _left(times, away)
    off = times - slope[:, None] * away
    return away[np.argsort(np.abs(off - np.median(off, axis=1)[:, None]).sum(axis=1))[:_LIKELY]]


def _places(x: Float) -> Float:
    return np.linspace(x[0], x[-1], min(_PLACES * len(x), _MOST_PLACES))


def _with_a_late_side(times: Float, x: Float) -> float:
    """What a straight line leaves of which a side of three receivers or more is late, s²."""
    count, away, late = len(x), x - x.mean(), times - times.mean()
    lever = float(away @ away)
    late = late - float(away @ late) / lever * away
    behind = np.arange(count, 0, -1.0)
    slope = np.cumsum(away[::-1])[::-1]
    size = behind - behind**2 / count - slope**2 / lever
    gain = np.cumsum(late[::-1])[::-1] ** 2 / np.maximum(size, 1e-9)
    return float(late @ late - gain[SIDE : count - SIDE + 1].max(initial=0.0))


def _left(times: Float, away: Float) -> tuple[Float, Float]:
    """What straight lines in distances, shape (n, nx), leave of arrivals, s²; their slopes."""
    away, times = away - away.mean(axis=1, keepdims=True), times - times.mean()
    slope = away @ times / np.sum(away**2, axis=1)
    return np.sum((times - slope[:, None] * away) ** 2, axis=1), slope


def few_waves_alone(
    right: Float,
    given: Float,
    t: Float,
    x: Float,
    rest: Rest,
    own: NDArray[np.int64],
    away: Float | None = None,
) -> bool:
    """Whether few waves leave far less of a field put right than of it as it was given.

    Args:
        right, given: of receivers at x, shape (nt, nx), of which some differ.
        t, x: times, s, and places, ascending, m.
        rest: of all channels; own are those, shape (nx,).
        away: distances from sources that may stand among the receivers, shape (n, nx), m: waves
            go from there to both sides.
    """
    differs = np.cumsum(np.append(0, (right != given).any(axis=0)))
    starts = np.arange(max(len(x) - TOGETHER, 0) + 1)
    start = int(np.argmax(differs[starts + min(TOGETHER, len(x))] - differs[starts]))
    part = slice(start, start + TOGETHER)

    spectra = [strong_spectrum(u[:, part], t, rest, own[part]) for u in (right, given)]
    if spectra[0] is None or spectra[1] is None:
        return False
    as_put, as_given = spectra[0][0], spectra[1][0]
    few = _left_of_few(as_put, x[part])
    known = [x[part], *(() if away is None else away[:, part])]
    return all(few < _LESS * _left_of_few(as_given, places) for places in known)


def _left_of_few(U: Any, places: Float) -> float:
    """What few waves leave of spectra, shape (n, nx), of receivers at places in any order, –."""
    by = np.argsort(places, kind="stable")
    at = places[by] + _APART * float(np.ptp(places)) * np.arange(len(by))
    U = U[:, by] / fall_off(np.abs(U[:, by]), at)
    off = along_line(at)(U, np.ones(len(by), bool))[1]
    return float(np.median(off / np.mean(np.abs(U) ** 2, axis=1)))
