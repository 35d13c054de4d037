"""What a case's [design] asks for, and what can't be asked, each told in a line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wavesim.case.layered_case import BarLayers, VariedKey, bar_layers, builder, varied_key
from wavesim.case.schema import CaseError, CaseFile, DesignTable, VariableTable
from wavesim.differentiable.traced_layers import TracedLayers, traced_layers
from wavesim.layered.transmission import transmission
from wavesim.material.layers import Layers
from wavesim.material.parameter import PARAMETERS
from wavesim.planewave.complex_wavenumber import wavenumber
from wavesim.studies.design_problem import Problem, Wish

# Frequencies of each wish at which the band is checked against the half-spaces.
_LOOKED_AT = 400


def problem(file: CaseFile, name: str) -> Problem:
    """What a case's [design] asks for.

    Args:
        file: its tables.
        name: of the file, for messages.

    Raises:
        CaseError: it can't be asked; the message names file, key, value and remedy.
    """
    table, known, make = file.design, bar_layers(file, name), builder(name)
    if known.layers is None or len(known.layers.layers) < 3:
        raise CaseError(
            f"{name}: [[layers]]: a design needs layers between two half-spaces; add them, and "
            '[bar] left = "half-space", right = "half-space"'
        )
    for heading, given in (("bands", table.bands), ("variables", table.variables)):
        if not given:
            raise CaseError(f"{name}: [[design.{heading}]]: required, but not given; add it")
    wishes = make(("design",), _wishes, table)
    for number, band in enumerate(table.bands):
        make(("design", "bands", str(number)), _check_carried, band, known.layers)
    make(("design",), _check_consistent, wishes)
    for wish in wishes:
        make(("design",), _check_energy, wish, known.layers)
    keys, low, high = _variables(table, known, name)
    make(("design",), _check_room, table, known.layers, keys, low)
    stack = make(("layers",), _traced, known.layers)
    return Problem(known, stack, wishes, keys, low, high, table.length_at_most, table.tolerance)


def _traced(layers: Layers) -> TracedLayers:
    stack = traced_layers(layers)
    if stack.kept:
        raise ValueError(
            "the gradient term counts in these layers, and the search leaves it out; lower its "
            "stiffness (G_n_g, K_n_g)"
        )
    return stack


def _wishes(table: DesignTable) -> tuple[Wish, ...]:
    return tuple(
        Wish(band.sector, band.low, band.high, limit, most, band.weight)
        for band in table.bands
        for limit, most in ((band.at_most, True), (band.at_least, False))
        if limit is not None
    )


def _check_carried(band: Any, layers: Layers) -> None:
    """Hold a band to its sector and to what the half-spaces carry."""
    family = layers.first.family
    if band.sector not in family.travelling:
        raise ValueError(
            f'sector = "{band.sector}": must be one of {", ".join(family.travelling)}; in others '
            "nothing travels"
        )
    frequency = np.linspace(band.low, band.high, _LOOKED_AT)
    for medium, side in ((layers.layers[0].medium, "first"), (layers.layers[-1].medium, "last")):
        k = wavenumber(medium, band.sector, 2 * np.pi * frequency)
        dark = np.abs(k.imag) > np.abs(k.real)
        if dark.any():
            raise ValueError(
                f"from = {band.low:g}, to = {band.high:g}: the {side} half-space carries no "
                f"{band.sector} wave between {frequency[dark].min():.6g} and "
                f"{frequency[dark].max():.6g} Hz; keep the band off that, or take a stiffer "
                "medium there"
            )


def _check_consistent(wishes: Sequence[Wish]) -> None:
    for n, one in enumerate(wishes):
        for other in wishes[n + 1 :]:
            low, high = max(one.low, other.low), min(one.high, other.high)
            if one.sector != other.sector or one.most == other.most or high < low:
                continue
            most, least = (one, other) if one.most else (other, one)
            if most.limit < least.limit:
                raise ValueError(
                    f"bands: {one.sector} is to be at most {most.limit:g} and at least "
                    f"{least.limit:g} dB from {low:g} to {high:g} Hz; nothing can be both"
                )


def _check_energy(wish: Wish, layers: Layers) -> None:
    """Hold what is to pass to the energy there is: |T|² Z₂/Z₁ ≤ 1, where the half-spaces of
    impedances Z₁ and Z₂ lose none."""
    first, last = layers.layers[0], layers.layers[-1]
    sides = Layers((first, replace(last, start=first.end, end=first.end + last.thickness)))
    if wish.most or sides.lossy or not layers.conserves_energy:
        return
    frequency = wish.frequencies(_LOOKED_AT)
    found = transmission(sides, wish.sector, 2 * np.pi * frequency, gradient=False)
    level = 10 * np.log10(np.abs(found.T) ** 2 / found.power_T)
    least = int(np.argmin(level))
    if wish.limit > level[least] + 1e-9:
        raise ValueError(
            f"bands: at_least = {wish.limit:g}: a stack gives no energy, so that between these "
            f"half-spaces it lets {round(level[least], 3) + 0:g} dB pass at most at "
            f"{frequency[least]:.6g} Hz; take that or less"
        )


def _variables(
    table: DesignTable, known: BarLayers, name: str
) -> tuple[tuple[VariedKey, ...], Any, Any]:
    keys: list[VariedKey] = []
    low, high = [], []
    make = builder(name)
    for number, variable in enumerate(table.variables):
        where = ("design", "variables", str(number))
        for key in make(where, expanded, variable.key, known):
            found = make(where, varied_key, known, key)
            start = make(where, _allowed, variable, found, table)
            make(where, _check_once, found, keys)
            keys.append(found)
            low.append(start)
            high.append(variable.high)
    return tuple(keys), np.array(low), np.array(high)


def expanded(key: str, known: BarLayers) -> list[str]:
    """The keys that one with * stands for; itself without.

    Raises:
        ValueError: it stands for none.
    """
    if "*" not in key:
        return [key]
    parts = key.split(".")
    # Of a graded parameter each end has a key.
    count = 2 if parts[-1] in ("0", "1") and not parts[-2].isdigit() else 1
    name = parts[-count:]
    pattern = re.compile(re.escape(key).replace(r"\*", r"\d+"))
    inner = [place for place in known.places if place.where[0] != "bar"]
    found = dict.fromkeys(".".join((*place.where, *name)) for place in inner)
    own = [one for one in found if pattern.fullmatch(one)]
    if not own:
        some = ", ".join(list(found)[:4])
        raise ValueError(f'key = "{key}": no layer has such a key; there are {some}')
    return own


def _allowed(variable: VariableTable, key: VariedKey, table: DesignTable) -> float:
    """Where the range begins; held to what the parameter admits and to the thinnest layer."""
    if key.name == "thickness":
        start = max(variable.low, table.thickness_at_least or 0.0)
        if not variable.low > 0:
            raise ValueError(f"from = {variable.low:g}: a thickness must be greater than 0")
        if start >= variable.high:
            raise ValueError(
                f"to = {variable.high:g}: leaves nothing above [design] thickness_at_least = "
                f"{table.thickness_at_least:g}; raise it, or lower that"
            )
        return start
    known = PARAMETERS[key.name]
    for word, value in (("from", variable.low), ("to", variable.high)):
        if not known.admits(value):
            raise ValueError(f"{word} = {value:g}: {key.name} must be {known.allowed}")
    return variable.low


def _check_once(key: VariedKey, before: Sequence[VariedKey]) -> None:
    for other in before:
        both = set(key.layers) & set(other.layers)
        ends = {key.end, other.end}
        if key.name == other.name and both and ends != {"first", "last"}:
            raise ValueError(
                f'key = "{key.key}": sets what "{other.key}" sets already; leave one of them out'
            )


def _check_room(table: DesignTable, layers: Layers, keys: Sequence[VariedKey], low: Any) -> None:
    """Hold the limits to the thinnest stack there is."""
    thickness = np.array([layer.thickness for layer in layers.layers])
    varied = np.zeros(len(thickness), dtype=bool)
    for key, start in zip(keys, low, strict=True):
        if key.name == "thickness":
            thickness[list(key.layers)] = start
            varied[list(key.layers)] = True
    inner = thickness[1:-1]
    if table.length_at_most is not None and inner.sum() > table.length_at_most * (1 + 1e-12):
        raise ValueError(
            f"length_at_most = {table.length_at_most:g}: the thinnest stack there is has "
            f"{inner.sum():.6g} m between the half-spaces; raise it, or take fewer layers"
        )
    least = table.thickness_at_least
    if least is not None and (inner[~varied[1:-1]] < least * (1 - 1e-12)).any():
        raise ValueError(
            f"thickness_at_least = {least:g}: a layer that does not vary is thinner; lower it, or "
            "let that layer vary"
        )
