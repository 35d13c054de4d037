"""A gain that changes in time, told by the noise: an instrument's is as loud all through.

Noise is seen by sixth differences, in blocks of channels. A gain that follows the signal, as an
automatic one, leaves less beneath it than where noise is alone. One that grows in time, as e^{at}
or tⁿ, makes what is alone grow too, in all alike; a window (Hann's, or modal analysis' e^{−at})
bends what is alone before the wave and behind it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# So many blocks, of so many samples at least, at so many channels, by differences of that order;
# it is heard above this part of the loudest.
_PARTS, _SAMPLES, _CHANNELS, _ORDER, _ROUNDING, _MEDIAN = 16, 8, 64, 6, 1e-9, 0.455 * 924
# Noise is alone where it is so much of all that is there, and beneath a signal where so much, as it
# is of what is alone where a gain follows that.
_ALONE, _BENEATH = 0.5, 0.15
# It grows by more nepers than this, and than so many of its errors (the variance of the logarithm
# of a median of m samples is the last over m), and goes on by that part of it in the later half.
_GROWS, _ERRORS, _CHANCE, _GOES_ON = 0.35, 8.0, 1.5, 0.25
# So many of these, or errors, on one side of the wave under a window, behind it so many times as
# steep later on; of one that falls so much across it.
_RISES, _STEEPER, _FALLS = 4.0, 1.5, 0.5
# More blocks, or so many channels, tell.
_SEVERAL = 3
_AT = np.arange(_PARTS)[:, None] / _PARTS


@dataclass(frozen=True)
class _Noise:
    """Noise in blocks of m samples of channels: its logarithm, where it is alone, (16, nx)."""

    log: Float
    alone: Mask
    samples: int

    @property
    def before(self) -> Mask:
        """Where it is alone before anything else comes."""
        return np.asarray(np.logical_and.accumulate(self.alone, axis=0))

    @property
    def after(self) -> Mask:
        """Where it is alone after all else has gone."""
        return np.asarray(np.logical_and.accumulate(self.alone[::-1], axis=0)[::-1] & ~self.before)

    def growth(self, of: Mask) -> tuple[float, float]:
        """Nepers that noise grows by over the record, in some blocks of channels, and its error."""
        count = of.sum(axis=0)
        late, own = (
            (w - (w * of).sum(axis=0) / np.maximum(count, 1)) * of
            for w in np.broadcast_arrays(_AT, self.log)
        )
        spread = max(float(np.sum(late**2)), 1e-300)
        slope = float(np.sum(late * own)) / spread
        spare = max(int(count.sum() - (count > 0).sum()) - 1, 1)
        left = float(np.sum((own - slope * late) ** 2)) / spare
        return slope, float(np.sqrt(max(left, _CHANCE / self.samples) / spread))

    def halves(self, of: Mask) -> tuple[float, float]:
        """The growth in the earlier and in the later half of some blocks."""
        late = np.arange(_PARTS)[:, None] > np.median(np.nonzero(of)[0])
        return self.growth(of & ~late)[0], self.growth(of & late)[0]


def unsteady(v: Float) -> tuple[str, str]:
    """How noise of channels, (nt, nx), changes in time, and how it follows the signal, or ""."""
    m, v = len(v) // _PARTS, v[:, :: max(1, v.shape[1] // _CHANNELS)]
    if m < _SAMPLES:
        return "", ""
    size = np.array([v[a * m : (a + 1) * m].std(axis=0) for a in range(_PARTS)])
    sixth = np.diff(v, _ORDER, axis=0)[: m * _PARTS - _ORDER]
    parts = [np.median(part**2, axis=0) for part in np.array_split(sixth, _PARTS)]
    noise = np.sqrt(np.array(parts) / _MEDIAN)
    heard = noise > _ROUNDING * size.max()
    alone, beneath = heard & (noise > _ALONE * size), heard & (noise < _BENEATH * size)
    seen = _Noise(np.log(np.maximum(noise, 1e-300)), alone, m)
    changes = _grows(seen) or _windowed(seen) or _falls(seen)
    return changes, _follows(noise, alone, beneath)


def _told(growth: float) -> str:
    return f"{np.exp(growth):.2g} times as loud at the end as at the beginning"


def _grows(seen: _Noise) -> str:
    """A gain goes on growing, and what waves bring with them (scattering, a shaker) does not."""
    rows = np.flatnonzero(seen.alone.any(axis=1))
    slope, error = seen.growth(seen.alone)
    if len(rows) <= _SEVERAL or slope <= max(_GROWS, _ERRORS * error):
        return ""
    few = (rows > np.median(np.nonzero(seen.alone)[0])).sum() < 2
    return _told(slope) if few or seen.halves(seen.alone)[1] > _GOES_ON * slope else ""


def _windowed(seen: _Noise) -> str:
    """A window bends noise before anything has come, from the first sample on, as no wave does
    whose foot has periods of few samples; behind the wave noise falls to nothing ever faster, where
    what a wave leaves behind dies away ever more slowly, down to the instrument's own."""
    for side, sign, said in (
        (seen.before, 1, "growing before anything comes"),
        (seen.after, -1, "falling ever faster after all has gone"),
    ):
        rise, sure = seen.growth(side)
        if side.any(axis=1).sum() > _SEVERAL and sign * rise > _RISES * max(_GROWS, sure):
            early, late = seen.halves(side)
            if late < _STEEPER * min(early, 0) if sign < 0 else min(early, late) > _GOES_ON * rise:
                return said
    return ""


def _falls(seen: _Noise) -> str:
    """Of a window that only falls noise is less behind the wave than before it, by as much as it
    falls all along."""
    (slope, error), before, after = seen.growth(seen.alone), seen.before, seen.after
    both = before.any(axis=0) & after.any(axis=0)
    if both.sum() < _SEVERAL or slope >= -max(_GROWS, _ERRORS * error):
        return ""
    means = [[np.sum(w * of, axis=0)[both] / of.sum(axis=0)[both] for w in (seen.log, _AT)]
             for of in (before, after)]  # fmt: skip
    fall, apart = np.subtract(means[1], means[0])
    return _told(slope) if np.median(fall / apart) < _FALLS * slope else ""


def _follows(noise: Float, alone: Mask, beneath: Mask) -> str:
    """Less noise beneath a signal than without it, as a gain that follows that leaves."""
    own = np.flatnonzero(alone.any(axis=0) & beneath.any(axis=0))
    if len(own) < max(_SEVERAL, noise.shape[1] / 2):
        return ""
    less = np.median([np.median(noise[beneath[:, j], j]) / np.median(noise[alone[:, j], j])
                      for j in own])  # fmt: skip
    return f"{100 * less:.2g} % as loud beneath the signal as without it" if less < _BENEATH else ""
