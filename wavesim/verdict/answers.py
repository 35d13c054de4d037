"""What a run found, in the few rows that a reader asks for first: gaps, velocities, T, Q.

A row is a dictionary of names, SI numbers and, where there is no number, None; each measured number
stands beside the exact one. They go into summary.json as they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.arguments import FREQUENCIES
from wavesim.material.damping import quality
from wavesim.material.family import sector_words
from wavesim.material.medium import Medium
from wavesim.material.shown import plain
from wavesim.planewave.dispersion_relation import Gap, gaps, wavenumber
from wavesim.readings.bar.eigenfrequencies import Ringing
from wavesim.readings.bar.pulse_test import PulseTest
from wavesim.readings.bar.reading import Reading
from wavesim.readings.bar.transmission import Scattered
from wavesim.simulation.field import Field
from wavesim.verdict.branches import Held
from wavesim.verdict.endless import told

Row = dict[str, Any]
Answers = dict[str, list[Row]]

_HERTZ = 1 / (2 * math.pi)
_DECIBELS = 20 / math.log(10)
_MOST_MODES = 5
# A band is stopped where T is below this, dB; below the other the end of a record speaks.
_STOPPED, _FLOOR = -20.0, -120.0
# The key that says how high a source goes, by its kind.
_PITCH = {
    "ricker": "peak_frequency",
    "gaussian-derivative": "peak_frequency",
    "tone-burst": "frequency",
}


def of_endless(field: Field, held: Sequence[Held]) -> Answers:
    """Gaps with the attenuation in their middle, and velocities of long waves, of an endless bar.

    Args:
        field: the field.
        held: every block that was measured, beside the theory.

    Returns:
        "gaps": name, sector, edges (Hz, of the plane-wave solver), attenuation (dB/m) in the
        middle, measured and exact at ω + iσ, exact at real ω, and what to set to look closer;
        "velocities": phase velocity (m/s) of each acoustic branch at the smallest wavenumber
        judged.
    """
    rows: list[Row] = []
    family = field.medium.family
    for sector in family.sectors:
        own = [h for h in held if h.measured.block.sector == sector]
        if own or sector in family.unlike:
            rows += [_gap(field, gap, own, sector) for gap in _open(field.medium, sector)]
    return {"gaps": rows, "velocities": [row for h in held for row in _velocity(h)]}


def _open(medium: Medium, sector: str) -> list[Gap]:
    return [gap for gap in gaps(medium, sector) if gap.upper > gap.lower]


def _gap(field: Field, gap: Gap, own: Sequence[Held], sector: str) -> Row:
    row: Row = {
        "gap": gap.name,
        "sector": sector,
        "lower": gap.lower * _HERTZ,
        "upper": gap.upper * _HERTZ,
        "frequency": None,
        "attenuation": None,
        "attenuation_exact": None,
        "attenuation_at_real_frequency": None,
        "frequencies": 0,
        "closer": "",
        "untold": "",
    }
    middle = (gap.lower + gap.upper) / 2
    if sector in field.medium.family.travelling:
        row |= {"frequency": middle * _HERTZ, **_steady_loss(field, sector, middle)}
    curves = [h.measured.attenuation for h in own if h.measured.attenuation is not None]
    if sector in field.medium.family.travelling:  # else nothing more is to be seen
        row["closer"] = _closer(field, sector, gap, max((len(c.omega) for c in curves), default=0))
    for h in own:
        curve, exact = h.measured.attenuation, h.k_exact
        if curve is None or exact is None:
            continue
        known = np.flatnonzero((curve.omega > gap.lower) & (curve.omega < gap.upper) & told(h))
        if not len(known):
            continue
        at = float(np.clip(middle, *curve.omega[known[[0, -1]]]))
        row |= {
            "frequency": at * _HERTZ,
            "attenuation": _between(curve.omega[known], curve.k[known].imag, at) * _DECIBELS,
            "attenuation_exact": _between(curve.omega[known], exact[known].imag, at) * _DECIBELS,
            **_steady_loss(field, sector, at),
            "frequencies": len(known),
        }
    if row["attenuation"] is None:
        row["untold"] = _untold(field, gap, sector, [curve.omega for curve in curves])
    return row


def _steady_loss(field: Field, sector: str, omega: float) -> Row:
    real = wavenumber(field.medium, sector, np.array([omega]))[0]
    return {"attenuation_at_real_frequency": float(real.imag) * _DECIBELS}


def _untold(field: Field, gap: Gap, sector: str, measured: Sequence[NDArray[Any]]) -> str:
    """Why nothing was measured of a gap.

    Args:
        field: the field.
        gap: the gap.
        sector: of its waves.
        measured: frequencies at which its attenuation was, rad/s.
    """
    family = field.medium.family
    if not any(s.field in b.fields for b in family.blocks_of(sector) for s in field.sources):
        return f"no source drives {sector_words(sector, sector)} waves"
    if sector in family.unlike:
        return "these waves do not travel"
    if not measured:
        return "the ring is too short to measure a decay along it"
    low, high = (end * _HERTZ / 1e3 for end in (measured[0][0], measured[0][-1]))
    if not gap.lower * _HERTZ / 1e3 < high:
        return f"what the sources drive, and frames show, ends at {high:.4g} kHz"
    if not gap.upper * _HERTZ / 1e3 > low:
        return f"what the sources drive begins at {low:.4g} kHz"
    inside = (measured[0] > gap.lower) & (measured[0] < gap.upper)
    if not inside.any():
        return "it lies between two frequencies: raise [analysis] frequencies"
    return "this record does not tell it: a note below says what to change"


def _between(omega: NDArray[Any], values: NDArray[Any], at: float) -> float:
    """Values at some frequencies at one among them, by the parabola through the three nearest."""
    near = np.argsort(np.abs(omega - at))[:3]
    return float(np.polyfit((omega[near] - at) / at, values[near], 2)[-1])


def _finer(field: Field, frequencies: int) -> str:
    """What to change for frequencies twice as fine; on a ring twice as long no wave comes round."""
    simulated = field.simulation
    twice = {
        "bar.length": f"{2 * field.bar.length:.6g}",
        "time.duration": f"{2 * simulated.duration:.6g}",
        "time.samples": f"{2 * simulated.frames}",
        "analysis.frequencies": f"{min(2 * frequencies, FREQUENCIES[1])}",
    }
    return " ".join(f"--set {key}={value}" for key, value in twice.items())


def _driven(field: Field, fields: Sequence[str], omega: float) -> bool:
    """Whether a source of these fields drives a frequency half as much as its own, or more."""
    own = [s for s in field.sources if s.field in fields and math.isfinite(s.peak_frequency)]
    return any(
        abs(s.spectrum(omega)) >= abs(s.spectrum(2 * math.pi * s.peak_frequency)) / 2 for s in own
    )


def _closer(field: Field, sector: str, gap: Gap, frequencies: int = 0) -> str:
    """What to change in the case to see more of a gap.

    Args:
        field: the field.
        sector: of its waves.
        gap: the gap.
        frequencies: of the curve that shows it, where it can be had finer; where the gap is well
            driven that helps, and else a source in the middle of the gap.
    """
    fields = [name for block in field.medium.family.blocks_of(sector) for name in block.fields]
    if frequencies and _driven(field, fields, (gap.lower + gap.upper) / 2):
        return _finer(field, frequencies)
    pitch = float(f"{(gap.lower + gap.upper) / 2 * _HERTZ:.3g}")
    sets = [
        f"--set sources.{number}.{_PITCH[source.kind]}={pitch:.4g}"
        for number, source in enumerate(field.sources)
        if source.field in fields and source.kind in _PITCH
    ]
    if any(source.field in fields for source in field.sources):
        return " ".join(sets)
    return f'not driven: add [[sources]] with field = "{fields[0]}", peak_frequency = {pitch:.4g}'


def _velocity(h: Held) -> list[Row]:
    if not h.measured.block.macro:
        return []
    branch = h.branches[0]
    judged = np.flatnonzero(branch.judged)
    if not len(judged):
        return []
    k = branch.k[judged[0]]
    return [
        {
            "wave": branch.name,
            "sector": h.measured.block.sector,
            "wavenumber": float(k),
            "velocity": float(branch.omega[judged[0]] / k),
            "velocity_exact": float(branch.omega_exact[judged[0]] / k),
        }
    ]


def of_bar(field: Field, reading: Reading) -> Answers:
    """What a bar with layers or ends lets through, how it rings, how fast pulses pass.

    Args:
        field: the field.
        reading: what was measured of it, beside the exact solver.

    Returns:
        "transmission": each band where T of a steady wave, exact at real ω, is below −20 dB (Hz;
        open where it goes on past what the run tells of), its level (dB) in the middle, and what
        was measured there, and is exact, at ω + iσ; where most passes; the worst of bands asked
        for;
        "eigenfrequencies": the lowest (Hz); "arrivals": of waves of several kinds at the farthest
        receiver by their first breaks (s), what comes before another as its precursor;
        "velocities": of a pulse by each convention (m/s); "quality": median Q between
        receivers, and that of the loss law.
    """
    found: Answers = {
        "transmission": [row for one in reading.scattered for row in _levels(field, one)],
        "eigenfrequencies": [row for one in reading.ringing for row in _modes(one)],
        "arrivals": _arrivals(field, reading),
        "velocities": [row for one in reading.pulses for row in _speeds(one)],
        "quality": [row for one in reading.pulses for row in _quality(one)],
    }
    return {name: rows for name, rows in found.items() if rows}


def _levels(field: Field, found: Scattered) -> list[Row]:
    """Each band that is stopped, where most passes, and the worst of each band asked for."""
    judged = found.judged
    if not judged.any():
        return []
    level, exact, real = _level(found.T), _level(found.T_exact), _steady(found)
    ends = found.omega[np.flatnonzero(judged)[[0, -1]]]
    omega, steady = found.omega, real
    if len(found.line):
        omega, steady = found.line[0], _level(found.line[3])
    within = (omega >= ends[0]) & (omega <= ends[1])
    inner = field.layers.layers[1:-1] or field.layers.layers
    media = list(dict.fromkeys(m for layer in inner for m in layer.sampled(2)))
    names = _open(media[0], found.sector) if len(media) == 1 else []
    rows: list[Row] = []
    stopped = _stopped(omega[within], steady[within])
    for number, (low, high, open_below, open_above) in enumerate(stopped, start=1):
        own = [gap.name for gap in names if gap.lower < high and low < gap.upper]
        middle = (low + high) / 2
        rows.append(
            {
                "where": f"about {', '.join(own)}" if own else f"stop band {number}",
                "lower": low * _HERTZ,
                "upper": high * _HERTZ,
                "lower_open": open_below,
                "upper_open": open_above,
                "frequency": middle * _HERTZ,
                "level_at_real_frequency": plain(np.interp(middle, omega, steady)),
                "closer": _closer(field, found.sector, Gap("", found.sector, low, high)),
            }
        )
    top = int(np.nanargmax(np.where(within, steady, -np.inf)))
    ends_of = [
        ("worst of a band", b.asked, b.highest if b.asked.at_least is None else b.lowest)
        for b in found.bands
        if (b.holds(found.omega) & judged).any()
    ]
    best = float(steady[top]), float(omega[top]) * _HERTZ
    for where, band, (worst, at) in [("most passes", None, best), *ends_of]:
        rows.append(
            {
                "where": where,
                "lower": None if band is None else band.low,
                "upper": None if band is None else band.high,
                "lower_open": False,
                "upper_open": False,
                "frequency": at,
                "level_at_real_frequency": plain(worst),
                "closer": "",
            }
        )
    for row in rows:
        near = np.abs(found.omega * _HERTZ - row["frequency"])
        at = int(np.argmin(np.where(judged, near, np.inf)))
        row |= {
            "sector": found.sector,
            "level": float(level[at]) if level[at] > _FLOOR else None,
            "level_exact": float(exact[at]),
        }
    return rows


def _steady(found: Scattered) -> NDArray[Any]:
    """Level of T at real ω; at ω + iσ where it is not known."""
    return _level(found.T_exact if found.T_real is None else found.T_real)


def _stopped(omega: NDArray[Any], level: NDArray[Any]) -> list[tuple[float, float, bool, bool]]:
    """Where a level is below the mark, its ends between frequencies by a straight line, rad/s, and
    whether it is open at either: the frequencies end there."""
    over = level - _STOPPED
    below = np.flatnonzero(over < 0)
    found = []
    for run in np.split(below, np.flatnonzero(np.diff(below) != 1) + 1) if len(below) else ():
        ends, beyond = [], []
        for inside, outside in ((run[0], run[0] - 1), (run[-1], run[-1] + 1)):
            there = 0 <= outside < len(omega)
            known = there and math.isfinite(over[outside])
            part = over[inside] / (over[inside] - over[outside]) if known else 0.0
            step = omega[outside] - omega[inside] if known else 0.0
            ends.append(float(omega[inside] + part * step))
            beyond.append(not there)
        found.append((ends[0], ends[1], beyond[0], beyond[1]))
    return found


def _level(amplitude: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(20 * np.log10(np.maximum(np.abs(amplitude), 1e-15)))


def _modes(found: Ringing) -> list[Row]:
    return [
        {
            "mode": number + 1,
            "sector": found.sector,
            "frequency": plain(found.found[number] * _HERTZ),
            "frequency_exact": float(found.exact[number]) * _HERTZ,
        }
        for number in range(min(_MOST_MODES, len(found.exact)))
    ]


def _speeds(test: PulseTest) -> list[Row]:
    if test.medium is None:  # one speed across several layers is the speed of nothing
        return []
    return [
        {
            "by": convention,
            "field": test.name,
            "velocity": plain(one.velocity),
            "velocity_error": plain(one.error),
            "velocity_exact": plain(test.exact.velocities[convention].velocity),
        }
        for convention, one in test.result.velocities.items()
        if math.isfinite(one.velocity)
    ]


def _arrivals(field: Field, reading: Reading) -> list[Row]:
    """Waves by name at the farthest receiver, in the order in which they arrive."""
    waves = field.medium.family.waves
    found = []
    for test in (one for one in reading.pulses if one.sector in waves):
        times = test.result.arrivals["first break"].time
        if np.isfinite(times).any():
            last = int(np.nanargmax(times))
            name = test.result.record.names[last]
            found.append((float(times[last]), waves[test.sector], test.name, name))
    found.sort()
    if len({wave for _, wave, _, _ in found}) < 2:
        return []
    latest, main, *_ = found[-1]
    return [
        {
            "arrival": f"{wave} wave" if wave == main else f"{wave} precursor",
            "field": name,
            "receiver": receiver,
            "time": time,
            "ahead": latest - time,
        }
        for time, wave, name, receiver in found
    ]


def _quality(test: PulseTest) -> list[Row]:
    found = test.result.dispersion
    if test.medium is None or not test.medium.damping:
        return []
    read = np.isfinite(found.quality) & (found.quality > 0)
    if not read.any():
        return []
    law = quality(test.medium.damping, found.omega)
    at = np.flatnonzero(read)[np.argsort(found.quality[read])[int(read.sum()) // 2]]
    return [
        {
            "field": test.name,
            "frequency": float(found.omega[at]) * _HERTZ,
            "quality": float(found.quality[at]),
            "quality_exact": float(law[at]),
        }
    ]
