"""The verdict on a bar with layers or ends: its reading against the exact frequency domain."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.damping import quality
from wavesim.material.shown import KHZ
from wavesim.planewave.dispersion_relation import cutoffs, wavenumber
from wavesim.readings.bar.bloch import Cells
from wavesim.readings.bar.eigenfrequencies import Ringing
from wavesim.readings.bar.excited_band import JUDGED, pulses
from wavesim.readings.bar.pulse_test import PulseTest
from wavesim.readings.bar.reading import Reading
from wavesim.readings.bar.transmission import Scattered
from wavesim.simulation.field import Field
from wavesim.sources import excitation
from wavesim.timedomain.absorber import REFLECTION
from wavesim.verdict import remedies
from wavesim.verdict.check import Check, judged
from wavesim.verdict.foreseen_errors import (
    AMPLITUDE_TOLERANCE,
    WAVENUMBER_TOLERANCE,
)
from wavesim.verdict.receivers_and_energy import energy_checks, signal_checks

Float = NDArray[Any]

DECIBEL_TOLERANCE = 1.0
RESONANCE_TOLERANCE = 1e-6
BLOCH_TOLERANCE = 1e-3
# Arrivals agree to this part of a period of the source's peak frequency.
ARRIVAL_TOLERANCE = 1e-3
# ω/2αv_g is the law's Q to the first order in 1/Q.
QUALITY_TOLERANCE = 0.02
_FAR = 10.0
# Signals tell of k and Q where the exact ones give them to this part of what is allowed.
_TOLD_BY_EXACT = 0.5
# Transmission is held to decibels down to here.
_DEEPEST = 1e-3
# Part of a spectrum's peak below which it is not told to a decibel.
_TAIL = 3e-3


def judge_bar(field: Field, reading: Reading) -> list[Check]:
    """All checks of a run.

    Args:
        field: the field.
        reading: what was measured of it, beside the exact solver.

    Returns:
        The checks; none about what the record is too short, or the bar too simple, to tell.
    """
    if not reading.moved:
        return []
    comes_back = "" if reading.finer else sent_back(field)  # thirds of the cells absorb as well
    checks = signal_checks(field, reading.error, comes_back, bool(reading.finer))
    for scattered in reading.scattered:
        checks += _scattered_checks(field, scattered) + _band_checks(field, scattered)
    for cells in reading.cells:
        checks += _cell_checks(field, cells)
    for ringing in reading.ringing:
        checks += _ringing_checks(field, ringing)
    for pulse in reading.pulses:
        checks += _pulse_checks(field, pulse)
    return checks + energy_checks(field)


def _scattered_checks(field: Field, found: Scattered) -> list[Check]:
    counted = found.judged
    count = int(counted.sum())
    if not count:
        return []
    checks = []
    for name, measured, exact in (
        ("T", found.T, found.T_exact),
        ("R", found.R, found.R_exact),
    ):
        error = np.abs(measured - exact)
        label = f"{found.sector} {name}: |Δ{name}| of the incident wave, {count} frequencies"
        worst = float(error[counted].max())
        known = field, found, error
        checks.append(judged(label, worst, AMPLITUDE_TOLERANCE, remedies.of_scattering, *known))
    deep = counted & (np.abs(found.T_exact) >= _DEEPEST)
    if deep.any():
        error = np.where(deep, np.abs(20 * np.log10(np.abs(found.T / found.T_exact))), 0.0)
        label = f"{found.sector} T down to −60 dB: difference, {deep.sum()} frequencies"
        worst, known = float(error[deep].max()), (field, found, error)
        checks.append(
            judged(label, worst, DECIBEL_TOLERANCE, remedies.of_scattering, *known, unit="dB")
        )
    return checks


def _band_checks(field: Field, found: Scattered) -> list[Check]:
    """Of each band of one's choice: whether the run tells of it, T in it, and its limits."""
    checks = []
    for band in found.bands:
        asked, inside = band.asked, band.holds(found.omega)
        told = inside & found.judged
        name = f"{asked.told}: frequencies that the run tells of"
        known = remedies.of_band, field, found, band
        whole = max(int(inside.sum()), 1)
        checks.append(judged(name, int(told.sum()), 0.0, *known, reference=whole))
        if told.any():
            error = np.where(told, np.abs(found.T - found.T_exact), 0.0)
            name = f"{asked.told}: |ΔT| of the incident wave"
            remedy = remedies.of_scattering, field, found, error
            checks.append(judged(name, float(error[told].max()), AMPLITUDE_TOLERANCE, *remedy))
        for limit, (level, at), sign, word in (
            (asked.at_most, band.highest, 1, "at most"),
            (asked.at_least, band.lowest, -1, "at least"),
        ):
            if limit is None:
                continue
            there = f"{at / 1e3:.5g} kHz"
            if math.isfinite(level):
                worst, short = f"worst {level:.2f} dB, at {there}", max(sign * (level - limit), 0.0)
                change = "change the layers: wavesim design finds some that keep a band"
            else:
                worst, short = f"no answer at {there}", math.nan
                change = (
                    "give its graded layer a quality_factor: without losses waves pile up where "
                    "it has its asymptote, and there is no T at real ω"
                )
            name = f"{asked.told}: miss of {word} {limit:g} dB at real ω ({worst})"
            checks.append(Check(name, short, 0.0, 0.0, "dB", change))
    return checks


