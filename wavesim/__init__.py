"""wavesim: rotation waves in granular media with microstructure, in time and by plane waves.

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
    "Medium": "wavesim.medium",
    "Bar": "wavesim.bar",
    "layered_bar": "wavesim.bar",
    "Layer": "wavesim.layers",
    "Layers": "wavesim.layers",
    "Damping": "wavesim.damping",
    "constant_quality": "wavesim.damping",
    "Ricker": "wavesim.source",
    "GaussianDerivative": "wavesim.source",
    "ToneBurst": "wavesim.source",
    "Chirp": "wavesim.source",
    "Recorded": "wavesim.source",
    "InitialField": "wavesim.source",
    "Field": "wavesim.field",
    "simulate": "wavesim.timedomain.integration",
    "traced_fields": "wavesim.timedomain.traced",
    "extract": "wavesim.extraction.analysis",
    "hold": "wavesim.verdict",
    "judge": "wavesim.verdict",
    "read_bar": "wavesim.finite.reading",
    "judge_bar": "wavesim.finite.barverdict",
    "measure_pulses": "wavesim.pulse.measurement",
    "load": "wavesim.problem",
    "record": "wavesim.extraction.record",
    "in_time": "wavesim.extraction.timewise",
    "in_space": "wavesim.extraction.spacewise",
    "synthesize": "wavesim.extraction.synthetic",
    "fit": "wavesim.extraction.fit",
}
# Offered under a name that says more than the one at home.
_NAMES = {"measure_pulses": "measure"}
_MODULES = ("layeredwave", "planewave")

__all__ = [*_HOMES, *_MODULES]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), _NAMES.get(name, name))
    if name in _MODULES:
        return importlib.import_module(f"wavesim.{name}")
    raise AttributeError(f"module 'wavesim' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
