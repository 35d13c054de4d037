"""What a run on a bar found, and what a reader should know beside its checks.

Found are the few rows that a reader asks for first: T, modes, speeds, Q. Each measured number
stands beside the exact one. The rows go into summary.json as they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.layered.transmission import specimen
from wavesim.material.damping import quality
from wavesim.material.shown import HERTZ, KHZ, decibels, plain
from wavesim.planewave.dispersion_relation import Gap, long_wave_speed, open_gaps
from wavesim.readings.bar.bloch import Cells
from wavesim.readings.bar.eigenfrequencies import Ringing
from wavesim.readings.bar.excited_band import JUDGED, pulses
from wavesim.readings.bar.pulse_test import PulseTest
from wavesim.readings.bar.reading import Reading
from wavesim.readings.bar.transmission import Scattered
from wavesim.readings.dispersion.spectrum import LOBE_BINS
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import default_samples
from wavesim.sources import excitation, unfolded
from wavesim.verdict import remedies
from wavesim.verdict.bar import sent_back, wavenumbers
from wavesim.verdict.receivers_and_energy import energy_note, receiver_notes
from wavesim.verdict.remedies import Answers, Row, to_see_more

_MOST_MODES = 5
# Lobes between neighbours that are told apart, πc/L of long waves, which others are slower than.
_TELLS = 6
# A band is stopped where T is below this, dB; below the other the end of a record speaks.
_STOPPED, _FLOOR = -20.0, -120.0
# Narrowest stop band that is told, part of its frequency.
_NARROWEST = 2e-3


def of_bar(field: Field, reading: Reading) -> Answers:
    """What a bar with layers or ends lets through, how it rings, how fast pulses pass.

    Returns:
        "transmission": each band where T of a steady wave, exact at real ω, is below −20 dB (Hz;
        open where it goes on past what the run tells of, and then what to set to see more of it),
        its level (dB) in the middle, and what was measured there, and is exact, at ω + iσ; where
        most passes; the worst of bands asked for, and whether that keeps the limit;
        "eigenfrequencies": the lowest (Hz); "arrivals": of waves of several kinds at the farthest
        receiver by their first breaks (s), what comes before another as its precursor;
        "velocities": of a pulse by each convention (m/s), or why there is none; "quality": median
        Q between receivers, and that of the loss law.
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
    """The worst of each band asked for, each band that is stopped, and where most passes."""
    judged = found.judged
    if not judged.any():
        return []
    level, exact = decibels(found.T), decibels(found.T_exact)
    ends = found.omega[np.flatnonzero(judged)[[0, -1]]]
    omega, steady = found.line[0], decibels(found.line[3])
    within = (omega >= ends[0]) & (omega <= ends[1])
    inner = field.layers.layers[1:-1] or field.layers.layers
    media = list(dict.fromkeys(m for layer in inner for m in layer.sampled(2)))
    names = open_gaps(media[0], found.sector) if len(media) == 1 else []
    rows = []
    for band in found.bands:
        if (band.holds(found.omega) & judged).any():
            rows += _asked(band)
    stopped = _stopped(omega[within], steady[within])
    known_at, known_there = omega[within], steady[within]
    for _ in range(2 if stopped else 0):  # what passes between its frequencies
        spans = [(low * HERTZ, high * HERTZ) for low, high, *_ in stopped]
        more, there = specimen(field.layers).peaks_within(found.sector, spans)
        known_at, first = np.unique(np.append(known_at, more / HERTZ), return_index=True)
        known_there = np.append(known_there, there)[first]
        stopped = _stopped(known_at, known_there)
    for number, (low, high, *opened) in enumerate(stopped, start=1):
        own = [gap.name for gap in names if gap.lower < high and low < gap.upper]
        where = f"about {', '.join(own)}" if own else f"stop band {number}"
        middle = (low + high) / 2
        level_there = plain(np.interp(middle, omega, steady))
        # What is told of as a whole needs no other source; and what drives other frequencies tells
        # less of the bands that were asked for.
        shown = low if opened[0] else high, high if opened[1] else low
        gap = Gap("", found.sector, *shown)
        asked = any(opened) and not found.bands
        more = to_see_more(field, found.sector, gap) if asked else ""
        edges = low * HERTZ, high * HERTZ, middle * HERTZ
        rows.append(_level_row(where, *edges, level_there, opened, more))
    known = np.flatnonzero(within & np.isfinite(steady))
    if len(known):
        top = known[np.argmax(steady[known])]
        best = float(omega[top]) * HERTZ
        rows.append(_level_row("most passes", None, None, best, float(steady[top])))
    for row in rows:
        near = np.abs(found.omega * HERTZ - row["frequency"])
        at = int(np.argmin(np.where(judged, near, np.inf)))
        row |= {
            "sector": found.sector,
            "level": float(level[at]) if level[at] > _FLOOR else None,
            "level_exact": float(exact[at]),
        }
    return rows


def _asked(band: Any) -> list[Row]:
    """The worst of a band against each of its limits; the most that passes where it has none."""
    asked = band.asked
    span = asked.low, asked.high
    if asked.at_most is None and asked.at_least is None:
        worst, at = band.highest
        return [_level_row("most of a band", *span, at, plain(worst))]
    rows = []
    for word, limit, (worst, at), sign in (
        ("at most", asked.at_most, band.highest, 1),
        ("at least", asked.at_least, band.lowest, -1),
    ):
        if limit is not None:
            kept = "kept" if sign * (worst - limit) <= 0 else "missed"
            where = f"{word} {limit:g} dB: {kept}".replace("-", "−")
            rows.append(_level_row(where, *span, at, plain(worst)))
    return rows