def _cell_checks(field: Field, found: Cells) -> list[Check]:
    counted = found.judged
    if not counted.any():
        return []
    # cos(qL) grows as e^{Im qL}: an error counts against it where it is large.
    size = np.maximum(np.abs(found.cosine_exact), 1.0)
    worst = float((np.abs(found.cosine - found.cosine_exact) / size)[counted].max())
    label = f"{found.sector} Bloch wave: |Δcos qL|, {counted.sum()} frequencies"
    return [judged(label, worst, BLOCH_TOLERANCE, remedies.of_grid, field)]


def _ringing_checks(field: Field, found: Ringing) -> list[Check]:
    heard = np.isfinite(found.found)
    label = f"{found.sector} eigenfrequencies"
    error = np.abs(found.found / found.exact - 1)[heard]
    off = bool((error > RESONANCE_TOLERANCE).any())
    remedy = remedies.of_eigenfrequencies, field, off
    name, count, whole = f"{label} heard", int(heard.sum()), len(heard)
    checks = [judged(name, count, 0.0, *remedy, reference=whole, unit="modes")]
    if heard.any():
        name, worst = f"{label}: |Δω|/ω, maximum", float(error.max())
        checks.append(judged(name, worst, RESONANCE_TOLERANCE, remedies.finer, field))
    return checks


def _pulse_checks(field: Field, pulse: PulseTest) -> list[Check]:
    checks = []
    sent = [s for s in field.sources if s.acts != "initial"]  # which has no frequency
    own = [s for s in sent if s.field == pulse.name] or sent
    # What is recorded may peak at 0 Hz.
    allowed = ARRIVAL_TOLERANCE / (own[0].peak_frequency or own[0].band / (2 * np.pi))
    for convention in ("threshold", "envelope"):
        found, known = (r.arrivals[convention].time for r in (pulse.result, pulse.exact))
        there = np.isfinite(known)
        if there.any():
            # One that is not found is not a number, and so fails.
            worst = float(np.abs(found - known)[there].max())
            label = f"{pulse.name} arrival, {convention}: |Δt|, {there.sum()} receivers"
            given = field, found, known
            checks.append(judged(label, worst, allowed, remedies.of_arrival, *given, unit="s"))
    loss, exact = pulse.result.loss, pulse.exact.loss
    both = loss.valid & exact.valid & _loud(pulse)
    if both.any():
        worst = float(np.abs(loss.level - exact.level)[both].max())
        label = (
            # Across an interface a ratio of levels holds its impedance step, and is no loss.
            f"{pulse.name} {'loss' if pulse.medium is not None else 'level'}, {loss.first} to "
            f"{loss.last}: difference, {both.sum()} frequencies"
        )
        checks.append(judged(label, worst, DECIBEL_TOLERANCE, remedies.of_grid, field, unit="dB"))
    if pulse.k_exact is not None:
        error, told = wavenumbers(pulse)
        if told.any():
            label = f"{pulse.name} k between receivers: |Δk|/|k|, {told.sum()} frequencies"
            worst = float(error[told].max())
            checks.append(judged(label, worst, WAVENUMBER_TOLERANCE, remedies.of_grid, field))
        checks += _quality_checks(field, pulse)
    return checks


