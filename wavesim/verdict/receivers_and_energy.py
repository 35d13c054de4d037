"""Lines of a verdict on receivers and energy, which are those of every bar."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesim.readings.bar.loudness import blurred
from wavesim.simulation.field import Field
from wavesim.verdict import remedies
from wavesim.verdict.check import Check, judged
from wavesim.verdict.foreseen_errors import SIGNAL_TOLERANCE

ENERGY_TOLERANCE = 1e-9
ENERGY_AFTER_TOLERANCE = 1e-10
# What was dissipated falls by rounding alone.
LOSSY_TOLERANCE = 1e-9


def signal_checks(
    field: Field,
    found: Mapping[str, Mapping[str, float]],
    comes_back: str = "",
    finer: bool = False,
) -> list[Check]:
    """Signals at receivers beside the exact ones, or those of a finer grid.

    Args:
        field: the field.
        found: {receiver: {field: error}}, of ``Loudness.compared``.
        comes_back: of ``remedies.of_signal``.
        finer: whether beside a grid of thirds of the cells.
    """
    checks, beside = [], ", beside thirds of the cells" if finer else ""
    for receiver, errors in found.items():
        # What is not a number is larger than any.
        worst = max(errors, key=lambda name: np.nan_to_num(errors[name], nan=np.inf))
        label = f"signal at {receiver}: |Δu|/peak, worst of {len(errors)} fields ({worst}){beside}"
        known = field, receiver, comes_back
        checks.append(judged(label, errors[worst], SIGNAL_TOLERANCE, remedies.of_signal, *known))
    return checks


def receiver_notes(
    field: Field,
    exact: Mapping[str, Any],
    heard: Mapping[str, Any] | None,
    refused: Sequence[str],
) -> list[str]:
    """Receivers that were not compared, and why.

    Args:
        field: the field.
        exact: by receiver, what it was held against.
        heard: of ``Loudness.compared``; None where all arrived.
        refused: why the exact solver does not have some of it.
    """
    found = [
        f"the exact solver does not have this bar, and less was checked: {why}" for why in refused
    ]
    silent = [name for name in exact if heard is not None and not heard.get(name)]
    if silent:
        found.append(
            f"receiver {_some(silent)}: next to nothing arrived, and it was not compared; lengthen "
            "[time] duration, or move it"
        )
    near = {name: blurred(field, x) for name, x in field.receivers.items()}
    for why in dict.fromkeys(near[name] for name in near if near[name]):
        these = [name for name, one in near.items() if one == why]
        found.append(
            f"receiver {_some(these)}: stands {why}, where the grid has a lower order, and its "
            f"signals were not compared; move it {field.bar.order} cells away to have them"
        )
    low, high = field.bar.clear
    hidden = [name for name, x in field.receivers.items() if not low <= x <= high]
    if hidden:
        found.append(
            f"receiver {_some(hidden)}: stands in an absorbing layer, and was not compared; move "
            f"it into {low:.4g} to {high:.4g} m"
        )
    return found


def _some(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def energy_note(field: Field) -> list[str]:
    """That energy was not judged, where the equations conserve none."""
    if field.energy is None or field.layers.conserves_energy:
        return []
    return [
        'energy was not judged: the equations of closure "printed" conserve none where a ≠ 0; '
        'take "consistent" to have it judged'
    ]


def energy_checks(field: Field) -> list[Check]:
    """Energy balance, where the closure conserves energy in every layer.

    Where nothing is lost, energy is the work of the sources. With losses their difference is what
    was dissipated, which must never fall; but an absorbing layer is no medium, and gives back some
    of what it takes from a wave that decays in it.
    """
    energy, bar = field.energy, field.bar
    absorbing = "absorbing" in (bar.left, bar.right)
    if energy is None or absorbing or not field.layers.conserves_energy:
        return []
    scale = float(energy.total.max())
    if scale == 0:
        return []
    if field.simulation.lossy:
        lost = energy.dissipated
        fall = float((np.maximum.accumulate(lost) - lost).max())
        name = "energy dissipated: its largest fall over its largest value"
        part = fall / max(float(lost.max()), 1e-300)
        return [judged(name, part, LOSSY_TOLERANCE, remedies.shorter_step, field)]
    balance = float(np.abs(energy.dissipated).max()) / scale
    name = "energy − work over energy"
    checks = [judged(name, balance, ENERGY_TOLERANCE, remedies.shorter_step, field)]
    after = energy.total[field.t >= field.quiet_from]
    if len(after) > 1:
        change = float(np.ptp(after)) / scale
        name = "energy after the pulse"
        checks.append(judged(name, change, ENERGY_AFTER_TOLERANCE, remedies.shorter_step, field))
    return checks
