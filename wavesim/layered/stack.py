"""A layered bar cut into pieces at some frequencies, with its sources in them, and its ends."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from wavesim.layered.cross_section import Section, generator, joined, limit
from wavesim.layered.graded_layer import TooMuch, Unresolved, graded
from wavesim.layered.star_product import Piece, jump, nothing, star, times
from wavesim.layered.uniform_layer import Waves, reflection, uniform, waves
from wavesim.material.dual import value_of
from wavesim.material.family import Block
from wavesim.material.layers import ENDS, Layer, Layers
from wavesim.material.scaling import Scales, block_coefficients, scales

_UNITS = ("length", "time", "macro", "micro", "energy")
# Beyond this many standard deviations a Gaussian is below 1e-15 of its top, and taken as 0.
CUT = 8.5


def sent(k: Any, start: float, end: float, centre: float, width: float) -> Any:
    """What a Gaussian source makes of a wave e^{ikx}, Im k ≥ 0, that leaves x₀ … x₁, shape of k.

        ∫ e^{ik(x₁ − x)} g(x) dx = ½ e^{ik(x₁ − x_s) − κ²} [erf(u₁ + iκ) − erf(u₀ + iκ)],

    g of unit integral, u = (x − x_s)/√2w, κ = kw/√2; erf by Faddeeva's function, so that no part of
    it overflows. Positions and width are in the unit of 1/k; for what travels left mirror them:
    sent(k, −end, −start, −centre, width).
    """
    from scipy.special import wofz

    out = end
    start, end = max(start, centre - CUT * width), min(end, centre + CUT * width)
    if end <= start:
        return np.zeros_like(k)
    kappa = k * width / math.sqrt(2)
    terms, signs = [], []
    for x in (start, end):
        u = (x - centre) / (math.sqrt(2) * width)
        z = u + 1j * kappa
        sign = np.where(z.real >= 0, 1.0, -1.0)
        terms.append(sign * np.exp(1j * k * (out - x) - u**2) * wofz(1j * sign * z))
        signs.append(sign)
    # erfc(z) = 2 − erfc(−z): the 2s cancel unless Re z changes sign in between.
    crossed = signs[1] - signs[0]
    exponent = np.where(crossed != 0, 1j * k * (out - centre) - kappa**2, 0)
    return (terms[0] - terms[1] + crossed * np.exp(exponent)) / 2


def density(x: float, centre: float, width: float) -> float:
    """g(x), 0 beyond the cut."""
    u = (x - centre) / width
    return math.exp(-(u**2) / 2) / (math.sqrt(2 * math.pi) * width) if abs(u) <= CUT else 0.0


# Decays of a micro-field that a graded layer may hold, where Γ is kept.
_MOST_DECAYS = 1e4


@dataclass(frozen=True)
class Load:
    """A source on one component of a block, scaled.

    Attributes:
        component: 0 for the macro-field if there is one, then the micro-fields.
        position, width: of its Gaussian; width 0 is a point.
        strength: its integral over x, shape (N,).
        inertial: whether the local inertia ι I multiplies it, as for an initial value.
    """

    component: int
    position: float
    width: float
    strength: Any
    inertial: bool = False

    def on(self, one: Section, omega: Any) -> Any:
        """Strength with the local inertia, shape (N,)."""
        if not self.inertial:
            return self.strength
        own = one.own.i_phi if self.component < one.macro else one.own.i_B
        return self.strength * own * one.losses(omega)[1]


def driven(one: Section, omega: Any, component: int) -> Any:
    """s of y′ = A y + s for a unit body force on a component, shape (N, 2n); see ``section``."""
    n, p = one.size, one.macro
    s = np.zeros((len(omega), 2 * n), dtype=complex)
    if component < p or one.kept:
        s[:, n + component] = 1 / np.sqrt(one.impedance[component])
    else:
        local = limit(one, omega)
        s = np.zeros_like(local.D, shape=s.shape)
        s[:, 0] = -1j * omega * np.sqrt(one.impedance[0]) * local.pX[:, component - p] / local.D
    return s


@dataclass(frozen=True)
class Stack:
    """A layered bar at some frequencies.

    Args:
        layers: the bar.
        block: one of its family's blocks.
        omega: ω in SI, shape (N,), real or complex, not 0, rad/s.
        kept: whether Γ is kept.

    Raises:
        ValueError: an ω is 0, or Γ is singular where it is kept.
    """

    layers: Layers
    block: Block
    omega: Any
    kept: bool

    def __post_init__(self) -> None:
        if (np.asarray(self.omega) == 0).any():
            raise ValueError("omega = 0: must not be 0; take a small ω for the static limit")
        for layer in self.layers.layers if self.kept else ():
            gamma = value_of(self.bare(layer, layer.start).own.gamma)
            if np.linalg.cond(gamma) > 1e12:
                raise ValueError(
                    f"{layer.medium.in_words}: Γ is singular, while it counts in this bar; give "
                    "every medium a G_n_g and a stiffness_ratio above 0, or all G_n_g = 0 (or, in "
                    "Python, gradient = False)"
                )

    @cached_property
    def units(self) -> Scales:
        """Units of the block in the medium at the left end."""
        first = self.layers.first
        found = scales(first).of(first.part(self.block).family)
        return Scales(*(value_of(getattr(found, name)) for name in _UNITS))

    @cached_property
    def scaled(self) -> Any:
        """ω τ, complex, shape (N,)."""
        return np.atleast_1d(np.asarray(self.omega, dtype=complex)) * self.units.time

    def bare(self, layer: Layer, position: float) -> Section:
        """The section at a position (m) of a layer, without impedance."""
        medium = layer.at(position)
        own = block_coefficients(medium, self.block, self.units)
        return Section(own, medium.damping, 1 / self.units.time, self.kept)

    @cached_property
    def impedance(self) -> Any:
        """z, shape (n,): the geometric mean of the layers' own."""
        logs = [
            np.log(value_of(self.bare(layer, (layer.start + layer.end) / 2).natural_impedance))
            for layer in self.layers.layers
        ]
        return np.exp(np.mean(logs, axis=0))

    def section(self, layer: Layer, position: float) -> Section:
        """The section at a position (m) of a layer."""
        return replace(self.bare(layer, position), impedance=self.impedance)

    @cached_property
    def _waves(self) -> dict[int, Waves]:
        return {}

    def waves(self, layer: Layer) -> Waves:
        """Waves of a uniform layer."""
        if id(layer) not in self._waves:
            self._waves[id(layer)] = waves(self.section(layer, layer.start), self.scaled)
        return self._waves[id(layer)]

    def end_waves(self, right: bool) -> Waves:
        """Waves of the medium at an end."""
        layer = self.layers.layers[-1 if right else 0]
        return waves(self.section(layer, layer.end if right else layer.start), self.scaled)

    def piece(self, layer: Layer, start: float, end: float, loads: Sequence[Load] = ()) -> Piece:
        """The stretch from start to end (m) of one layer, with the Gaussian sources in it."""
        x0, x1 = start / self.units.length, end / self.units.length
        reach = CUT
        near = [
            load
            for load in loads
            if load.width > 0
            and load.position - reach * load.width < x1
            and load.position + reach * load.width > x0
        ]
        if layer.last is not None:
            return self._graded(layer, x0, x1, near)
        own = self.waves(layer)
        return uniform(own, x1 - x0, self._made(layer, own, x0, x1, near) if near else None)

    def _made(self, layer: Layer, own: Waves, x0: float, x1: float, loads: Sequence[Load]) -> Any:
        here = self.section(layer, layer.start)
        basis = np.block([[own.v, own.mirror_v], [own.f, own.mirror_f]])
        right, left = np.zeros_like(own.k), np.zeros_like(own.k)
        n = here.size
        for load in loads:
            s = driven(here, self.scaled, load.component) * load.on(here, self.scaled)[:, None]
            share = np.linalg.solve(basis, s[..., None])[..., 0]
            x, w = load.position, load.width
            right += share[:, :n] * sent(own.k, x0, x1, x, w)
            left -= share[:, n:] * sent(own.k, -x1, -x0, -x, w)
        return right, left

    def _graded(self, layer: Layer, x0: float, x1: float, loads: Sequence[Load]) -> Piece:
        length, full = self.units.length, self.scaled

        def system(x: Any, chosen: Any) -> tuple[Any, Any]:
            places, omega = [self.section(layer, one * length) for one in x], full[chosen]
            A = generator(joined(places), omega)
            s = np.zeros_like(A[..., 0])
            for load in loads:
                for own, here, at in zip(s, places, x, strict=True):
                    g = density(at, load.position, load.width)
                    amount = g * load.on(here, full)[chosen]
                    own += amount[:, None] * driven(here, omega, load.component)
            return A, s

        if self.kept:
            A, _ = system(np.array([(x0 + x1) / 2]), np.arange(len(full)))
            turns = float(np.abs(np.linalg.eigvals(value_of(A)).real).max()) * (x1 - x0)
            if turns > _MOST_DECAYS:
                raise ValueError(
                    f"the graded layer from {layer.start:g} to {layer.end:g} m: Γ counts in this "
                    f"bar, and micro-fields decay within {(x1 - x0) * length / turns:.2g} m there, "
                    "too short to be followed through it; give every medium a stiffness_ratio "
                    "above 0 (Γ counts for nothing then), or uniform layers in its place"
                )
        strength = None
        if loads:
            middle = self.section(layer, (x0 + x1) / 2 * length)
            strength = sum(
                np.abs(value_of(load.on(middle, full)))
                * np.abs(value_of(driven(middle, full, load.component))).max(1)
                for load in loads
            )
            strength = np.maximum(strength, 1e-12 * strength.max()) + 1e-300
        try:
            return graded(system, x0, x1, len(full), strength)
        except Unresolved as error:
            (number,) = error.args
            raise ValueError(
                f"omega = {np.atleast_1d(self.omega)[number]:g} rad/s: the graded layer from "
                f"{layer.start:g} to {layer.end:g} m has an asymptote at it, where waves pile up; "
                "take a complex ω, with Im ω > 0"
            ) from None
        except TooMuch:
            raise TooMuch(
                f"the graded layer from {layer.start:g} to {layer.end:g} m takes too many steps: "
                "waves are short in it, or pile up; take lower frequencies, sources that set in "
                "smoothly, a shorter run, or uniform layers in its place"
            ) from None

    def pieces(
        self, cuts: Sequence[float] = (), loads: Sequence[Load] = ()
    ) -> tuple[list[float], list[Piece]]:
        """The bar cut at its interfaces, its point sources, and at given positions (m).

        Returns:
            Positions x_0 … x_M (m) and the M pieces between them; a point source belongs to the
            piece on its right, or at the right end to the last one.
        """
        length = self.layers.length
        points = [
            (load, min(max(load.position * self.units.length, 0.0), length))
            for load in loads
            if load.width == 0
        ]
        marks = {0.0, length, *self.layers.interfaces, *cuts, *(x for _, x in points)}
        for load in loads:
            for u in (-8.5, -4.0, -2.0, 0.0, 2.0, 4.0, 8.5) if load.width > 0 else ():
                x = (load.position + u * load.width) * self.units.length
                if 0 < x < length and self.layers.layer_at(x).last is not None:
                    marks.add(x)
        nodes = sorted(marks)
        found = []
        for start, end in itertools.pairwise(nodes):
            layer = self.layers.layer_at((start + end) / 2)
            one = self.piece(layer, start, end, loads)
            for load, x in points:
                if x == start or (x == end == length):
                    here = self.section(layer, x)
                    s = driven(here, self.scaled, load.component)
                    s = s * load.on(here, self.scaled)[:, None]
                    kick = jump(s[:, : here.size], s[:, here.size :])
                    one = star(kick, one) if x == start else star(one, kick)
            found.append(one)
        return nodes, found

    def whole(self) -> Piece:
        """The bar in one."""
        total = None
        for one in self.pieces()[1]:
            total = one if total is None else star(total, one)
        return total if total is not None else nothing(len(self.scaled), len(self.impedance))


