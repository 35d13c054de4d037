"""Records with the medium that they are of: those of a result file, or one with a medium laid over.

A result.h5 brings its medium and its grid along; of any other record the medium is what a user
supposes, and there is no grid.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesim.material.damping import UNDAMPED, Damping
from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.records.record import Record, RecordError
from wavesim.records.record import record as made_record
from wavesim.records.relations import OfMedium

if TYPE_CHECKING:
    from wavesim.records.files import Layout

OF_LAYERS = (
    "is of a bar with layers or ends; its run has read its receivers already: see summary.json and "
    "the groups exact, transmission, bloch, eigenfrequencies, pulse"
)


@dataclass(frozen=True)
class RecordOfMedium:
    """A record, with what is known of the medium whose waves it holds.

    Attributes:
        name: of the block, or of the file.
        record: the record.
        medium, block: theory to lay over it; None without.
        bar: grid that the record obeys; None for a laboratory's.
    """

    name: str
    record: Record
    medium: Medium | None = None
    block: Block | None = None
    bar: Any = None

    @property
    def label(self) -> str:
        """The name as part of a file's: no brackets."""
        return self.name.translate({ord("["): "_skew_", ord("("): "_even_", 93: "", 41: ""})

    @property
    def law(self) -> Damping:
        """Losses of a simulated field; none of any other."""
        return self.medium.damping if self.bar is not None and self.medium else UNDAMPED

    @property
    def theory(self) -> tuple[OfMedium, OfMedium | None] | None:
        """Relations of the continuum and of the grid."""
        if self.medium is None or self.block is None:
            return None
        exact = OfMedium(self.medium, self.block)
        return exact, None if self.bar is None else OfMedium(self.medium, self.block, self.bar)


def of_files(
    paths: Sequence[str | Path], layout: Layout, medium: Medium | None, sector: str
) -> RecordOfMedium:
    """One record of files that are no run's.

    Args:
        paths: of the file, or of several, each of some receivers.
        layout: what it does not say for itself.
        medium: theory to lay over it.
        sector: which sector's, for a record that does not say.

    Raises:
        RecordError: the file can't be used.
    """
    from wavesim.records.files import file_of, read  # a run's own record needs no reader of files

    path = file_of(Path(paths[0]))
    record = read(paths, layout)
    if medium is None:
        return RecordOfMedium(path.stem, record)
    try:
        (block, *others) = medium.family.blocks_of(sector)
    except ValueError as error:
        raise RecordError(f"--sector: {error}") from None
    if others:
        raise RecordError(
            f"--sector {sector}: its waves do not travel and can't be told apart in one record; "
            "take longitudinal or transverse2"
        )
    return RecordOfMedium(path.stem, record, medium, block)


def block_record(field: Any, block: Block) -> Record:
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
    made = made_record(
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


def sectors(path: Path, travelling: bool = False) -> Iterator[RecordOfMedium]:
    """Records of the driven sectors of a result.h5, each read when it is asked for.

    Args:
        path: of the file.
        travelling: whether of no more than those in which waves travel, where there are any.

    Raises:
        RecordError: the file can't be used, or is of a bar with layers or ends.
    """
    from wavesim.io.result_reader import StorageError
    from wavesim.records.run_folder import field_of

    field = field_of(path)
    if not field.simulation.endless:
        # Its waves are not ω(k) of one medium on a ring, which is what is looked for here.
        raise RecordError(f"{path}: {OF_LAYERS}")
    moving = [b for b in field.blocks if b.macro]
    for block in moving if travelling and moving else field.blocks:
        try:
            record = block_record(field, block)
        except RecordError as error:
            raise RecordError(f"{path}: {error}") from None
        except StorageError as error:
            raise RecordError(str(error)) from None
        yield RecordOfMedium(block.name, record, field.medium, block, field.bar)
