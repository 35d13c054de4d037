"""By how much the grid of a run will miss what is exact, found before it.

Of a bar with layers or ends, signals at receivers, T and R as its grid has them stand beside those
of the exact solver (``grid_signals.py``), or where layers are graded, which takes that long, those
of a grid of thirds of the cells; of a ring of one medium ω(k) besides, at the grid's modified
wavenumbers.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavesim.layered.signals import BeyondNumbersError, Contour, contour_of, field_spectra
from wavesim.material.family import Block
from wavesim.material.layers import Layers
from wavesim.material.scaling import judged_range
from wavesim.planewave.dispersion_relation import block_oscillations
from wavesim.readings.bar.grid_signals import grid_spectra, in_thirds
from wavesim.readings.bar.loudness import ARRIVED, NODE, ROUNDING, TAIL, blurred, reach
from wavesim.readings.bar.transmission import (
    TOLD,
    Buffers,
    amplitudes,
    buffers,
    exact_scattering,
)
from wavesim.records.relations import OfMedium
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import Simulation, at_double_moment
from wavesim.sources import EXCITED, Source, excitation, excited_band

if TYPE_CHECKING:  # slow to import, and drawing does without
    from wavesim.case.schema import AnalysisTable

# What is allowed: of a signal, in its peak; of T and R, in the incident wave; of ω(k) and k(ω), in
# themselves.
SIGNAL_TOLERANCE, AMPLITUDE_TOLERANCE = 1e-4, 1e-3
MEDIAN_TOLERANCE, MAXIMUM_TOLERANCE, WAVENUMBER_TOLERANCE = 1e-3, 1e-2, 1e-3
# Cells times frequencies that are worked out at most, in about a second.
BUDGET = 1.3e6
# Places about a receiver at which a field's size is looked at, and nodes of a buffer.
_ABOUT, _NODES = 8, 24
# A spectrum is left out below this part of its peak, softly, over this part of the rest.
_SMALL, _TAPER = 1e-5, 0.03
_SOURCE, _BUFFER, _NEXT = "next to a source", "in a buffer", 4
# Wavenumbers of a ring's judged range; how much more a folded band takes, and a graded bar and the
# finer one beside it.
_RANGE, _FOLDED, _GRADED = 129, 4, 4
# A transform has this many frequencies at least.
_MOST_CELLS = BUDGET / 64
# Times of a signal to each of its frequencies, at most.
_FRAMES = 8
# So long a signal (rad of the highest frequency) takes long to transform.
_MOST_PHASE = 500.0


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


def foretold(
    simulated: Simulation,
    table: AnalysisTable | None = None,
    k_range: tuple[float, float] | None = None,
) -> list[Foretold] | None:
    """What the grid will do to each thing that is judged; None where that is too much to work out,
    and of a ring, whose branches always are, without its receivers then.

    Args:
        simulated: what is to be run.
        table: how it is to be analysed, by default where None.
        k_range: wavenumbers of a ring that are judged, rad/m; those by default where None.
    """
    if table is None:
        from wavesim.case.schema import AnalysisTable

        table = AnalysisTable()
    try:
        with np.errstate(all="ignore"):
            if simulated.endless:
                k_range = k_range or judged_range(simulated.medium)
                ring = list(_of_ring(simulated, table, k_range))
                found: list[Foretold] | None = ring + (_of_bar(simulated, table) or [])
            else:
                found = _of_bar(simulated, table)
    except (BeyondNumbersError, np.linalg.LinAlgError, ArithmeticError, MemoryError):
        return None  # numbers so far out that no transform holds them
    return found and [one for one in found if math.isfinite(one.error)]


def limit_of(simulated: Simulation) -> str:
    """Why :func:`foretold` does not work out what the grid of a simulation does to signals, T and
    R; "" where it does, or where no macro-field is judged."""
    bar, graded = simulated.bar, simulated.layers.graded
    blocks = sum(bool(block.macro) for block in simulated.blocks)
    if not blocks or (simulated.endless and not simulated.receivers):
        return ""
    if bar.cells > _MOST_CELLS:
        return f"{bar.cells} cells are more than {_MOST_CELLS:.0f}"
    if simulated.gradient_felt:
        return "the gradient term Γ counts here"
    if (count := simulated.duration * simulated.band / math.pi) > BUDGET:
        return f"{bar.cells} cells at {count:.0f} frequencies take too long to work out"
    for one in simulated.sources:
        if (one.end - one.onset) * one.excited[1] > _MOST_PHASE:
            return f"the signal of the {one.field} source is too long, {one.end - one.onset:.3g} s"
    try:
        with np.errstate(all="ignore"):
            grid = _contour(simulated.layers, simulated.sources, float(simulated.times[-1]))
    except (BeyondNumbersError, ArithmeticError):
        return "what the sources send is beyond numbers so early"
    each = bar.cells * blocks * (_FOLDED if bar.periodic else 1) * (_GRADED if graded else 1)
    if each * len(grid.omega) > BUDGET:
        return f"{bar.cells} cells at {len(grid.omega)} frequencies take too long to work out"
    return ""


def untold(simulated: Simulation, errors: Sequence[Foretold] | None) -> str:
    """What of a grid's errors is not known beforehand, and why; "" where all is."""
    why = limit_of(simulated) or ("" if errors is not None else "no transform has it")
    return why and f"at receivers not known beforehand, as {why}; the run's checks tell"


