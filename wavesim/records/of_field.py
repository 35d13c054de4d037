"""The record of one block of a simulated field, for the methods that take any record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wavesim.material.family import Block
from wavesim.records.record import Record, record
from wavesim.records.relations import OfMedium
from wavesim.simulation.field import Field

OF_LAYERS = (
    "is of a bar with layers or ends; its run has read its receivers already: see summary.json and "
    "the groups exact, transmission, bloch, eigenfrequencies, pulse"
)


def block_record(field: Field, block: Block) -> Record:
    """One block's components on the grid, a ring.

    Components that live on half-nodes are given at the nodes half a cell before: a shift that all
    their waves share, which changes no frequency and no wavenumber.

    Args:
        field: the field.
        block: one of ``field.blocks``.

    Returns:
        The record, in the units of ``Field.components``.
    """
    parts = [values for values, _ in field.components(block)]
    names = [next(iter(c)) for c in block.macro + block.micro]
    own = tuple(s.position for s in field.sources if s.field in block.fields)
    made = record(
        np.stack(parts),
        field.t,
        field.bar.nodes,
        names=names,
        ring=True,
        quiet_from=field.quiet_from,
        sources=own,
        trusted=True,
    )
    return replace(made, leak=0.0)  # all its receivers are alike


def references(field: Field, block: Block) -> tuple[OfMedium, OfMedium]:
    """Relations of the continuum and of the field's grid."""
    return OfMedium(field.medium, block), OfMedium(field.medium, block, field.bar)
