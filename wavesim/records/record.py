"""A space-time record, from wherever it comes, and what is done to it before it is used.

Extraction wants even times and finite values. What can be remedied is, and said in ``notes``:
uneven times are resampled, dead receivers left out, short breaks bridged or marked missing. What
can't be is refused with a message that names value, limit and remedy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

Float = NDArray[Any]

FEWEST_FRAMES = 16
# Times even to this part of their interval, and receivers to this part of theirs, count as even.
_EVEN_TIMES = 1e-5
_EVEN_RECEIVERS = 1e-6
# A break of up to this many frames at one receiver is bridged.
_BRIDGED = 2
# A receiver that varies less than this part of the strongest is dead.
_DEAD = 1e-12
# A receiver with more than this part of its samples missing is left out.
_MOST_MISSING = 0.2


class RecordError(ValueError):
    """A record can't be used; the message names what is wrong, the limit and the remedy."""


@dataclass(frozen=True)
class Record:
    """A space-time record of one or more components.

    Attributes:
        t: times, even, shape (nt,), s.
        x: receiver positions, ascending, shape (nx,), m.
        values: shape (C, nt, nx), any unit; finite, 0 at missing frames.
        names: of the components.
        ring: whether the receivers go evenly round a periodic bar, so that its wavenumbers are
            exact.
        quiet_from: time from which on no source acts, s.
        missing: frames that are missing, shape (nt,).
        sources: positions of sources, where known, m.
        notes: what was done to the record.
        lattice: whether the receivers are all the sites there are, so that k has no alias.
        answer: the truth, where the record is synthetic: {name: array}.
    """

    t: Float
    x: Float
    values: Float
    names: tuple[str, ...] = ("u",)
    ring: bool = False
    quiet_from: float = 0.0
    missing: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    sources: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()
    lattice: bool = False
    answer: dict[str, Any] | None = None

    @property
    def interval(self) -> float:
        """Time between frames, s."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @property
    def spacing(self) -> float:
        """Mean distance between receivers, m."""
        return float(self.x[-1] - self.x[0]) / max(len(self.x) - 1, 1)

    @property
    def even(self) -> bool:
        """Whether the receivers are evenly spaced."""
        gaps = np.diff(self.x)
        return len(gaps) > 0 and bool(np.ptp(gaps) <= _EVEN_RECEIVERS * gaps.mean())

    @property
    def aperture(self) -> float:
        """Length that the receivers cover, m; for a ring its circumference."""
        return self.spacing * (len(self.x) if self.ring else len(self.x) - 1)

    @property
    def noise(self) -> float:
        """Standard deviation of a white noise with the level of the highest tenth in frequency."""
        window = np.hanning(len(self.t))
        spectrum = np.abs(np.fft.rfft(self.values * window[:, None], axis=1)) ** 2
        top = spectrum[:, -max(4, spectrum.shape[1] // 10) : -1]
        return float(np.sqrt(np.median(top) / np.log(2) / np.sum(window**2)))

    def component(self, index: int) -> Record:
        """The record of one component alone."""
        return replace(
            self, values=self.values[index : index + 1], names=self.names[index : index + 1]
        )

    def since(self, time: float) -> Record:
        """The record from a time on, s."""
        first = int(np.searchsorted(self.t, time - 1e-9 * self.interval))
        if len(self.t) - first < FEWEST_FRAMES:
            raise RecordError(
                f"from t = {time:.4g} s on the record has {max(0, len(self.t) - first)} frames; "
                f"at least {FEWEST_FRAMES} are needed: lengthen the record, or name an earlier time"
            )
        return replace(
            self,
            t=self.t[first:],
            values=self.values[:, first:],
            missing=self.missing[first:] if len(self.missing) else self.missing,
        )


def record(
    values: ArrayLike,
    t: ArrayLike,
    x: ArrayLike,
    names: Sequence[str] = (),
    ring: bool = False,
    quiet_from: float = 0.0,
    sources: Sequence[float] = (),
    answer: dict[str, Any] | None = None,
    lattice: bool = False,
) -> Record:
    """A record from arrays, remedied where that can be done.

    Args:
        values: shape (nt, nx) or (C, nt, nx); NaN where a sample is missing.
        t: times, ascending, shape (nt,), s.
        x: receiver positions, shape (nx,), in any order, m.
        names: of the components.
        ring: whether the receivers go evenly round a periodic bar.
        quiet_from: time from which on no source acts, s.
        sources: positions of sources, m.
        answer: the truth, where it is known.
        lattice: whether the receivers are all the sites there are.

    Returns:
        The record; its notes say what was done.

    Raises:
        RecordError: it can't be used.
    """
    values, t, x = np.array(values, float), np.array(t, float), np.array(x, float)
    if values.ndim == 2:
        values = values[None]
    _check_shapes(values, t, x)
    notes: list[str] = []
    order = np.argsort(x, kind="stable")
    x, values = x[order], values[..., order]
    if len(x) > 1 and (np.diff(x) <= 0).any():
        twice = x[1:][np.diff(x) <= 0][0]
        raise RecordError(f"x = {twice:g} m: two receivers stand there; leave one out")
    values, t = _whole_frames(values, t, notes)
    values, x = _living(values, x, ring, notes)
    values, missing = _bridged(values, t, notes)
    values, t, missing = _even_times(values, t, missing, notes)
    if ring and not _is_even(x):
        raise RecordError(
            "ring: the receivers round a periodic bar must be evenly spaced; treat the record as "
            "a stretch instead"
        )
    labels = tuple(names) or tuple(f"u{i}" for i in range(len(values)))
    return Record(
        t,
        x,
        values,
        labels,
        ring=ring,
        quiet_from=float(quiet_from),
        missing=missing,
        sources=tuple(float(s) for s in sources),
        notes=tuple(notes),
        lattice=lattice,
        answer=answer,
    )


def _is_even(x: Float) -> bool:
    gaps = np.diff(x)
    return bool(np.ptp(gaps) <= _EVEN_RECEIVERS * gaps.mean())


def _check_shapes(values: Float, t: Float, x: Float) -> None:
    if values.ndim != 3 or values.shape[1:] != (len(t), len(x)):
        raise RecordError(
            f"values of shape {values.shape}: must be (frames, receivers) = ({len(t)}, {len(x)}), "
            "or that for each component"
        )
    if len(t) < FEWEST_FRAMES:
        raise RecordError(
            f"{len(t)} frames: at least {FEWEST_FRAMES} are needed; lengthen the record or sample "
            "it more often"
        )
    if len(x) < 2:
        raise RecordError(
            f"{len(x)} receiver: at least 2 are needed for a wavenumber, 3 where waves run both "
            "ways"
        )
    if not (np.isfinite(t).all() and np.isfinite(x).all()):
        raise RecordError("t or x: holds values that are not finite; give every time and position")
    if (np.diff(t) <= 0).any():
        at = int(np.argmax(np.diff(t) <= 0))
        raise RecordError(
            f"t[{at + 1}] = {t[at + 1]:g} s after t[{at}] = {t[at]:g} s: times must ascend; sort "
            "the frames"
        )


def _whole_frames(values: Float, t: Float, notes: list[str]) -> tuple[Float, Float]:
    """Frames left out of an even sequence of times, put in again as missing."""
    steps = np.diff(t)
    usual = float(np.median(steps))
    counts = np.maximum(1, np.round(steps / usual)).astype(int)
    regular = np.abs(steps - counts * usual) <= 1e-3 * usual
    if (counts == 1).all() or not regular.all():
        return values, t
    at = np.concatenate([[0], np.cumsum(counts)])
    if at[-1] + 1 > 4 * len(t):
        raise RecordError(
            f"t: {at[-1] + 1 - len(t)} of {at[-1] + 1} frames are missing; at most three quarters "
            "may be: use a part of the record"
        )
    filled = np.full((values.shape[0], at[-1] + 1, values.shape[2]), np.nan)
    filled[:, at] = values
    notes.append(f"{at[-1] + 1 - len(t)} frames are missing from the times")
    return filled, np.interp(np.arange(at[-1] + 1), at, t)


def _living(values: Float, x: Float, ring: bool, notes: list[str]) -> tuple[Float, Float]:
    """Without the receivers that say nothing."""
    finite = np.isfinite(values)
    size = np.nanmax(np.where(finite, np.abs(values), 0), axis=(0, 1))
    seen = ~(~finite).all(axis=(0, 2))
    if not seen.any():
        raise RecordError("no sample is finite: every receiver is dead or mostly missing")
    broken = (~finite[:, seen]).mean(axis=(0, 1)) > _MOST_MISSING
    varies = np.nanmax(np.where(finite, values, -np.inf), axis=1) - np.nanmin(
        np.where(finite, values, np.inf), axis=1
    )
    still = np.nan_to_num(varies, nan=0, neginf=0).max(axis=0) <= _DEAD * max(size.max(), 1e-300)
    # On a ring a wave that does not travel leaves receivers rightly at rest.
    dead = broken if ring else broken | still
    if not dead.any():
        return values, x
    where = ", ".join(f"{p:g}" for p in x[dead][:6]) + (", …" if dead.sum() > 6 else "")
    if len(x) - dead.sum() < 2:
        raise RecordError(
            f"{dead.sum()} of {len(x)} receivers are dead or mostly missing (x = {where} m); at "
            "least 2 must live"
        )
    if ring:
        raise RecordError(
            f"receivers at x = {where} m are dead, so that the ring is not whole: treat the record "
            "as a stretch instead"
        )
    notes.append(f"{dead.sum()} dead receivers left out (x = {where} m)")
    return values[..., ~dead], x[~dead]


def _bridged(values: Float, t: Float, notes: list[str]) -> tuple[Float, NDArray[np.bool_]]:
    """Short breaks at single receivers filled by a spline; longer ones make the frame missing."""
    absent = ~np.isfinite(values)
    missing: NDArray[Any] = np.asarray(absent.all(axis=(0, 2)))
    single = absent & ~missing[:, None]
    filled = 0
    for c, r in zip(*np.nonzero(single.any(axis=1)), strict=True):
        gone = single[c, :, r]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], gone.astype(int), [0]])))
        for start, stop in edges.reshape(-1, 2):
            if stop - start > _BRIDGED or start < 2 or stop > len(t) - 2:
                missing[start:stop] = True
        own = ~absent[c, :, r]
        bridge = gone & ~missing
        if bridge.any():
            values[c, bridge, r] = CubicSpline(t[own], values[c, own, r])(t[bridge])
            filled += int(bridge.sum())
    if filled:
        notes.append(f"{filled} missing samples bridged by a cubic spline")
    if missing.any():
        notes.append(f"{missing.sum()} of {len(t)} frames count as missing")
    if missing.sum() > len(t) - FEWEST_FRAMES:
        raise RecordError(
            f"{missing.sum()} of {len(t)} frames hold values that are not finite; at least "
            f"{FEWEST_FRAMES} whole ones are needed"
        )
    values[:, missing] = 0.0
    return values, missing


def _even_times(
    values: Float, t: Float, missing: NDArray[np.bool_], notes: list[str]
) -> tuple[Float, Float, NDArray[np.bool_]]:
    """Resample to even times where they are not."""
    even = np.linspace(t[0], t[-1], len(t))
    step = even[1] - even[0]
    off = float(np.abs(t - even).max() / step)
    if off <= _EVEN_TIMES:
        return values, even, missing
    own = ~missing
    longest = float(np.diff(t).max())
    if longest > 8 * step:
        raise RecordError(
            f"t: the longest interval, {longest:.4g} s, is {longest / step:.3g} times the mean; "
            "sample evenly, or use the part before or after it"
        )
    values = CubicSpline(t[own], values[:, own], axis=1)(even)
    gone = np.asarray(PchipInterpolator(t, missing.astype(float))(even) > 1e-9)
    values[:, gone] = 0.0
    notes.append(
        f"times uneven by up to {off:.2g} of their interval: resampled by a cubic spline, which "
        "is good to 1 % only up to about a fifth of the sampling frequency"
    )
    return values, even, gone
