"""What losses ask of a reading of ω at given k: how weak a wave is sought, and until when.

Waves of a medium with losses are sinusoids that decay, which harmonic inversion holds exactly. Two
things limit it: a wave that has died away is left out and shifts the others by a part of their
width; and relaxations (constant Q) leave sums of decays that do not oscillate, which no sinusoid
holds and which outlast the waves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wavesim.material.damping import Damping
from wavesim.records.record import Record
from wavesim.records.relations import Relation

# Weakest wave sought, over the strongest at its wavenumber: where nothing relaxes, and where
# something does. By what is left out a wave may be shifted by that part of its width γ + 2π/T.
WEAKEST, WEAKEST_RELAXING = 1e-4, 3e-3
# A wave is asked for where it is so many times stronger.
ABOVE_WEAKEST = 5.0
# Nepers by which waves have fallen when relaxations begin to outlast them.
_NEPERS = 3.0
_WAVENUMBERS = 65


def weakest(law: Damping) -> float:
    """Weakest wave sought, over the strongest at its wavenumber, –."""
    return WEAKEST_RELAXING if law.rates else WEAKEST


def while_waves_last(record: Record, law: Damping, waves: Relation, k_max: float) -> Record:
    """The record, ended where relaxations would outlast its waves, with a note.

    Args:
        record: of a field.
        law: the medium's losses.
        waves: the medium's relation, ω − iγ.
        k_max: highest wavenumber wanted, rad/m.
    """
    note = f"waves decay: what is weaker than {weakest(law):g} of the strongest is not sought"
    if not law.rates:
        return replace(record, notes=(*record.notes, note))
    k = np.linspace(0, k_max, _WAVENUMBERS)[1:]
    fall = float(np.median(-np.imag(waves.omega(k))))
    last = int(np.searchsorted(record.t, record.quiet_from + _NEPERS / fall)) + 1
    if last < len(record.t):
        note += (
            f", and it is read until {record.t[last - 1]:.3g} s, when waves have fallen by "
            f"{_NEPERS:g} nepers: after that relaxations outlast them, which do not oscillate"
        )
        record = replace(
            record,
            t=record.t[:last],
            values=record.values[:, :last],
            missing=record.missing[:last],
        )
    return replace(record, notes=(*record.notes, note))
