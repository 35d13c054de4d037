"""The cell size that would do where a grid's errors are more than is allowed, or what else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from wavesim.simulation.field import Field
from wavesim.simulation.simulation import Simulation, with_spacing
from wavesim.verdict.foreseen_errors import Foretold, foretold

if TYPE_CHECKING:  # slow to import, and drawing does without
    from wavesim.case.load import Case
    from wavesim.case.schema import AnalysisTable

# A size is looked for that leaves this part of what is allowed, in so many tries.
_ASIDE, _TRIES = 0.6, 3
# By what power of it errors are taken to fall at first, and at least; by what factor it changes at
# most and at least in a try.
_ORDER, _LEAST_ORDER, _FINEST, _COARSEST = 5.0, 1.5, 0.4, 0.9
# Cells of this part of the size that leave this part of an error: it is not theirs.
_FINER, _AS_MUCH = 0.8, 0.8
# Of what order differences serve well: beyond, closures decide.
WELL = 8
# Cells of a source's width beyond which it drives hardly any wave that the grid slows down.
_WIDE = 6


def too_coarse(
    simulated: Simulation, found: Sequence[Foretold], *asked: AnalysisTable | tuple[float, float]
) -> list[str]:
    """What of it will be more than is allowed, with the cell size that would do.

    Args:
        simulated: what is to be run.
        found, asked: of ``foreseen_errors.foretold``, and its other arguments.
    """
    short = sorted((f for f in found if not f.passed), key=lambda f: f.error / f.allowed)
    if not short:
        return []
    worst, bar = short[-1], simulated.bar
    more = f", and {len(short) - 1} more fall short" if len(short) > 1 else ""
    return [
        f"[bar] spacing = {bar.spacing:.6g}: by this grid {worst.what} will be off by "
        f"{worst.error:.1e} (allowed {worst.allowed:g}){more}; "
        f"{cell_size(simulated, worst, *asked)[0]}"
    ]


def serves(case: Case) -> bool:
    """Whether it is told beforehand that a case's grid leaves much less than is allowed, T and R
    included, or what a finer one leaves too, as absorbing ends do."""
    if case.simulation.layers.graded:
        return False
    told = foretold(case.simulation, case.analysis, case.k_range)
    short = [n for n, one in enumerate(told or ()) if one.error > _ASIDE * one.allowed]
    if not (told and short):
        return bool(told)
    with suppress(ValueError):  # more cells than there may be
        finer = with_spacing(case.simulation, case.simulation.bar.spacing * _FINER)
        better = foretold(finer, case.analysis, case.k_range) or []
        return len(better) == len(told) and all(
            better[n].error > _AS_MUCH * told[n].error for n in short
        )
    return False


def cell_size(
    simulated: Simulation, worst: Foretold, *asked: AnalysisTable | tuple[float, float]
) -> tuple[str, bool]:
    """The cell size at which all is allowed, tried out; or what else would do.

    Returns:
        In words, and whether it was tried out that all is allowed then.
    """
    spacing, error, order = simulated.bar.spacing, worst.error, _ORDER
    other = ""
    if simulated.bar.order < WELL:
        with suppress(ValueError):  # a stretch too short for the order
            better = replace(simulated, bar=replace(simulated.bar, order=WELL))
            told = foretold(better, *asked)  # type: ignore[arg-type]
            if told and all(one.passed for one in told):
                other = f"[bar] order = {WELL} (now {simulated.bar.order}), or "
    for _ in range(_TRIES):
        factor = max((_ASIDE * worst.allowed / error) ** (1 / order), _FINEST)
        tried = rounded(spacing * min(factor, _COARSEST))
        told = None
        with suppress(ValueError):  # more cells than there may be
            finer = with_spacing(simulated, tried)
            told = foretold(finer, *asked)  # type: ignore[arg-type]
        if told is None:
            seen = f" (tried out to {spacing:g} m)" if spacing < simulated.bar.spacing else ""
            return f"take {other}{sized(simulated, tried)}{seen}", False
        now = max((f.error * worst.allowed / f.allowed for f in told), default=0.0)
        if now <= worst.allowed:
            return f"take {other}{sized(simulated, tried)}", True
        order = max(math.log(error / now) / math.log(spacing / tried), _LEAST_ORDER)
        error, spacing = now, tried
    text = f"take {other}{gentler(simulated)}: cells of {spacing:g} m would still leave {error:.1e}"
    return text, False


def sized(simulated: Field | Simulation, spacing: float) -> str:
    """A cell size (m), with how many cells it makes, which a case may give."""
    cells = round(simulated.bar.length / spacing)
    return f"[bar] spacing = {spacing:g} ({cells} cells) or finer"


def rounded(length: float) -> float:
    """Two digits, downwards."""
    step = 10.0 ** (math.floor(math.log10(length)) - 1)
    return float(f"{math.floor(length / step * (1 + 1e-9)) * step:.2g}")


def gentler(field: Field | Simulation) -> str:
    """Less of the waves that are short: a smoother burst, a lower or a wider source."""
    source = field.sources[0]
    if getattr(source, "window", None) == "hann":
        return 'a smoother burst: [[sources]] window = "cos4"'
    text = f"fewer short waves: {lower(field)}"
    if source.acts == "body" and not source.width:
        text += f" or [[sources]] width = {_WIDE * field.bar.spacing:.2g} or more"
    return text


def lower(field: Field | Simulation) -> str:
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
