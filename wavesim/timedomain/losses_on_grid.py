"""What a bar loses, point by point: loss laws and absorbers on its grid, scaled.

Values at half-nodes stand at the node to their left, as those of ``coefficients_on_grid.py`` do.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.family import Block
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.timedomain.absorber import absorption
from wavesim.timedomain.coefficients_on_grid import at_half, joined, module, placed, stretches


class Losses(eqx.Module):
    """What is lost, point by point, shape (points,) unless it says otherwise.

    Attributes:
        mass_node: α at nodes.
        drag_node, drag_half: α + d on φ̇, α + α_B on Ḃ.
        spring_node: α d on φ.
        stiffness: β_d over the unrelaxed modulus, at half-nodes.
        rates, strengths: ω_l and Y_l of the standard linear solids, at half-nodes, shape
            (mechanisms, points).
        absorb_half: d at half-nodes.
        damped, viscous, absorbing: whether there is a loss law, one with β_d, an absorbing end.
    """

    mass_node: Any
    drag_node: Any
    drag_half: Any
    spring_node: Any
    stiffness: Any
    rates: Any
    strengths: Any
    absorb_half: Any
    damped: bool = eqx.field(static=True)
    viscous: bool = eqx.field(static=True)
    absorbing: bool = eqx.field(static=True)

    @property
    def lossy(self) -> bool:
        """Whether anything is lost."""
        return self.damped or self.absorbing


def losses(
    layers: Layers,
    bar: Bar,
    block: Block,
    reference: Medium,
    plain: Layers | None = None,
    sizes: Any = None,
) -> Losses:
    """Loss laws and absorbers over a bar.

    Args:
        layers: what the bar is made of; parameters may be traced by jax.
        bar: its grid.
        block: one of those that it is for: absorbers and what layers that meet are to it differ by
            family.
        reference: the medium whose units to scale by.
        plain: layers of plain numbers, for the absorbers, where the others are traced.
        sizes: as of :func:`coefficients`; absorbers stay as they are.
    """
    time = float(scales(reference).time)
    layers = layers.mapped(lambda medium: medium.part(block))
    plain = layers if plain is None else plain.mapped(lambda medium: medium.part(block))
    laws = [layer.medium.damping for layer in layers.layers]
    count, points = max(len(law.rates) for law in laws), len(bar.nodes)
    mass_half, stiffness = np.zeros(points), np.zeros(points)
    rates, strengths = np.zeros((count, points)), np.zeros((count, points))
    drag: Any = np.zeros(bar.cells + 1)
    inertia: Any = np.zeros(bar.cells + 1)
    for layer, cells, norm, x in stretches(layers, bar, sizes):
        law = layer.medium.damping
        mass_half[cells] = law.mass * time
        stiffness[cells] = law.stiffness / time / law.unrelaxed
        for number, (rate, strength) in enumerate(zip(law.rates, law.strengths, strict=True)):
            rates[number, cells], strengths[number, cells] = rate * time, strength
        # Only at the ends of a stretch do others share the node; elsewhere any inertia will do.
        ends = [layer.at(position) for position in x[[0, -1]]]
        of_ends = [end.inertias[0] for end in ends]
        at = np.append(np.zeros(len(x) - 1, int), 1)
        xp = module(*of_ends)
        own = placed(xp.stack([xp.asarray(end) for end in of_ends])[at] * norm, cells, bar)
        drag, inertia = drag + law.mass * time * own, inertia + own
    at_node, _ = absorption(plain, bar, bar.nodes)
    inner, calm = absorption(plain, bar, bar.half_nodes)
    mass_node = joined(bar, drag) / joined(bar, inertia)
    return Losses(
        mass_node=mass_node,
        drag_node=mass_node + time * at_node,
        drag_half=mass_half + at_half(bar, time * calm),
        spring_node=mass_node * time * at_node,
        stiffness=stiffness,
        rates=rates,
        strengths=strengths,
        absorb_half=at_half(bar, time * inner),
        damped=any(laws),
        viscous=bool(stiffness.any()),
        absorbing="absorbing" in (bar.left, bar.right),
    )
