"""What to change in a case: where a check falls short, or to see more of a gap."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.arguments import FREQUENCIES, WINDOW
from wavesim.material.family import Block
from wavesim.material.shown import HERTZ, KHZ
from wavesim.planewave.dispersion_relation import Gap, asymptotes
from wavesim.readings.bar.pulse_test import PulseTest
from wavesim.readings.bar.transmission import Band, Scattered
from wavesim.readings.dispersion.decay_along_ring import Attenuation
from wavesim.readings.pulse.spectral_windows import Gate
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import Simulation, default_samples
from wavesim.timedomain.absorber import least_absorber
from wavesim.verdict import foreseen_errors
from wavesim.verdict.cell_size import WELL, cell_size, gentler, lower, sized
from wavesim.verdict.warnings_before_run import begins_with_a_jump, changes_in_absorber

# A row of an answer: names, SI numbers and, where there is no number, None.
Row = dict[str, Any]
Answers = dict[str, list[Row]]

# The key that says how high a source goes, by its kind.
_PEAK_KEY = {
    "ricker": "peak_frequency",
    "gaussian-derivative": "peak_frequency",
    "tone-burst": "frequency",
}
# What explains this part of an error is what to change first.
_EXPLAINS = 0.3
# Part of a record after which an arrival may be lost at its end.
_AT_THE_END = 0.95
# By how much a step is to be shorter, and σT of the exponential window larger.
_SHORTER, _MORE_DAMPING = 5, 6.0
# σT that serves as a rule.
_SERVES = 18.0
# So many cells from an interface or an end the differences are exact to a lower degree.
ONE_SIDED = 8
# Steppers that leave no error of their own, rounding apart, whatever the step.
_EXACT_IN_TIME = ("propagator", "chebyshev")
# A source peaks in the middle of a band to this part of it.
_THERE = 0.05
# Part of an asymptote's frequency that a wave stays below it to be longer than a few cells.
_BELOW = 0.95


def finer(field: Field) -> str:
    """A finer grid: the cell size that would do, where what is foreseen tells it, or half of it."""
    now = f"(now {field.bar.spacing:.6g} m)"
    tried, _ = _tried(field.simulation)
    if tried:
        return f"{tried} {now}"
    better = f"[bar] order = {WELL} (now {field.bar.order}), or " * (field.bar.order < WELL)
    return f"take {better}{sized(field, field.bar.spacing / 2)} {now}"


_LAST: list[tuple[Simulation, tuple[str, bool]]] = []


def _tried(simulated: Simulation) -> tuple[str, bool]:
    """The cell size that would do, and whether it was seen to, where the grid is to blame; "" where
    it is not. Kept, as all checks of a run ask for it."""
    if not any(known is simulated for known, _ in _LAST):
        short = [one for one in foreseen_errors.foretold(simulated) or () if not one.passed]
        worst = max(short, key=lambda one: one.error / one.allowed, default=None)
        _LAST[:] = [(simulated, cell_size(simulated, worst) if worst else ("", False))]
    return _LAST[0][1]


def longer_run(field: Field, why: str) -> str:
    """A longer record."""
    last = float(field.t[-1])
    return f"lengthen [time] duration to {2 * last:.3g} or more (now {last:.3g} s): {why}"


def shorter_step(field: Field) -> str:
    """A shorter time step, or where that is not one of them a stepper that is exact in time."""
    text = f"take [time] step = {field.step / _SHORTER:.2g} or shorter (now {field.step:.2g} s)"
    if field.stepper in _EXACT_IN_TIME:
        return text
    return (
        f'leave [time] solver (now "{field.stepper}") at "auto", which is exact in time, or {text}'
    )


def of_frequencies(field: Field, block: Block, k: Any, branch: int, error: float) -> str:
    """Where ω(k) of a branch is off by this part of itself, or is not found (not a number)."""
    k = np.atleast_1d(np.asarray(k, dtype=float))
    if len(k) and np.isfinite(error):
        _, by_grid = foreseen_errors.of_frequencies(field, block, k)
        if by_grid[:, branch].max() >= _EXPLAINS * error:
            return finer(field)
        if field.stepper not in _EXACT_IN_TIME:
            return shorter_step(field)
    return longer_run(field, "its frequency bins do not tell this branch from its neighbours")


def of_wavenumbers(field: Field, block: Block, omega: NDArray[Any], error: Any) -> str:
    """Where complex k(ω) is off by these parts of itself.

    Args:
        field: of an endless bar.
        block: whose wave was measured.
        omega: ω + iσ, shape (n,), rad/s.
        error: |Δk|/|k| at each, shape (n,).
    """
    worst = int(np.nanargmax(error))
    by_grid = foreseen_errors.of_wavenumbers(field, block, np.asarray(omega)[worst : worst + 1])
    if by_grid[0] / error[worst] >= _EXPLAINS:
        return finer(field)
    damping = float(np.imag(omega[0]) * field.t[-1])
    return _more_damping(field, damping, min(damping + _MORE_DAMPING, WINDOW[1]))


def to_tell(field: Field, curve: Attenuation, where: Any, part: float) -> str:
    """What to change for complex k(ω) to be told somewhere.

    What a record's end leaves out falls as e^{−σT}.

    Args:
        field: of an endless bar.
        curve: its attenuation.
        where: the frequencies, mask of shape (n,).
        part: of |k| that may be hidden, at most.
    """
    damping = float(curve.sigma * field.t[-1])
    hidden = (curve.error / (part * np.abs(curve.k)))[where]
    hidden = hidden[np.isfinite(hidden)]
    more = damping + (math.log(float(hidden.min())) + 1 if len(hidden) else _MORE_DAMPING)
    return _more_damping(field, damping, math.ceil(max(more, _SERVES)))


def _more_damping(field: Field, damping: float, more: float) -> str:
    """A larger σT of the exponential window, where it may be so large, or else a longer record."""
    if damping * (1 + 1e-9) < more <= WINDOW[1]:
        return (
            f"raise [analysis] damping to {more:.4g} (now {damping:.4g}), which leaves less of the "
            "record's end"
        )
    return longer_run(field, "of what still rings too much lies past the record's end")


def whatever_the_grid(field: Field) -> str | None:
    """What no grid mends: a source that begins with a jump, an absorber where the medium changes,
    or one that is short."""
    bar = field.bar
    if jumps := [told for source in field.sources for told in begins_with_a_jump(source)]:
        return jumps[0]
    if changed := changes_in_absorber(field):
        return changed
    if not bar.absorber:
        return None
    least = least_absorber(field.layers)
    if bar.absorber >= least * (1 - 1e-9):
        return None
    return (
        f"lengthen [bar] absorber to {2 * least:g} (now {bar.absorber:g} m): below {least:g} it "
        "reflects too much"
    )


def of_grid(field: Field) -> str:
    """An absorber that is too short, or else a finer grid or a band that it carries better."""
    told = whatever_the_grid(field)
    if told:
        return told
    inexact = field.stepper and field.stepper not in _EXACT_IN_TIME
    if inexact and not _tried(field.simulation)[0]:
        return shorter_step(field)
    told, other = finer(field), gentler(field)
    return told if other in told else f"{told}, or {other}"


def of_signal(field: Field, receiver: str, sent_back: str = "") -> str:
    """Where a receiver's signal is off.

    Args:
        field: the field.
        receiver: its name.
        sent_back: frequencies that absorbing ends send back, to blame where no grid mends it; ""
            for none.
    """
    bar, layers = field.bar, field.layers
    low, high = bar.clear
    caught = [s.position for s in field.sources if not low <= s.position <= high]
    if caught:
        return (
            f"move [[sources]] position = {caught[0]:g} into {low:.4g} to "
            f"{high:.4g} m: it stands in an absorbing layer, which takes up what it sends"
        )
    if told := whatever_the_grid(field):
        return told
    # It is little beside what differences of a low order do.
    if sent_back and bar.order >= WELL and not _tried(field.simulation)[1]:
        told = (
            f"take {lower(field)}, or stiffer media at the absorbing ends, which send back some of "
            f"{sent_back}"
        )
        known = foreseen_errors.foretold(field.simulation)
        if known and all(one.passed for one in known):  # by the grid it would be right
            return told
        return f"{told}; if that is not it, {of_grid(field)}"
    faces = list(layers.interfaces)
    faces += [] if bar.periodic else [0.0, bar.length]
    reach = ONE_SIDED * bar.spacing
    position = field.receivers[receiver]
    near = [face for face in faces if abs(position - face) <= reach]
    if not near:
        return of_grid(field)
    return (
        f'move [[receivers]] "{receiver}" more than {reach:.3g} m ({ONE_SIDED} cells) from the '
        f"interface or end at {near[0]:g} m (now at {position:g}), or {finer(field)}"
    )


def of_scattering(field: Field, found: Scattered, error: Any) -> str:
    """Where T or R is off."""
    worst = int(np.argmax(np.where(found.judged & np.isfinite(error), error, -1.0)))
    omega = float(found.omega[worst])
    at = f"furthest off at {omega * KHZ:.4g} kHz"
    ends = {field.layers.layers[0].medium, field.layers.layers[-1].medium}
    for medium in ends:
        for edge in asymptotes(medium, found.sector):
            if _BELOW * edge <= omega <= edge:
                return (
                    f"{at}, close below an asymptote of a buffer ({edge * KHZ:.4g} "
                    f"kHz), where waves are short: take {lower(field)}, or stiffer buffers "
                    "([[layers]])"
                )
    return f"{at}: {of_grid(field)}"


def of_band(field: Field, found: Scattered, band: Band) -> str:
    """Where a run tells of part of a band, or of nothing in it."""
    low, high = band.asked.low, band.asked.high
    dark = band.holds(found.omega) & ~found.judged
    if not band.holds(found.omega).any():
        return f"take [time] samples = {math.ceil(2.2 * high * float(field.t[-1])) + 1} or more"
    at = found.omega[dark] * KHZ
    span = f"{at[0]:.4g} to {at[-1]:.4g} kHz" if len(at) else ""
    if any((np.abs(k.imag) >= np.abs(k.real))[dark].any() for k in found.k):
        return (
            f"no word on {span}, where a buffer carries nothing; take stiffer buffers ([[layers]])"
        )
    peak = (low + high) / 2
    if any(abs(source.peak_frequency / peak - 1) < _THERE for source in field.sources):
        return (
            f"no word on {span}; {longer_run(field, 'its end hides what the sources drive there')}"
        )
    return (
        f"no word on {span}, as the sources drive too little there; take [[sources]] "
        f"peak_frequency = {peak:.4g}, or less [[sources]] width"
    )


def of_eigenfrequencies(field: Field, off: bool) -> str:
    """Where eigenfrequencies are not heard: by the grid if those heard are off too."""
    if off:
        return finer(field)
    return "add [[receivers]] elsewhere, as a mode is silent at its nodes, or " + longer_run(
        field, "a mode that is weakly driven stands out of its neighbours"
    )


def of_arrival(field: Field, found: Any, known: Any) -> str:
    """Where arrivals are off, or not found where the exact signals have them, s."""
    lost = np.isfinite(known) & ~np.isfinite(found)
    if lost.any() and np.asarray(known)[lost].max() >= _AT_THE_END * field.t[-1]:
        return longer_run(field, "an arrival comes as the record ends")
    return of_grid(field)


def of_window(field: Field, test: PulseTest) -> str:
    """Where k or Q between receivers is not the medium's own, though the grid has no part in it."""
    window, last = test.result.window, float(field.t[-1])
    if isinstance(window, Gate) and window.end < last * (1 - 1e-9):
        length = field.bar.length
        return (
            f"lengthen [bar] length to {2 * length:.4g} (now {length:.4g} m), or move "
            "[[receivers]] nearer to the source: an echo comes back before the pulse has passed"
        )
    return longer_run(field, "the record's end cuts off waves that are still passing")


def to_see_more(field: Field, sector: str, gap: Gap, frequencies: int = 0) -> str:
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
    peak = float(f"{(gap.lower + gap.upper) / 2 * HERTZ:.3g}")
    if any(source.field in fields for source in field.sources):
        return _driven_at(field.simulation, fields, peak)
    return f'not driven: add [[sources]] with field = "{fields[0]}", peak_frequency = {peak:.4g}'


def _driven_at(simulated: Simulation, fields: Sequence[str], peak: float) -> str:
    """What to change for sources of these fields with their peak there, Hz, and frames to do."""
    sources: list[Any] = list(simulated.sources)
    sets = []
    for number, source in enumerate(sources):
        if source.field in fields and source.kind in _PEAK_KEY:
            key = _PEAK_KEY[source.kind]
            sources[number] = dataclasses.replace(source, **{key: peak})
            sets.append(f"--set sources.{number}.{key}={peak:.4g}")
    samples = default_samples(sources, simulated.layers, simulated.duration)
    if sets and samples > simulated.frames:
        sets.append(f"--set time.samples={samples}")
    return " ".join(sets)


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
