"""The three problems: a uniform ring, a lossy bar, a layered bar; what peers are handed of them.

Twelve fields, all sectors driven, 4,096 cells of l/8, order 8, 200 units of time, 401 frames.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

import wavesim as ws
from wavesim.grid.stencils import difference_weights
from wavesim.material.granular_equations import ROTATION
from wavesim.material.scaling import block_coefficients, scales, to_fields
from wavesim.simulation.simulation import simulation
from wavesim.timedomain.integrate import equation_of
from wavesim.timedomain.sparse_matrix import flat, sparse_matrix

Float = NDArray[np.float64]
PROBLEMS = ("ring", "lossy", "layered")
CELLS, UNITS, FRAMES = 4096, 200.0, 401
# Entries of A below this are the gradient term's (1e-10), which no error here feels; peers are
# spared them, two thirds of the products.
_NOTHING = 1e-8


def problem(name: str, other: bool = False) -> Any:
    """Medium or layers, bar, sources and duration, as ``ws.simulate`` takes them.

    Args:
        name: of ``PROBLEMS``.
        other: with another anisotropy: the second run in a process.
    """
    medium = ws.Medium(anisotropy=0.26 if other else 0.25, closure="consistent")
    scale = scales(medium)
    length, unit = float(scale.length), float(scale.time)
    h = length / 8
    made: Any = medium
    bar = ws.Bar(CELLS, h)
    if name == "lossy":
        law = ws.constant_quality(40.0, (1e5, 2e6))
        made = dataclasses.replace(medium, damping=law)
        bar = ws.Bar(CELLS, h, left="absorbing", right="absorbing", absorber=64 * h)
    if name == "layered":
        stiff = dataclasses.replace(medium, G_n_a=9.0, density=2000.0)
        edges = [CELLS * h * n / 4 for n in range(5)]
        kinds = itertools.cycle((medium, stiff))
        pairs = zip(itertools.pairwise(edges), kinds, strict=False)
        made = ws.Layers(tuple(ws.Layer(a, b, kind) for (a, b), kind in pairs))
        bar = ws.layered_bar(made, h)
    # A few branch lengths apart, each on a point of its own grid; in the middle of the ring, so
    # that no wave comes round it, and near an end of the others.
    middle = CELLS // 2 if name == "ring" else CELLS // 8
    sources = []
    for field, offset in (("phi1", 0), ("phi2", -3), ("phi3", 4), ("B22", 2), ("B23", -5)):
        at = middle + 8 * offset + (0.5 if field in ROTATION.micro else 0.0)
        amplitude = float(scale.force(field)) * length
        sources.append(ws.Ricker(field, at * h, 1 / (2 * np.pi * unit), amplitude))
    return made, bar, tuple(sources), UNITS * unit


def for_peers(arguments: Any, nothing: float = _NOTHING) -> dict[str, Any]:
    """ẏ = A y + g s(t), scaled, as arrays: the sparse A, and for leapfrogs the stencil beside it.

    Args:
        arguments: of :func:`problem`.
        nothing: entries of A below this are left out.
    """
    simulated = simulation(*arguments, FRAMES)
    equation, start = equation_of(simulated)
    rest, pulse = start.y, simulated.sources[0]
    A = sparse_matrix(equation.operator)
    A.data[np.abs(A.data) < nothing] = 0.0
    A.eliminate_zeros()
    amplitudes = np.array([source.amplitude for source in simulated.sources])
    sizes = [[array.size for array in state] for state in rest]
    starts = np.cumsum([0, *(size for state in sizes for size in state)])
    first = starts[:-1].reshape(len(sizes), -1)
    unit = float(scales(simulated.medium).time)
    made = {
        **_stored("A", A),
        "g": flat(equation.sources.add(rest, amplitudes)),
        # Where the fields and their rates are in y.
        "fields": np.concatenate([np.arange(row[0], row[2]) for row in first]),
        "rates": np.concatenate([np.arange(row[2], row[4]) for row in first]),
        "peak": np.pi * pulse.peak_frequency * unit,
        "delay": pulse.peak_time / unit,
        "quiet_from": pulse.end / unit,
        "interval": simulated.interval / unit,
        "points": len(simulated.bar.nodes),
    }
    if simulated.lossy:
        return made
    # From rest κ is Dφ as κ̇ is Dφ̇: without κ, q̈ = L q.
    strains = np.concatenate([np.arange(row[4], row[5]) for row in first])
    L = A[made["rates"]][:, made["fields"]]
    L = sp.csr_array(L + A[made["rates"]][:, strains] @ A[strains][:, made["rates"]])
    return made | _stored("L", L) | _stencil(simulated, L, len(simulated.bar.nodes))


def _stored(name: str, matrix: Any) -> dict[str, Any]:
    return {f"{name}_{part}": getattr(matrix, part) for part in ("data", "indices", "indptr")}


def _stencil(simulated: Any, L: Any, n: int) -> dict[str, Any]:
    """L of q̈ = L q by the stencil and coefficients of each layer, and what differs near interfaces.

    Coefficients c[layer, block] are rows for σ/m, B̈₁ and B̈₂ from κ, B₁ and B₂; those of the three
    oscillators are c[layer, 3, 0].
    """
    units, bar = scales(simulated.medium), simulated.bar
    w = np.array(difference_weights(bar.order)) / (bar.spacing / float(units.length))
    edges = np.cumsum([0, *(cells for cells, _ in bar.all_stretches)])
    edges[-1] = n
    c = np.zeros((len(edges) - 1, 4, 3, 3))
    for number, layer in enumerate(simulated.layers.layers):
        for block, form in enumerate(
            block_coefficients(layer.medium, block, units) for block in ROTATION.blocks
        ):
            if block < 3:
                rows = [[form.c_pp / form.i_phi, -form.c_pb / form.i_phi]]
                rows += [[form.c_bp / form.i_B, -form.c_bb / form.i_B]]
                c[number, block] = np.block(rows)
            else:
                c[number, 3, 0, block - 3] = -form.c_bb[0, 0] / form.i_B
    ring = bar.periodic
    D = sum(weight * (_shift(n, j, ring) - _shift(n, 1 - j, ring)) for j, weight in enumerate(w, 1))
    spread = c[np.searchsorted(edges, np.arange(n), side="right") - 1]
    rows_of = []
    for b in range(3):
        part = [[sp.diags_array(spread[:, b, i, j]) for j in range(3)] for i in range(3)]
        sigma, *rest = [sp.hstack([row[0] @ D, *row[1:]]) for row in part]
        rows_of.append(sp.vstack([-D.T @ sigma, *rest]))
    rows_of += [sp.diags_array(spread[:, 3, 0, j]) for j in range(3)]
    # From block by block to A's order: φ of the three, their B₁, their B₂, the oscillators.
    order = (np.array([0, 3, 6, 1, 4, 7, 2, 5, 8, 9, 10, 11])[:, None] * n + np.arange(n)).ravel()
    change = sp.coo_array(L - sp.csr_array(sp.block_diag(rows_of, format="csr"))[order][:, order])
    felt = np.abs(change.data) > _NOTHING
    near = [change.data[felt], change.row[felt], change.col[felt]]
    names = ("near_values", "near_rows", "near_columns")
    return {"w": w, "edges": edges, "c": c, "ring": ring, **dict(zip(names, near, strict=True))}


def _shift(n: int, by: int, ring: bool) -> Any:
    """(S u)_i = u_{i+by}, round the ring or with zeros beyond the ends."""
    turned = sp.eye_array(n, k=by)
    if ring and by:
        turned = turned + sp.eye_array(n, k=by - n if by > 0 else by + n)
    return sp.csr_array(turned)


def exact(name: str) -> Float:
    """The reference, fields × frames × points, in SI.

    Of the ring the modal solution of the semi-discrete system by the tests' own route: the 12 × 12
    system in SI, eigenvectors of each wavenumber, Gauss sums over the pulses, without A. Of the
    bars expm_multiply on the whole A, which on the ring is within 2e-12 of the modal solution.

    Args:
        name: of the problem.
    """
    made, bar, sources, seconds = problem(name)
    if name == "ring":
        sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
        from exact import modal_field

        found = modal_field(made, bar, sources, np.linspace(0.0, seconds, FRAMES))
        return np.stack([found[field] for field in sorted(found)])
    from peers.expm_multiply import Peer
    from peers.given import Given

    given = Given(for_peers((made, bar, sources, seconds), nothing=0.0))
    return in_fields(name, Peer(given, 0.0).run(FRAMES))


def in_fields(name: str, frames: Float) -> Float:
    """A peer's frames, of A's scaled components, as fields × frames × points in SI."""
    made, bar, _, _ = problem(name)
    medium = made if isinstance(made, ws.Medium) else made.first
    n = len(bar.nodes)
    parts = np.split(frames.reshape(len(frames), 12, n), [3, 9], axis=1)
    pairs = [
        (parts[0][:, None], parts[1].reshape(-1, 2, 3, n)),
        (np.zeros((len(frames), 0, 3, n)), parts[2][:, None]),
    ]
    found = to_fields(pairs, ROTATION.blocks, medium)
    return np.stack([found[field][..., : bar.cells] for field in sorted(found)])


def error(fields: Float, reference: Float) -> float:
    """Largest over the fields of max |difference| / max |exact|, over all frames given."""
    reference = reference[:, : fields.shape[1], : fields.shape[2]]
    difference = np.abs(fields - reference).max(axis=(1, 2))
    return float((difference / np.abs(reference).max(axis=(1, 2))).max())
