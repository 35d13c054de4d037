"""All that a run of a bar with layers or ends measures, beside the exact frequency domain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavesim.layered.graded_layer import at_most
from wavesim.layered.signals import signals
from wavesim.material.family import known_field
from wavesim.readings.bar.bloch import Cells, Repeated, cells, repeated_stretch
from wavesim.readings.bar.eigenfrequencies import Ringing, audible, ringing
from wavesim.readings.bar.loudness import Loudness
from wavesim.readings.bar.pulse_test import PulseTest, pulse_test, spectra
from wavesim.readings.bar.transmission import Scattered, Specimen, scattered, specimen
from wavesim.readings.damped_transform import check_asked
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import at_double_moment

if TYPE_CHECKING:  # what draws a run reads no case file
    from wavesim.case.schema import BandTable

Float = NDArray[Any]

# Steps through graded layers, all together: about 16 s beside the run.
_MOST_STEPS = 2e6


@dataclass(frozen=True)
class Reading:
    """What was measured, each beside its exact counterpart.

    Attributes:
        exact: {receiver: {field: signal (nt,)}} of the exact solver, in its unit.
        error, heard: of :meth:`Loudness.compared`; heard None where all arrived.
        scattered, cells, ringing, pulses: transmission, Bloch waves, eigenfrequencies and pulse
            tests, of each sector that has them.
        moved: whether anything moved at all.
        refused: why the exact solvers do not have some of it.
        finer: signals of a grid of thirds of the cells, where the exact solver has none.
    """

    exact: dict[str, dict[str, Float]]
    error: dict[str, dict[str, float]]
    scattered: tuple[Scattered, ...]
    cells: tuple[Cells, ...]
    ringing: tuple[Ringing, ...]
    pulses: tuple[PulseTest, ...]
    heard: Mapping[str, set[str]] | None = None
    moved: bool = True
    refused: tuple[str, ...] = ()
    finer: Mapping[str, dict[str, Float]] = field(default_factory=dict)

    def tables(self) -> dict[str, tuple[Any, str]]:
        """All arrays with their units, by their path in result.h5."""
        found: dict[str, tuple[Any, str]] = {}
        for receiver, own in self.exact.items():
            for name, values in own.items():
                found[f"exact/{receiver}/{name}"] = values, known_field(name).unit
        parts: tuple[tuple[str, Sequence[Any]], ...] = (
            ("transmission", self.scattered),
            ("bloch", self.cells),
            ("eigenfrequencies", self.ringing),
        )
        for group, members in parts:
            for member in members:
                for name, value in vars(member).items():
                    if name not in _NOT_STORED:
                        path = f"{group}/{member.sector}/{name}"
                        found[path] = np.asarray(value), _UNITS.get(name, "–")
        for test in self.pulses:
            for name, value in spectra(test).items():
                found[f"pulse/{test.name}/{name}"] = value, _UNITS.get(name, "–")
        return found


# Of what was measured: what it is of, and where in the bar.
_NOT_STORED = (
    "sector",
    "line",
    "bands",
    "before",
    "behind",
    "faces",
    "k",
    "nodes",
    "step",
    "driven",
)
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


@dataclass(frozen=True)
class Expected:
    """What the exact solvers say of a bar before anything is simulated.

    Attributes:
        signals: {receiver: {field: signal (nt,)}}, in its unit; none inside an absorber, which is
            no part of the bar that it ends, and none on a point source of a micro-field.
        finer: of a grid of thirds of the cells, where the exact solver has none.
        specimens, repeated, eigenfrequencies: by sector, of those that have them.
        refused: why the exact solvers do not have some of it.
    """

    signals: dict[str, dict[str, Float]]
    finer: dict[str, dict[str, Float]]
    specimens: dict[str, Specimen]
    repeated: dict[str, Repeated]
    eigenfrequencies: dict[str, Float]
    refused: list[str]


def expected(
    field: Field,
    frequencies: int = 120,
    damping: float = 18.0,
    bands: Sequence[BandTable] = (),
) -> Expected:
    """What is to be expected of a field; no value of it is looked at, so that it may be to come.

    Args:
        field: of any bar; of a ring of one medium signals alone.
        frequencies: number of frequencies of spectra.
        damping: σT of exponential windows.
        bands: those in which T is to be judged.
    """
    layers, bar = field.layers, field.bar
    low, high = bar.clear
    seen = {name: x for name, x in field.receivers.items() if low <= x <= high}
    seen = {name: x for name, x in seen.items() if not at_double_moment(field.simulation, x)}
    found = Expected({}, {}, {}, {}, {}, [])

    def asked(make: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return make(*arguments)
        except ValueError as error:  # what the exact solvers do not have, the simulator may
            if str(error) not in found.refused:
                found.refused.append(str(error))
            return None

    with at_most(_MOST_STEPS):
        if seen:
            known = layers, bar.left, bar.right, field.sources, seen, field.t
            found.signals.update(asked(signals, *known) or {})
            if not found.signals:
                from wavesim.readings.bar.grid_signals import on_thirds  # loads scipy

                found.finer.update(asked(on_thirds, field.simulation, seen) or {})
        blocks = () if field.simulation.endless else field.blocks
        for block in (block for block in blocks if block.macro):
            if (between := asked(specimen, field, block, frequencies, damping, bands)) is not None:
                found.specimens[block.sector] = between
            if (stretch := asked(repeated_stretch, field, block, frequencies, damping)) is not None:
                found.repeated[block.sector] = stretch
            if (clear := asked(audible, field, block)) is not None:
                found.eigenfrequencies[block.sector] = clear
    return found


def read_bar(
    field: Field,
    frequencies: int = 120,
    damping: float = 18.0,
    known: Expected | None = None,
    bands: Sequence[BandTable] = (),
) -> Reading:
    """Measure a field of a bar with layers, ends or both.

    Args:
        field: the field, with receivers.
        frequencies: number of frequencies of spectra.
        damping: σT of exponential windows.
        known: of :func:`expected`, for the same numbers; worked out where None.
        bands: those in which T is to be judged.

    Returns:
        The reading.

    Raises:
        ValueError: the field is of a ring of one medium, or a number is out of its range.
    """
    check_asked(frequencies, damping)
    if field.simulation.endless:
        raise ValueError(
            "field: of a ring of one medium, with no layers and no ends to be read; take extract"
        )
    known = known or expected(field, frequencies, damping, bands)
    exact, loud = known.signals, Loudness(field)
    error, heard = loud.compared(exact or known.finer)
    of = {block.sector: block for block in field.blocks if block.macro}
    pulses = [pulse_test(field, block, exact, damping, heard) for block in of.values() if exact]
    rung = [ringing(field, of[name], one, exact) for name, one in known.eigenfrequencies.items()]
    return Reading(
        exact,
        error,
        tuple(scattered(field, of[name], one, loud) for name, one in known.specimens.items()),
        tuple(cells(field, of[name], one, loud) for name, one in known.repeated.items()),
        tuple(one for one in rung if len(one.exact)),
        tuple(test for test in pulses if test is not None),
        heard,
        loud.moved,
        tuple(known.refused),
        known.finer,
    )
