"""Figures of what was recovered of a record: spectrum, c(f), attenuation; a record over a case."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from wavesim.figures import style
from wavesim.figures.style import (
    FOUND,
    MAP,
    MARKS,
    POINT,
    SHADES,
    THEORY,
    as_written,
    cell_ends,
    gap_edges,
    plot_branch,
    shade,
)
from wavesim.material.shown import DECIBELS, in_frequency, in_wavenumber
from wavesim.readings.dispersion.fft_peaks import power
from wavesim.readings.dispersion.frequency_at_wavenumber import series
from wavesim.readings.dispersion.phase_beam import highest_wavenumber, phase_beam
from wavesim.readings.dispersion.points import BAR, METHODS
from wavesim.readings.dispersion.receiver_spectra import spectra
from wavesim.readings.dispersion.waves_along_line import one_side
from wavesim.verdict.record import Recovered
from wavesim.verdict.recovered_points import Matched, MatchedInSpace

if TYPE_CHECKING:
    from wavesim.readings.misfit import Comparison

_MOST_POINTS = 60
_DEEPEST = -100.0


def spectrum(one: Recovered) -> Figure:
    """Power over k and ω, the points with their 95 % bars, and theory where it is known."""
    points, record = one.points, one.origin.record
    quiet = record.since(record.quiet_from)
    k, channels = series(quiet, float(points.k.max(initial=0)) or None)
    heights, per_bin = power(channels)
    omega = np.arange(heights.shape[1]) * per_bin / quiet.interval
    shown = points.take(points.valid)
    top = 1.15 * float(shown.omega.max(initial=omega[-1] / 1.15))
    kept = omega <= top
    to_k, k_unit = in_wavenumber(float(k[-1]))
    to_f, f_unit = in_frequency(top)
    figure = style.bare_figure(5.8, 4.6)
    axes = figure.subplots()
    image = axes.imshow(
        10 * np.log10(np.maximum(heights[:, kept].T / heights.max(), 1e-15)),
        origin="lower",
        aspect="auto",
        extent=(*cell_ends(k * to_k, len(k)), *cell_ends(omega[kept] * to_f, int(kept.sum()))),
        cmap=MAP,
        vmin=_DEEPEST,
        vmax=0,
        interpolation="nearest",
    )
    if one.origin.theory is not None:
        fine = np.linspace(k[0] / 10, k[-1], 400)
        lines = axes.plot(
            fine * to_k, np.real(one.origin.theory[0].omega(fine)) * to_f, color=THEORY, lw=0.8
        )
        lines[0].set_label("theory")
    for branch in points.branches:
        own = points.take(points.branch == branch)
        every = slice(None, None, max(1, len(own) // _MOST_POINTS))
        shown_k, bar = own.k[every] * to_k, own.bar[every] * to_f
        label = f"branch {branch + 1}, 95 %"
        plot_branch(axes, branch, shown_k, own.omega[every] * to_f, bar, label)
    lone = shown.take(shown.branch < 0)
    if len(lone):
        axes.plot(lone.k * to_k, lone.omega * to_f, "x", ms=4, color="#555555", label="no branch")
    axes.set(
        xlabel=f"k (rad/{k_unit})", ylabel=f"ω/2π ({f_unit})", xlim=(0, None), ylim=(0, top * to_f)
    )
    axes.set_title(f"{style.name_in_title(one.origin.name)}: {METHODS[points.method]}", y=1.01)
    figure.colorbar(image, ax=axes, label="power (dB)", pad=0.03)
    style.set_out(figure, right=0.3)
    return figure


def residuals(one: Recovered) -> Figure:
    """Relative error of each wave against the grid and against the continuum, with its bar."""
    matched = one.matched
    assert isinstance(matched, Matched)
    to_k, unit = in_wavenumber(float(matched.k.max()))
    references = (("against the continuum", True),)
    if one.origin.bar is not None:
        references = (("against the grid's exact relation", False), *references)  # type: ignore[assignment]
    figure = style.bare_figure(4.2 * len(references) + 0.4, 3.9)
    panels = np.atleast_1d(figure.subplots(1, len(references), sharey=True))
    for axes, (title, continuum) in zip(panels, references, strict=True):
        for b, name in enumerate(matched.names):
            error = np.maximum(matched.error(continuum)[:, b], 1e-16)
            every = slice(None, None, max(1, len(error) // (2 * _MOST_POINTS)))
            shade = SHADES[b % 6]
            axes.plot(
                matched.k[every] * to_k, error[every], MARKS[b % 6], **POINT, mec=shade, label=name
            )
            bar = (matched.bar / matched.omega)[:, b]
            axes.plot(matched.k * to_k, bar, color=shade, lw=0.8, label=f"{name}, 95 % bar")
        style.decades(axes)
        axes.set_xlabel(f"k (rad/{unit})")
        axes.set_title(title, y=1.01)
        axes.grid(alpha=0.25, lw=0.5)
    panels[0].set_ylabel("|Δω|/ω")
    figure.suptitle(style.name_in_title(one.origin.name))
    style.set_out(figure, left=0.95)
    return figure


def attenuation(one: Recovered) -> Figure:
    """Attenuation and Re k with 95 % bands, theory at the same complex ω, and what was refused."""
    points = one.points
    to_f, f_unit = in_frequency(float(points.omega.real.max()))
    figure = style.bare_figure(6.0, 5.6)
    loss, real = figure.subplots(2, 1, sharex=True)
    frequency = points.omega.real * to_f
    to_k, k_unit = in_wavenumber(float(np.abs(points.k.real).max()))
    decibels = DECIBELS * to_k
    parts: tuple[tuple[Any, Callable[[Any], Any], float, str], ...] = (
        (loss, np.imag, decibels, f"attenuation (dB/{k_unit})"),
        (real, np.real, to_k, f"Re k (rad/{k_unit})"),
    )
    valid = points.valid
    for axes, part, factor, label in parts:
        for branch in points.branches:
            own = points.branch == branch
            middle, bar = factor * part(points.k[own]), factor * points.bar[own]
            axes.fill_between(
                frequency[own], middle - bar, middle + bar, color=FOUND, alpha=0.25, lw=0,
                label="95 % band" if branch == 0 else None,
            )  # fmt: skip
        middle = factor * part(points.k[valid])
        axes.plot(frequency[valid], middle, "o", **POINT, mec=FOUND, label="measured")
        for number, at in enumerate(frequency[~valid]):
            axes.axvline(at, color="#888888", lw=0.6, ls=":", label=None if number else "refused")
        if one.origin.theory is not None:
            fine = np.linspace(points.omega.real.min(), points.omega.real.max(), 1500)
            sigma = float(points.omega.imag[0])
            exact = one.origin.theory[0].wavenumber(fine + 1j * sigma)
            axes.plot(
                fine * to_f, factor * part(exact), color=THEORY, lw=0.9, label="theory, ω + iσ"
            )
            assert one.origin.medium is not None
            sector = one.origin.block.sector  # type: ignore[union-attr]
            shade(axes, gap_edges(one.origin.medium, sector, to_f), named=axes is loss)
        axes.set_ylabel(label)
        shown = factor * part(points.k[valid])
        if len(shown):
            room = 0.12 * max(float(np.ptp(shown)), 1e-300)
            axes.set_ylim(shown.min() - room, shown.max() + room)
    real.set_xlabel(f"ω/2π ({f_unit})")
    name, sigma = style.name_in_title(one.origin.name), points.omega.imag[0]
    loss.set_title(f"{name}: k at ω + iσ, σ = {sigma:.3g} rad/s", y=1.01)
    style.set_out(figure, columns=4)
    return figure


def wavenumber_residuals(one: Recovered) -> Figure:
    """|Δk|/|k| against each reference, with the 95 % bar."""
    matched = one.matched
    assert isinstance(matched, MatchedInSpace)
    points = matched.points
    to_f, f_unit = in_frequency(float(points.omega.real.max()))
    figure = style.bare_figure(5.6, 3.9)
    axes = figure.subplots()
    for own, name in enumerate(("grid", "continuum")):
        if name == "continuum" or one.origin.bar is not None:
            error = np.maximum(matched.error(name == "continuum"), 1e-17)
            axes.plot(
                points.omega.real * to_f, error, MARKS[own], **POINT, mec=SHADES[own],
                label=f"against the {name}",
            )  # fmt: skip
    bar = np.where(points.valid, points.bar / np.abs(points.k), np.nan)
    axes.plot(points.omega.real * to_f, bar, color=THEORY, lw=0.9, label="95 % bar")
    style.decades(axes)
    axes.set(xlabel=f"ω/2π ({f_unit})", ylabel="|Δk|/|k|")
    axes.set_title(style.name_in_title(one.origin.name), y=1.01)
    axes.grid(alpha=0.25, lw=0.5)
    style.set_out(figure, left=0.95)
    return figure


def write(results: Sequence[Recovered], folder: Path) -> list[Path]:
    """Write every figure of what was recovered; the files written."""
    drawings: style.Drawings = {}
    for one in results:
        if one.points.in_space:
            kind, shown, compared = "attenuation", attenuation, wavenumber_residuals
        else:
            along_line = one.points.method == "beam"
            kind, compared = "dispersion", residuals
            shown = phase_velocity if along_line else spectrum
        drawings[f"{kind}_{one.origin.label}"] = partial(shown, one)
        if one.matched is not None:
            drawings[f"{kind}_{one.origin.label}_residuals"] = partial(compared, one)
    return style.write(drawings, folder)


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
    seen = spectra(values, record.interval)
    rows = np.flatnonzero((seen.omega >= low) & (seen.omega <= high))
    seen = seen.take(rows[:: max(1, len(rows) // _MOST_FREQUENCIES)])
    omega, U, weight = seen.omega, seen.U, seen.weight
    c = np.geomspace(slow, fast, _VELOCITIES)
    k = omega[:, None] / c
    height = np.maximum(*(phase_beam(U, x, weight, sign * k) for sign in (1, -1)))
    to_f, unit = in_frequency(float(omega.max()))
    figure = style.bare_figure(6.0, 4.6)
    axes = figure.subplots()
    image = axes.pcolormesh(
        omega * to_f, c, height.T, cmap=MAP, vmin=0, vmax=1, shading="nearest", rasterized=True
    )
    longest = Counter(points.branch[points.branch >= 0].tolist()).most_common(_MOST)
    for branch in points.branches:
        own = points.take(points.branch == branch)
        error = BAR * own.phase_velocity_error
        label = f"mode {branch + 1}, 95 %" if branch in dict(longest) else "_"
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
        xlabel=f"frequency ({unit})", ylabel="phase velocity (m/s)",
        xlim=(omega[0] * to_f, omega[-1] * to_f), ylim=(slow, fast),
    )  # fmt: skip
    axes.set_title(f"{style.name_in_title(one.origin.name)}: phases in line, B(f, c)", y=1.01)
    figure.colorbar(image, ax=axes, label="B", pad=0.03)
    style.set_out(figure, right=0.3, columns=4)
    return figure


_MOST = 10
_GREY = "#8a949e"


def overlay(found: Comparison) -> Figure:
    """Record, case and residual of each receiver, all on one scale."""
    shown = found.receivers[:_MOST]
    t = found.measured.t * 1e6
    largest = float(np.nanmax(np.abs(found.measured.values - found.measured.values.mean(axis=0))))
    figure = Figure(figsize=(6.8, 1.1 + 1.15 * len(shown)))
    rows = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for j, (axes, one) in enumerate(zip(rows, shown, strict=True)):
        u, there = found.measured.values[:, j], found.simulated[:, j]
        base = float(np.nanmean(u))
        axes.plot(t, (u - base) / largest, color=FOUND, lw=1.1, label="record")
        axes.plot(t, (there - base) / largest, color=THEORY, lw=0.9, ls="--", label="case")
        axes.plot(t, (u - there) / largest, color=_GREY, lw=0.7, label="difference")
        where = f"{as_written(one.name)}\n{one.position * 1e3:.4g} mm"
        axes.set_ylabel(where, rotation=0, ha="right", va="center")
        axes.set_yticks([])
        told = f"{one.residual:.1%} left, {one.arrival * 1e9:+.3g} ns, × {one.amplitude:.3g}"
        axes.text(0.995, 0.94, told, ha="right", va="top", fontsize=7, transform=axes.transAxes)
    rows[-1].set_xlabel("t (µs)")
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure
