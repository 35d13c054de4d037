"""What a line of receivers leaves open in k: folding about ±π/d, spreading, rounded positions.

A wavenumber is known but for multiples of 2π/d, d the receivers' spacing: Re k that runs through
π/d between two frequencies comes back at −π/d, as a wave that it is not. Waves that spread from a
point fall off as r^{−p}, p = 1/2 on a surface and 1 in a body, which a plane wave's Im k takes for
a loss of p/r.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.damped_transform import damped_transform
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.records.record import Record

Float = NDArray[Any]

FOLDED = (
    "folded: receivers are more than half a wavelength apart, so that k is known but for multiples "
    "of 2π/d; space them closer"
)
# Re k runs through π/d where it changes sign between neighbours, both beyond this part of it.
_NEAR = 0.4
# Unfolded by the signal's own speed, so many points lie within so much of it.
_AGREE, _CLOSE = 0.8, 0.1
_POWERS = (0.5, 1.0)
_NAMES = {0.5: "cylindrical", 1.0: "spherical"}
# A power of the distance is believed where it leaves this part of what an exponential does.
_BETTER = 0.2
_FEWEST = 6


def folded(points: BranchPoints, x: Float, speed: float) -> BranchPoints:
    """Points with those refused whose Re k is, or may be, another's by 2π/d.

    Args:
        points: k at ascending ω, one wave.
        x: positions of the receivers, ascending, shape (m,), m.
        speed: at which the signal goes along them, m/s; NaN where it is not known.
    """
    gaps = np.diff(x)
    if len(gaps) < 1 or np.ptp(gaps) > 0.05 * gaps.mean():
        return points  # uneven receivers fold no two wavenumbers into one
    edge = np.pi / float(gaps.mean())
    omega, k = points.omega.real, points.k.real
    own = np.flatnonzero(points.valid)
    wrong = np.zeros(len(points), bool)
    # No wave of a passive medium runs with its phases backward but near such an edge.
    wrong[own] = k[own] < -0.05 * edge
    order = own[np.argsort(omega[own], kind="stable")]
    through = np.flatnonzero((k[order[:-1]] > _NEAR * edge) & (k[order[1:]] < -_NEAR * edge))
    if len(through):
        wrong |= points.valid & (omega >= omega[order[through[0] + 1]])
    if np.isfinite(speed) and speed > 0 and len(own):
        turns = np.round((omega / speed - k) / (2 * edge))
        unfolded = k + 2 * edge * turns
        close = np.abs(unfolded - omega / speed) < _CLOSE * omega / speed
        if np.mean(close[own]) > _AGREE:
            wrong |= points.valid & (turns != 0)
    return points.refused(wrong, FOLDED)


def spreading(U: Any, used: NDArray[np.bool_], x: Float, k: Any) -> tuple[float, float] | None:
    """Power and origin of a spreading that amplitudes show, as no exponential does.

    With |U_j| ∝ (x_j − x_s)^{−p} e^{−α(ω)x_j} the logarithms bend alike at all frequencies.

    Args:
        U: spectra, shape (n, m).
        used: which are above the noise, shape (n, m).
        x: positions, ascending, shape (m,), m.
        k: wavenumbers found, shape (n,), rad/m; NaN where none was.

    Returns:
        p and x_s, m; None where an exponential does.
    """
    whole = used.all(axis=1) & np.isfinite(k)
    if whole.sum() < 3 or len(x) < _FEWEST:
        return None
    heights = np.log(np.abs(U[whole]))
    s = (x - x.mean()) / np.ptp(x)

    def left(bend: Float) -> Float:
        rest = heights - bend
        rest = rest - rest.mean(axis=1, keepdims=True)
        slope = rest @ s / np.sum(s * s)
        return np.asarray(rest - slope[:, None] * s)

    plain = left(np.zeros(len(x)))
    shape = np.median(plain, axis=0)
    before = float(np.sum(shape**2))
    scatter = float(np.median(np.abs(plain - shape))) * 1.4826 / np.sqrt(whole.sum())
    if np.sqrt(before / len(x)) < 5 * scatter or np.sqrt(before / len(x)) < 1e-3:
        return None
    best: tuple[float, float, float] | None = None
    for side in (-1, 1):
        end = x[0] if side < 0 else x[-1]
        for away in np.ptp(x) * np.geomspace(0.02, 5, 60):
            origin = end + side * away
            for power in _POWERS:
                rest = np.median(left(-power * np.log(np.abs(x - origin))), axis=0)
                after = float(np.sum(rest**2))
                if best is None or after < best[0]:
                    best = after, power, float(origin)
    assert best is not None
    return (best[1], best[2]) if best[0] < _BETTER * before else None


def spreading_of(record: Record, points: BranchPoints) -> tuple[float, float] | None:
    """:func:`spreading` of a record along its longest stretch without a source, by its points."""
    from wavesim.readings.dispersion.wavenumber_at_frequency import line_of

    first = points.take(np.unique(points.omega.real, return_index=True)[1])
    receivers, x = line_of(record)
    component = int(np.argmax(np.abs(record.values).max(axis=(1, 2))))
    values = record.values[component][:, receivers]
    sigma = float(first.omega.imag[0])
    t = record.t - record.t[0]
    U = damped_transform(values, t, first.omega.real, sigma)
    step = record.interval
    weights = np.sqrt(step / (2 * sigma)) * np.sqrt(step)
    used = np.abs(U) > 10 * record.noise * weights
    k = np.where(first.valid, first.k, np.nan)
    return spreading(U, used, x, k)


def told(power: float, origin: float) -> str:
    """The spreading in words."""
    return (
        f"amplitudes fall off as r^-{power:g} from about x = {origin:.3g} m ({_NAMES[power]} "
        f"spreading): Im k is that of plane waves, {power:g}/r of it is no loss, and the bars hold "
        f"that; give --spreading {_NAMES[power]} with --source to take it out"
    )


def widened(points: BranchPoints, x: Float, power: float, origin: float) -> BranchPoints:
    """Points whose errors hold what spreading adds to Im k: p ln(r₂/r₁)/(x₂ − x₁)."""
    r = np.abs(x - origin)
    added = power * abs(np.log(r[-1] / r[0])) / (x[-1] - x[0])
    return replace(points, error=np.hypot(points.error, added))


def with_axes(points: BranchPoints, interval_error: float, spacing_error: float) -> BranchPoints:
    """Points whose errors hold what rounding leaves open of the interval and the spacing."""
    if not (interval_error or spacing_error):
        return points
    part = np.abs(points.k) * np.hypot(interval_error, spacing_error)
    return replace(points, error=np.hypot(points.error, part))