def _level_row(
    where: str,
    lower: float | None,
    upper: float | None,
    frequency: float,
    steady: float | None,
    opened: Sequence[bool] = (False, False),
    closer: str = "",
) -> Row:
    return {
        "where": where,
        "lower": lower,
        "upper": upper,
        "lower_open": opened[0],
        "upper_open": opened[1],
        "frequency": frequency,
        "level_at_real_frequency": steady,
        "closer": closer,
    }


def _stopped(omega: NDArray[Any], level: NDArray[Any]) -> list[tuple[float, float, bool, bool]]:
    """Where a level is below the mark, its ends between frequencies by a straight line, rad/s, and
    whether it is open at either: the frequencies end there. Below an asymptote there is no end of
    ever narrower ones, which are left out."""
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
        if ends[1] - ends[0] >= _NARROWEST * ends[1]:
            found.append((ends[0], ends[1], beyond[0], beyond[1]))
    return found


def _modes(found: Ringing) -> list[Row]:
    return [
        {
            "mode": number + 1,
            "sector": found.sector,
            "frequency": plain(found.found[number] * HERTZ),
            "frequency_exact": float(found.exact[number]) * HERTZ,
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
            "untold": one.reason,
        }
        for convention, one in test.result.velocities.items()
        # Where waves run both ways it may be of neither.
        if 0 < test.result.speeds[convention].velocity < math.inf
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
            "frequency": float(found.omega[at]) * HERTZ,
            "quality": float(found.quality[at]),
            "quality_error": float(found.quality_error[at]),
            "quality_exact": float(law[at]),
        }
    ]


def bar_notes(reading: Reading, field: Field) -> list[str]:
    """What a reader should know beside the checks."""
    if not reading.moved:
        return [
            "nothing moved: nothing could be checked; begin a source before the end ([[sources]] "
            "delay or start), and away from fixed ends"
        ]
    found = []
    if not field.receivers:
        found.append(
            "no receiver: nothing was held against the exact solver; add [[receivers]] to compare "
            "signals"
        )
    held = reading.exact or reading.finer
    found += receiver_notes(field, held, reading.heard, reading.refused)
    found += energy_note(field)
    found += [note for pulse in reading.pulses if (note := _blind(field, pulse))]
    return found + _folded(reading, field) + _too_short(reading, field) + _near_cutoffs(field)


def _blind(field: Field, pulse: PulseTest) -> str:
    """The note on frequencies at which k between receivers is not that of one wave, or ""."""
    if pulse.k_exact is None:
        return ""
    error, told = wavenumbers(pulse)
    read, off = np.isfinite(error).sum(), (np.isfinite(error) & ~told).sum()
    if 2 * off <= read:
        return ""
    return (
        f"{pulse.name} k between receivers is not that of one wave at {off} of {read} frequencies, "
        f"nor is it in the exact signals, and was not judged there; "
        f"{remedies.of_window(field, pulse)}"
    )


def _folded(reading: Reading, field: Field) -> list[str]:
    """The note on frequencies that frames fold something onto, which are not judged."""
    own = {block.sector: pulses(field, block) for block in field.blocks if block.macro}
    lost = {}
    spectra: list[Scattered | Cells] = [*reading.scattered, *reading.cells]
    for one in spectra:
        driven = excitation(own[one.sector], one.omega) >= JUDGED
        off = one.omega[driven & ~unfolded(own[one.sector], one.omega, field.interval)]
        if len(off):
            lost[one.sector] = f"{one.sector} from {float(off.min()) * KHZ:.4g} kHz on"
    needed = default_samples(field.sources, field.layers, field.simulation.duration)
    if not lost or needed <= len(field.t):
        return []
    return [
        f"T, R and Bloch waves were not judged everywhere ({', '.join(lost.values())}): "
        f"{len(field.t)} frames fold onto these frequencies what the sources drive beyond "
        f"{math.pi / field.interval * KHZ:.4g} kHz; take [time] samples = {needed} or more"
    ]


def _too_short(reading: Reading, field: Field) -> list[str]:
    """Bars that ring, of which the receivers hear no eigenfrequency apart from the next."""
    if field.simulation.lossy or not field.receivers or reading.ringing:
        return []
    if not any(block.macro for block in field.blocks):
        return []
    last = float(field.t[-1])
    # Neighbours of a wave of speed c lie πc/L apart, and are told by this many bins.
    across = [
        sum(one.thickness / long_wave_speed(one.medium, sector) for one in field.layers.layers)
        for sector in dict.fromkeys(block.sector for block in field.blocks if block.macro)
        if len(field.medium.family.blocks_of(sector)) == 1
    ]
    needed = _TELLS * LOBE_BINS * min(across, default=last)
    more = f"lengthen [time] duration to {needed:.2g} or more, or " if needed > last else ""
    return [
        f"no eigenfrequency was judged: none that a record of {last:.3g} s tells from the next is "
        f"heard at the receivers; {more}move a receiver"
    ]


def _near_cutoffs(field: Field) -> list[str]:
    """The note on what absorbing ends send back."""
    told = sent_back(field)
    if not told:
        return []
    return [
        "an absorbing end sends back more than 1e-3 of waves just above a cutoff, which are long: "
        f"{told}; keep the sources' band off them, or take stiffer media at the ends"
    ]
