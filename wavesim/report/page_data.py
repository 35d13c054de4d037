"""What the page of a run draws from, small enough to travel in it: arrays thinned and packed.

A packed array stands for low + step · n, n whole numbers of one or two bytes; the steps are finer
than anything that a pointer on a screen can tell. Along each row stand the differences of n, their
low bytes before their high ones, deflated, in base64: smooth fields take half as much so. All else
is in SI.
"""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import is_macro, known_field
from wavesim.material.shown import DECIBELS, HERTZ, decibels, plain
from wavesim.planewave.dispersion_relation import block_oscillations, open_gaps, wavenumber
from wavesim.readings.amplitude_map import amplitude_map, gone_round, tile_ends
from wavesim.readings.bar.reading import Reading
from wavesim.readings.record_section import record_section
from wavesim.simulation.field import Field
from wavesim.verdict.branches import Held

Data = dict[str, Any]

# Tiles of the space-time picture; frames and places of the field in the bar; of a signal.
_TILES = (220, 400)
_FRAMES, _PLACES, _SAMPLES = 80, 1200, 4000
# Numbers of all snapshots and of all signals together, and frequencies of a spectrum, at most.
_ALL_PLACES, _ALL_SAMPLES, _FREQUENCIES, _WAVENUMBERS = 1_000_000, 150_000, 400, 320
# Amplitudes and powers are shown so far below their largest, dB.
_FAINTEST, _FAINTEST_POWER = -60.0, -80.0
_FINE = 800
# A field moves where it is this part of its largest in the run.
_MOVES = 0.2


def of_field(field: Field) -> Data:
    """The field: amplitude over time and place, snapshots, signals at receivers."""
    bar, medium = field.bar, field.medium
    sectors = list(dict.fromkeys(block.sector for block in field.blocks))
    return {
        "units": {"length": float(medium.length_scale), "time": float(medium.time_scale)},
        "time_unit": medium.family.time,
        "symbols": {name: known_field(name).symbol for name in field.names},
        "length": bar.length,
        "duration": float(field.t[-1]),
        "periodic": bar.periodic,
        "interfaces": [float(x) for x in field.layers.interfaces],
        "clear": [float(x) for x in bar.clear],
        "sources": [_source(field, source) for source in field.sources],
        "receivers": [{"name": n, "position": float(x)} for n, x in field.receivers.items()],
        "sectors": sectors,
        "fields": {sector: _fields(field, sector) for sector in sectors},
        "gaps": {sector: _gaps(field, sector) for sector in sectors},
        "spacetime": {sector: _spacetime(field, sector) for sector in sectors},
        "round": {sector: gone_round(field, sector) for sector in sectors},
        "snapshots": _snapshots(field),
        "signals": _signals(field),
    }


def _fields(field: Field, sector: str) -> list[str]:
    """Names of the fields of a sector: those that travel, those of no other sector, others."""
    own, others = (
        {name for b in field.blocks if (b.sector == sector) == ours for name in b.fields}
        for ours in (True, False)
    )
    return sorted(
        own & set(field.names), key=lambda name: (not is_macro(name), name in others, name)
    )


def _source(field: Field, source: Any) -> Data:
    own = [b.sector for b in field.blocks if source.field in b.fields]
    return {
        "field": source.field,
        "position": float(source.position),
        "time": plain(source.peak_time),
        "sectors": list(dict.fromkeys(own)),
    }


def _gaps(field: Field, sector: str) -> list[Data]:
    """Those of the one medium; of several layers none is the bar's."""
    media = field.layers.inner_media
    if len(media) > 1:
        return []
    return [
        {"name": gap.name, "lower": gap.lower * HERTZ, "upper": gap.upper * HERTZ}
        for gap in open_gaps(media[0], sector)
    ]


def _spacetime(field: Field, sector: str) -> Data:
    amplitude = amplitude_map(field, sector, _TILES)
    peak = float(amplitude.max()) or 1.0
    right, early, late = tile_ends(field, _TILES)
    ends = {"x_end": right, "t_begin": early, "t_end": late}
    return _packed(decibels(amplitude, peak), _FAINTEST, 0.25, np.uint8) | ends


