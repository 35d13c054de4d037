"""A case as the program's own objects: medium, bar, sources, receivers and plan. No jax."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from wavesim.case import parts
from wavesim.case.parts import Parts
from wavesim.case.schema import Case, read
from wavesim.grid.bar import Bar
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.simulation.field import MOST_WAVENUMBERS
from wavesim.simulation.plan import Plan, plan
from wavesim.sources import Source
from wavesim.timedomain.timestep import StepTooLongError

# Branches are judged between these k̄ where the case does not say otherwise.
_JUDGED = (0.02, 0.5)
# A field of more bytes than this is taken for a slip of the pen.
_LARGEST = 1e12
_MOST_STEPS = 10**8
# A run of fewer frames by default shows nothing.
_FEWEST_FRAMES = 6


@dataclass(frozen=True)
class Problem:
    """What a case describes.

    Attributes:
        case: the tables, as given.
        plan: medium, bar, sources, stepper, step and frames.
        receivers: {name: position in m}.
        k_range: wavenumbers between which branches of an endless bar are judged, rad/m.
        parts: the tables as objects.
    """

    case: Case
    plan: Plan
    receivers: dict[str, float]
    k_range: tuple[float, float]
    parts: Parts

    @property
    def resolved(self) -> str:
        """The case as TOML, every default filled in; a run of it repeats this one."""
        schedule = self.plan.schedule
        tables = parts.resolved(self.case, self.parts)
        tables["time"] |= {
            "solver": schedule.solver,
            # A step that was asked for is kept to, and rules strides out.
            "step": self.plan.step if schedule.quiet is None else "auto",
            "samples": schedule.frames,
        }
        if self.plan.endless:
            tables["analysis"] |= {"k_min": self.k_range[0], "k_max": self.k_range[1]}
        tables["analysis"] = {k: v for k, v in tables["analysis"].items() if v is not None}
        return tomli_w.dumps(tables)


def load(path: str | Path, overrides: Sequence[str] = ()) -> Problem:
    """Read a case file, lay overrides over it, and build what it describes.

    Args:
        path: of the TOML file.
        overrides: "table.key=value", value in TOML.

    Raises:
        CaseError: anything that can't be used; the message names file, key, value and remedy.
    """
    return settle(read(path, overrides), str(path))


def settle(case: Case, name: str) -> Problem:
    """Build what a case describes.

    Args:
        case: the tables.
        name: of the file, for messages.

    Raises:
        CaseError: as :func:`load`.
    """

    made = parts.assemble(case, name)
    build = parts.builder(name)
    bar = made.bar
    settled = build(("time",), lambda: _plan(case, made.layers or made.medium, bar, made.sources))
    judged = (0.0, 0.0)
    if settled.endless:
        judged = build(("analysis",), lambda: _judged(case, made.medium, bar))
    return Problem(case, settled, made.receivers, judged, made)


def _judged(case: Case, medium: Medium, bar: Bar) -> tuple[float, float]:
    """Wavenumbers between which branches are judged, held to what the bar resolves."""
    unit = 2 * math.pi / medium.length_scale
    low = case.analysis.k_min or _JUDGED[0] * unit
    high = case.analysis.k_max or _JUDGED[1] * unit
    if low >= high:
        raise ValueError(
            f"k_min = {low:g}: must be below k_max = {high:g} rad/m (k̄ = {_JUDGED[0]:g} and "
            f"{_JUDGED[1]:g} are the defaults); give the other too"
        )
    if high > math.pi / bar.spacing:
        raise ValueError(
            f"k_max = {high:g}: the grid holds wavenumbers up to {math.pi / bar.spacing:.5g} "
            "rad/m; take that or less, or a finer [bar] spacing"
        )
    if high * bar.length < 4 * math.pi:
        raise ValueError(
            f"k_max = {high:g}: the bar of {bar.length:.4g} m holds only multiples of "
            f"{2 * math.pi / bar.length:.4g} rad/m, and at least two are needed; raise k_max, or "
            f"lengthen the bar to {4 * math.pi / high:.3g} m"
        )
    return low, high


def _plan(case: Case, medium: Medium | Layers, bar: Bar, sources: Sequence[Source]) -> Plan:
    time = case.time
    step = None if time.step == "auto" else time.step
    samples = None if time.samples == "auto" else time.samples
    try:
        settled = plan(
            medium, bar, sources, time.duration, samples, time.solver, step, time.precision
        )
    except StepTooLongError as error:
        assert step is not None
        limit = error.fraction * step
        raise ValueError(
            f"step = {step:g}: the Verlet stepper is stable up to {limit:.4g} s on this bar; "
            "take that or less, 'auto', or solver = 'chebyshev'"
        ) from None
    if samples is None and settled.schedule.frames < _FEWEST_FRAMES:
        raise ValueError(
            f"duration = {time.duration:g}: holds only {settled.schedule.frames} frames of signals "
            "so slow; lengthen it, give samples, or see that the times of a recorded signal are in "
            "seconds"
        )
    _check_size(
        settled, f"duration = {time.duration:g}" if samples is None else f"samples = {samples}"
    )
    return settled


def _check_size(settled: Plan, given: str) -> None:
    """Refuse what no such machine can hold, before it is begun.

    Raises:
        ValueError: the frames are too many to store, the steps to take, or the run to hold in
            memory; the message says what it would need.
    """
    frames, cells, fields = settled.schedule.frames, settled.bar.cells, len(settled.fields)
    stored = float(settled.stored.itemsize) * frames * cells * fields
    # What is loaded and compiled; a dozen states while stepping; a chunk eight times over: in jax,
    # on its way to the disk, and the next one; the spectra of all blocks, at wavenumbers capped.
    waves = min(cells // 2 + 1, MOST_WAVENUMBERS)
    needed = 0.5e9 + 8.0 * cells * fields * (12 + 8 * settled.chunk)
    needed += 8.0 * frames * waves * (6 + 8 * len(settled.blocks))
    asked = f"{given}: {frames:.6g} frames of {fields} fields on a bar of {cells:.6g} cells"
    if stored > _LARGEST:
        raise ValueError(
            f"{asked} are {stored / 1e12:.3g} TB, more than {_LARGEST / 1e12:g} TB; lower it, or "
            "take fewer cells"
        )
    if settled.schedule.steps > _MOST_STEPS:
        raise ValueError(
            f"duration = {settled.duration:g} takes {settled.schedule.steps:.3g} steps of "
            f"{settled.step:.3g} s, more than {_MOST_STEPS:.0e}; shorten it, or lengthen step"
        )
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > 0.8 * memory:
        raise ValueError(
            f"{asked} need about {needed / 1e9:.3g} GB of memory, this machine has "
            f"{memory / 1e9:.3g} GB; lower it, or take fewer cells"
        )
