"""How a field is read at a position between the grid's points, and what acts there laid on them."""

from __future__ import annotations

import math

import numpy as np

from wavesim.grid.bar import Bar, Float, Index
from wavesim.grid.stencils import interpolation_weights

# A Gaussian is cut at so many widths, where it is 1e-16 of its top. Sampled at a width of so many
# cells its sum is its integral to 3e-15; where that is off by more, a closure is near, which is not
# felt from so many cells on.
CUT = 8.5
_SAMPLED = 1.3
_INTEGRATED = 1e-9
_WIDE = 32


def sampling(bar: Bar, position: float, staggered: bool) -> tuple[Float, Index]:
    """Weights and grid indices that interpolate a field at a position, to the bar's order.

    Points are taken from one stretch only, as a field has kinks or jumps at interfaces; at an
    interface from the one to its right, as :meth:`Layers.layer_at` does.

    Args:
        bar: the grid.
        position: m, in [0, L].
        staggered: True for a field on the half-nodes.

    Raises:
        ValueError: the position is outside the bar.
    """
    if not 0 <= position <= bar.length * (1 + 1e-12):
        raise ValueError(
            f"position = {position:g} m: must be within the bar, 0 to {bar.length:g} m"
        )
    first_cell, start = 0, 0.0
    for cells, spacing in bar.all_stretches:
        end = start + cells * spacing
        if position < end - 1e-9 * spacing or end >= bar.length * (1 - 1e-12):
            break
        first_cell, start = first_cell + cells, end
    first = start + 0.5 * spacing if staggered else start
    weights, indices = interpolation_weights(position, first, spacing, bar.order)
    if not (bar.uniform and bar.periodic):
        last = cells - 1 if staggered else cells
        shift = max(0, -int(indices[0])) - max(0, int(indices[-1]) - last)
        if shift:
            weights, indices = interpolation_weights(position, first, spacing, bar.order, shift)
        indices = indices + first_cell
    return weights, indices % (bar.cells if bar.periodic or staggered else bar.cells + 1)


def spread(bar: Bar, position: float, width: float, staggered: bool) -> tuple[Float, Index]:
    """Density that stands for δ(x − position), or for a Gaussian of that standard deviation.

    A point is the transpose of :func:`sampling` in the norm of the grid, so that source
    and receiver can be exchanged. A Gaussian exp(−(x−x_s)²/2w²)/(√(2π) w) is cut at 8.5 w
    (1e-16), on a periodic bar laid round it if need be. Where the grid's sum does not integrate
    it, being narrower than 1.3 cells or at a closure, it is a mean of points instead, which has
    its moments up to the bar's order: the moment of a point above all.

    Args:
        bar: the grid.
        position: m, in [0, L].
        width: w, m; 0 for a point.
        staggered: True for a field on the half-nodes.

    Returns:
        Density (1/m) and the grid indices it stands at.

    Raises:
        ValueError: the position is outside the bar, or the Gaussian is too wide for it.
    """
    if width == 0:
        return _point(bar, position, staggered)
    made = sampled(bar, position, width, staggered)
    return _mean_of_points(bar, position, width, staggered) if made is None else made


def sampled(bar: Bar, position: float, width: float, staggered: bool) -> tuple[Float, Index] | None:
    """The Gaussian of :func:`spread` at the grid's points; None where they do not integrate it.

    Arguments and errors are those of :func:`spread`; width > 0.
    """
    if not 0 <= position <= bar.length * (1 + 1e-12):
        sampling(bar, position, staggered)  # says what is wrong
    if 17 * width > bar.length:
        raise ValueError(
            f"width = {width:g} m: a Gaussian of 17 widths must fit into the bar of "
            f"{bar.length:g} m; take at most {0.99 * bar.length / 17:.3g} m"
        )
    x = bar.half_nodes if staggered else bar.nodes
    if bar.periodic:
        distance = (x - position + bar.length / 2) % bar.length - bar.length / 2
    else:
        distance = x - position
        if not CUT * width <= position <= bar.length - CUT * width:
            raise ValueError(
                f"width = {width:g} m: the Gaussian at {position:g} m stands out over an end "
                f"of the bar; take at most "
                f"{min(position, bar.length - position) / CUT:.3g} m, or move it inward"
            )
    indices = np.flatnonzero(np.abs(distance) <= CUT * width)
    density = np.exp(-((distance[indices] / width) ** 2) / 2) / (np.sqrt(2 * np.pi) * width)
    norms = bar.differences
    norm = norms.half_norm if staggered else norms.node_norm
    integrated = abs(density @ norm[indices] - 1) < _INTEGRATED
    if width >= _WIDE * bar.spacing or (width >= _SAMPLED * bar.spacing and integrated):
        return density, indices
    return None


def gaussian(bar: Bar, x: Float, position: float, width: float) -> Float:
    """exp(−(x − position)²/2width²) at points x of a bar, on a periodic one laid round it."""
    shifts = (-bar.length, 0.0, bar.length) if bar.periodic else (0.0,)
    return np.sum([np.exp(-(((x - position - by) / width) ** 2) / 2) for by in shifts], axis=0)


def gaussian_points(cells: float) -> tuple[Float, Float]:
    """Points that stand for a Gaussian so many cells wide: where, in widths, and their shares."""
    count = 2 * math.ceil(CUT * max(4.0, min(4 * cells, 1000.0))) + 1
    u = np.linspace(-CUT, CUT, count)
    weights = np.exp(-(u**2) / 2)
    return u, weights / weights.sum()


def _point(bar: Bar, position: float, staggered: bool) -> tuple[Float, Index]:
    weights, indices = sampling(bar, position, staggered)
    if bar.uniform and bar.periodic:
        return weights / bar.spacing, indices
    norms = bar.differences
    return weights / (norms.half_norm if staggered else norms.node_norm)[indices], indices


def _mean_of_points(
    bar: Bar, position: float, width: float, staggered: bool
) -> tuple[Float, Index]:
    """The same Gaussian as point sources side by side, four to a cell and to a width."""
    u, weights = gaussian_points(width / min(size for _, size in bar.all_stretches))
    densities, points = [], []
    for place, weight in zip(position + width * u, weights, strict=True):
        at = place % bar.length if bar.periodic else min(max(place, 0.0), bar.length)
        density, indices = _point(bar, float(at), staggered)
        densities.append(weight * density)
        points.append(indices)
    indices, entry = np.unique(np.concatenate(points), return_inverse=True)
    return np.bincount(entry, np.concatenate(densities)), indices
