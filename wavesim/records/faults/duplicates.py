"""Channels that are no signals of their own: those that hold the times, or another's samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places

Float = NDArray[Any]
Mask = NDArray[np.bool_]


def clocks(values: Float) -> Mask:
    """Channels that hold nothing but the times, in whatever unit, shape (nx,)."""
    component = values[0]
    s = np.linspace(-1, 1, len(component))
    with np.errstate(invalid="ignore"):
        rising = (np.diff(component, axis=0) > 0).all(axis=0)
    found = np.zeros(component.shape[1], bool)
    for j in np.flatnonzero(rising):
        v = component[:, j]
        slope = float(np.sum(s * v) / np.sum(s * s))
        found[j] = np.abs(v - v.mean() - slope * s).max() < 1e-3 * np.ptp(v)
    return found if len(values) == 1 and not found.all() else np.zeros_like(found)


def duplicates(
    values: Float, x: Float, noisy: bool, found: list[Finding], labels: tuple[str, ...]
) -> Mask:
    """Channels to leave out because they hold the samples of another.

    Args:
        values: shape (C, nt, nx), as recorded.
        x: positions, m.
        noisy: whether the channels hold noise, so that no two are alike by right.
        found: findings, added to.
        labels: names of the receivers.
    """
    nx = values.shape[2]
    out = np.zeros(nx, bool)
    if nx < 3:
        return out
    flat = np.moveaxis(values, 2, 0).reshape(nx, -1)
    alive = np.nanmax(flat, axis=1) > np.nanmin(flat, axis=1)
    seen: dict[bytes, int] = {}
    pairs = []
    for j in np.flatnonzero(alive):
        key = flat[j].tobytes()
        if key in seen:
            pairs.append((seen[key], int(j)))
        seen[key] = int(j)
    if not pairs:
        return out
    # A symmetric field repeats itself about its middle.
    pairs = [(i, j) for i, j in pairs if not _alike(flat[(i + 1) % nx], flat[j - 1])
             or not _alike(flat[i - 1], flat[(j + 1) % nx])]  # fmt: skip
    if pairs == [(0, nx - 1)] and nx > 4:
        gaps = np.diff(x)
        if np.ptp(gaps) <= 1e-3 * gaps.mean():
            out[-1] = True
            where = places(x, [nx - 1], labels)
            found.append(
                Finding("end point twice", where, "1 receiver", TAKEN_OUT,
                        "the first and the last receiver are identical, a ring's end point counted "
                        f"twice: the last left out ({where})")
            )  # fmt: skip
            return out
    if not noisy:
        pairs = [p for p in pairs if p[1] == p[0] + 1]
    if not pairs or len(pairs) > nx / 3:
        return out
    for pair in pairs:
        out[list(pair)] = True
    where = places(x, out, labels)
    if (~out).sum() < 2:
        out[:] = False
    found.append(
        Finding("duplicate", where, f"{len(pairs)} pairs", TAKEN_OUT if out.any() else "told",
                f"receivers hold the same samples, so that which of them is right is not known: "
                f"{'left out' if out.any() else 'too few others to leave them out'} ({where})")
    )  # fmt: skip
    return out


def _alike(a: Float, b: Float) -> bool:
    return bool(np.nanmax(np.abs(a - b)) <= 1e-6 * np.nanmax(np.abs(a)))


# No more than this part of the frames may be there twice, or, where times fall back, of them all;
# programs that go on write them again to this part of the largest.
_FRAMES_TWICE, _WRITTEN_AGAIN, _ALIKE_AGAIN = 0.01, 0.75, 1e-6


def without_frames_twice(values: Float, t: Float, found: list[Finding]) -> tuple[Float, Float]:
    """One of each of a few frames that are there twice, time and samples.

    A program that goes on from where it last stored its state writes again what came after: times
    fall back, and frames that were there come once more.

    Args:
        values: shape (C, nt, nx), NaN where a sample is missing.
        t: shape (nt,), s.
        found: findings, added to.
    """
    falls = np.flatnonzero(np.diff(t) < 0)
    # Times that begin anew are of another record.
    given, again = (values, t), len(falls) > 0 and bool(t[falls + 1].min() > t[0])
    if not again and (np.diff(t) > 0).all():
        return given
    if again:
        order = np.argsort(t, kind="stable")
        values, t = values[:, order], t[order]
    twice, alike = np.r_[False, np.diff(t) == 0], np.ones(len(t), bool)
    near = _ALIKE_AGAIN * float(np.nanmax(np.abs(values))) if again else 0.0
    apart = np.abs(values[:, 1:] - values[:, :-1])
    alike[1:] = ((apart <= near) | np.isnan(values[:, 1:])).all(axis=(0, 2))
    part, whole = _FRAMES_TWICE, True
    if again:
        part, whole = _WRITTEN_AGAIN, bool(alike[twice].all())
    twice &= alike
    if not whole or not 0 < twice.sum() <= part * len(t):
        return given
    said = f"{int(twice.sum())} frames there twice, time and samples: one of each taken"
    found.append(
        Finding("frames twice", "all receivers", f"{int(twice.sum())} frames", CURED, said)
    )
    return np.array(values[:, ~twice]), np.array(t[~twice])
