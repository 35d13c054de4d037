"""Exact semi-discrete solution on a uniform periodic bar: FFT in space, eigenvectors per mode.

A second route to what the steppers compute. Each wavenumber of the grid is an ordinary
differential equation q̂̈ = −K(k̃) q̂ + ĝ s(t), solved by its eigenvectors; the integral over the pulse
is a Gauss sum on panels much shorter than its period.
"""

from __future__ import annotations

import numpy as np

from wavesim.grid.stencils import modified_wavenumber
from wavesim.material.wave_equations import CURVATURES, FIELDS, ROTATIONS, flux_form


def modal_field(medium, bar, sources, times, rate=False):
    """All twelve fields in SI at the given times, {name: (nt, N)}, from rest at t = 0.

    Works on the 12 × 12 system in SI, not on the program's blocks and scaled unknowns.
    """
    flux = flux_form(medium)
    n, h = bar.cells, bar.spacing
    k = 2 * np.pi * np.fft.fftfreq(n, h)
    kt = modified_wavenumber(k, h, bar.order)
    # φ at nodes, B at half nodes: D acts as i k̃ e^{ikh/2}; the half-cell shift is taken out of B.
    mass = np.concatenate([np.full(3, flux.m_phi), np.full(9, flux.m_B)])
    root = np.sqrt(mass)
    K = np.zeros((n, 12, 12), dtype=complex)
    K[:, :3, :3] = kt[:, None, None] ** 2 * flux.C_phi_phi
    K[:, :3, 3:] = 1j * kt[:, None, None] * flux.C_phi_B
    K[:, 3:, :3] = -1j * kt[:, None, None] * flux.C_B_phi
    K[:, 3:, 3:] = flux.C_B_B + kt[:, None, None] ** 2 * flux.Gamma
    K /= root[:, None] * root[None, :]
    squares, V = np.linalg.eig(K)
    assert np.abs(squares.imag).max() < 1e-6 * np.abs(squares).max()
    omega = np.sqrt(np.maximum(squares.real, 0))
    Vinv = np.linalg.inv(V)
    shift = np.exp(1j * k * h / 2)
    total = np.zeros((len(times), n, 12), dtype=complex)
    scale = medium.branch_length**2 * medium.contact_density
    for source in sources:
        index = FIELDS.index(source.field)
        staggered = source.field in CURVATURES
        density, at = bar.spread(source.position, source.width, staggered)
        line = np.zeros(n)
        np.add.at(line, at, density)
        ghat = np.fft.fft(line) / (shift if staggered else 1)
        force = Vinv[:, :, index] * (ghat / (scale * root[index]))[:, None]
        total += _convolve(source, omega, times, rate)[..., :] * force[None]
    total = np.einsum("kij,tkj->tki", V, total) / root
    fields = {}
    for i, name in enumerate(FIELDS):
        hat = total[..., i] * (1 if name in ROTATIONS else shift)
        fields[name] = np.fft.ifft(hat, axis=1).real
    return fields


def _convolve(source, omega, times, rate):
    """∫₀^t sin(ω(t−τ))/ω s(τ) dτ, or its time derivative, (nt, k, mode)."""
    result = np.zeros((len(times), *omega.shape))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    fastest = max(omega.max(), 6 * source.band)
    for i, t in enumerate(times):
        end = min(t, source.end)
        panels = max(1, int(np.ceil(end * fastest / 12)))
        edges = np.linspace(0, end, panels + 1)
        half = (edges[1] - edges[0]) / 2
        tau = (edges[:-1, None] + half * (nodes + 1)).ravel()
        w = np.tile(half * weights, panels) * source.signal(tau)
        parts = max(1, len(tau) // 64)
        for part_tau, part_w in zip(
            np.array_split(tau, parts), np.array_split(w, parts), strict=True
        ):
            lag = t - part_tau
            phase = np.multiply.outer(lag, omega)
            kernel = np.cos(phase) if rate else lag[:, None, None] * np.sinc(phase / np.pi)
            result[i] += np.tensordot(part_w, kernel, 1)
    return result
