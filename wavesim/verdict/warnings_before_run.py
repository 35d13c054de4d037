"""What will make a run less than it could be, said before it; each with its remedy. No jax."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from wavesim.material.damping import quality
from wavesim.material.family import is_macro, known_field
from wavesim.material.shown import KHZ
from wavesim.planewave.dispersion_relation import block_oscillations, wavenumber
from wavesim.readings.bar.loudness import beside_a_source
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import Simulation, largest_phase
from wavesim.sources import EXCITED, GaussianDerivative, Recorded, Ricker, Source, excitation
from wavesim.timedomain.absorber import least_absorber
from wavesim.timedomain.time_step import TimeStep, slower

if TYPE_CHECKING:  # slow to import, and only where it is asked for
    from wavesim.case.load import Case
    from wavesim.verdict.foreseen_errors import Foretold

# A wave propagates where its k turns less than this part of it into decay.
_CARRIED = 0.1
# Products beyond this many times what a wave that crosses the bar takes are out of proportion.
_PROPORTION = 30
_FEW_PRODUCTS = 20_000
# On either side of an interface, in cells.
_ON_INTERFACE = 1e-6
# A source reaches this many of its widths.
_REACH = 3.0
# Least part of a bar that is set in motion in a run that is meant.
_MOVED = 0.1
# Q is constant to 8 % within its band.
_OFF_QUALITY = 0.2
# Wavenumbers at which the judged range is looked at.
_RANGE = 65


def foreseen(case: Case, steps: TimeStep, errors: Sequence[Foretold] | None = None) -> list[str]:
    """What will make a run less than it could be; errors are those of its grid, where
    ``foreseen_errors.foretold`` found them."""
    simulated = case.simulation
    found: list[str] = []
    for looked in (_in_time, _at_rest, _at_ends, _receivers, _absorbed):
        found += looked(simulated)
    if errors:
        from wavesim.verdict.cell_size import too_coarse

        found += too_coarse(simulated, errors, case.analysis, case.k_range)
    else:
        found += _on_the_grid(simulated)
    found += _losses(simulated)
    # Blocks of one sector say the same.
    return list(dict.fromkeys([*found, *_judged(case), *_products(simulated, steps)]))


def _in_time(simulated: Simulation) -> Iterator[str]:
    """Frames too far apart, and sources that the run is too short for, or that jump."""
    band, duration = simulated.band, simulated.duration
    if math.pi / simulated.interval < band:
        needed = math.ceil(duration * band / math.pi) + 1
        yield (
            f"[time] samples = {simulated.frames}: the frames alias the sources' band "
            f"(to {band * KHZ:.4g} kHz); take at least {needed}"
        )
    after = [s for s in simulated.sources if s.acts != "initial" and s.onset >= duration]
    if after:
        yield (
            f"[time] duration = {duration:g}: the {after[0].field} source begins only at "
            f"{after[0].onset:.4g} s, after the end, and nothing moves; lengthen the run to "
            f"{after[0].end:.3g} s, or begin the source earlier ([[sources]] delay or start)"
        )
    late = [s for s in simulated.sources if s.onset < duration < s.end]
    if late:
        yield (
            f"[time] duration = {duration:g}: the {late[0].field} source acts until "
            f"{late[0].end:.4g} s; lengthen the run"
        )
    for source in simulated.sources:
        yield from begins_with_a_jump(source)


def _at_rest(simulated: Simulation) -> Iterator[str]:
    """A bar of which next to all stays at rest."""
    bar, duration = simulated.bar, simulated.duration
    speed = max(medium.fastest for medium in simulated.layers.media)
    gone = speed * duration
    reached = [(one.position, gone + _REACH * one.width) for one in simulated.sources]
    moved = max(x + r for x, r in reached) - min(x - r for x, r in reached)
    if moved < _MOVED * bar.length:
        yield (
            f"[bar] length = {bar.length:g}: the fastest wave goes {gone:.3g} m within the "
            f"{duration:g} s of [time] duration, and the rest of the bar stays at rest; shorten it "
            f"to about {moved:.2g} m, or see that lengths are in metres and times in seconds"
        )


def _at_ends(simulated: Simulation) -> Iterator[str]:
    """Macro-fields driven where a fixed end holds them."""
    bar = simulated.bar
    for source in simulated.sources:
        if source.acts not in ("body", "initial") or source.staggered:
            continue
        (word,) = known_field(source.field).family.words_for(("prescribed",))[:1]
        for side, end, at in (("left", bar.left, 0.0), ("right", bar.right, bar.length)):
            distance = abs(source.position - at)
            cell = float(bar.cell_sizes[0 if side == "left" else -1])
            if end == "fixed" and distance <= cell / 2 * (1 + 1e-9):
                yield (
                    f"[[sources]] position = {source.position:g}: the source on {source.field} "
                    f"acts within half a cell of the fixed end at {at:g} m, which holds it, and "
                    f'next to nothing moves; move it inward, or take drive = "{word}"'
                )


def _receivers(simulated: Simulation) -> Iterator[str]:
    """Receivers where nothing moves, where fields jump, and that nothing reaches in time."""
    bar, layers = simulated.bar, simulated.layers
    macro, micro = simulated.medium.family.words
    turned = {s.position for s in simulated.sources if s.acts == "prescribed"}
    moving = [name for name in simulated.fields if is_macro(name)]
    for name, position in simulated.receivers.items():
        where = f'[[receivers]] "{name}" position = {position:g}:'
        for end, at in ((bar.left, 0.0), (bar.right, bar.length)):
            held = end == "fixed" and not any(abs(at - x) < bar.spacing for x in turned)
            if held and abs(position - at) <= 1e-9 * bar.length and moving:
                yield (
                    f"{where} stands on the fixed end, where no {macro} moves; move it inward, "
                    f"or look at {micro} alone"
                )
        for face in layers.interfaces:
            if abs(position - face) <= _ON_INTERFACE * bar.spacing:
                yield (
                    f"{where} stands on the interface at {face:g} m, where {micro} jumps: "
                    "it is that to its right; move it into a layer"
                )
        if beside_a_source(simulated, position):
            yield (
                f"{where} stands within {bar.order} cells of a point source, where the grid has a "
                "lower order, and its signals will not be compared; move it farther away, or give "
                "the source a width"
            )
        reached = min((_reached(simulated, s, position) for s in simulated.sources), default=0.0)
        if reached > simulated.duration:
            yield (
                f"{where} nothing reaches it before {reached:.3g} s, and the run ends at "
                f"{simulated.duration:g} s; lengthen [time] duration, or move it nearer"
            )


def _reached(simulated: Simulation, source: Source, position: float) -> float:
    """When the fastest wave brings a thousandth of a source's peak to a position, s."""
    bar = simulated.bar
    begun = 0.0
    if source.acts != "initial":
        begun = source.peak_time
        if source.peak_frequency > 0:  # a recorded step has none
            begun = min(begun, source.onset + 1 / source.peak_frequency)
    reach = _REACH * source.width
    low, high = sorted((position, source.position))
    low, high = min(low + reach, high), max(high - reach, low)
    across = _travel(simulated, low, high)
    if bar.periodic:
        across = min(across, _travel(simulated, 0.0, low) + _travel(simulated, high, bar.length))
    return begun + across


