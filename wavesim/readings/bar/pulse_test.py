"""The pulse test in a run: what an experimenter reads from the receivers, beside the exact route.

The same reading is made of the exact signals, so that what differs is the field and not the
convention. Where one wave alone passes the receivers, as in a uniform bar whose far end absorbs,
its wavenumber is held against the medium's own.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import Gap, gaps, long_wave_speed, wavenumber
from wavesim.readings.bar.excited_band import JUDGED, pulses
from wavesim.readings.bar.loudness import beside_a_source
from wavesim.readings.pulse.measurement import PulseResult, measure
from wavesim.readings.pulse.signals import FEWEST_SAMPLES
from wavesim.readings.pulse.spectral_windows import Exponential, Gate
from wavesim.simulation.field import Field
from wavesim.sources import Source, excitation

_MOST_RECEIVERS = 20
_TAPER = 0.15
# The tail of a pulse runs at this part of the speed of long waves.
_SLOWER = 0.75
_FREQUENCIES = 80


@dataclass(frozen=True)
class PulseTest:
    """A pulse test on one macro-field.

    Attributes:
        name: of the macro-field, such as phi1 or u1.
        sector: its sector.
        result: read from the run.
        exact: the same read from the exact signals.
        k_exact: where one wave alone passes, or is let through, the medium's k at ω + iσ of the
            result, σ = 0 through a gate, rad/m.
        medium: where the receivers stand, if all stand in one uniform layer.
        gaps: its gaps in the sector; none where there is no such medium.
    """

    name: str
    sector: str
    result: PulseResult
    exact: PulseResult
    k_exact: NDArray[np.complex128] | None
    medium: Medium | None
    gaps: tuple[Gap, ...]


def pulse_test(
    field: Field,
    block: Block,
    exact: Mapping[str, Mapping[str, Any]],
    damping: float,
    heard: Mapping[str, Collection[str]] | None = None,
) -> PulseTest | None:
    """Read the receivers of a run.

    Args:
        field: with receivers, those to the right of the sources are read, but next to a point.
        block: one with a macro-field.
        exact: {receiver: {field: signal}} of the exact solver.
        damping: σT of the exponential window, where the record has one.
        heard: {receiver: names of fields}, where something arrived; everywhere where None.

    Returns:
        What was read; None where fewer than two receivers to the right of the sources hear
        anything, or the record is too short.
    """
    (name,) = block.macro[0]
    own = pulses(field, block)
    layers, bar = field.layers, field.bar
    if not own or len(field.t) < FEWEST_SAMPLES:
        return None
    last = max(source.position + 8.5 * source.width for source in own)
    high = bar.clear[1]
    hearing = [n for n in field.receivers if heard is None or name in heard.get(n, ())]
    places = sorted((field.receivers[n], n) for n in hearing)
    places = [(x, n) for x, n in places if last < x <= high and not beside_a_source(field, x)]
    places = [p for i, p in enumerate(places) if i == 0 or p[0] > places[i - 1][0]]
    if not 2 <= len(places) <= _MOST_RECEIVERS:
        return None
    positions = {n: x for x, n in places}
    held = {id(layers.layer_at(x)) for x in positions.values()}
    layer = layers.layer_at(places[0][0])
    medium = layer.medium if len(held) == 1 and layer.last is None else None
    same = medium is not None and layers.layer_at(last) is layer and layer is layers.layers[-1]
    if bar.right == "absorbing":
        window: Exponential | Gate = Exponential(damping)
    else:
        # Up to when an echo of the far end is back at the last receiver, with the acoustic wave.
        speed = max(long_wave_speed(one.medium, block.sector) for one in layers.layers)
        echo = (2 * bar.length - places[-1][0] - last) / speed + max(own[0].onset, 0.0)
        end = min(float(field.t[-1]), max(echo, 2 * own[0].peak_time))
        window = Gate(-_TAPER * end, end, _TAPER)
        # A gate that cuts into the pulse lets through no wave whose k could be judged.
        direct = (places[-1][0] - last) / (_SLOWER * speed) + own[0].end
        same = same and direct <= (1 - _TAPER) * end
    options: dict[str, Any] = {"window": window, "k_max": np.pi / bar.spacing, "noise": 0.0}
    omega = _driven(own, field) if isinstance(window, Exponential) else None
    if len(own) == 1:
        options["source"] = np.asarray(own[0].signal(field.t))
    signals = {n: field.at(x, name) for n, x in positions.items()}
    result = measure(field.t, signals, positions, omega=omega, **options)
    known = measure(
        field.t,
        {n: exact[n][name] for n in positions},
        positions,
        omega=result.dispersion.omega,
        **options,
    )
    k = None
    if same and medium is not None:
        found = result.dispersion
        k = wavenumber(medium, block.sector, found.omega + 1j * found.sigma)
    shown = tuple(gaps(medium, block.sector)) if medium is not None else ()
    return PulseTest(name, block.sector, result, known, k, medium, shown)


def _driven(sources: Sequence[Source], field: Field) -> NDArray[Any]:
    """Frequencies at which a source has 1 % of its peak spectrum, rad/s."""
    top = min(max(source.excited[1] for source in sources), 0.9 * np.pi / field.interval)
    omega = np.linspace(0, top, 20 * _FREQUENCIES)[1:]
    heard = np.flatnonzero(excitation(sources, omega) >= JUDGED)
    return np.linspace(omega[heard[0]], omega[heard[-1]], _FREQUENCIES)


def rows(test: PulseTest) -> dict[str, Any]:
    """Tables of what was read, for summary.json; frequencies are in result.h5."""
    tables = test.result.rows()
    del tables["frequencies"]
    return {"field": test.name, "sector": test.sector} | tables


def spectra(test: PulseTest) -> dict[str, NDArray[Any]]:
    """Columns against frequency, for result.h5."""
    found, loss = test.result.dispersion, test.result.loss
    columns = {
        name: getattr(found, name)
        for name in (
            "omega",
            "damped",
            "phase_velocity",
            "group_velocity",
            "attenuation",
            "quality",
        )
    }
    columns["sigma"] = found.sigma
    columns["loss"] = loss.level
    if test.k_exact is not None:
        columns["k_exact"] = test.k_exact
    return {key: np.asarray(value) for key, value in columns.items()}