def check_ends(left: str, right: str, allowed: tuple[str, ...] = ENDS) -> None:
    """Hold the names of two ends to what is known.

    Raises:
        ValueError: an end is unknown, or one is periodic and the other not.
    """
    for name, end in (("left", left), ("right", right)):
        if end not in allowed:
            raise ValueError(f"{name} = {end!r}: must be one of {', '.join(allowed)}")
    if (left == "periodic") != (right == "periodic"):
        raise ValueError(f"left = {left!r}, right = {right!r}: both ends must be periodic, or none")


def returned(stack: Stack, left: str, right: str) -> Any:
    """What both ends send back, (a at 0, b at L) = R (b at 0, a at L) + p, shape (N, 2n, 2n).

    Fixed: φ = g; free: σ·n = g with n outward; at both the double stress V is 0, the natural
    condition on a micro-field. Absorbing: the end's medium goes on for ever. Periodic: what leaves
    at one end comes in at the other.
    """
    n, count = len(stack.impedance), len(stack.scaled)
    unit, none = np.tile(np.eye(n, dtype=complex), (count, 1, 1)), np.zeros((count, n, n))
    if left == "periodic":
        return np.block([[none, unit], [unit, none]])
    R = []
    for to_right, end in enumerate((left, right)):
        R.append(unit.copy())
        if end == "absorbing":
            R[-1] = reflection(stack.end_waves(to_right > 0), to_right > 0)
        elif end == "fixed" and stack.block.macro:
            R[-1][:, 0, 0] = -1
    return np.block([[R[0], none], [none, R[1]]])


def waves_at_ends(whole: Piece, R: Any, p: Any) -> Any:
    """(a at 0, b at L) of a bar with sources in it and p at its ends, shape (N, 2n)."""
    unit = np.eye(R.shape[-1])
    out = np.linalg.solve(unit - whole.whole @ R, (times(whole.whole, p) + whole.sent)[..., None])
    return times(R, out[..., 0]) + p
