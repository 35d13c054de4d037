"""Media and their losses as tables of a case file: names and numbers, as its [medium] has them."""

from __future__ import annotations

from typing import Any

from wavesim.material.damping import UNDAMPED, Damping, constant_quality
from wavesim.material.medium import Medium

# Digits that are written: a sum of thicknesses is off in the sixteenth.
_DIGITS = 14


def rounded(value: Any) -> float:
    """A number as it is written."""
    return float(f"{float(value):.{_DIGITS}g}")


def loss_keys(damping: Damping) -> dict[str, Any]:
    """A loss law as the keys of [medium].

    Raises:
        ValueError: no keys say it.
    """
    found: dict[str, Any] = {}
    if damping.mass:
        found["mass_damping"] = damping.mass
    if damping.stiffness:
        found["stiffness_damping"] = damping.stiffness
    solids = (damping.unrelaxed, damping.rates, damping.strengths)
    if solids == (UNDAMPED.unrelaxed, UNDAMPED.rates, UNDAMPED.strengths):
        return found
    if damping.made is not None:
        law = constant_quality(*damping.made)
        if (law.unrelaxed, law.rates, law.strengths) == solids:
            quality, band = damping.made
            return found | {"quality_factor": quality, "quality_band": list(band)}
    raise ValueError(
        "damping: a case file has no keys for this law; take constant_quality(Q, band), or mass "
        "and stiffness alone"
    )


def medium_table(medium: Medium) -> dict[str, Any]:
    """A medium as [medium] of a case file, inertias left out where they follow from R.

    Raises:
        ValueError: its loss law has no keys, or its closure no wave equations.
    """
    if medium.closure == "appendix_c":
        raise ValueError('closure = "appendix_c": has no wave equations, so that no case has it')
    given = {name: value for name, value in medium.keys.items() if value is not None}
    words = {name: given.pop(name) for name in ("family", "closure")}
    plain = {name: rounded(value) for name, value in given.items()}
    return words | plain | loss_keys(medium.damping)


def grouped(tables: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Tables of layers with what repeats as groups: {"repeat": n, "layers": […]}."""
    found: list[dict[str, Any]] = []
    at = 0
    while at < len(tables):
        size, times = 1, 1
        for length in range(1, (len(tables) - at) // 2 + 1):
            first, count = tables[at : at + length], 1
            while tables[at + count * length : at + (count + 1) * length] == first:
                count += 1
            if count > 1 and count * length > size * times:
                size, times = length, count
        own = tables[at : at + size]
        found += own if times == 1 else [{"repeat": times, "layers": own}]
        at += size * times
    return found