def _of_ring(
    simulated: Simulation, table: AnalysisTable, k_range: tuple[float, float]
) -> Iterator[Foretold]:
    """ω of each branch that is excited, over the judged wavenumbers, and k(ω)."""
    k = np.linspace(*k_range, _RANGE)
    for block in simulated.blocks:
        own = [s for s in simulated.sources if s.field in block.fields]
        exact, off = of_frequencies(simulated, block, k)
        loud = (excitation(own, exact, k[:, None]) >= EXCITED) & (exact > 0)
        loud &= exact <= math.pi / simulated.interval
        for number, name in enumerate(block.branches):
            known = off[loud[:, number], number]
            if len(known):
                what = f"ω(k) of {block.sector} {name}"
                yield Foretold(what, float(known.max()), MAXIMUM_TOLERANCE)
                yield Foretold(what, float(np.median(known)), MEDIAN_TOLERANCE)
        if block.macro and own:
            yield from _along_ring(simulated, table, block, own)


def of_frequencies(simulated: Field | Simulation, block: Block, k: NDArray[Any]) -> Any:
    """ω of each branch at k, rad/s, and how far the differences slow it: |ω_grid/ω − 1|."""
    modified = OfMedium(simulated.medium, block, simulated.bar).modified(k)
    exact, slowed = (block_oscillations(simulated.medium, block, at) for at in (k, modified))
    return exact, np.abs(slowed / np.where(exact > 0, exact, np.inf) - 1)


def of_wavenumbers(simulated: Field | Simulation, block: Block, omega: NDArray[Any]) -> Any:
    """How far the grid's own k(ω) is off: |k_grid/k − 1|."""
    exact, on_grid = (
        OfMedium(simulated.medium, block, bar).wavenumber(omega) for bar in (None, simulated.bar)
    )
    return np.abs(on_grid / exact - 1)


def _along_ring(
    simulated: Simulation, table: AnalysisTable, block: Block, own: Sequence[Source]
) -> Iterator[Foretold]:
    """k(ω), at frequencies as of ``readings/dispersion/extract.py``."""
    low, high = excited_band(own)
    peak = 2 * math.pi * max(source.peak_frequency for source in own)
    high, low = min(high, 0.95 * math.pi / simulated.interval), low or math.tau / simulated.duration
    top = min(high, 2 * peak)
    real = np.linspace(low, top if top > low else high, table.frequencies)
    omega = np.asarray(real + 1j * table.damping / simulated.duration, complex)
    off = float(of_wavenumbers(simulated, block, omega).max())
    yield Foretold(f"k(ω) of {block.sector} waves", off, WAVENUMBER_TOLERANCE)


