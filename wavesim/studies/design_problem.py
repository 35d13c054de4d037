"""A design as a problem: what is wished, what varies, and the level of T as a function of it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.case.layered_case import BarLayers, VariedKey, bar_layers, builder, varied_key
from wavesim.case.schema import CaseError, CaseFile, DesignTable, VariableTable
from wavesim.differentiable.level_slopes import level, level_and_slopes
from wavesim.differentiable.traced_layers import TracedLayers, traced_layers
from wavesim.layered.transmission import specimen
from wavesim.material.layers import Layers
from wavesim.material.parameter import PARAMETERS
from wavesim.planewave.band_edges import keeps_gradient
from wavesim.planewave.complex_wavenumber import wavenumber

# Uniform slices of a graded layer: in the search, and on the finer net of frequencies.
_UNIFORM, _FINER = 16, 32
# Frequencies of each wish at which the band is checked against the half-spaces.
_LOOKED_AT = 400


@dataclass(frozen=True)
class Wish:
    """What must, or must not, pass in a band.

    Attributes:
        sector: of the wave.
        low, high: the band, Hz.
        limit: dB of |T|.
        most: whether T is to be at most that; else at least.
        weight: of its shortfall against that of others.
    """

    sector: str
    low: float
    high: float
    limit: float
    most: bool
    weight: float

    def frequencies(self, count: int, wider: float = 0.0) -> Any:
        """So many over the band, made wider at each end by a part of that, both among them, Hz."""
        return np.linspace(self.low * (1 - wider), self.high * (1 + wider), count)


@dataclass(frozen=True)
class Problem:
    """What is sought.

    Attributes:
        known: the case's material, its values where the search has none to begin with.
        stack: the same as arrays.
        wishes: what is wished.
        keys: what varies.
        low, high: between what, in each key's unit, shape (n,).
        length_at_most: of all between the half-spaces, m; None for no limit.
        tolerance: relative, of each variable.
    """

    known: BarLayers
    stack: TracedLayers
    wishes: tuple[Wish, ...]
    keys: tuple[VariedKey, ...]
    low: Any
    high: Any
    length_at_most: float | None
    tolerance: float

    @property
    def graded(self) -> bool:
        """Whether a layer is graded, which costs as much as its slices."""
        return any(grading is not None for grading in self.stack.gradings)

    def values(self, x: Any) -> Any:
        """The variables in their units, of x from 0 to 1."""
        return self.low + (self.high - self.low) * x

    def stack_at(self, values: Any) -> TracedLayers:
        """What stands between half-spaces, with values of the variables, (n,); may be traced."""
        stack = self.stack
        for number, key in enumerate(self.keys):
            stack = stack.with_values(key.name, key.layers, values[number], key.end)
        # Half-spaces have no length, which would cost where they lose.
        return stack.with_values("thickness", [0, -1], 0.0)

    def layers_at(self, values: Any) -> Layers:
        """The same as layers of plain numbers."""
        own = list(self.known.stretches)
        thickness = [layer.thickness for layer in own]
        for key, value in zip(self.keys, np.asarray(values).tolist(), strict=True):
            for n in key.layers:
                if key.name == "thickness":
                    thickness[n] = value
                    continue
                layer, new = own[n], {key.name: value}
                first, last = layer.medium, layer.last
                if key.end in ("first", "both"):
                    first = dataclasses.replace(first, **new)
                if last is not None and key.end in ("last", "both"):
                    last = dataclasses.replace(last, **new)
                own[n] = dataclasses.replace(layer, medium=first, last=last)
        ends = np.cumsum([0.0, *thickness]).tolist()
        placed = zip(own, ends[:-1], ends[1:], strict=True)
        return Layers(tuple(dataclasses.replace(one, start=a, end=b) for one, a, b in placed))

    def exact(self, values: Any) -> tuple[Any, Any]:
        """Worst level of each wish, dB, and where, Hz, (wishes,) each, by ``layered``, another
        route than the search's.

        NaN where a graded layer without losses has its asymptote in a band.
        """
        between, found = specimen(self.layers_at(values)), []
        for wish in self.wishes:
            highest, lowest = between.extremes(wish.sector, wish.low, wish.high)
            found.append(highest if wish.most else lowest)
        level, where = np.array(found).T
        return level, where

    def length(self, values: Any) -> float:
        """Of all between the half-spaces, m; linear in values."""
        return float(sum(layer.thickness for layer in self.layers_at(values).layers[1:-1]))

    @property
    def _sectors(self) -> dict[str, list[int]]:
        """{sector: which wishes it has}."""
        found: dict[str, list[int]] = {}
        for n, wish in enumerate(self.wishes):
            found.setdefault(wish.sector, []).append(n)
        return found

    def net(self, count: int, wider: float = 0.0) -> Any:
        """So many frequencies of each wish, of bands wider by a part, (wishes, count), Hz."""
        return np.array([wish.frequencies(count, wider) for wish in self.wishes])

    def slopes(self) -> Callable[[Any, Any], tuple[Any, Any]]:
        """Compiled: L in dB at frequencies of each wish in turn, (members, M), and ∂L/∂x,
        (members, M, n), of x from 0 to 1, (members, n), and each member's frequencies, real or
        complex, (wishes, count), Hz."""
        order = np.argsort([n for own in self._sectors.values() for n in own])

        def both(x: Any, frequency: Any) -> tuple[Any, Any]:
            parts = [
                (sector, 2 * np.pi * frequency[np.array(own)].ravel())
                for sector, own in self._sectors.items()
            ]
            found = level_and_slopes(self.stack_at, self.values(x), parts, _UNIFORM)
            level, J = (a.reshape(*frequency.shape, *a.shape[1:])[order] for a in found)
            return level.ravel(), J.reshape(level.size, -1) * (self.high - self.low)

        return jax.jit(jax.vmap(both))

    def levels(self) -> Callable[[Any, Any], Any]:
        """Compiled: L in dB, (members, wishes, count), of values (members, n), at real or complex
        frequencies of each wish, (wishes, count), Hz."""

        def all_(values: Any, frequency: Any) -> Any:
            stack = self.stack_at(values)
            found = [jnp.zeros(())] * len(self.wishes)
            for sector, own in self._sectors.items():
                omega = 2 * np.pi * frequency[np.array(own)]
                levels = level(stack, sector, omega.ravel(), _FINER).reshape(omega.shape)
                for n, part in zip(own, levels, strict=True):
                    found[n] = part
            return jnp.stack(found)

        return jax.jit(jax.vmap(all_, (0, None)))

    def short(self, reached: Any) -> Any:
        """By how much each wish is missed, dB, 0 where it is kept; reached (…, wishes)."""
        limit = np.array([wish.limit for wish in self.wishes])
        sign = np.array([1.0 if wish.most else -1.0 for wish in self.wishes])
        return np.maximum(sign * (np.asarray(reached) - limit), 0.0)


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
    for number, wish in enumerate(table.bands):
        make(("design", "bands", str(number)), _check_carried, wish, known.layers)
    make(("design",), _check_consistent, wishes)
    keys, low, high = _variables(table, known, name)
    make(("design",), _check_room, table, known.layers, keys, low)
    stack = make(("layers",), _traced, known.layers)
    return Problem(known, stack, wishes, keys, low, high, table.length_at_most, table.tolerance)


def _traced(layers: Layers) -> TracedLayers:
    if keeps_gradient(layers):
        raise ValueError(
            "the gradient term counts in these layers, and the search leaves it out; lower its "
            "stiffness (G_n_g, K_n_g)"
        )
    return traced_layers(layers)


def _wishes(table: DesignTable) -> tuple[Wish, ...]:
    found = []
    for band in table.bands:
        for limit, most in ((band.at_most, True), (band.at_least, False)):
            if limit is not None:
                found.append(Wish(band.sector, band.low, band.high, limit, most, band.weight))
    return tuple(found)


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
    for wish in wishes:
        if not wish.most and wish.limit > 0:
            raise ValueError(
                f"bands: at_least = {wish.limit:g}: a stack gives no energy; take 0 dB or less"
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
