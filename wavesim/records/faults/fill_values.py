"""Fill values, overload codes and spikes: samples that no wave can have, made missing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, Finding, places

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# Values that programs and instruments write for one that is not there.
_CODES = (
    -999.0, -999.25, -9999.0, -99999.0, 999.0, 9999.0, 99999.0, -99.0, 99.0, 1e20, 1e30, 1e35, 1e36,
    1e37, 1e38, 9.9e37, 9.91e37, 9.99e37, -9.99e37, -1e30, -1e20, 9.969209968386869e36,
    3.4028234663852886e38, -3.4028234663852886e38, 1.7976931348623157e308, -32768.0, 32767.0,
    -12345.0, -2147483648.0, 2147483647.0,
)  # fmt: skip
# An extreme value is a fill value where it is this many times all others of its channel …
_BEYOND = 1e3
# … and a code that is known where it is this many times.
_BEYOND_KNOWN = 8.0
_MOST_CODES = 6
_LARGEST = 1e100
# A spike is off the cubic through its neighbours by this many times what samples about it are (or,
# where signals go up to the Nyquist frequency, by the range of its neighbours), and by this many
# times the noise of the whole channel.
_SPIKE = 5.0
_HIGH = 0.01
_SPIKE_NOISE = 10.0
_MOST_SPIKES = 0.01
# What a bad sample, a kink and a step leave of the five cubics about them, kinks and steps between
# either two samples; a bad one explains it by so much better.
_SHAPES = [
    np.array(rows, float).T / 6
    for rows in (
        [[1, -4, 6, -4, 1]],
        [[0, 1, -2, 1, 0], [0, 0, 1, -2, 1]],
        [[0, 1, -2, 1, 0], [1, -2, 1, 0, 0]],
        [[0, 1, -3, 3, -1]],
        [[-1, 3, -3, 1, 0]],
    )
]
_BETTER = 0.3


# Values wrapped round fill this part of a range of 2^n steps, n no less, or of a turn; steps of
# neighbours are so many times as large or more, and as good as none of this part of it.
_FILLED, _TURNS, _FEWEST_BITS, _MOST_BITS = 0.93, (2 * np.pi, 360.0), 7, 33
_WRAPS, _MIDDLE, _BETWEEN, _AT_ENDS = 3, (0.3, 0.7), 0.1, 0.5


def unwrapped(values: Float, found: list[Finding]) -> Float:
    """Values that run over one end of their range to the other, put one range beyond, in place.

    So are signed numbers read as unsigned ones, sums too large for their digits, and phases.

    Args:
        values: shape (C, nt, nx), NaN where a sample is missing.
        found: findings, added to.
    """
    for component in values:
        low, high = np.nanmin(component), np.nanmax(component)
        with np.errstate(over="ignore"):
            steps = np.abs(np.diff(component, axis=0))
        quantum = float(np.min(steps[steps > 0], initial=np.inf))
        if not np.isfinite(quantum):
            continue
        ranges, whole = list(_TURNS), False
        if high - low < quantum * 2.0**_MOST_BITS:
            bits = np.ceil(np.log2((high - low) / quantum + 1) - 1e-9)
            grid = (component[:: max(1, len(component) // 512)] - low) / quantum
            whole = bool(np.nanmax(np.abs(grid - np.round(grid))) < 1e-3)
            ranges += [quantum * 2.0 ** max(bits, _FEWEST_BITS)] if whole else []
        ends = np.mean((component == low) | (component == high))
        for size in ranges:
            part = (high - low + (quantum if whole else 0)) / size
            beyond = steps > _MIDDLE[1] * size
            wraps = int(beyond.sum())
            between = int(np.sum((steps > _MIDDLE[0] * size) & (steps <= _MIDDLE[1] * size)))
            # What all do at once is a step.
            often = beyond.any(axis=1).sum() >= _WRAPS
            if not (_FILLED < part < 1 + 1e-6 and between <= _BETWEEN * wraps and often):
                continue
            # Signed numbers read as unsigned ones are whole about the range's end.
            about = (component - low + size / 2) % size
            signed = np.sum(np.abs(np.diff(about, axis=0)) > _MIDDLE[1] * size) < _WRAPS
            if signed or ends < _AT_ENDS:
                own = np.isfinite(component).all(axis=0)
                right = about if signed else np.unwrap(component, axis=0, period=size)
                component[:, own] = right[:, own]
                said = f"values run over the end of a range of {size:.6g} to its other end "
                said += f"{wraps} times: put one range beyond"
                found.append(Finding("wrapped", "all receivers", f"{wraps} times", CURED, said))
                break
    return values


def within_range(values: Float, found: list[Finding]) -> Float:
    """Values with those that no instrument gives, infinite ones among them, as NaN, in place."""
    with np.errstate(invalid="ignore"):
        beyond = np.abs(values) > _LARGEST
    count = int((beyond & np.isfinite(values)).sum())
    # A code is one value; it is told of as such.
    codes = np.unique(values[beyond & np.isfinite(values)])
    if len(codes) > _MOST_CODES:
        found.append(Finding("out of range", "several receivers", f"{count} samples", CURED,
                             f"{count} samples beyond {_LARGEST:g} taken as missing"))  # fmt: skip
        values[beyond] = np.nan
    values[np.isinf(values)] = np.nan
    return values


def without_fill(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> Float:
    """Values with fill values and overload codes as NaN.

    Args:
        values: shape (C, nt, nx); changed in place.
        t, x, labels: times, positions and names of the receivers.
        found: findings, added to.
    """
    told: dict[float, Mask] = {}
    count: dict[float, int] = {}
    frame: dict[float, int] = {}
    for component in values:
        for j in _suspects(component):
            column = component[:, j]
            for _ in range(_MOST_CODES):
                code = _code(column)
                if code is None:
                    break
                marked = column == code
                told.setdefault(code, np.zeros(len(x), bool))[j] = True
                count[code] = count.get(code, 0) + int(marked.sum())
                frame.setdefault(code, int(np.argmax(marked)))
                column[marked] = np.nan
    for code, which in told.items():
        where = places(x, which, labels)
        found.append(
            Finding("fill value", f"{where}, from t = {t[frame[code]]:.6g} s",
                    f"{count[code]} of {code:.6g}", CURED,
                    f"{count[code]} samples of {code:.6g} taken as missing ({where}, first at "
                    f"t = {t[frame[code]]:.6g} s)")
        )  # fmt: skip
    return values


def _suspects(component: Float) -> NDArray[np.int64]:
    """Channels whose largest value stands far above what most of them have."""
    size = np.abs(np.nan_to_num(component, nan=0.0, posinf=1.7e308, neginf=-1.7e308))
    top = size.max(axis=0)
    usual = np.percentile(size, 75, axis=0)
    return np.flatnonzero((top > _BEYOND_KNOWN * usual) & (top > 0))


def _code(column: Float) -> float | None:
    """A value that is none, or None."""
    finite = column[np.isfinite(column)]
    if len(finite) < 8:
        return None
    for code in (float(finite.max()), float(finite.min())):
        others = np.abs(finite[finite != code])
        if not len(others):
            continue
        size = float(others.max())
        # All others alike 0: an impulse, not a code, unless it is one that is known.
        known = any(abs(code - c) <= 1e-6 * abs(c) for c in _CODES)
        if abs(code) > (_BEYOND_KNOWN if known else _BEYOND) * size and (known or size > 0):
            return code
    return None


def without_spikes(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], flat: Mask, found: list[Finding]
) -> Float:
    """Values with lone samples far off their neighbours as NaN.

    Args:
        values: shape (C, nt, nx); changed in place.
        t, x, labels: times, positions and names of the receivers.
        flat: which have flat tops, whose corners are no spikes.
        found: findings, added to.
    """
    if values.shape[1] < 16:
        return values
    which, total, first = np.zeros(len(x), bool), 0, len(t)
    for component in values:
        marked = _spikes(component, _coarse(component))
        # At all receivers at once it came from without: crosstalk of the trigger, not a bad sample.
        together = marked.sum(axis=1) > max(1, len(x) // 2)
        marked[together] = False
        marked[:, flat] = False
        marked[:, marked.mean(axis=0) > _MOST_SPIKES] = False
        if marked.any():
            which |= marked.any(axis=0)
            total += int(marked.sum())
            first = min(first, int(np.argmax(marked.any(axis=1))))
            component[marked] = np.nan
    if total:
        where = places(x, which, labels)
        found.append(
            Finding("spikes", f"{where}, from t = {t[first]:.6g} s", f"{total} samples", CURED,
                    f"{total} spikes of one sample taken as missing ({where}, first at "
                    f"t = {t[first]:.6g} s)")
        )  # fmt: skip
    return values


def off_cubic(component: Float) -> Float:
    """How far samples are off the cubic through two neighbours on either side, shape (nt, nx);
    one bad sample spoils those two off."""
    left = np.zeros(component.shape)
    left[2:-2] = (
        component[2:-2]
        - (4 * (component[1:-3] + component[3:-1]) - component[:-4] - component[4:]) / 6
    )
    return left


def _spikes(component: Float, coarse: bool) -> Mask:
    nt = len(component)
    marked = np.zeros(component.shape, bool)
    left = off_cubic(component)
    off = np.abs(left)
    with np.errstate(invalid="ignore"):
        noise = 1.4826 * np.nanmedian(off, axis=0)
        rows, columns = np.nonzero(off > np.maximum(_SPIKE_NOISE * noise, 1e-300))
    if len(rows) > 5 * component.size * _MOST_SPIKES:
        return marked
    for i, j in zip(rows, columns, strict=True):
        near = component[[k for k in range(i - 3, i + 4) if k != i and 0 <= k < nt], j]
        if i < 3 or i > nt - 4 or not np.isfinite(near).all():
            continue
        usual = near.max() - near.min() if coarse else _usual(off[:, j], int(i))
        largest = off[i, j] >= off[i - 2 : i + 3, j].max() and off[i, j] > _SPIKE * usual
        if largest and _lone(left[i - 2 : i + 3, j]):
            marked[i, j] = True
    return marked


def _lone(left: Float) -> bool:
    """Whether one sample alone is off, by what it leaves of its neighbours' cubics, and not a kink
    between two samples, as where a pulse begins or ends, or a step."""
    spike, *others = (left - basis @ np.linalg.pinv(basis) @ left for basis in _SHAPES)
    return float(np.sum(spike**2)) < _BETTER * min(float(np.sum(one**2)) for one in others)


def _usual(off: Float, i: int) -> float:
    """How far samples about one are off their neighbours, those that it spoils left out."""
    around = np.r_[off[max(0, i - 8) : i - 2], off[i + 3 : i + 9]]
    around = around[np.isfinite(around)]
    return float(around.max()) if len(around) else np.inf


def _coarse(component: Float) -> bool:
    """Whether signals go up to the Nyquist frequency, so that a peak may be one sample wide."""
    some = np.nan_to_num(component[:, :: max(1, component.shape[1] // 64)])
    power = np.abs(np.fft.rfft(some - some.mean(axis=0), axis=0)) ** 2
    floor = np.median(power, axis=0)
    above = np.maximum(power - 4 * floor, 0)
    part = above[len(above) // 2 :].sum(axis=0) / np.maximum(above.sum(axis=0), 1e-300)
    return bool(np.median(part) > _HIGH)
