"""Layered, graded, damped, finite bars, exactly, in the frequency domain: what is offered.

The second route to what the time domain simulates. It shares the material with it (medium,
equations, sectors, layers, damping, sources) and nothing else: there is no grid here.

    transmission    T(ω), R(ω) of a layered stretch between half-spaces, both ways, and power
    signals         what receivers record, by the inverse transform of the exact response
    field_spectra   the same at given complex ω
    resonances      all eigenfrequencies of a finite bar in a band
    bloch           Bloch wavenumber of a cell repeated for ever; stop_bands, where there is none
"""

from __future__ import annotations

from wavesim.layered.bloch import bloch, stop_bands
from wavesim.layered.eigenfrequencies import resonances
from wavesim.layered.signals import field_spectra, signals
from wavesim.layered.transmission import Transmission, transmission
from wavesim.material.arguments import checked as _checked

__all__ = [
    "Transmission",
    "bloch",
    "field_spectra",
    "resonances",
    "signals",
    "stop_bands",
    "transmission",
]
globals().update({name: _checked(globals()[name]) for name in __all__ if name[0].islower()})


def __dir__() -> list[str]:
    return sorted(__all__)
