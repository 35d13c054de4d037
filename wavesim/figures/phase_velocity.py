"""Power over frequency and phase velocity of a line that waves pass, and the modes picked in it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from wavesim.figures.style import MAP, THEORY, plot_branch
from wavesim.material.shown import HERTZ
from wavesim.readings.dispersion.beam import highest_wavenumber, phase_beam, transform, weights
from wavesim.readings.dispersion.noise_level import noise_of_transform
from wavesim.readings.dispersion.points import BAR
from wavesim.readings.dispersion.waves_along_line import one_side
from wavesim.verdict.record import Recovered

_VELOCITIES = 400
_MOST_FREQUENCIES = 500
_ROOM = 1.35


def _span(one: Recovered) -> tuple[float, float, float, float]:
    """Lowest and highest frequency (rad/s) and phase velocity (m/s) shown."""
    points = one.points
    own = points.take(points.valid) if points.valid.any() else points
    if not len(own):
        return 0.0, np.pi / one.origin.record.interval, 1.0, 10.0
    c = np.quantile(own.phase_velocity, (0.02, 0.98))
    return (
        float(own.omega.min()) / _ROOM, float(own.omega.max()) * _ROOM,
        float(c[0]) / _ROOM, float(c[1]) * _ROOM,
    )  # fmt: skip


def phase_velocity(one: Recovered) -> Figure:
    """B(k = ω/c, ω), with the points that count, their 95 % bars, and where c is out of reach.

    Above the dashed line a wave is longer than the line, below the dotted one shorter than two
    distances between receivers.
    """
    record, points = one_side(one.origin.record.without_gaps()), one.points
    values, x = record.values[0], record.x
    low, high, slow, fast = _span(one)
    omega, U = transform(values, record.interval)
    rows = np.flatnonzero((omega >= low) & (omega <= high))
    rows = rows[:: max(1, len(rows) // _MOST_FREQUENCIES)]
    omega, U = omega[rows], U[rows]
    weight = weights(U, noise_of_transform(values, record.interval, omega))
    c = np.geomspace(slow, fast, _VELOCITIES)
    k = omega[:, None] / c
    height = np.maximum(*(phase_beam(U, x, weight, sign * k) for sign in (1, -1)))
    unit, prefix = (1e-3, "k") if float(omega.max()) * HERTZ >= 1e3 else (1.0, "")
    to_f = HERTZ * unit
    figure = Figure(figsize=(6.0, 4.6))
    axes = figure.subplots()
    image = axes.pcolormesh(
        omega * to_f, c, height.T, cmap=MAP, vmin=0, vmax=1, shading="nearest", rasterized=True
    )
    for branch in points.branches:
        own = points.take(points.branch == branch)
        error = BAR * own.phase_velocity_error
        label = f"mode {branch + 1}, 95 %"
        plot_branch(axes, branch, own.omega * to_f, own.phase_velocity, error, label)
    if one.origin.theory is not None:
        fine = np.linspace(float(k.min()), float(k.max()), 800)
        curves = np.real(one.origin.theory[0].omega(fine))
        lines = axes.plot(curves * to_f, curves / fine[:, None], color=THEORY, lw=0.8)
        lines[0].set_label("theory")
    aperture, gap = float(np.ptp(x)), np.pi / highest_wavenumber(x)
    axes.plot(omega * to_f, omega * aperture / (2 * np.pi), "--", color="#555555", lw=0.9)
    axes.plot(omega * to_f, omega * gap / np.pi, ":", color="#555555", lw=1.1)
    axes.set(
        xlabel=f"frequency ({prefix}Hz)", ylabel="phase velocity (m/s)",
        xlim=(omega[0] * to_f, omega[-1] * to_f), ylim=(slow, fast),
    )  # fmt: skip
    axes.set_title(f"{one.origin.name}: phases in line, B(f, c)")
    figure.legend(loc="outside lower center", ncols=4)
    figure.colorbar(image, ax=axes, label="B")
    return figure
