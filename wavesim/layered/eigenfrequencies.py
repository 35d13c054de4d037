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
# The last change of a complex eigenfrequency that is known, relative to it.
_FOLLOWED = 1e-9
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
    """Complex eigenfrequencies, from det(1 − S R) = 0 by secants, loss brought up in steps."""
    earlier, omega = None, real.astype(complex)
    known = np.ones(len(real), bool)
    for part in np.linspace(0, 1, _STEPS + 1)[1:]:
        lossy = with_loss(layers, float(part))

        def residue(at: Any, lossy: Layers = lossy) -> Any:
            stack = Stack(lossy, block, at, kept)
            whole = stack.whole().whole
            unit = np.eye(whole.shape[-1])
            return np.linalg.det(unit - whole @ returned(stack, left, right))

        now = omega * (1 - 1e-6j) if earlier is None else 2 * omega - earlier
        before, earlier = now * (1 + 1e-7), omega
        with np.errstate(all="ignore"):  # where one is lost
            value = residue(before)
            for _ in range(30):
                fresh = residue(now)
                rise = fresh - value
                step = np.where(rise == 0, 0, fresh * (now - before) / np.where(rise == 0, 1, rise))
                before, value, now = now, fresh, now - step
                if (np.abs(step) <= 1e-14 * np.abs(now)).all():
                    break
        known &= np.abs(step) <= _FOLLOWED * np.abs(now)
        omega = now
    return np.where(known, omega, np.nan)
