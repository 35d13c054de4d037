"""Whether numbers written with few digits are even, and how well their step is known then.

Numbers x_i = x₀ + i d + e_i, |e_i| ≤ q_i/2, where q_i is the last digit that x_i is written with
(or the spacing of its floating-point format), are even as far as anyone can tell. The step's
standard error by least squares is then q/N^{3/2}; a step (or a rate 1/d) that within it is a number
of far fewer digits than chance would have is taken for that number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]

_MOST_DIGITS = 17
# A rounder number is believed where it has this many digits fewer than chance would give.
_FEWER = 3
_ROUNDEST = 12


@dataclass(frozen=True)
class Even:
    """An even sequence.

    Attributes:
        first, step: x₀ and d.
        error: standard error of the step over the step, –; 0 where it is exact.
        digit: largest q.
        off: largest distance of a number from the sequence, over the step, –.
    """

    first: float
    step: float
    error: float
    digit: float
    off: float

    def values(self, count: int) -> Float:
        """The sequence."""
        # By a rate that is a whole number the quotients are exact.
        rate = round(1 / self.step)
        if rate > 1 and abs(rate * self.step - 1) < 4e-16:
            return self.first + np.arange(count) / rate
        return self.first + self.step * np.arange(count)


def last_digit(x: Float, storage: float = 0.0) -> Float:
    """q of each number: of its decimals as written, or of how it was stored if that is coarser."""
    some = x if len(x) <= 400 else np.r_[x[:100], x[:: max(1, len(x) // 200)], x[-100:]]
    some = some[some != 0]
    if not len(some):
        return np.full(len(x), storage)
    digits = next(
        (d for d in range(1, _MOST_DIGITS)
         if all(abs(float(f"{v:.{d}g}") - v) <= 4e-16 * abs(v) for v in some.tolist())),
        _MOST_DIGITS,
    )  # fmt: skip
    if digits >= 15:
        return np.maximum(np.spacing(np.abs(x).max()), storage) * np.ones(len(x))
    size = np.floor(np.log10(np.maximum(np.abs(x), 1e-300)))
    own = 10.0 ** (np.where(x == 0, size.min(), size) + 1 - digits)
    # A fixed number of decimals: all are multiples of one power of ten.
    top = int(np.floor(np.log10(np.abs(some).max())))
    fixed = 0.0
    for power in range(top, top - 16, -1):
        turns = some / 10.0**power
        if np.abs(turns - np.round(turns)).max() <= 1e-14 * np.abs(turns).max() + 1e-9:
            fixed = 10.0**power
            break
    return np.maximum(np.maximum(own, fixed), storage)


def even(x: Float, storage: float = 0.0, tolerance: float = 0.0) -> Even | None:
    """The even sequence that numbers are of, to their last digit or to a part of the step.

    Args:
        x: ascending, shape (n,), n ≥ 2.
        storage: least distance between numbers as they were stored, unit of x.
        tolerance: part of the step by which they may be off beside their rounding, –.

    Returns:
        The sequence; None where they are not even.
    """
    n = len(x)
    q = last_digit(x, storage)
    i = np.arange(n) - (n - 1) / 2
    plain = (x[-1] - x[0]) / (n - 1)
    straight = x[0] + plain * np.arange(n)
    # Ends alone give numbers of full precision back as they came.
    if np.abs(x - straight).max() <= max(8 * np.spacing(np.abs(x).max()), 1e-9 * plain):
        step = _rounder(plain, 4 * np.spacing(np.abs(x).max()) / (n - 1))
        return Even(float(x[0]), step, 0.0, float(q.max()), 0.0)
    weight = 1 / np.maximum(q, 1e-300) ** 2
    centre = np.sum(weight * i) / weight.sum()
    mean = np.sum(weight * x) / weight.sum()
    spread = np.sum(weight * (i - centre) ** 2)
    step = float(np.sum(weight * (i - centre) * (x - mean)) / spread)
    error = float(np.sqrt(1 / 12 / spread))
    off = np.abs(x - mean - step * (i - centre))
    if not step > 0:
        return None
    slack = 0.5 + 2 / np.sqrt(n)
    if (off > np.maximum(slack * q, tolerance * step)).any():
        return None
    if not (off <= slack * q).all():
        error = float(off.std() / np.sqrt(np.sum((i - i.mean()) ** 2)))
    rounder = _rounder(step, 3 * error)
    if rounder != step:
        error, step = 0.0, rounder
    # The first number as it is written: where the whole sequence lies changes nothing.
    first = float(x[0])
    return Even(first, step, error / step, float(q.max()), float(off.max()) / step)


def _rounder(value: float, within: float) -> float:
    """A number of far fewer digits within a distance, or one whose inverse is; else the value."""
    if not within > 0 or value == 0:
        return value
    chance = np.log10(abs(value) / within)  # digits that the distance leaves
    for number, back in ((value, False), (1 / value, True)):
        reach = within if not back else within / value**2
        for digits in range(1, _ROUNDEST):
            if digits > chance - _FEWER:
                break
            short = float(f"{number:.{digits}g}")
            if abs(short - number) <= reach:
                return 1 / short if back else short
    return value


def unrounded(arrays: dict[str, Float], interval: float) -> bool:
    """Whether times, "t", are so rounded that they repeat, and made even by an interval said beside
    them, with which they agree."""
    t = arrays["t"]
    steps, even = np.diff(t), t[0] + interval * np.arange(len(t))
    if not len(steps) or steps.min() != 0 or np.abs(t - even).max() > steps.max():
        return False
    arrays["t"] = even
    return True