def wavenumbers(pulse: PulseTest) -> tuple[Float, NDArray[np.bool_]]:
    """|Δk|/|k| between receivers, shape (n,), and where the signals tell k that well: where the
    same reading of the exact signals does, which no grid has a part in."""
    k = np.asarray(pulse.k_exact)
    error, of_exact = (np.abs(own.dispersion.damped / k - 1) for own in (pulse.result, pulse.exact))
    return error, np.isfinite(error) & (of_exact <= _TOLD_BY_EXACT * WAVENUMBER_TOLERANCE)


def _loud(pulse: PulseTest) -> NDArray[np.bool_]:
    """Frequencies at which the loss's input and output can be told to a decibel, shape (n,)."""
    seen, loss = pulse.exact, pulse.exact.loss
    ends = [seen.record.index(name) for name in (loss.first, loss.last)]
    size = np.abs(seen.spectra.values[:, ends])
    return np.asarray((size >= _TAIL * size.max(axis=0)).all(axis=1))


def _quality_checks(field: Field, pulse: PulseTest) -> list[Check]:
    """Q as an experimenter reads it, beside that of the loss law over the bands."""
    found = pulse.result.dispersion
    if pulse.medium is None or not pulse.medium.damping:
        return []
    law = quality(pulse.medium.damping, found.omega)
    passes = np.isfinite(found.quality) & (found.quality > 0)
    # What is read at ω + iσ tells of real ω only away from where k(ω) branches.
    away = _FAR * found.sigma
    passes &= found.omega > away
    for gap in pulse.gaps:
        passes &= (found.omega < gap.lower - away) | (found.omega > gap.upper + away)
    if not passes.any():
        return []
    ratio, same = (
        float(np.median((own.dispersion.quality / law)[passes]))
        for own in (pulse.result, pulse.exact)
    )
    label = f"{pulse.name} Q between receivers over that of the law, median of {passes.sum()}"
    if not abs(same - 1) <= _TOLD_BY_EXACT * QUALITY_TOLERANCE:
        return []
    return [judged(label, ratio, QUALITY_TOLERANCE, remedies.of_grid, field, reference=1.0)]


def sent_back(field: Field) -> str:
    """Where absorbing ends send back more than a thousandth of what the sources drive, or "".

    A wave of phase velocity c comes back with R^(c_∞/c): a long wave just above a cutoff, whose
    phase velocity is high, all but whole.
    """
    layers, bar = field.layers, field.bar
    ends = (bar.left, layers.at(0.0)), (bar.right, layers.at(layers.length))
    media = {medium for end, medium in ends if end == "absorbing"}
    told = []
    for block in (block for block in field.blocks if block.macro):
        driven = pulses(field, block)
        for medium in media:
            for cutoff in cutoffs(medium, block.sector):
                omega = cutoff * (1 + np.geomspace(1e-6, 0.1, 200))
                loud = float(excitation(driven, cutoff)) if driven else 0.0
                slowness = wavenumber(medium, block.sector, omega).real / omega
                back = REFLECTION ** (slowness * medium.fastest)
                if loud >= JUDGED and back[0] > AMPLITUDE_TOLERANCE:
                    until = omega[min((back > AMPLITUDE_TOLERANCE).sum(), len(omega) - 1)]
                    told.append(f"{block.sector} {cutoff * KHZ:.5g} to {until * KHZ:.5g} kHz")
    return ", ".join(dict.fromkeys(told))