def _travel(simulated: Simulation, low: float, high: float) -> float:
    """Time that the fastest wave takes from one place to another, s."""
    return sum(
        max(0.0, min(high, layer.end) - max(low, layer.start))
        / max(medium.fastest for medium in layer.sampled(3))
        for layer in simulated.layers.layers
    )


def _on_the_grid(simulated: Simulation) -> Iterator[str]:
    """Waves at a source's strongest frequency that are shorter than the grid carries."""
    bar, told = simulated.bar, set()
    limit = largest_phase(bar.order)
    media = [
        (layer, medium, size)
        for layer, (_, size) in zip(simulated.layers.layers, bar.all_stretches, strict=True)
        for medium in layer.ends
    ]
    for layer, medium, size in media:
        for source in (s for s in simulated.sources if 0 < s.peak_frequency < math.inf):
            omega = np.array([2 * math.pi * source.peak_frequency])
            for block in simulated.blocks:
                key = medium, size, block.sector, source.peak_frequency
                if source.field not in block.fields or not block.macro or key in told:
                    continue
                told.add(key)
                with np.errstate(all="ignore"):
                    k = complex(wavenumber(medium, block.sector, omega)[0])
                if abs(k.imag) <= _CARRIED * abs(k.real) and abs(k.real) * size > limit:
                    cells = 2 * math.pi / abs(k.real) / size
                    yield (
                        f"[bar] spacing = {size:.4g}: the {block.sector} wave at "
                        f"{source.peak_frequency / 1e3:.4g} kHz has {cells:.2g} "
                        f"cells to its length in the layer at {layer.start:g} m, and order "
                        f"{bar.order} needs {2 * math.pi / limit:.2g}; take at most "
                        f"{limit / abs(k.real):.3g} m, or another frequency"
                    )


def _losses(simulated: Simulation) -> Iterator[str]:
    """Constant-Q bands away from what is excited."""
    peaks = [s.peak_frequency for s in simulated.sources if 0 < s.peak_frequency < math.inf]
    for law in dict.fromkeys(layer.medium.damping for layer in simulated.layers.layers):
        if not law.rates or not peaks:
            continue
        series = dataclasses.replace(law, mass=0.0, stiffness=0.0)
        low, high = min(law.rates), max(law.rates)
        meant = float(quality(series, math.sqrt(low * high)))
        for peak in peaks:
            found = float(quality(series, 2 * math.pi * peak))
            if not abs(found / meant - 1) <= _OFF_QUALITY:
                yield (
                    f"[medium] quality_band: a source peaks at {peak:.4g} Hz, outside of it, "
                    f"where Q is {found:.3g} and not {meant:.3g}; take a band about that frequency"
                )
                break