def _of_bar(simulated: Simulation, table: AnalysisTable) -> list[Foretold] | None:
    """Signals at receivers, and T and R."""
    bar, sources = simulated.bar, simulated.sources
    low, high = bar.clear
    seen = {
        name: x
        for name, x in simulated.receivers.items()
        if low <= x <= high and not at_double_moment(simulated, x) and not blurred(simulated, x)
    }
    specimens = list(_specimens(simulated, table))
    if not any(block.macro for block in simulated.blocks) or not (seen or specimens):
        return []
    if limit_of(simulated):
        return None
    grid = _contour(simulated.layers, sources, simulated.duration)
    # Signals of so many frequencies show nothing more in frames that lie closer.
    t = np.linspace(0.0, simulated.duration, min(simulated.frames, _FRAMES * len(grid.omega)))
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
    for (name, number), fields in record.items():
        # A receiver's half wavelength may hold a source.
        x = about[name, number]
        at = [one for one, y in seen.items() if abs(x - y) <= reach(simulated, y)]
        for field, signal in fields.items():
            largest = float(np.abs(signal).max())
            for one in (name, *at) if name == _SOURCE else (name,):
                size[one, field] = max(size.get((one, field), 0.0), largest)
    overall = {
        field: max(value for (_, one), value in size.items() if one == field)
        for field in dict.fromkeys(field for _, field in size)
    }
    found = []
    ends = bar.left, bar.right
    finer = in_thirds(simulated) if simulated.layers.graded else None
    exact = None
    with suppress(ValueError):  # what the exact solver does not have
        if not finer:
            exact = field_spectra(simulated.layers, *ends, sources, seen, grid.omega, False)
    if exact is None:
        finer = finer or in_thirds(simulated)
        exact = grid_spectra(finer, seen, grid.omega)
    for name in seen:
        worst = Foretold(f'the signal at "{name}"', 0.0, SIGNAL_TOLERANCE)
        for field, on_grid in record[name, 0].items():
            signal = grid.signal(exact[name][field], t)
            own, near = float(np.abs(signal).max()), size[name, field]
            if own == 0 or own < NODE * near or own < ARRIVED * overall[field]:
                continue
            error = float(np.abs(on_grid - signal).max()) / max(near, own)
            if error > worst.error:
                worst = replace(worst, what=f'{field} at "{name}"', error=error)
        found.append(worst)
    end = t > t[-1] * (1 - TAIL)
    for block, known in specimens:
        (field,) = block.macro[0]
        tail = max(
            float(np.abs(fields[field][end]).max())
            for (name, _), fields in record.items()
            if name == _BUFFER
        )
        hidden = tail * math.exp(-known.sigma * simulated.duration) + ROUNDING * overall[field]
        found += _of_scattering(simulated, block, known, hidden / known.sigma, finer)
    return found


def _specimens(simulated: Simulation, table: AnalysisTable) -> Iterator[tuple[Block, Buffers]]:
    """What stands between half-spaces, in each block that tells of it."""
    field = Field(simulated, simulated.times, {})
    for block in (block for block in simulated.blocks if block.macro):
        known = buffers(field, block, table.frequencies, table.damping)
        if known is not None and known.judged.any():
            yield block, known


def _of_scattering(
    simulated: Simulation, block: Block, known: Buffers, hidden: float, finer: Simulation | None
) -> Iterator[Foretold]:
    """T and R, where they can be told, beside exact ones, or those of a finer grid; hidden as of
    ``Loudness.hidden``."""
    (name,) = block.macro[0]
    x, omega = simulated.bar.nodes, known.omega + 1j * known.sigma
    ends = known.before, known.behind
    places = {
        i: float(x[i])
        for nodes in ends
        for i in range(nodes.start, nodes.stop, max(1, (nodes.stop - nodes.start) // _NODES))
    }

    def told(on: Simulation) -> tuple[Any, Any, Any]:
        spectra = grid_spectra(on, places, omega)
        found = []
        for nodes, face, k in zip(ends, known.faces, known.k, strict=True):
            own = [i for i in places if nodes.start <= i < nodes.stop]
            values = np.array([spectra[i][name] for i in own]).T
            found.append(amplitudes(values, x[own] - face, k))
        (a, b), (c, _) = found
        return a, c / a, b / a

    a, *measured = told(simulated)
    judged = known.judged & (np.abs(a) * TOLD >= hidden)
    if not judged.any():
        return
    exact = told(finer)[1:] if finer else exact_scattering(simulated.layers, block.sector, omega)
    for letter, one, other in zip("TR", measured, exact, strict=True):
        off = float(np.abs(one - other)[judged].max())
        yield Foretold(f"{letter} of {block.sector} waves", off, AMPLITUDE_TOLERANCE)


@functools.lru_cache(maxsize=4)  # grids that are tried out ask for the same
def _contour(layers: Layers, sources: tuple[Source, ...], duration: float) -> Contour:
    """Frequencies of a record's transform, to where sources' spectra have fallen to a little."""
    grid = contour_of(layers, sources, duration)
    if grid.lowpass is not None:
        return grid
    size = [np.abs(source.spectrum(grid.omega)) for source in sources]
    loud = np.any([one > _SMALL * one.max() for one in size], axis=0)
    top = float(grid.omega[np.flatnonzero(loud).max()].real)
    width = max(_TAPER * top, 20 * grid.step)
    kept = grid.omega.real <= top + 12 * width
    return replace(grid, omega=grid.omega[kept], lowpass=(top + 6 * width, width))
