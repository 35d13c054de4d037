"""One frequency of a layered bar by least-squares Chebyshev collocation: no waves, no scattering.

Unknowns in each layer are φ, B, σ and, with Γ, V at Chebyshev points, in SI; equations are the
balance laws and the constitutive laws at all of them, continuity, and the ends.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev
from scipy.linalg import lstsq

from wavesim.material.granular_equations import ROTATION


def coefficients(medium, phi, curvatures):
    """I_φ, I_B, C_φφ, C_φB, C_Bφ, C_BB, Γ in SI, of one rotation and its micro-curvatures."""
    flux, scale = medium.flux_form(), medium.branch_length**2 * medium.contact_density
    i, j = ROTATION.macro.index(phi), [ROTATION.micro.index(name) for name in curvatures]
    parts = (
        flux.m_phi, flux.m_B, flux.C_phi_phi[i, i], flux.C_phi_B[i, j], flux.C_B_phi[j, i],
        flux.C_B_B[np.ix_(j, j)], flux.Gamma[np.ix_(j, j)],
    )  # fmt: skip
    return [scale * part for part in parts]


def fields(layers, left, right, source, omega, at, kept):
    """φ and its micro-curvatures at positions for a source with a width, {name: (len(at),)}.

    Longitudinal: φ1, B11, B22, B33. Ends: fixed, free, or a complex number Z with f = ±Zv for an
    outgoing wave, f = −σ, v = −iωφ (without Γ).
    """
    names = ["phi1", "B11", "B22", "B33"]
    b, points = 3, 40 if kept else 50
    kinds = 2 + b + (b if kept else 0)  # φ, B, σ, V
    nodes = np.cos(np.pi * np.arange(points) / (points - 1))[::-1]
    values = chebyshev.chebvander(nodes, points - 1)
    slopes = np.stack([chebyshev.chebval(nodes, chebyshev.chebder(c)) for c in np.eye(points)], 1)
    D = slopes @ np.linalg.inv(values)
    size = kinds * points
    rows, rhs = [], []

    def unknown(layer, kind, i):
        return layer * size + kind * points + i

    total = len(layers.layers) * size
    amplitude = source.spectrum(omega)

    def add(entries, right_side=0.0):
        row = np.zeros(total, dtype=complex)
        for columns, value in entries:
            row[columns] += value
        rows.append(row)
        rhs.append(right_side)

    for n, layer in enumerate(layers.layers):
        x = layer.start + (nodes + 1) / 2 * layer.thickness
        slope = D * 2 / layer.thickness
        span = np.arange(points)
        for i in range(points):
            medium = layer.at(x[i])
            Ip, Ib, pp, pB, Bp, BB, G = coefficients(medium, "phi1", names[1:])
            m, iota = medium.damping.modulus(omega), medium.damping.inertia(omega)
            g = np.exp(-((x[i] - source.position) ** 2) / 2 / source.width**2)
            g *= amplitude / (np.sqrt(2 * np.pi) * source.width)
            push = [g if name == source.field else 0.0 for name in names]
            d_phi, d_sigma = (unknown(n, 0, span), slope[i]), (unknown(n, 1 + b, span), slope[i])
            add([d_sigma, (unknown(n, 0, i), omega**2 * iota * Ip)], -push[0])
            stress = [(unknown(n, 1 + b, i), 1.0), (d_phi[0], -m * pp * d_phi[1])]
            add(stress + [(unknown(n, 1 + q, i), m * pB[q]) for q in range(b)])
            for q in range(b):
                entries = [(d_phi[0], m * Bp[q] * d_phi[1])]
                entries += [(unknown(n, 1 + r, i), -m * BB[q, r]) for r in range(b)]
                entries += [(unknown(n, 1 + q, i), omega**2 * iota * Ib)]
                if kept:
                    entries += [(unknown(n, 2 + b + q, span), slope[i])]
                    law = [(unknown(n, 1 + r, span), -m * G[q, r] * slope[i]) for r in range(b)]
                    add([(unknown(n, 2 + b + q, i), 1.0), *law])
                add(entries, -push[1 + q])
    continuous = range(kinds) if kept else (0, 1 + b)
    for n in range(len(layers.layers) - 1):
        for kind in continuous:
            add([(unknown(n, kind, points - 1), 1.0), (unknown(n + 1, kind, 0), -1.0)])
    for end, n, i, sign in ((left, 0, 0, -1), (right, len(layers.layers) - 1, points - 1, 1)):
        phi, sigma = unknown(n, 0, i), unknown(n, 1 + b, i)
        if end == "fixed":
            add([(phi, 1.0)])
        elif end == "free":
            add([(sigma, 1.0)])
        else:
            add([(sigma, 1.0), (phi, -sign * 1j * omega * end)])
        for q in range(b if kept else 0):
            add([(unknown(n, 2 + b + q, i), 1.0)])
    matrix, rhs = np.array(rows), np.array(rhs)
    # Equilibrate: units differ by many powers of ten.
    for _ in range(3):
        if _ == 0:
            column = np.ones(total)
        weight = np.abs(matrix).max(axis=1)
        matrix, rhs = matrix / weight[:, None], rhs / weight
        factor = np.abs(matrix).max(axis=0)
        matrix, column = matrix / factor, column / factor
    solution = lstsq(matrix, rhs, lapack_driver="gelsy", check_finite=False)[0] * column
    found = {name: [] for name in names}
    for x in at:
        n = next(
            i for i, one in enumerate(layers.layers) if x < one.end or one.end == layers.length
        )
        layer = layers.layers[n]
        u = 2 * (x - layer.start) / layer.thickness - 1
        weights = chebyshev.chebvander([u], points - 1)[0] @ np.linalg.inv(values)
        for q, name in enumerate(names):
            found[name].append(weights @ solution[unknown(n, q, 0) : unknown(n, q, 0) + points])
    return {name: np.array(values) for name, values in found.items()}
