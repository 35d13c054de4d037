"""By how much a run's grid will miss what is exact, found before it, and the pitch that would do.

Of a bar with layers or ends, signals at receivers, T and R as its grid has them stand beside those
of the exact solver (``grid_signals.py``); of a ring, ω(k) at the grid's modified wavenumbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from wavesim.case.load import Case
from wavesim.grid.bar import layered_bar
from wavesim.grid.stencils import modified_wavenumber
from wavesim.grid.summation_by_parts import closure
from wavesim.layered.inverse_transform import Contour
from wavesim.layered.signals import contour_of, field_spectra
from wavesim.material.family import Block
from wavesim.planewave.dispersion_relation import block_oscillations
from wavesim.readings.bar.loudness import ARRIVED, NODE, ROUNDING, TAIL, blurred, reach
from wavesim.readings.bar.transmission import TOLD, Specimen, amplitudes, specimen
from wavesim.records.relations import OfMedium
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import Simulation, at_double_moment
from wavesim.sources import EXCITED, Source, excitation, excited_band
from wavesim.verdict.bar import AMPLITUDE_TOLERANCE, SIGNAL_TOLERANCE
from wavesim.verdict.endless import MAXIMUM_TOLERANCE, MEDIAN_TOLERANCE, WAVENUMBER_TOLERANCE
from wavesim.verdict.grid_signals import grid_spectra
from wavesim.verdict.remedies import gentler

# Cells times frequencies that are worked out, about a million in a second.
BUDGET = 1.2e6
# Places about a receiver at which a field's size is looked at, and nodes of a buffer.
_ABOUT, _NODES = 24, 24
# A spectrum is left out below this part of its peak, softly, over this part of the rest.
_SMALL, _TAPER = 1e-5, 0.03
_SOURCE, _BUFFER, _NEXT = "next to a source", "in a buffer", 4
# A pitch is looked for that leaves this part of what is allowed, in so many tries; one that takes
# less than this off the error in a try mends nothing.
_ASIDE, _TRIES = 0.6, 3
_ORDER, _LEAST_ORDER, _FINEST, _COARSEST = 5.0, 1.0, 0.4, 0.9
# Wavenumbers of a ring's judged range; how much more a folded band takes; the least part of a run
# that tells of all of it.
_RANGE, _FOLDED, _LEAST_PART = 129, 4, 0.2


@dataclass(frozen=True)
class Foretold:
    """What the grid will do to one thing that is judged.

    Attributes:
        what: such as 'the signal at "r1" (phi1)'.
        error, allowed: as its check has them, –.
    """

    what: str
    error: float
    allowed: float

    @property
    def passed(self) -> bool:
        """Whether its check will pass, as far as the grid goes."""
        return self.error <= self.allowed


def foretold(case: Case) -> list[Foretold] | None:
    """What the grid will do to each thing that is judged; None where that is too much to work out.

    Args:
        case: what is to be run.
    """
    if case.simulation.endless:
        return list(_of_ring(case))
    return _of_bar(case, case.simulation)


def too_coarse(case: Case, found: Sequence[Foretold]) -> list[str]:
    """What of it will be more than is allowed, with the pitch that would do.

    Args:
        case: what is to be run.
        found: of :func:`foretold`.
    """
    short = sorted((f for f in found if not f.passed), key=lambda f: f.error / f.allowed)
    if not short:
        return []
    worst, bar = short[-1], case.simulation.bar
    more = f", and {len(short) - 1} more fall short" if len(short) > 1 else ""
    return [
        f"[bar] spacing = {bar.spacing:.6g}: by this grid {worst.what} will be off by "
        f"{worst.error:.1e} (allowed {worst.allowed:g}){more}; {_remedy(case, worst)}"
    ]


def _remedy(case: Case, worst: Foretold) -> str:
    """The pitch that would do, or what else would."""
    simulated = case.simulation
    h, error = simulated.bar.spacing, worst.error
    aim, spacing, order = _ASIDE * worst.allowed, h, _ORDER
    for _ in range(_TRIES):
        factor = max((aim / error) ** (1 / order), _FINEST)
        tried = _rounded(spacing * min(factor, _COARSEST))
        finer = replace(case, simulation=_with_spacing(simulated, tried))
        told = foretold(finer)
        if told is None:
            return f"take about {_rounded(spacing * factor):g} m"
        now = max((f.error * worst.allowed / f.allowed for f in told), default=0.0)
        if now <= worst.allowed:
            cells = finer.simulation.bar.cells
            return f"take [bar] spacing = {tried:g} ({cells} cells) or finer"
        order = max(math.log(error / now) / math.log(spacing / tried), _LEAST_ORDER)
        error, spacing = now, tried
    return f"{spacing:g} m would still leave {error:.1e}; take {gentler(simulated)}"


def _rounded(length: float) -> float:
    """Two digits, downwards."""
    step = 10.0 ** (math.floor(math.log10(length)) - 1)
    return float(f"{math.floor(length / step * (1 + 1e-9)) * step:.2g}")


def _with_spacing(simulated: Simulation, spacing: float) -> Simulation:
    """The same on a grid of other cells, as a case with that [bar] spacing has it."""
    bar, layers = simulated.bar, simulated.layers
    if bar.stretches:
        least = closure(bar.order).cells
        sizes = [min(spacing, layer.thickness / least) for layer in layers.layers]
        made = layered_bar(layers, sizes, bar.order, bar.left, bar.right, bar.absorber)
    else:
        cells = round(bar.length / spacing)
        made = replace(bar, cells=cells, spacing=bar.length / cells)
    return replace(simulated, bar=made)


def _of_ring(case: Case) -> Iterator[Foretold]:
    """ω of each branch that is excited, over the judged wavenumbers."""
    simulated = case.simulation
    medium, bar = simulated.medium, simulated.bar
    low, high = case.k_range
    k = np.linspace(low, high, _RANGE)
    slowed_k = modified_wavenumber(k, bar.spacing, bar.order)
    for block in simulated.blocks:
        own = [s for s in simulated.sources if s.field in block.fields]
        exact, slowed = (block_oscillations(medium, block, one) for one in (k, slowed_k))
        loud = (excitation(own, exact, k[:, None]) >= EXCITED) & (exact > 0)
        loud &= exact <= math.pi / simulated.interval
        off = np.where(loud, np.abs(slowed / np.where(exact > 0, exact, np.inf) - 1), 0.0)
        for number, name in enumerate(block.branches):
            known = off[loud[:, number], number]
            if len(known):
                what = f"ω(k) of {block.sector} {name}"
                yield Foretold(what, float(known.max()), MAXIMUM_TOLERANCE)
                yield Foretold(what, float(np.median(known)), MEDIAN_TOLERANCE)
        if block.macro and own:
            yield from _along_ring(case, block, own)


def _along_ring(case: Case, block: Block, own: Sequence[Source]) -> Iterator[Foretold]:
    """k(ω), at frequencies as of ``readings/dispersion/extract.py``."""
    simulated, table = case.simulation, case.analysis
    low, high = excited_band(own)
    peak = 2 * math.pi * max(source.peak_frequency for source in own)
    top = min(high, 0.95 * math.pi / simulated.interval, 2 * peak)
    real = np.linspace(low or 2 * math.pi / simulated.duration, top, table.frequencies)
    omega = np.asarray(real + 1j * table.damping / simulated.duration, complex)
    exact, on_grid = (
        OfMedium(simulated.medium, block, bar).wavenumber(omega) for bar in (None, simulated.bar)
    )
    off = np.abs(on_grid / exact - 1)
    yield Foretold(f"k(ω) of {block.sector} waves", float(off.max()), WAVENUMBER_TOLERANCE)


def _of_bar(case: Case, simulated: Simulation) -> list[Foretold] | None:
    """Signals at receivers, and T and R."""
    if simulated.gradient_felt:
        return None
    bar, sources = simulated.bar, simulated.sources
    low, high = bar.clear
    seen = {
        name: x
        for name, x in simulated.receivers.items()
        if low <= x <= high and not at_double_moment(simulated, x) and not blurred(simulated, x)
    }
    specimens = list(_specimens(case, simulated))
    if not seen and not specimens:
        return []
    t = simulated.times
    blocks = sum(bool(block.macro) for block in simulated.blocks)
    each = bar.cells * blocks * (_FOLDED if bar.periodic else 1)
    grid = _contour(simulated, float(t[-1]))
    share = min(1.0, BUDGET / (each * len(grid.omega)))
    if share < _LEAST_PART:
        return None
    if share < 1:  # what is too much is looked at for a part of the time
        t = t[: max(int(len(t) * share), 2)]
        grid, share = _contour(simulated, float(t[-1])), float(t[-1]) / simulated.duration
    about = {(name, 0): x for name, x in seen.items()}
    for name, x in [*seen.items(), *((f"source {i}", s.position) for i, s in enumerate(sources))]:
        near = reach(simulated, x)
        for number, y in enumerate(np.linspace(x - near, x + near, _ABOUT), start=1):
            about[name, number] = float(min(max(y, 0.0), bar.length))
    for source in sources:  # next to a point fields are largest
        near_cells = np.argsort(np.abs(bar.half_nodes - source.position))[:_NEXT]
        for node in near_cells:
            about[_SOURCE, int(node)] = float(bar.half_nodes[node])
    for _, known in specimens:
        for nodes in (known.before, known.behind):
            for node in (nodes.start, nodes.stop - 1):
                about[_BUFFER, node] = float(bar.nodes[node])
    spectra = grid_spectra(simulated, about, grid.omega)
    record = {
        place: {field: grid.signal(spectrum, t) for field, spectrum in fields.items()}
        for place, fields in spectra.items()
    }
    size: dict[tuple[str, str], float] = {}
    for (name, _), fields in record.items():
        for field, signal in fields.items():
            largest = max(size.get((name, field), 0.0), float(np.abs(signal).max()))
            size[name, field] = largest
    overall = {
        field: max(value for (_, one), value in size.items() if one == field)
        for field in dict.fromkeys(field for _, field in size)
    }
    found = []
    ends = bar.left, bar.right
    exact = field_spectra(simulated.layers, *ends, sources, seen, grid.omega, False)
    for name in seen:
        worst = Foretold(f'the signal at "{name}"', 0.0, SIGNAL_TOLERANCE)
        for field, on_grid in record[name, 0].items():
            signal = grid.signal(exact[name][field], t)
            own, near = float(np.abs(signal).max()), size[name, field]
            if own == 0 or own < NODE * near or own < ARRIVED * overall[field]:
                continue
            error = float(np.abs(on_grid - signal).max()) / max(near, own) / share
            if error > worst.error:
                worst = replace(worst, what=f'{field} at "{name}"', error=error)
        found.append(worst)
    late = t > t[-1] * (1 - TAIL)
    for block, known in specimens:
        (field,) = block.macro[0]
        tail = max(
            float(np.abs(fields[field][late]).max())
            for (name, _), fields in record.items()
            if name == _BUFFER
        )
        hidden = tail * math.exp(-known.sigma * simulated.duration) + ROUNDING * overall[field]
        found += _of_scattering(simulated, block, known, hidden / known.sigma)
    return found


def _specimens(case: Case, simulated: Simulation) -> Iterator[tuple[Block, Specimen]]:
    """What stands between half-spaces, in each block that tells of it."""
    field, table = Field(simulated, simulated.times, {}), case.analysis
    for block in (block for block in simulated.blocks if block.macro):
        with suppress(ValueError):  # what the exact solver does not have
            known = specimen(field, block, table.frequencies, table.damping)
            if known is not None and known.judged.any():
                yield block, known


def _of_scattering(
    simulated: Simulation, block: Block, known: Specimen, hidden: float
) -> Iterator[Foretold]:
    """T and R, where they can be told; hidden as of ``Loudness.hidden``."""
    (name,) = block.macro[0]
    x = simulated.bar.nodes
    ends = []
    for nodes, face, k in zip((known.before, known.behind), known.faces, known.k, strict=True):
        step = max(1, (nodes.stop - nodes.start) // _NODES)
        places = {i: float(x[i]) for i in range(nodes.start, nodes.stop, step)}
        spectra = grid_spectra(simulated, places, known.omega + 1j * known.sigma)
        values = np.array([spectra[place][name] for place in places]).T
        ends.append(amplitudes(values, x[list(places)] - face, k))
    (a, b), (c, _) = ends
    judged = known.judged & (np.abs(a) * TOLD >= hidden)
    if not judged.any():
        return
    for letter, measured, exact in (("T", c / a, known.T), ("R", b / a, known.R)):
        off = float(np.abs(measured - exact)[judged].max())
        yield Foretold(f"{letter} of {block.sector} waves", off, AMPLITUDE_TOLERANCE)


def _contour(simulated: Simulation, duration: float) -> Contour:
    """Frequencies of a record's transform, to where sources' spectra have fallen to a little."""
    grid = contour_of(simulated.layers, simulated.sources, duration)
    if grid.lowpass is not None:
        return grid
    size = [np.abs(source.spectrum(grid.omega)) for source in simulated.sources]
    loud = np.any([one > _SMALL * one.max() for one in size], axis=0)
    top = float(grid.omega[np.flatnonzero(loud).max()].real)
    width = max(_TAPER * top, 20 * grid.step)
    kept = grid.omega.real <= top + 12 * width
    return replace(grid, omega=grid.omega[kept], lowpass=(top + 6 * width, width))