def _snapshots(field: Field) -> Data:
    frames = _some(len(field.t), _FRAMES)
    found: Data = {"t": field.t[frames].tolist(), "fields": {}}
    most = min(_PLACES, _ALL_PLACES // (len(frames) * len(field.names)))
    for name in field.names:
        x = field.positions(name)
        places = _some(len(x), most)
        step = int(places[1] - places[0]) if len(places) > 1 else 1
        values = field.part(name, slice(0, len(field.t), frames[1] - frames[0]),
                            slice(0, len(x), step))  # fmt: skip
        if name == field.names[0]:
            found["first"] = _on_its_way(values)
        found["fields"][name] = _whole(values) | {
            "x": np.round(x[places], 7 - math.floor(math.log10(field.bar.length))).tolist(),
            "unit": field.unit(name),
        }
    return found


def _on_its_way(values: Any) -> int:
    """The snapshot that is shown first: a third into the run, or before, where it still moves."""
    size = np.abs(values).max(axis=1)
    moving = np.flatnonzero(size >= _MOVES * size.max())
    return int(min(moving[-1], round(len(size) / 3), len(size) - 1))


def _some(count: int, most: int) -> NDArray[np.int_]:
    """Every second, third, … of so many, at most."""
    return np.arange(0, count, max(1, -(-count // most)))


def _shown_samples(field: Field) -> NDArray[np.int_]:
    """Samples of signals at receivers that the page shows."""
    many = max(1, len(field.receivers) * len(field.names))
    return _some(len(field.t), max(50, min(_SAMPLES, _ALL_SAMPLES // many)))


def _signals(field: Field) -> Data:
    samples = _shown_samples(field)
    order = sorted(field.receivers.items(), key=lambda item: item[1])
    receivers: list[Data] = [
        {"name": name, "position": float(x), "fields": {}} for name, x in order
    ]
    sections: Data = {}
    for each in field.names if order else ():
        own = record_section(field, each)
        sections[each] = {"alike": own.alike, "end": own.end, "unit": field.unit(each)}
        for number, receiver in enumerate(receivers):
            first = own.first[number]
            receiver["fields"][each] = _whole(own.signals[number][samples]) | {
                "peak": float(own.peaks[number]),
                "scale": float(own.scale[number]),
                "arrival": float(field.t[first]) if own.arrived[number] else None,
            }
    return {"t": field.t[samples].tolist(), "sections": sections, "receivers": receivers}


def of_found(field: Field, found: Any) -> Data:
    """What was measured, beside the exact solution.

    Args:
        field: the field.
        found: every block of an endless bar beside the theory, or the reading of any other.
    """
    if isinstance(found, list):
        return {
            "spectrum": {
                sector: _spectrum(field, [h for h in found if h.measured.block.sector == sector])
                for sector in dict.fromkeys(h.measured.block.sector for h in found)
            },
            "attenuation": {
                h.measured.block.sector: _attenuation(field, h)
                for h in found
                if h.k_exact is not None
            },
        }
    return _of_reading(field, found)


def _spectrum(field: Field, own: Sequence[Held]) -> Data:
    first = own[0].measured.spectrum
    size = min(len(h.measured.spectrum.omega) for h in own)
    power = np.sum([h.measured.spectrum.power[:, :size] for h in own], axis=0)
    branches = []
    k = np.linspace(0, float(first.k[-1]), _FINE // 4)
    highest = 0.0
    for h in own:
        exact = block_oscillations(field.medium, h.measured.block, k)
        highest = max(highest, float(exact.max()))
        for number, branch in enumerate(h.branches):
            points = _some(len(branch.k), 50)
            branches.append(
                {
                    "name": branch.name,
                    "k": branch.k[points].tolist(),
                    "frequency": (branch.omega[points] * HERTZ).tolist(),
                    "exact": (branch.omega_exact[points] * HERTZ).tolist(),
                    "line": (exact[:, number] * HERTZ).tolist(),
                }
            )
    top = min(size, int(np.searchsorted(first.omega[:size], 1.08 * highest)) + 1)
    rows, columns = _some(top, _FREQUENCIES), _some(len(first.k), _WAVENUMBERS)
    tiles = np.maximum.reduceat(power[:, :top], rows, axis=1)
    tiles = np.maximum.reduceat(tiles, columns, axis=0)
    level = 10 * np.log10(np.maximum(tiles / (float(power.max()) or 1.0), 1e-30))
    half, beside = (
        (some[1] - some[0] - 1) / 2 * (axis[1] - axis[0]) if len(some) > 1 else 0.0
        for some, axis in ((rows, first.omega), (columns, first.k))
    )
    return {
        "power": _packed(level.T, _FAINTEST_POWER, 80 / 250, np.uint8),
        "k": (first.k[columns] + beside).tolist(),
        "frequency": ((first.omega[rows] + half) * HERTZ).tolist(),
        "line_k": k.tolist(),
        "branches": branches,
    }


def _attenuation(field: Field, held: Held) -> Data:
    curve = held.measured.attenuation
    assert curve is not None
    assert held.k_exact is not None
    sector = held.measured.block.sector
    omega = np.linspace(curve.omega[0], curve.omega[-1], _FINE)
    real = wavenumber(field.medium, sector, omega)
    damped = wavenumber(field.medium, sector, omega + 1j * curve.sigma)
    return {
        "sigma": float(curve.sigma),
        "frequency": (curve.omega * HERTZ).tolist(),
        "measured": plain(curve.k.imag * DECIBELS),
        "exact": plain(held.k_exact.imag * DECIBELS),
        "line_frequency": (omega * HERTZ).tolist(),
        "line_exact": plain(damped.imag * DECIBELS),
        "line_real": plain(real.imag * DECIBELS),
    }


def _of_reading(field: Field, reading: Reading) -> Data:
    found: Data = {"transmission": {}, "bloch": {}, "eigenfrequencies": {}, "pulse": {}}
    for one in reading.scattered:
        line = one.line
        some = _some(len(line[0]), _FINE)
        found["transmission"][one.sector] = {
            "sigma": float(one.sigma),
            "frequency": (one.omega[one.judged] * HERTZ).tolist(),
            "line_frequency": (line[0][some] * HERTZ).tolist(),
        } | {
            name: {
                "measured": _levels(getattr(one, name)[one.judged]),
                "exact": _levels(getattr(one, f"{name}_exact")[one.judged]),
                "line": _levels(np.asarray(curve)[some]),
            }
            for name, curve in (("T", line[1]), ("R", line[2]))
        }
        own = found["transmission"][one.sector]
        own["bands"] = [
            {
                "lower": b.asked.low,
                "upper": b.asked.high,
                "limits": [b.asked.at_most, b.asked.at_least],
            }
            for b in one.bands
        ]
        for name, real in (("T", one.T_real), ("R", one.R_real)):
            omega, curve = one.omega, real
            if name == "T":
                omega, first = np.unique([*omega, *line[0][some]], return_index=True)
                curve = np.array([*real, *line[3][some]])[first]
            own[name] |= {"real_frequency": (omega * HERTZ).tolist(), "real": _levels(curve)}
    for two in reading.cells:
        fine, q = two.line
        some = _some(len(fine), _FINE)
        found["bloch"][two.sector] = {
            "frequency": (two.omega[two.judged] * HERTZ).tolist(),
            "phase": plain(two.q[two.judged].real * two.period / math.pi),
            "decay": plain(two.q[two.judged].imag * two.period),
            "line_frequency": (fine[some] * HERTZ).tolist(),
            "line_phase": plain(q[some].real * two.period / math.pi),
            "line_decay": plain(q[some].imag * two.period),
        }
    for three in reading.ringing:
        shown = np.flatnonzero(three.omega <= 1.08 * three.exact[-1])
        some = _some(len(shown), 3000)
        level = np.maximum.reduceat(three.level[shown], some)
        found["eigenfrequencies"][three.sector] = {
            "frequency": (three.omega[shown][some] * HERTZ).tolist(),
            "level": _levels(level, 2),
            "exact": (three.exact * HERTZ).tolist(),
            "measured": plain(three.found * HERTZ),
            "height": _levels(np.interp(three.found, three.omega, three.level), 2),
        }
    for test in reading.pulses:
        if test.medium is None:  # one speed across several layers is the speed of nothing
            continue
        ours, known = test.result.dispersion, test.exact.dispersion
        columns = ("phase_velocity", "group_velocity", "attenuation", "quality")
        found["pulse"][test.name] = {
            "sector": test.sector,
            "frequency": (ours.omega * HERTZ).tolist(),
            "measured": {name: plain(getattr(ours, name)) for name in columns},
            "exact": {name: plain(getattr(known, name)) for name in columns},
        }
    found["exact_signals"] = _exact_signals(field, reading)
    return {name: part for name, part in found.items() if part}


def _exact_signals(field: Field, reading: Reading) -> Data:
    samples = _shown_samples(field)
    return {
        receiver: {name: _whole(signal[samples]) for name, signal in own.items()}
        for receiver, own in reading.exact.items()
    }


def _packed(values: Any, low: float, step: float, kind: Any) -> Data:
    """An array as whole numbers; what is below its range, or no number, is at its low end."""
    highest = np.iinfo(kind).max
    count = np.nan_to_num((np.asarray(values) - low) / step, nan=0.0)
    whole = np.clip(np.rint(count), np.iinfo(kind).min, highest).astype(kind)
    steps = whole.copy()
    steps[..., 1:] -= whole[..., :-1]  # modulo 2^8 or 2^16
    planes = steps.reshape(-1, 1).view(np.uint8).T
    return {
        "shape": list(whole.shape),
        "low": low,
        "step": step,
        "bytes": whole.dtype.itemsize,
        "data": base64.b64encode(zlib.compress(planes.tobytes(), 4)).decode("ascii"),
    }


def _whole(values: Any) -> Data:
    """An array of both signs, in steps of 1/32767 of its largest value."""
    top = float(np.abs(values).max(initial=0.0)) or 1.0
    return _packed(values, 0.0, top / 32767, np.int16)


def _levels(values: Any, decimals: int = 6) -> Any:
    return plain(np.round(decibels(values), decimals))
