"""How many eigenfrequencies of a lossless bar lie below ω: Wittrick and Williams' count.

Cut into elements, the bar has the dynamic stiffness K(ω) between the macro-fields (and, where Γ is
kept, micro-fields) of its nodes. Eigenfrequencies below ω number

    J(ω) = Σ J₀(ω) + (negative eigenvalues of K(ω)),

J₀ those of each element with its ends clamped. An element short enough has none but those of the
micro-field alone, one for each cutoff: its φ(end)/σ(start) = t₁₂ ≷ 0 tells on which side ω is.
With Γ a uniform layer is halved until its energy bounds its lowest clamped frequency from below.

Without Γ, J jumps by infinity at each asymptote: only differences within a window between two
asymptotes count.

Wittrick & Williams, Q. J. Mech. Appl. Math. 24, 263 (1971).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.layered.cross_section import Section
from wavesim.layered.stack import Stack
from wavesim.layered.star_product import Piece
from wavesim.layered.uniform_layer import uniform, waves
from wavesim.material.layers import Layer

# Where a bar of one layer is cut: no part of it holds whole half-waves together with the other.
_CUT = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class Element:
    """A stretch of one layer between two nodes; start and end in m."""

    layer: Layer
    start: float
    end: float


def stiffness(piece: Piece, omega: Any, impedance: Any) -> Any:
    """K = −iω √z (1 − S)(1 + S)⁻¹ √z between both ends, real, shape (N, 2n, 2n)."""
    S, unit = piece.whole, np.eye(2 * len(impedance))
    K = np.linalg.solve(np.swapaxes(unit + S, 1, 2), np.swapaxes(unit - S, 1, 2))
    root = np.sqrt(np.tile(impedance, 2))
    K = (-1j * omega[:, None, None] * root * root[:, None] * np.swapaxes(K, 1, 2)).real
    return (K + np.swapaxes(K, 1, 2)) / 2


def one_wave_stiffness(own: Any, omega: Any, thickness: float, z: float) -> tuple[Any, Any]:
    """K and t₁₂ of a uniform layer without Γ: K = 𝒟k cot kh, −𝒟k/sin kh."""
    k, stiff = own.k[:, 0], (own.f / own.v)[:, 0, 0] * z * omega  # 𝒟k = Zω
    # Both are even in k: taken by decaying exponentials, with k real or imaginary.
    through = np.exp(1j * k * thickness)
    gone = -np.expm1(2j * k * thickness)
    diagonal = (1j * stiff * (2 - gone) / gone).real
    across = (-2j * stiff * through / gone).real
    # cot = i(1 + E²)/(E² − 1): the sign of i turns.
    K = np.empty((len(omega), 2, 2))
    K[:, 0, 0] = K[:, 1, 1] = -diagonal
    K[:, 0, 1] = K[:, 1, 0] = -across
    return K, k


def clamped_bound(one: Section) -> float:
    """√ of the least of J/I_φ and Γ/I_B: a clamped element has ω ≥ this π/h."""
    own = one.own
    parts = [float(np.linalg.eigvalsh(own.gamma).min()) / own.i_B]
    if one.macro:
        static = own.c_pp - own.c_pb @ np.linalg.solve(own.c_bb, own.c_bp)
        parts.append(float(static[0, 0]) / own.i_phi)
    return math.sqrt(min(parts))


def _negative(K: Any) -> Any:
    return (np.linalg.eigvalsh(K) < 0).sum(axis=1)


def clamped_count(stack: Stack, layer: Layer, thickness: float) -> Any:
    """J₀ of a uniform layer with Γ, by halving: J₀(2h) = 2 J₀(h) + neg(K at the middle node)."""
    bound = clamped_bound(stack.section(layer, layer.start))
    top = float(stack.scaled.real.max())
    halvings = max(0, math.ceil(math.log2(max(thickness * top / (math.pi * bound), 1e-9))) + 1)
    total = np.zeros(len(stack.scaled), dtype=int)
    own, n = stack.waves(layer), len(stack.impedance)
    for j in range(halvings, 0, -1):
        K = stiffness(uniform(own, thickness / 2**j), stack.scaled, stack.impedance)
        total = 2 * total + _negative(K[:, :n, :n] + K[:, n:, n:])
    return total


def elements(stack: Stack) -> list[Element]:
    """Uniform layers whole; graded ones in parts short enough to have no clamped wave.

    A bar of one uniform layer is cut in two, as between free ends its eigenfrequencies stand just
    where K of the whole is infinite, and would be told to half the digits.
    """
    found = []
    omega = np.array([stack.scaled.real.max()]) + 0j
    for layer in stack.layers.layers:
        parts = 1
        if layer.last is not None:
            sampled = [
                stack.section(layer, layer.start + layer.thickness * s)
                for s in np.linspace(0, 1, 33)
            ]
            if stack.kept:
                shortest = math.pi / max(
                    omega[0].real / min(clamped_bound(s) for s in sampled), 1e-9
                )
            else:
                shortest = 2 / max(float(waves(s, omega).k[0, 0].real) + 1e-9 for s in sampled)
            parts = math.ceil(layer.thickness / stack.units.length / shortest) + 1
        marks = np.linspace(layer.start, layer.end, parts + 1)
        if len(stack.layers.layers) == 1 and parts == 1:
            marks = np.insert(marks, 1, layer.start + _CUT * layer.thickness)
        found += [Element(layer, float(a), float(b)) for a, b in itertools.pairwise(marks)]
    return found


def count(
    stack: Stack, parts: list[Element], left: str, right: str, has_cutoff: dict[int, bool]
) -> Any:
    """J(ω) of a bar, shape (N,); without Γ up to what one window has.

    Args:
        stack: a lossless bar at real ω.
        parts: its elements, of :func:`elements` at the highest ω.
        left, right: fixed, free; or periodic or antiperiodic, both.
        has_cutoff: by the layer's id, whether the window holds a cutoff of it.
    """
    n, M, N = len(stack.impedance), len(parts), len(stack.scaled)
    ring = left in ("periodic", "antiperiodic")
    nodes = M if ring else M + 1
    K = np.zeros((N, nodes * n, nodes * n))
    total = np.zeros(N, dtype=int)
    length = stack.units.length
    for i, part in enumerate(parts):
        thickness = (part.end - part.start) / length
        if part.layer.last is None and not stack.kept:
            own = stack.waves(part.layer)
            here, k = one_wave_stiffness(own, stack.scaled, thickness, float(stack.impedance[0]))
            stiff = ((own.f / own.v)[:, 0, 0] * stack.scaled / k).real  # of the sign of 𝒟
            clamped = np.floor(k.real * thickness / math.pi).astype(int)
            total += np.where(stiff > 0, clamped + has_cutoff[id(part.layer)], 0)
        else:
            piece = stack.piece(part.layer, part.start, part.end)
            here = stiffness(piece, stack.scaled, stack.impedance)
            if part.layer.last is None:
                total += clamped_count(stack, part.layer, thickness)
            elif not stack.kept:
                total += (here[:, 0, 1] < 0) & has_cutoff[id(part.layer)]
        a, b = slice(i * n, (i + 1) * n), slice((i + 1) % nodes * n, ((i + 1) % nodes + 1) * n)
        sign = -1 if left == "antiperiodic" and i == M - 1 else 1
        K[:, a, a] += here[:, :n, :n]
        K[:, b, b] += here[:, n:, n:]
        K[:, a, b] += sign * here[:, :n, n:]
        K[:, b, a] += sign * here[:, n:, :n]
    free = np.ones(nodes * n, dtype=bool)
    if stack.block.macro:
        free[0] &= left != "fixed"
        free[M * n if not ring else 0] &= right != "fixed"
    K = K[:, free][:, :, free]
    return total + (_negative(K) if K.shape[1] else 0)
