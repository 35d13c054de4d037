"""A measured record beside a case's signals: lag and scale, overlay, and the misfit in parts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.load import Case
from wavesim.readings.matched_record import Measured
from wavesim.readings.misfit import Comparison, misfit
from wavesim.studies.least_squares import Solution, solve
from wavesim.studies.waveform_fit import GAIN, LAG, Waveforms

Float = NDArray[Any]


def signals_of(case: Case, measured: Measured) -> Float:
    """The case's field at the receivers, (frames, m): exact for a bar, simulated for a ring."""
    simulated = case.simulation
    names, places = measured.names, measured.positions
    if simulated.endless:
        from wavesim.timedomain.integrate import simulate

        field = simulate(
            simulated.layers, simulated.bar, simulated.sources, simulated.duration,
            samples=simulated.frames, receivers=simulated.receivers,
        )  # fmt: skip
        return np.stack([field.at(x, measured.field) for x in places], axis=1)
    from wavesim.layered.signals import signals

    found = signals(
        simulated.layers, simulated.bar.left, simulated.bar.right, simulated.sources,
        dict(zip(names, places, strict=True)), simulated.times,
    )  # fmt: skip
    return np.stack([found[name][measured.field] for name in names], axis=1)


def compare(
    case: Case, measured: Measured, lag: float | None = None, scale: float | None = None
) -> Comparison:
    """Lay a case beside a record.

    Args:
        case: the case.
        measured: the record.
        lag, scale: stated, s and –; fitted where None.
    """
    data = Waveforms(case, [], measured, lag, scale, known=signals_of(case, measured))
    values = data.beginning()
    solution: Solution | None = solve(data, values) if data.parameters else None
    if solution is not None:
        values = solution.values
    there, left = data.laid_over(values)
    inside = np.isfinite(there).all(axis=1)
    found = data.scale_of(values)
    errors = solution.errors if solution is not None else {}
    recorded = measured.values[inside] - measured.values[inside].mean(axis=0)
    per = tuple(
        misfit(name, x, recorded[:, j], there[inside, j], left[inside, j], measured.interval)
        for j, (name, x) in enumerate(zip(measured.names, measured.positions, strict=True))
    )
    turned = [one.name for one in per if one.amplitude < 0]
    if turned:
        said = f"{', '.join(turned)}: of reversed polarity beside the case; turn round or leave out"
        measured = replace(measured, notes=(*measured.notes, said))
    return Comparison(
        measured, there, per,
        lag if lag is not None else values[LAG], errors.get(LAG, np.nan),
        found, errors.get(GAIN, np.nan) * abs(found / values.get(GAIN, 1.0)),
        float(np.sqrt(np.mean(left[inside] ** 2) / np.mean(recorded**2))),
    )  # fmt: skip