def _judged(case: Case) -> Iterator[str]:
    """Wavenumbers that are to be judged, where no branch is excited."""
    simulated = case.simulation
    if not simulated.endless:
        return
    low, high = case.k_range
    k = np.linspace(low, high, _RANGE)
    for block in simulated.blocks:
        own = [s for s in simulated.sources if s.field in block.fields]
        moving = (other for other in simulated.blocks if other.macro)
        if not block.macro and any(s.field in other.fields for other in moving for s in own):
            continue  # is meant to drive what travels
        omega = block_oscillations(simulated.medium, block, k)
        loud = excitation(own, omega, k[:, None]) >= EXCITED
        seen = omega <= math.pi / simulated.interval
        if not (loud & seen).any():
            yield (
                f"[analysis] k_min = {low:.4g}, k_max = {high:.4g}: the {block.sector} branches "
                f"lie at {omega.min() * KHZ:.4g} to {omega.max() * KHZ:.4g} "
                "kHz there, which no source excites or no frame shows; take others, or another "
                "peak_frequency"
            )


def _products(simulated: Simulation, steps: TimeStep) -> Iterator[str]:
    """More work than the waves on the grid ask for."""
    crossing = max(
        medium.fastest / size
        for layer, _, size in simulated.stretches
        for medium in layer.sampled(3)
    )
    needed = max(simulated.duration * crossing, simulated.frames)
    if steps.operator_products <= max(_PROPORTION * needed, _FEW_PRODUCTS):
        return
    yield (
        f"[time] {steps.operator_products:.3g} products for {simulated.bar.cells} cells, "
        f"{steps.operator_products / needed:.0f} times what waves that cross them ask for; "
        f"{slower(simulated, steps)}"
    )


def _absorbed(simulated: Simulation) -> Iterator[str]:
    """What stands in an absorbing layer, and absorbers that are too short."""
    bar, layers = simulated.bar, simulated.layers
    low, high = bar.clear
    for key, places in (
        ("[[sources]] position", [s.position for s in simulated.sources]),
        ("[[receivers]] position", list(simulated.receivers.values())),
    ):
        inside = [x for x in places if not low <= x <= high]
        if inside:
            yield (
                f"{key} = {inside[0]:g}: stands in an absorbing layer, where waves are no waves of "
                f"the medium; move it into {low:g} to {high:g} m"
            )
    if changed := changes_in_absorber(simulated):
        yield f"[bar] absorber = {bar.absorber:g}: {changed}"
    room = 2 * float(simulated.medium.length_scale)
    free = (
        low + room if bar.left == "absorbing" else 0.0,
        high - room if bar.right == "absorbing" else bar.length,
    )
    near = [x for x in layers.interfaces if low <= x <= high and not free[0] <= x <= free[1]]
    if near:
        yield (
            f"[[layers]] from = {near[0]:g}: an interface within two branch lengths of an "
            "absorbing layer can feed waves caught beside it; move it away, or lengthen the bar"
        )
    least = least_absorber(layers)
    if 0 < bar.absorber < least:
        yield (
            f"[bar] absorber = {bar.absorber:g}: below four branch lengths it reflects more than "
            f"1e-4; take at least {least:g}"
        )


def changes_in_absorber(simulated: Field | Simulation) -> str:
    """What to change where the medium changes within an absorbing layer, which takes up what the
    change would send back; "" where it does not."""
    bar, (first, *_, last) = simulated.bar, (*simulated.layers.layers, simulated.layers.layers[-1])
    low, high = bar.clear
    if low > 0 and (first.last is not None or first.end < low * (1 - 1e-9)):
        within, uniform = f"0 to {low:g}", "before"
    elif high < bar.length and (last.last is not None or last.start > high * (1 + 1e-9)):
        within, uniform = f"{high:g} to {bar.length:g}", "behind"
    else:
        return ""
    return (
        f"the medium changes in the absorbing layer, {within} m, which takes up what that would "
        f"send back; put a uniform [[layers]] of that length {uniform} it"
    )


def begins_with_a_jump(source: Source) -> Iterator[str]:
    """What to change where a signal has begun before the run does."""
    if isinstance(source, Ricker | GaussianDerivative):
        # From three quarters of the way to its onset on, a pulse is below 1e-8 of its peak.
        least = 0.75 * (source.peak_time - source.onset)
        if source.peak_time < least * (1 - 1e-9):
            yield (
                f"[[sources]] delay = {source.peak_time:g}: the pulse begins with a jump; take at "
                f"least {least:.3g} s"
            )
    if isinstance(source, Recorded) and source.onset < 0:
        jump = abs(source.signal(0.0)) / abs(source.signal(source.peak_time))
        if jump > 1e-8:
            yield (
                f"[[sources]] start = {source.first:g}: the recorded signal begins with a jump of "
                f"{jump:.1e} of its peak at t = 0; taper it, or take at least "
                f"{2 * source.interval:.3g} s"
            )
