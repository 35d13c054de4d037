"""What to change in the case of a real bar where a check of it falls short, key by key."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wavesim.material.sectors import blocks_of
from wavesim.planewave.dispersion_relation import asymptotes
from wavesim.readings.bar.pulse_test import PulseTest
from wavesim.readings.bar.transmission import Scattered
from wavesim.readings.pulse.spectral_windows import Gate
from wavesim.simulation.field import Field
from wavesim.verdict import remedies

# So many cells from an interface or an end the differences are exact to a lower degree.
ONE_SIDED = 8
# An absorber of fewer branch lengths reflects more than 1e-4.
_ABSORBER = 4
# Part of an asymptote's frequency that a wave stays below it to be longer than a few cells.
_BELOW = 0.95
# Cells of a source's width beyond which it drives hardly any wave that the grid slows down.
_WIDE = 6
# What explains this part of an error is what to change first.
_EXPLAINS = 0.3


def absorber(field: Field) -> str | None:
    """A longer absorber, where it is short."""
    bar, layers = field.bar, field.layers
    if not bar.absorber or layers is None:
        return None
    least = _ABSORBER * max(float(medium.branch_length) for medium in layers.media)
    if bar.absorber >= least * (1 - 1e-9):
        return None
    return (
        f"lengthen [bar] absorber to {2 * least:g} (now {bar.absorber:g} m): below {least:g} it "
        "reflects too much"
    )


def of_grid(field: Field, sector: str | None = None) -> str:
    """An absorber that is too short, or else a finer grid or a band that it carries better."""
    told = absorber(field)
    return told or f"{remedies.finer(field)}, or {_gentler(field)}"


def _gentler(field: Field) -> str:
    """Less of the waves that are short: a smoother burst, a lower or a wider source."""
    source = field.sources[0]
    if getattr(source, "window", None) == "hann":
        return 'a smoother burst: [[sources]] window = "cos4"'
    text = f"fewer short waves: {lower(field)}"
    if source.drive == "body" and not source.width:
        text += f" or [[sources]] width = {_WIDE * field.bar.spacing:.2g} or more"
    return text


def lower(field: Field) -> str:
    """A source that goes less high, by its key."""
    source = field.sources[0]
    key = {"tone-burst": "frequency", "chirp": "high", "initial": ""}.get(
        source.kind, "peak_frequency"
    )
    if source.kind == "recorded":
        return "a lower or smoother recorded signal"
    if not key:
        return f"[[sources]] width above {source.width:g}"
    value = getattr(source, key)
    return f"[[sources]] {key} below {value:g}"


def of_signal(field: Field, receiver: str) -> str:
    """Where a receiver's signal is off."""
    bar, layers = field.bar, field.layers
    faces = list(layers.interfaces) if layers else []
    faces += [] if bar.periodic else [0.0, bar.length]
    reach = ONE_SIDED * bar.spacing
    position = field.receivers[receiver]
    near = [face for face in faces if abs(position - face) <= reach]
    told = absorber(field)
    if told or not near:
        return told or of_grid(field)
    return (
        f'move [[receivers]] "{receiver}" more than {reach:.3g} m ({ONE_SIDED} cells) from the '
        f"interface or end at {near[0]:g} m (now at {position:g}), or {remedies.finer(field)}"
    )


def of_scattering(field: Field, found: Scattered, error: Any) -> str:
    """Where T or R is off.

    Args:
        field: the field.
        found: what was measured.
        error: of it at each frequency, shape (n,).
    """
    worst = int(np.argmax(np.where(found.judged & np.isfinite(error), error, -1.0)))
    omega = float(found.omega[worst])
    at = f"furthest off at {omega / 2e3 / math.pi:.4g} kHz"
    if field.layers is not None:
        ends = {field.layers.layers[0].medium, field.layers.layers[-1].medium}
        for medium in ends:
            for edge in asymptotes(medium, found.sector):
                if _BELOW * edge <= omega <= edge:
                    return (
                        f"{at}, close below an asymptote of a buffer ({edge / 2e3 / math.pi:.4g} "
                        f"kHz), where waves are short: take {lower(field)}, or stiffer buffers "
                        "([[layers]] G_n_a and G_n_r)"
                    )
    return f"{at}: {of_grid(field)}"


def of_eigenfrequencies(field: Field, off: bool) -> str:
    """Where eigenfrequencies are not heard: by the grid if those heard are off too."""
    if off:
        return remedies.finer(field)
    return (
        "add [[receivers]] elsewhere, as a mode is silent at its nodes, or "
        + remedies.longer_run(field, "a mode that is weakly driven stands out of its neighbours")
    )


def of_arrival(field: Field, found: Any, known: Any) -> str:
    """Where arrivals are off, or not found where the exact signals have them."""
    if (np.isfinite(known) & ~np.isfinite(found)).any():
        return remedies.longer_run(field, "an arrival is not in the record")
    return of_grid(field)


def of_one_wave(field: Field, test: PulseTest, omega: Any = None, error: Any = None) -> str:
    """Where k or Q between receivers is not the medium's own.

    Args:
        field: the field.
        test: what was read.
        omega, error: ω + iσ, shape (n,), rad/s, and |Δk|/|k| there; None where k is not judged.
    """
    told = absorber(field)
    if told:
        return told
    (block,) = blocks_of(test.sector)
    if error is not None and len(field.bar.stretches) <= 1:
        one = remedies.wavenumber_grid_error(field, block, omega, error)
        if one >= _EXPLAINS:
            return remedies.finer(field)
    if isinstance(test.result.window, Gate):
        return (
            f"lengthen [bar] length (now {field.bar.length:.4g} m), or move [[receivers]] nearer "
            "to the source: an echo comes back before the gate has closed"
        )
    return remedies.longer_run(field, "the record's end cuts off waves that are still passing")
