"""wavesim: waves in granular media with microstructure, in time and by plane waves.

    import wavesim as ws

    medium = ws.Medium(anisotropy=0.25)
    bar = ws.Bar(cells=2048, spacing=1.25e-4)
    pulse = ws.Ricker("phi1", position=0.128, peak_frequency=1e6)
    field = ws.simulate(medium, bar, [pulse], duration=8e-5)
    measured = ws.extract(field)

Names are loaded when they are first used, so that ``import wavesim`` is quick and the plane-wave
solver needs no jax.
"""

from __future__ import annotations

import importlib
from typing import Any

_HOMES = {
    "Medium": "wavesim.material.medium",
    "Family": "wavesim.material.family",
    "Block": "wavesim.material.family",
    "FluxForm": "wavesim.material.medium",
    "Parameter": "wavesim.material.parameter",
    "together": "wavesim.material.several_families",
    "Bar": "wavesim.grid.bar",
    "layered_bar": "wavesim.grid.bar",
    "Layer": "wavesim.material.layers",
    "Layers": "wavesim.material.layers",
    "Damping": "wavesim.material.damping",
    "constant_quality": "wavesim.material.damping",
    "Ricker": "wavesim.sources",
    "GaussianDerivative": "wavesim.sources",
    "ToneBurst": "wavesim.sources",
    "Chirp": "wavesim.sources",
    "Recorded": "wavesim.sources",
    "InitialField": "wavesim.sources",
    "Field": "wavesim.simulation.field",
    "Simulation": "wavesim.simulation.simulation",
    "simulate": "wavesim.timedomain.integrate",
    "integrate": "wavesim.timedomain.integrate",
    "traced_fields": "wavesim.timedomain.gradient",
    "traced_layers": "wavesim.differentiable.traced_layers",
    "traced_transmission": "wavesim.differentiable.stack_transmission",
    "extract": "wavesim.readings.dispersion.extract",
    "hold": "wavesim.verdict.branches",
    "judge": "wavesim.verdict.endless",
    "read_bar": "wavesim.readings.bar.reading",
    "judge_bar": "wavesim.verdict.bar",
    "measure_pulses": "wavesim.readings.pulse.measurement",
    "read_pulse_test": "wavesim.records.of_pulse_test",
    "read_pulses": "wavesim.readings.pulse.array_reading",
    "transmission_record": "wavesim.readings.pulse.transmission_record",
    "read_transmission": "wavesim.readings.pulse.reading",
    "read_series": "wavesim.readings.pulse.series_reading",
    "matched": "wavesim.readings.matched_record",
    "compare": "wavesim.studies.comparison",
    "fit_waveforms": "wavesim.studies.fit_answer",
    "load": "wavesim.case.load",
    "progress": "wavesim.report.progress",
    "open": "wavesim.records.run_folder",
    "record": "wavesim.records.record",
    "read_record": "wavesim.records.files",
    "inspect": "wavesim.records.inspection",
    "Layout": "wavesim.records.arrays",
    "in_time": "wavesim.readings.dispersion.frequency_at_wavenumber",
    "in_space": "wavesim.readings.dispersion.wavenumber_at_frequency",
    "synthesize": "wavesim.records.synthetic",
    "score": "wavesim.verdict.score",
    "fit": "wavesim.studies.medium_fit",
    "sweep": "wavesim.studies.sweep",
}
# Offered under a name that says more than the one at home.
_NAMES = {
    "measure_pulses": "measure",
    "read_pulse_test": "of_pulse_file",
    "read_pulses": "read_array",
    "read_transmission": "read_one",
    "fit_waveforms": "of_waveforms",
    "open": "open_run",
    "progress": "part_done",
    "read_record": "read",
    "traced_transmission": "transmission",
}
_MODULES = {"layeredwave": "wavesim.layered", "planewave": "wavesim.planewave"}

__all__ = [*_HOMES, *_MODULES]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        found = getattr(importlib.import_module(_HOMES[name]), _NAMES.get(name, name))
        if not isinstance(found, type):
            checked = importlib.import_module("wavesim.material.arguments").checked
            found = checked(found, name)
            found.__module__, found.__qualname__ = __name__, name  # where pickle finds it
        globals()[name] = found
        return found
    if name in _MODULES:
        return importlib.import_module(_MODULES[name])
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("wavesim")
    raise AttributeError(f"module 'wavesim' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__doc__", "__version__"])
