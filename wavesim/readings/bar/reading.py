"""All that a run of a bar with layers or ends measures, beside the exact frequency domain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.layered.signals import signals
from wavesim.material.wave_equations import UNITS
from wavesim.readings.bar.bloch import Cells, cells
from wavesim.readings.bar.eigenfrequencies import Ringing, ringing
from wavesim.readings.bar.pulse_test import PulseTest, pulse_test, spectra
from wavesim.readings.bar.transmission import Scattered, scattered
from wavesim.simulation.field import Field

Float = NDArray[Any]


@dataclass(frozen=True)
class Reading:
    """What was measured, each beside its exact counterpart.

    Attributes:
        exact: {receiver: {field: signal (nt,)}} of the exact solver, rad and 1/m.
        error: {receiver: {field: largest difference over the field's largest value there}}.
        scattered, cells, ringing, pulses: transmission, Bloch waves, eigenfrequencies and pulse
            tests, of each sector that has them.
    """

    exact: dict[str, dict[str, Float]]
    error: dict[str, dict[str, float]]
    scattered: tuple[Scattered, ...]
    cells: tuple[Cells, ...]
    ringing: tuple[Ringing, ...]
    pulses: tuple[PulseTest, ...]

    def tables(self) -> dict[str, tuple[Any, str]]:
        """All arrays with their units, by their path in result.h5."""
        found: dict[str, tuple[Any, str]] = {}
        for receiver, own in self.exact.items():
            for name, values in own.items():
                found[f"exact/{receiver}/{name}"] = values, UNITS[name]
        parts: tuple[tuple[str, Sequence[Any]], ...] = (
            ("transmission", self.scattered),
            ("bloch", self.cells),
            ("eigenfrequencies", self.ringing),
        )
        for group, members in parts:
            for member in members:
                for name, value in vars(member).items():
                    if name != "sector":
                        path = f"{group}/{member.sector}/{name}"
                        found[path] = np.asarray(value), _UNITS.get(name, "–")
        for test in self.pulses:
            for name, value in spectra(test).items():
                found[f"pulse/{test.name}/{name}"] = value, _UNITS.get(name, "–")
        return found


_UNITS = dict.fromkeys(("omega", "sigma", "exact", "found", "bin"), "rad/s") | {
    "period": "m",
    "q": "rad/m",
    "q_exact": "rad/m",
    "damped": "rad/m",
    "k_exact": "rad/m",
    "phase_velocity": "m/s",
    "group_velocity": "m/s",
    "attenuation": "1/m",
    "loss": "dB",
}


def read_bar(field: Field, frequencies: int = 120, damping: float = 18.0) -> Reading:
    """Measure a field of a bar with layers, ends or both.

    Args:
        field: the field, with receivers.
        frequencies: number of frequencies of spectra.
        damping: σT of exponential windows.

    Returns:
        The reading.
    """
    layers, bar = field.layers, field.bar
    assert layers is not None
    # An absorber is no part of the bar that it ends: receivers inside have no counterpart.
    low, high = bar.clear
    seen = {name: x for name, x in field.receivers.items() if low <= x <= high}
    exact: dict[str, dict[str, Float]] = {}
    if seen:
        exact = signals(layers, bar.left, bar.right, field.sources, seen, field.t)
    error = {
        name: {
            key: float(np.abs(field.at(seen[name], key) - value).max() / _peak(value))
            for key, value in own.items()
        }
        for name, own in exact.items()
    }
    blocks = [block for block in field.blocks if block.rotations]
    kept: tuple[list[Any], ...] = ([], [], [], [])
    for block in blocks:
        found = (
            scattered(field, block, frequencies, damping),
            cells(field, block, frequencies, damping),
            ringing(field, block),
            pulse_test(field, block, exact, damping) if exact else None,
        )
        for part, value in zip(kept, found, strict=True):
            if value is not None:
                part.append(value)
    return Reading(exact, error, *(tuple(part) for part in kept))


def _peak(values: Float) -> float:
    return float(np.abs(values).max()) or 1.0
