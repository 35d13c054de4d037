"""Eigenfrequencies of a finite bar: all of them in a band, by counting; with loss, from those."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from wavesim.layered.mode_count import count, elements
from wavesim.layered.stack import Stack, check_ends, returned
from wavesim.layered.uniform_layer import waves
from wavesim.material.family import Block, travelling_block
from wavesim.material.layers import Layers, as_layers
from wavesim.planewave.band_edges import form_asymptotes, form_cutoffs, keeps_gradient
from wavesim.planewave.eigenproblem import spectral_form

# Default smallest spacing, of the band's upper end.
_SPACING = 1e-4
# Steps in which loss is brought up.
_STEPS = 8
# The last change of a complex eigenfrequency that is known, relative to it; how often it is changed
# at most, and by what part of it a slope is taken.
_FOLLOWED, _TRIES, _ASIDE = 1e-9, 30, 1e-6
# Places at which a graded layer is looked at for the range that its band edges sweep.
_FINE = 65


def with_loss(layers: Layers, share: float) -> Layers:
    """The bar with a share of its losses: all strengths and rates of loss times it."""
    return layers.mapped(lambda m: dataclasses.replace(m, damping=m.damping.part(share)))


def _edges(layers: Layers, block: Block, which: Any) -> list[Any]:
    """Cutoffs or asymptotes over each layer, shape (samples, b), rad/s."""
    return [
        np.array([which(spectral_form(m, block)) / m.time_scale for m in media])
        for media in (layer.sampled(_FINE) for layer in layers.layers)
    ]


def windows(layers: Layers, sector: str, band: tuple[float, float]) -> Any:
    """The parts of a band between asymptotes, shape (windows, 2), rad/s.

    Over a graded layer an asymptote sweeps a range, in which the spectrum is continuous.
    """
    low, high = band
    stops = [
        (float(column.min()), float(column.max()))
        for values in _edges(layers, travelling_block(layers.first.family, sector), form_asymptotes)
        for column in values.T
    ]
    found = []
    for start, end in sorted(stops):
        if end <= low or start >= high:
            continue
        if start > low:
            found.append((low, start))
        low = max(low, end)
    if high > low:
        found.append((low, high))
    return np.array(found).reshape(-1, 2)


def _density(layers: Layers, block: Block, omega: Any) -> Any:
    """Eigenfrequencies per rad/s, about: Σ h dk/dω / π; shape of omega."""
    total = np.zeros(len(omega))
    step = 1e-6
    for layer in layers.layers:
        most = np.zeros(len(omega))
        for medium in layer.sampled():
            single = as_layers(medium, layer.thickness)
            k = []
            for factor in (1 - step, 1 + step):
                stack = Stack(single, block, omega * factor, False)
                here = stack.section(single.layers[0], 0.0)
                k.append(waves(here, stack.scaled).k[:, 0].real / stack.units.length)
            most = np.maximum(most, (k[1] - k[0]) / (2 * step * omega))
        total += most * layer.thickness / np.pi
    return total


def _reach(layers: Layers, block: Block, low: float, high: float, spacing: float) -> float:
    """How far into a window eigenfrequencies are at least a spacing apart, on average."""
    omega = high - (high - low) * np.geomspace(1, 1e-5, 400)[1:]
    sparse = np.flatnonzero(_density(layers, block, omega) * spacing <= 1)
    # Waves are dense just above a cutoff too, but few: only the run up to the window's end counts.
    last = int(sparse[-1]) if len(sparse) else 0
    return high if last == len(omega) - 1 else float(omega[last])


def eigenfrequencies(
    layers: Layers,
    block: Block,
    left: str,
    right: str,
    band: tuple[float, float],
    kept: bool,
    spacing: float | None = None,
) -> Any:
    """Real eigenfrequencies of the lossless bar; see :func:`resonances`. Ascending, rad/s."""
    low, high = band
    if not 0 < low < high:
        raise ValueError(f"band = ({low:g}, {high:g}): must be two frequencies, 0 < ω1 < ω2")
    plain = with_loss(layers, 0.0)
    if kept and not plain.conserves_energy:
        raise ValueError("closure: with Γ eigenfrequencies are counted for 'consistent' alone")
    spacing = _SPACING * high if spacing is None else spacing
    found = []
    parts_of_band = [(low, high)] if kept else windows(plain, block.sector, band)
    for start, end in parts_of_band:
        if not kept:
            end = _reach(plain, block, start, end, spacing)
            start = start * (1 + 1e-12)
        if end > start:
            found.append(_within(plain, block, left, right, (start, end), kept))
    return np.concatenate(found) if found else np.zeros(0)


def _within(
    layers: Layers, block: Block, left: str, right: str, window: tuple[float, float], kept: bool
) -> Any:
    start, end = window
    cut = _edges(layers, block, form_cutoffs)
    bounds = _edges(layers, block, form_asymptotes)
    has_cutoff = {}
    for layer, c, a in zip(layers.layers, cut, bounds, strict=True):
        floor = max([x for x in a.max(axis=0) if x <= start * (1 + 1e-9)], default=0.0)
        inside = (c.max(axis=0) > floor * (1 + 1e-9)) & (c.min(axis=0) < end)
        has_cutoff[id(layer)] = bool(inside.any())
    parts = elements(Stack(layers, block, np.array([end]), kept))

    def below(omega: Any) -> Any:
        return count(Stack(layers, block, omega, kept), parts, left, right, has_cutoff)

    first, last = below(np.array([start, end]))
    wanted = np.arange(first, last)
    low, high = np.full(len(wanted), start), np.full(len(wanted), end)
    while len(wanted):
        middle = (low + high) / 2
        if ((middle <= low) | (middle >= high)).all():
            break
        trial, place = np.unique(middle, return_inverse=True)
        over = below(trial)[place] > wanted
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return (low + high) / 2


def resonances(
    layers: Layers,
    left: str,
    right: str,
    sector: str,
    band: tuple[float, float],
    gradient: bool | None = None,
    spacing: float | None = None,
) -> Any:
    """All eigenfrequencies of a finite bar in a band, as often as they are.

    Without Γ they pile up below each asymptote of each layer; where they are on average closer
    than ``spacing`` the search stops, up to that asymptote. In the range that an asymptote
    sweeps over a graded layer there are none but a continuum.

    Args:
        layers: the bar.
        left, right: fixed, free, or both periodic.
        sector: longitudinal, transverse2 or transverse3.
        band: lowest and highest ω (its real part), rad/s, > 0.
        gradient: whether Γ is kept; None lets planewave.gradient_share > 1e-9 of a layer decide.
        spacing: smallest mean spacing, rad/s; 1e-4 of the band's upper end by default.

    Returns:
        ω, ascending, rad/s: real without loss, to rounding; complex with Im ω < 0 with loss. With
        laws that differ each is followed from its lossless one as the loss is brought up; NaN
        where that fails, as it does where a wave is overdamped.

    Raises:
        ValueError: an end is not fixed, free or periodic; the sector is at rest; the closure
            is not symmetric where Γ is kept.
    """
    check_ends(left, right, ("fixed", "free", "periodic"))
    kept = keeps_gradient(layers, gradient)
    block = travelling_block(layers.first.family, sector)
    real = eigenfrequencies(layers, block, left, right, band, kept, spacing)
    law, *others = {layer.medium.damping for layer in layers.layers}
    # One law for all moduli and one for all inertias: Ω(ω) = ω₀ whatever the bar is made of.
    return damped(layers, left, right, block, real, kept) if others else law.lossy(real)


def damped(layers: Layers, left: str, right: str, block: Block, real: Any, kept: bool) -> Any:
    """Complex eigenfrequencies, from (1 − S R) x = 0, the loss brought up in steps.

    Each is led to its root by successive linear problems, M(ω) x = −δ M′(ω) x with the least |δ|;
    of those that came to one, as a ring's pairs are without loss, the second takes the second δ.

    Ruhe, SIAM J. Numer. Anal. 10, 674 (1973).
    """
    omega = earlier = real.astype(complex)
    known, each = np.ones(len(real), bool), np.arange(len(real))
    for part in np.linspace(0, 1, _STEPS + 1)[1:]:
        lossy = with_loss(layers, float(part))

        def turned_back(at: Any, lossy: Layers = lossy) -> Any:
            stack = Stack(lossy, block, at, kept)
            whole = stack.whole().whole
            return np.eye(whole.shape[-1]) - whole @ returned(stack, left, right)

        now, earlier = 2 * omega - earlier, omega
        for _ in range(2):
            alike = np.abs(now[:, None] - now) <= _FOLLOWED * np.abs(now)
            rank = np.tril(alike, -1).sum(axis=1)
            for _ in range(_TRIES):
                with np.errstate(all="ignore"):  # where one is lost
                    M = turned_back(now)
                    slope = (turned_back(now * (1 + _ASIDE)) - M) / _ASIDE
                    known &= np.isfinite(np.sum(M, axis=(1, 2)) / np.linalg.det(slope))
                M[~known], slope[~known] = 0.0, np.eye(M.shape[-1])
                steps = -np.linalg.eigvals(np.linalg.solve(slope, M))
                order = np.argsort(np.abs(steps), axis=1)
                step = steps[each, order[each, np.minimum(rank, steps.shape[1] - 1)]]
                now, rank = now * (1 + step), 0 * rank
                if (np.abs(step) <= 1e-14)[known].all():
                    break
        known &= np.abs(step) <= _FOLLOWED
        omega = now
    return np.where(known, omega, np.nan)
