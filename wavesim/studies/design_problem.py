"""A design as a problem: what is wished, what varies, and the level of T as a function of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.case.layered_case import BarLayers, VariedKey
from wavesim.differentiable.level_slopes import level, level_and_slopes
from wavesim.differentiable.traced_layers import TracedLayers
from wavesim.layered.transmission import specimen
from wavesim.material.layers import Layers

# Uniform slices of a graded layer: in the search, and on the finer net of frequencies.
_UNIFORM, _FINER = 16, 32


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
        stack, laid = self.stack, dict[tuple[str, str], list[tuple[int, int]]]()
        for number, key in enumerate(self.keys):
            laid.setdefault((key.name, key.end), []).extend((n, number) for n in key.layers)
        for (name, end), places in laid.items():  # all at once, which compiles sooner
            layers, numbers = np.array(places).T
            stack = stack.with_values(name, layers, values[numbers], end)
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
