"""Which way waves along a line go: by when they come, by their phases, by their amplitudes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.points import BranchPoints

Float = NDArray[Any]

GROWS = (
    "amplitudes grow the way that the waves go, as of no one wave in a medium: receivers differ in "
    "gain, several waves pass, or the times run backward; make gains equal, add receivers, or give "
    "--interval where only the times count down"
)
# A wave grows where its loss is below 0 by so many 95 % bars.
_SURELY_GROWS = 1.5
# Arrivals tell a direction by so many errors.
_SURELY = 4.0
# Where its envelope is this high it goes about as fast as its top, by this part.
_SHOULDER, _ALIKE = 0.8, 0.5
# A pulse's k is about sω to this part.
_ABOUT = 0.3


def slowness(size: Float, t: Float, x: Float, period: float) -> float:
    """Of the signal along x by when it comes to receivers, s/m; 0 where it is unsure.

    It is so where the tops of its envelopes, and where these rise to four fifths of them and fall
    from there, do not go alike: of a long signal with several tops each receiver may hear another.

    Args:
        size: envelopes at the receivers, shape (nt, nx).
        t: times, shape (nt,), s.
        x: positions, shape (nx,), m.
        period: of the signal, s.
    """
    high = size >= _SHOULDER * size.max(axis=0)
    rises, falls = t[high.argmax(axis=0)], t[len(t) - 1 - high[::-1].argmax(axis=0)]
    away = x - x.mean()
    each = [away @ come / (away @ away) for come in (rises, t[size.argmax(axis=0)], falls)]
    come, late = t[size.argmax(axis=0)], float(each[1])
    left = come - come.mean() - late * away
    error = float(np.sqrt(left @ left / max(len(x) - 2, 1) / (away @ away)))
    sure = abs(late) > _SURELY * error and abs(late) * np.ptp(x) > period / 12
    alike = all(abs(one - late) < _ALIKE * abs(late) + period / 12 / np.ptp(x) for one in each)
    return late if sure and alike else 0.0


def runs_on(points: BranchPoints, late: float, gap: float, width: float) -> NDArray[np.bool_]:
    """Points of a pulse whose phases run on by more than a turn within its band.

    Its phases between receivers d apart change by d s dω: those below half a turn lie in no more
    than a turn of it, whatever part of them seems to; at its begin, where k is about sω.

    Args:
        points: of waves.
        late: s, its slowness, s/m.
        gap: d, of receivers on an even line that folds at the same k, m.
        width: of its band, whatever part of that is asked for, rad/s.
    """
    expected = abs(late) * points.omega.real
    near = np.abs(np.abs(points.k.real) - expected) < _ABOUT * expected
    begins = near & (expected * gap < np.pi)
    return ~begins & bool(abs(late) * gap * width > 2 * np.pi)


def against_travel(points: BranchPoints, late: float, models: Any) -> tuple[Any, Any]:
    """Waves one way, of which phases run another than they come; of which amplitudes grow so.

    Args:
        points: in the order of the models.
        late: of :func:`slowness`.
        models: number of pairs, whether both ways, and the fit of each frequency.
    """
    goes = float(np.sign(late))
    turned = np.concatenate([fit.backward[i, :pairs] > fit.forward[i, :pairs]
                             for i, (pairs, _, fit) in enumerate(models)])  # fmt: skip
    alone = np.repeat([not both for _, both, _ in models], [pairs for pairs, _, _ in models])
    fades = np.where(turned, -1, 1)
    # Where arrivals tell nothing, a wave goes the way that it fades.
    along = points.k.real * (fades * goes if goes else points.k.imag > points.bar)
    folded = alone & (along < -points.bar)
    grows = alone & points.valid & bool(goes) & (fades != goes) & (points.k.imag > points.bar)
    grows &= 2 * grows.sum() > points.valid.sum()
    return folded, grows | _grows_at_real_frequencies(points)


def _grows_at_real_frequencies(points: BranchPoints) -> NDArray[np.bool_]:
    """Points of waves that grow as they go, which all the same fade at the complex ω + iσ.

    In a medium without sources Im k ≥ 0 wherever Im ω ≥ 0, and so, by Poisson's integral of Im k
    over real frequencies,

        Im k(ω + iσ) ≥ σ dRe k/dω,

    equal where nothing is lost: what is left over is the loss. Of a record that runs backward, or
    of gains that grow along the line, it is below 0.

    Args:
        points: valid or not, with their branches.
    """
    grows = np.zeros(len(points), bool)
    for b in np.unique(points.branch[points.valid & (points.branch >= 0)]):
        own = np.flatnonzero(points.valid & (points.branch == b))
        own = own[np.argsort(points.omega.real[own])]
        k = np.where(points.k.imag[own] < 0, -1, 1) * points.k[own]
        omega, sigma = points.omega.real[own], points.omega.imag[own]
        if np.ptp(omega) < 2 * sigma.max():
            continue
        # Over ±σ a slope is known about as well as k/σ.
        ends = np.clip([omega - sigma, omega + sigma], omega[0], omega[-1])
        slope = np.diff(np.interp(ends, omega, k.real), axis=0)[0] / np.diff(ends, axis=0)[0]
        grows[own] = k.imag - sigma * slope < -_SURELY_GROWS * points.bar[own]
    return grows & (2 * grows.sum() > points.valid.sum())
