"""What a reader should know beside the checks of a bar with layers or ends."""

from __future__ import annotations

import math

import numpy as np

from wavesim.material.shown import KHZ
from wavesim.readings.bar.bloch import Cells
from wavesim.readings.bar.excited_band import JUDGED, pulses
from wavesim.readings.bar.pulse_test import PulseTest
from wavesim.readings.bar.reading import Reading
from wavesim.readings.bar.transmission import Scattered
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import default_samples
from wavesim.sources import excitation, unfolded
from wavesim.verdict import remedies
from wavesim.verdict.bar import sent_back, wavenumbers
from wavesim.verdict.check import receiver_notes


def bar_notes(reading: Reading, field: Field) -> list[str]:
    """What a reader should know beside the checks."""
    if not reading.moved:
        return [
            "nothing moved: nothing could be checked; begin a source before the end ([[sources]] "
            "delay or start), and away from fixed ends"
        ]
    found = []
    if not field.receivers:
        found.append(
            "no receiver: nothing was held against the exact solver; add [[receivers]] to compare "
            "signals"
        )
    found += receiver_notes(field, reading.exact, reading.heard, reading.refused)
    if field.energy is not None and not field.layers.conserves_energy:
        found.append(
            'energy was not judged: the equations of closure "printed" conserve none where a ≠ 0; '
            'take "consistent" to have it judged'
        )
    found += [note for pulse in reading.pulses if (note := _blind(field, pulse))]
    return found + _folded(reading, field) + _too_short(reading, field) + _near_cutoffs(field)


def _blind(field: Field, pulse: PulseTest) -> str:
    """The note on frequencies at which k between receivers is not that of one wave, or ""."""
    if pulse.k_exact is None:
        return ""
    error, told = wavenumbers(pulse)
    read, off = np.isfinite(error).sum(), (np.isfinite(error) & ~told).sum()
    if 2 * off <= read:
        return ""
    return (
        f"{pulse.name} k between receivers is not that of one wave at {off} of {read} frequencies, "
        f"nor is it in the exact signals, and was not judged there; "
        f"{remedies.of_window(field, pulse)}"
    )


def _folded(reading: Reading, field: Field) -> list[str]:
    """The note on frequencies that frames fold something onto, which are not judged."""
    own = {block.sector: pulses(field, block) for block in field.blocks if block.macro}
    lost = {}
    spectra: list[Scattered | Cells] = [*reading.scattered, *reading.cells]
    for one in spectra:
        driven = excitation(own[one.sector], one.omega) >= JUDGED
        off = one.omega[driven & ~unfolded(own[one.sector], one.omega, field.interval)]
        if len(off):
            lost[one.sector] = f"{one.sector} from {float(off.min()) * KHZ:.4g} kHz on"
    needed = default_samples(field.sources, field.layers, field.simulation.duration)
    if not lost or needed <= len(field.t):
        return []
    return [
        f"T, R and Bloch waves were not judged everywhere ({', '.join(lost.values())}): "
        f"{len(field.t)} frames fold onto these frequencies what the sources drive beyond "
        f"{math.pi / field.interval * KHZ:.4g} kHz; take [time] samples = {needed} or more"
    ]


def _too_short(reading: Reading, field: Field) -> list[str]:
    """Bars that ring, of which the receivers hear no eigenfrequency apart from the next."""
    if field.simulation.lossy or not field.receivers or reading.ringing:
        return []
    if not any(block.macro for block in field.blocks):
        return []
    last = float(field.t[-1])
    return [
        f"no eigenfrequency was judged: none that a record of {last:.3g} s tells from the next is "
        "heard at the receivers; lengthen [time] duration, or move a receiver"
    ]


def _near_cutoffs(field: Field) -> list[str]:
    """The note on what absorbing ends send back."""
    told = sent_back(field)
    if not told:
        return []
    return [
        "an absorbing end sends back more than 1e-3 of waves just above a cutoff, which are long: "
        f"{told}; keep the sources' band off them, or take stiffer media at the ends"
    ]
