"""What to change in a case to see more of a gap: for the answers of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from wavesim.material.arguments import FREQUENCIES
from wavesim.material.shown import HERTZ
from wavesim.planewave.dispersion_relation import Gap
from wavesim.simulation.field import Field

# A row of an answer: names, SI numbers and, where there is no number, None.
Row = dict[str, Any]
Answers = dict[str, list[Row]]

# The key that says how high a source goes, by its kind.
_PEAK_KEY = {
    "ricker": "peak_frequency",
    "gaussian-derivative": "peak_frequency",
    "tone-burst": "frequency",
}


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
    sets = [
        f"--set sources.{number}.{_PEAK_KEY[source.kind]}={peak:.4g}"
        for number, source in enumerate(field.sources)
        if source.field in fields and source.kind in _PEAK_KEY
    ]
    if any(source.field in fields for source in field.sources):
        return " ".join(sets)
    return f'not driven: add [[sources]] with field = "{fields[0]}", peak_frequency = {peak:.4g}'


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
