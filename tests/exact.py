"""Exact semi-discrete solution on a uniform periodic bar: FFT in space, eigenvectors per mode.

A second route to what the steppers compute. Each wavenumber of the grid is an ordinary
differential equation q̂̈ = −K(k̃) q̂ + ĝ s(t), solved by its eigenvectors; the integral over the pulse
is a Gauss sum on panels much shorter than its period.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from media import twelve_by_twelve

from wavesim.grid.points import spread
from wavesim.grid.stencils import modified_wavenumber
from wavesim.records.relations import OfMedium


def modal_field(medium, bar, sources, times, rate=False):
    """All twelve fields in SI at the given times, {name: (nt, N)}, from rest at t = 0.

    Works on the 12 × 12 system in SI, not on the program's blocks and scaled unknowns; wavenumbers
    k ≥ 0 are enough, as the fields are real.
    """
    n, h = bar.cells, bar.spacing
    k = 2 * np.pi * np.fft.rfftfreq(n, h)
    kt = modified_wavenumber(k, h, bar.order)
    # φ at nodes, B at half nodes: D acts as i k̃ e^{ikh/2}; the half-cell shift is taken out of B.
    K, root = twelve_by_twelve(medium, kt)
    squares, V = np.linalg.eig(K)
    assert np.abs(squares.imag).max() < 1e-6 * np.abs(squares).max()
    omega = np.sqrt(np.maximum(squares.real, 0))
    Vinv = np.linalg.inv(V)
    shift = np.exp(1j * k * h / 2)
    total = np.zeros((len(times), len(k), 12), dtype=complex)
    scale = medium.branch_length**2 * medium.contact_density
    pulses = {}
    for source in sources:
        index = medium.family.fields.index(source.field)
        staggered = source.field in medium.family.micro
        density, at = spread(bar, source.position, source.width, staggered)
        line = np.zeros(n)
        np.add.at(line, at, density)
        ghat = np.fft.rfft(line) / (shift if staggered else 1)
        force = Vinv[:, :, index] * (ghat / (scale * root[index]))[:, None]
        signal = dataclasses.replace(source, field=medium.family.macro[0], position=0.0, width=0.0)
        if signal not in pulses:
            pulses[signal] = _convolve(source, omega, times, rate)
        total += pulses[signal] * force[None]
    total = np.einsum("kij,tkj->tki", V, total) / root
    fields = {}
    for i, name in enumerate(medium.family.fields):
        hat = total[..., i] * (1 if name in medium.family.macro else shift)
        fields[name] = np.fft.irfft(hat, n, axis=1)
    return fields


def _convolve(source, omega, times, rate):
    """∫₀^t sin(ω(t−τ))/ω s(τ) dτ, or its time derivative, (nt, k, mode).

    e^{iωt} ∫ e^{−iωτ} s dτ, whose second factor is the same for all times past the pulse; where ωt
    is small, by (t−τ) sinc.
    """
    result = np.zeros((len(times), *omega.shape))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    fastest = max(omega.max(), 6 * source.band)
    known = {}
    for i, t in enumerate(times):
        end = min(t, source.end)
        panels = max(1, int(np.ceil(end * fastest / 12)))
        half = end / panels / 2
        tau = (np.linspace(0, end, panels + 1)[:-1, None] + half * (nodes + 1)).ravel()
        w = np.tile(half * weights, panels) * source.signal(tau)
        if end not in known:
            spectrum = np.zeros(omega.shape, dtype=complex)
            for at, weight in zip(tau, w, strict=True):
                spectrum += weight * np.exp(-1j * at * omega)
            known[end] = spectrum
        turned = np.exp(1j * t * omega) * known[end]
        if rate:
            result[i] = turned.real
            continue
        slow = omega * t < 1e-2
        lag = t - tau
        np.divide(turned.imag, omega, out=result[i], where=~slow)
        result[i][slow] = (lag * np.sinc(np.multiply.outer(omega[slow], lag) / np.pi)) @ w
    return result


def references(field, block):
    """Relations of the continuum and of a field's grid."""
    return OfMedium(field.medium, block), OfMedium(field.medium, block, field.bar)
