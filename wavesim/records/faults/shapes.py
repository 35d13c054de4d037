"""What arrays must be to be a record: real, finite, as long as each other, no place twice."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.evenness import even
from wavesim.records.faults.finding import CURED, Finding
from wavesim.records.faults.gaps import FEWEST_FRAMES

Float = NDArray[Any]

# Receivers even to this part of their spacing count as even.
_EVEN_RECEIVERS = 1e-3
# Positions are taken as rounded where their last digit is at most this part of the spacing.
_ROUNDED = 0.02
# Spans of time (s) and place (m) within which squares and products are numbers still.
_LEAST, _GREATEST = 1e-30, 1e30


def real(values: Float, copy: bool = True) -> Float:
    """Values as real floats, of the caller's own array too if not copied; refused if no numbers."""
    if values.dtype.kind not in "fiubc":
        raise RecordError(f"values are no numbers (type {values.dtype})")
    if np.iscomplexobj(values):
        if np.abs(values.imag).max(initial=0.0) > 0:
            raise RecordError(
                "complex values: both parts can't be one real signal; give one real component "
                "(the real part of an analytic signal; a demodulated one multiplied back up to its "
                "carrier)"
            )
        values = values.real
    return np.array(values, float) if copy else np.asarray(values, float)


def is_even(x: Float) -> bool:
    """Whether receivers are evenly spaced, to a thousandth of their spacing."""
    i = np.arange(len(x))
    off = x - x.mean() - np.polyfit(i, x, 1)[0] * (i - i.mean())
    return bool(np.abs(off).max() <= _EVEN_RECEIVERS * (x[-1] - x[0]) / (len(x) - 1))


def snapped(x: Float, storage: float, found: list[Finding]) -> tuple[Float, float]:
    """Positions that are even to within their last digit, made even."""
    if len(x) < 4:
        return x, 0.0
    sequence = even(x, storage)
    if sequence is None or sequence.digit > _ROUNDED * sequence.step:
        return x, 0.0
    if sequence.off > 1e-9:
        found.append(
            Finding("positions rounded", "all receivers", f"to {sequence.digit:.2g} m", CURED,
                    f"positions are rounded to {sequence.digit:.2g} m: taken as even, "
                    f"{sequence.step:.9g} m apart")
        )  # fmt: skip
    return sequence.values(len(x)), sequence.error


def check_shapes(values: Float, t: Float, x: Float, placed: bool) -> None:
    """Refuse arrays that do not fit each other, or that hold too little."""
    if t.ndim not in (1, 2) or x.ndim != 1:
        raise RecordError(
            f"t of shape {t.shape}, x of shape {x.shape}: must be (frames,) and (receivers,)"
        )
    if (
        values.ndim != 3
        or values.shape[1:] != (len(t), len(x))
        or (t.ndim == 2 and t.shape != values.shape[1:])
    ):
        raise RecordError(
            f"values of shape {values.shape}: must be (frames, receivers) = ({len(t)}, {len(x)}), "
            "or that for each component"
        )
    if len(t) < FEWEST_FRAMES:
        raise RecordError(
            f"{len(t)} frames: at least {FEWEST_FRAMES} are needed; lengthen the record or sample "
            "it more often"
        )
    if len(x) < (2 if placed else 1):
        raise RecordError(
            f"{len(x)} receiver: at least 2 are needed for a wavenumber, 3 where waves run both "
            "ways"
        )
    if not (np.isfinite(t).all() and (not placed or np.isfinite(x).all())):
        raise RecordError("t or x: holds values that are not finite; give every time and position")
    if len(t) and np.ptp(t) == 0:
        raise RecordError(
            f"all times are {t.flat[0]:.9g} s: the numbers that they are stored in hold none "
            "between; give --interval (s)"
        )
    span, reach = np.ptp(t), np.ptp(x) if len(x) and np.isfinite(x).all() else 0.0
    if not (_LEAST < span < _GREATEST and (reach == 0 or _LEAST < reach < _GREATEST)):
        raise RecordError(
            f"t or x: times span {span:g} s, positions {reach:g} m; give them between {_LEAST:g} "
            f"and {_GREATEST:g}"
        )


def check_places(x: Float) -> None:
    """Refuse two receivers at one place."""
    if len(x) > 1 and (np.diff(x) <= 0).any():
        twice = x[1:][np.diff(x) <= 0][0]
        raise RecordError(f"x = {twice:g} m: two receivers stand there; leave one out")


def check_round(x: Float) -> None:
    """Refuse receivers round a ring that are not evenly spaced."""
    if not is_even(x):
        raise RecordError(
            "ring: the receivers round a periodic bar must be evenly spaced; treat the record as "
            "a stretch instead, or give --spacing where they are"
        )


def named(labels: Sequence[str], count: int) -> tuple[str, ...]:
    """Names of so many receivers; their numbers where none are given."""
    if len(labels) not in (0, count):
        raise RecordError(f"labels: {len(labels)} for {count} receivers; give one each")
    return tuple(labels) or tuple(f"receiver {j}" for j in range(1, count + 1))
