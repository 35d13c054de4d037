"""Signals at receivers as the grid of a bar will have them, without a step in time.

The semi-discrete bar (``timedomain/operator.py``) in the frequency domain, the micro-field
eliminated as in ``layered/cross_section.py``: with D, norms N and H and Q = HD of the grid,

    [Qᵀ (𝒟/s) D − ω² N ι I_φ s] φ = F + Qᵀ C_φB X Π,    s = 1 + i d/ω in absorbing layers,

a band of a few numbers at each ω. What it differs by from ``layered/signals.py`` is what stencils,
closures, absorbers and sources laid on points do to a signal, all at once. Viscous stress feels of
an initial strain κ₀ only what κ changes by: to σ come −β_d (C_φφ κ₀ − C_φB B₀), to Π likewise.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_lapack_funcs
from scipy.sparse import csr_array

from wavesim.grid.bar import Bar
from wavesim.grid.points import gaussian, sampling, spread
from wavesim.layered.cross_section import Limit, Section, limit
from wavesim.layered.signals import contour_of, named
from wavesim.layered.source_loads import acts_of, body_loads, components
from wavesim.layered.stack import Stack
from wavesim.material.family import Block
from wavesim.simulation.simulation import Simulation, with_spacing
from wavesim.timedomain.absorber import absorption

Values = NDArray[Any]
P = TypeVar("P")  # what a place is called

# A node that is held is so much stiffer than all others.
_STIFF = 1e12
# Friction below this part of the strongest is not felt.
_CALM = 1e-3
# Cells times frequencies that are held in memory; and, times blocks, that are worked out beside a
# run, in about 20 s.
_AT_ONCE = 1_000_000
_MOST = 2e7


def grid_spectra(
    simulated: Simulation, places: Mapping[P, float], omega: Values
) -> dict[P, dict[str, Values]]:
    """Spectra ∫ u e^{iωt} dt of the fields, as the grid has them; Γ is left out.

    Args:
        simulated: bar, layers and sources.
        places: positions by name, m.
        omega: ω, shape (N,), Im ω > 0, rad/s.

    Returns:
        {place: {field: shape (N,)}}, the field's unit times s.
    """
    found: dict[P, dict[str, Values]] = {
        name: {field: np.zeros(len(omega), complex) for field in simulated.fields}
        for name in places
    }
    share = max(1, _AT_ONCE // simulated.bar.cells)
    for block, start in itertools.product(simulated.blocks, range(0, len(omega), share)):
        own = slice(start, start + share)
        for name, fields in _of_block(simulated, block, places, omega[own]).items():
            for field, values in fields.items():
                found[name][field][own] += values
    return found


def in_thirds(simulated: Simulation) -> Simulation:
    """The same on cells a third as long, whose error is a ninth, or less, where differences are of
    order 2 or more: a grid to hold another against."""
    return with_spacing(simulated, simulated.bar.spacing / 3)


def on_thirds(
    simulated: Simulation, receivers: Mapping[str, float]
) -> dict[str, dict[str, Values]]:
    """Signals at receivers (m) by a grid of thirds of the cells, {receiver: {field: (nt,)}}.

    Raises:
        ValueError: the gradient term Γ counts, or it would take long.
    """
    finer = in_thirds(simulated)
    grid = contour_of(simulated.layers, simulated.sources, simulated.duration)
    why = "the gradient term Γ counts" if simulated.gradient_felt else ""
    if finer.bar.cells * len(grid.omega) * len(simulated.blocks) > _MOST:
        why = "it takes too long"
    if why:
        raise ValueError(
            f"nor were signals held against those of thirds of the cells, as {why}; run it again "
            f"with [bar] spacing = {finer.bar.spacing:.6g} and compare"
        )
    return {
        name: {field: grid.signal(values, simulated.times) for field, values in fields.items()}
        for name, fields in grid_spectra(finer, receivers, grid.omega).items()
    }


def _of_block(
    simulated: Simulation, block: Block, places: Mapping[P, float], omega: Values
) -> dict[P, dict[str, Values]]:
    bar = simulated.bar
    stack = Stack(simulated.layers, block, omega, False)
    sections = _sections(stack, bar)
    limits = [(cells, limit(one, stack.scaled)) for cells, one in sections]
    inertia = _inertia(stack, bar) if block.macro else np.zeros((1, len(bar.nodes)))
    force, pushed, strained = _forces(simulated, stack, sections, inertia)
    seen, weights = _sampled(bar, places.values(), True)
    # A block without a macro-field follows what drives it, each point by itself.
    values = np.zeros((len(omega), len(places)))
    kappa = np.zeros((len(omega), len(seen)))
    if block.macro:
        near, at_nodes = _sampled(bar, places.values(), False)
        phi, kappa = _moved(simulated, stack, limits, inertia, (force, pushed, strained), seen)
        values = phi[:, near] @ at_nodes
    B = np.zeros((len(block.micro), *kappa.shape), complex)
    for cells, one in limits:
        own = (seen >= cells.start) & (seen < cells.stop)
        if block.macro:
            B[..., own] = one.Xp.T[:, :, None] * kappa[:, own]
        for component, total in pushed.items():
            amount = total[:, seen[own]] / one.modulus[:, None]
            B[..., own] += one.X[..., component].T[:, :, None] * amount
    strains = B @ weights
    found, p = {}, len(block.macro)
    for place, name in enumerate(places):
        there = values[:, place, None][:, :p], strains[:, :, place].T
        found[name] = named(block, *there, stack.units)
    return found


def _moved(
    simulated: Simulation,
    stack: Stack,
    limits: Sequence[tuple[slice, Limit]],
    inertia: Values,
    driven: tuple[Values, Mapping[int, Values], Values],
    seen: Values,
) -> tuple[Values, Values]:
    """φ at nodes, shape (N, nodes), and κ at the half-nodes that are seen; driven as of _forces."""
    bar, (force, pushed, begun) = simulated.bar, driven
    length, scaled = float(stack.units.length), stack.scaled
    at_node, at_half = (_stretching(simulated, stack, x) for x in (bar.nodes, bar.half_nodes))
    D, half_norm = bar.difference_matrix * length, bar.differences.half_norm / length
    stiffness = np.zeros((len(scaled), bar.cells), complex)
    strained = stiffness + begun
    for cells, one in limits:
        stiffness[:, cells] = one.D[:, None]
        for component, total in pushed.items():
            strained[:, cells] += one.pX[:, component, None] * total[:, cells]
    stiffness *= half_norm / at_half
    force += (D.T @ (half_norm * strained).T).T
    diagonal = -(scaled[:, None] ** 2) * inertia * at_node
    held = [node for node, end in ((0, bar.left), (-1, bar.right)) if end == "fixed"]
    stiff = _STIFF * float(np.abs(diagonal).max())
    diagonal[:, held], force[:, held] = stiff, 0.0
    for node, drive in _at_ends(simulated, stack):
        force[:, node] += drive * (stiff if node in held else 1.0)
    phi = _solve(D, stiffness, diagonal, force, bar.periodic)
    return phi, (D[seen] @ phi.T).T / np.broadcast_to(at_half, stiffness.shape)[:, seen]


def _sampled(bar: Bar, positions: Iterable[float], staggered: bool) -> tuple[Values, Values]:
    """The points that values at positions (m) are read from, and the weights, (points, positions).

    Arguments and error as of :func:`sampling`.
    """
    each = [sampling(bar, x, staggered) for x in positions]
    points = np.unique(np.concatenate([own for _, own in each]))
    weights = np.zeros((len(points), len(each)))
    for place, (own_weights, own) in enumerate(each):
        np.add.at(weights[:, place], np.searchsorted(points, own), own_weights)
    return points, weights


def _stretching(simulated: Simulation, stack: Stack, x: Values) -> Values:
    """s at positions (m), shape (N, n), or (1, n) of 1 without absorbing layers."""
    d, _ = absorption(simulated.layers, simulated.bar, x)
    if not d.any():
        return np.ones((1, len(x)))
    return 1 + 1j * np.outer(1 / stack.scaled, float(stack.units.time) * d)


def _forces(
    simulated: Simulation,
    stack: Stack,
    sections: Sequence[tuple[slice, Section]],
    inertia: Values,
) -> tuple[Values, dict[int, Values], Values]:
    """F at nodes, shape (N, nodes), Π of each micro-field that is driven, (N, half-nodes), and what
    viscous stress does not feel of σ, (half-nodes,)."""
    bar, length = simulated.bar, float(stack.units.length)
    node_norm = bar.differences.node_norm / length
    force = np.zeros((len(stack.scaled), len(bar.nodes)), complex)
    none = np.zeros((len(stack.scaled), bar.cells), complex)
    pushed: dict[int, Values] = {}
    kappa = np.zeros(bar.cells)
    begun = np.zeros((len(stack.block.micro), bar.cells))
    for source in simulated.sources:
        for load in body_loads(stack, [source], False, inertial=True):
            micro = load.component - len(stack.block.macro)
            density, points = _laid(bar, source, micro >= 0)
            on = np.outer(load.strength, density * length)
            if load.inertial:
                value = (on[0] / (-1j * stack.scaled[0] * stack.units.time)).real
                if micro < 0:
                    kappa += bar.difference_matrix @ value * length
                else:
                    begun[micro] += value
            if micro < 0:
                force[:, points] += on * (inertia if load.inertial else node_norm[None])[:, points]
                continue
            for cells, one in sections if load.inertial else ():
                mine = (points >= cells.start) & (points < cells.stop)
                on[:, mine] *= (one.own.i_B * one.losses(stack.scaled)[1])[:, None]
            pushed.setdefault(micro, none.copy())[:, points] += on
    strained = np.zeros(bar.cells)
    for cells, one in sections if kappa.any() or begun.any() else ():
        own, viscous = one.own, one.damping.stiffness
        at = viscous * kappa[cells], viscous * begun[:, cells]
        if one.macro:
            strained[cells] = own.c_pp[0, 0] * at[0] - own.c_pb[0] @ at[1]
        back = own.c_bb @ at[1] - (np.outer(own.c_bp[:, 0], at[0]) if one.macro else 0)
        for micro, total in enumerate(back) if viscous else ():
            pushed.setdefault(micro, none.copy())[:, cells] += total
    return force, pushed, strained


def _at_ends(simulated: Simulation, stack: Stack) -> list[tuple[int, Values]]:
    """What is driven at an end: the node, and its load or the φ that it is given, shape (N,)."""
    found = []
    for source in simulated.sources:
        acts = acts_of(source)
        if source.field in stack.block.fields and acts in ("surface", "prescribed"):
            unit = stack.units.macro
            if acts == "surface":
                unit = stack.units.force(source.field) * stack.units.length
            signal = np.asarray(source.spectrum(stack.omega), complex) / unit
            node = 0 if source.position < simulated.bar.length / 2 else -1
            parts = components(stack.block, source.field)
            found += [(node, weight * signal) for _, weight in parts]
    return found


def _sections(stack: Stack, bar: Bar) -> list[tuple[slice, Section]]:
    """Cells of one section each: those of a layer, or single ones where it is graded, or where
    friction on B calms the depth of an absorbing layer."""
    found, first = [], 0
    _, calm = absorption(stack.layers, bar, bar.half_nodes)
    felt = calm > _CALM * calm.max()
    for layer, (cells, _) in zip(stack.layers.layers, bar.all_stretches, strict=True):
        alone = felt[first : first + cells] | (layer.last is not None)
        cuts = np.flatnonzero(alone[1:] | alone[:-1]) + 1
        for start, end in itertools.pairwise([0, *cuts.tolist(), cells]):
            own = slice(first + start, first + end)
            one = stack.bare(layer, float(bar.half_nodes[own].mean()))
            if felt[own.start]:
                law = one.damping
                one = replace(one, damping=replace(law, mass=law.mass + float(calm[own.start])))
            found.append((own, one))
        first += cells
    return found


def _inertia(stack: Stack, bar: Bar) -> Values:
    """N ι I_φ of each node, shape (N, nodes); layers that share a node add theirs."""
    length, scaled = float(stack.units.length), stack.scaled
    found = np.zeros((len(scaled), bar.cells + 1), complex)
    first = 0
    for layer, (cells, size), norm in zip(
        stack.layers.layers, bar.all_stretches, bar.stretch_norms, strict=True
    ):
        x = layer.start + np.arange(cells + 1 if layer.last else 1) * size
        for node, position in enumerate(np.minimum(x, layer.end)):
            one = stack.bare(layer, float(position))
            own = slice(first + node, first + node + 1 if layer.last else first + cells + 1)
            share = (norm[node : node + 1] if layer.last else norm) / length
            found[:, own] += np.outer(one.own.i_phi * one.losses(scaled)[1], share)
        first += cells
    if not bar.periodic:
        return found
    found[:, 0] += found[:, -1]
    return found[:, :-1]


def _laid(bar: Bar, source: Any, staggered: bool) -> tuple[Values, Values]:
    """Density (1/m) of a source and the points it stands at; an initial field is sampled."""
    if acts_of(source) != "initial":
        return spread(bar, source.position, source.width, staggered)
    x = bar.half_nodes if staggered else bar.nodes
    density = gaussian(bar, x, source.position, source.width)
    return density / (np.sqrt(2 * np.pi) * source.width), np.arange(len(x))


def _solve(D: csr_array, stiffness: Values, diagonal: Values, force: Values, ring: bool) -> Values:
    """φ of (Dᵀ c D + m) φ = F at each ω, by elimination in a band.

    Args:
        D: shape (half-nodes, nodes).
        stiffness: c, shape (N, half-nodes).
        diagonal, force: m and F, shape (N, nodes).
        ring: whether D reaches round; the ring then is folded, which doubles the band.
    """
    nodes = D.shape[1]
    place = np.arange(nodes)
    if ring:
        place = np.where(place < (nodes + 1) // 2, 2 * place, 2 * (nodes - 1 - place) + 1)
    # One entry of DᵀcD for each pair of a row's numbers.
    count = np.diff(D.indptr)
    first = np.repeat(np.arange(D.nnz), np.repeat(count, count))
    starts = np.repeat(D.indptr[:-1], count**2)
    within = np.arange(len(first)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
    second = starts + within % np.repeat(count, count**2)
    i, j = place[D.indices[first]], place[D.indices[second]]
    wide = int(np.abs(i - j).max())
    deep = 3 * wide + 1
    at = j * deep + 2 * wide + i - j
    row = np.repeat(np.arange(D.shape[0]), count**2)
    spread_out = csr_array(
        ((D.data[first] * D.data[second]).astype(complex), (at, row)),
        shape=(nodes * deep, D.shape[0]),
    )
    (gbsv,) = get_lapack_funcs(("gbsv",), (diagonal, force))
    found = np.empty_like(force)
    for number in range(len(force)):
        band = (spread_out @ stiffness[number]).reshape(nodes, deep)
        band[place, 2 * wide] += diagonal[number]
        right = np.empty(nodes, complex)
        right[place] = force[number]
        *_, x, _ = gbsv(wide, wide, band.T, right, overwrite_ab=True, overwrite_b=True)
        found[number] = x[place]
    return found
