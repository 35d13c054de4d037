"""A design as a problem: what is wished, what varies, and the level of T as a function of it."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.case.layered_case import BarLayers, VariedKey
from wavesim.differentiable.graded_slices import uniform_slices
from wavesim.differentiable.stack_transmission import transmission
from wavesim.differentiable.traced_layers import TracedLayers
from wavesim.layered.transmission import specimen
from wavesim.material.layers import Layers

# Uniform slices of a graded layer: in the search, and on the finer net of frequencies.
_UNIFORM, _FINER = 16, 32
# Of the first descent: steps, frequencies of a wish, and from where to where softness and steps go.
STEPS, _ASKED, _SOFT, _RATE = 300, 48, (3.0, 0.02), (0.03, 0.0015)
# What lengths are kept below their limit by, relatively.
ROOM = 1e-6


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

    @functools.cached_property
    def scale(self) -> Any:
        """Of each wish's e: its weight over 1 + |limit|/10, (wishes,)."""
        return np.array([wish.weight / (1 + abs(wish.limit) / 10) for wish in self.wishes])

    @functools.cached_property
    def by_x(self) -> Any:
        """What each x adds to the shortest stack there is, m, (n,)."""
        ends = np.where(np.eye(len(self.keys)), self.high, self.low)
        return np.array([self.length(one) for one in ends]) - self.length(self.low)

    @property
    def longest(self) -> float:
        """What all x may add, m, with room for rounding."""
        limit = np.inf if self.length_at_most is None else self.length_at_most
        return (limit - self.length(self.low)) * (1 - ROOM)

    def cut(self, x: Any) -> Any:
        """x (members, n) with what adds to the length scaled down until it fits; may be traced."""
        most = self.longest / jnp.maximum(x @ self.by_x, 1e-300)
        return jnp.where(self.by_x > 0, x * jnp.minimum(most, 1.0)[:, None], x)

    def net(self, count: int, wider: float = 0.0) -> Any:
        """So many frequencies of each wish, of bands wider by a part, (wishes, count), Hz."""
        return np.array([wish.frequencies(count, wider) for wish in self.wishes])

    def slopes(self) -> Callable[[Any, Any], tuple[Any, Any]]:
        """Compiled: L in dB at frequencies of each wish in turn, (members, M), and ∂L/∂x,
        (members, M, n), of x from 0 to 1, (members, n), and each member's frequencies,
        (wishes, count), Hz."""

        def twice(x: Any, frequency: Any) -> tuple[Any, Any]:
            found = self._level(self.values(x), frequency, _UNIFORM).ravel()
            return found, found

        return jax.jit(jax.vmap(lambda x, f: jax.jacfwd(twice, has_aux=True)(x, f)[::-1]))

    def levels(self) -> Callable[[Any, Any], Any]:
        """Compiled: L in dB, (members, wishes, count), of values (members, n), at
        frequencies of each wish, (wishes, count), Hz."""

        return jax.jit(jax.vmap(functools.partial(self._level, slices=_FINER), (0, None)))

    def _level(self, values: Any, frequency: Any, slices: int) -> Any:
        """L of one stack, (wishes, count)."""
        stack, found = uniform_slices(self.stack_at(values), slices), dict[int, Any]()
        for sector in {wish.sector: None for wish in self.wishes}:
            own = np.array([n for n, wish in enumerate(self.wishes) if wish.sector == sector])
            omega = 2 * np.pi * frequency[own]
            level = transmission(stack, sector, omega.ravel()).level.reshape(omega.shape)
            found |= zip(own.tolist(), level, strict=True)
        return jnp.stack([found[n] for n in range(len(self.wishes))])

    def descent(self) -> Callable[[Any, int, float], Any]:
        """Compiled: x (members, n), from 0 to 1, after so many steps of Adam down

            E = T log Σ exp(e/T),    e = scale (±(L − limit)),

        of each, whose T and steps fall by the way: first over all there is, at last the worst e
        alone. Where it is asked moves with each step, so that narrow resonances are met. Arguments
        are x, a seed, and at what part of the way to begin."""
        net = self.net(_ASKED)
        apart = net[:, 1:2] - net[:, :1]
        sign = np.array([1.0 if wish.most else -1.0 for wish in self.wishes])[:, None]
        limit = np.array([wish.limit for wish in self.wishes])[:, None]
        level = self._level

        def soft(x: Any, frequency: Any, T: Any) -> Any:
            e = self.scale[:, None] * sign * (level(self.values(x), frequency, _UNIFORM) - limit)
            return T * jax.scipy.special.logsumexp(e / T)

        slope = jax.vmap(jax.grad(soft), (0, None, None))

        def step(way: Any, at: Any) -> Any:
            (x, mean, square), (part, n, key) = way, at
            moved = net + apart * jax.random.uniform(key, net.shape, minval=-0.5, maxval=0.5)
            moved = jnp.concatenate([net[:, :1], moved[:, 1:-1], net[:, -1:]], axis=1)
            T, rate = (a * (b / a) ** part for a, b in (_SOFT, _RATE))
            g = jnp.nan_to_num(slope(x, moved, T), posinf=0.0, neginf=0.0)
            g = g / (1e-9 + jnp.linalg.norm(g, axis=1, keepdims=True))
            mean, square = 0.9 * mean + 0.1 * g, 0.99 * square + 0.01 * g**2
            d = mean / (1 - 0.9**n) / (jnp.sqrt(square / (1 - 0.99**n)) + 1e-6)
            return (self.cut(jnp.clip(x - rate * d, 0.0, 1.0)), mean, square), None

        def go(x: Any, seed: int, begin: float) -> Any:
            counted = np.arange(1.0, STEPS + 1)
            parts = begin + (1 - begin) * (counted - 1) / STEPS
            given = parts, counted, jax.random.split(jax.random.key(seed), STEPS)
            none = jnp.zeros_like(x)
            return jax.lax.scan(step, (x, none, none), given)[0][0]

        return jax.jit(go)

    def short(self, reached: Any) -> Any:
        """By how much each wish is missed, dB, 0 where it is kept; reached (…, wishes)."""
        limit = np.array([wish.limit for wish in self.wishes])
        sign = np.array([1.0 if wish.most else -1.0 for wish in self.wishes])
        return np.maximum(sign * (np.asarray(reached) - limit), 0.0)
