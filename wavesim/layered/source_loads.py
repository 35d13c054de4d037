"""From the sources of a run to loads on the components of a block, scaled.

An initial value u₀ is let go from rest. Viscous stress knows no strain before that, so that it is
of iωU + u₀ in place of iωU: with m = m_r − iωβ_d, U = V + (β_d/m) u₀, and V is what a load of the
inertia times −iωι(m_r/m) u₀ makes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from wavesim.layered.stack import Load, Stack, density
from wavesim.material.family import Acts, Block, is_macro, known_field
from wavesim.material.layers import Layers

# Of a Gaussian 1e-9 lies further out than so many standard deviations.
REACH = 6.0


def acts_of(source: Any) -> Acts:
    """What a source does: it is "body", "surface", "prescribed" or "initial".

    Raises:
        ValueError: its drive is none of its field's family.
    """
    return known_field(source.field).family.acts(str(getattr(source, "drive", "body")))


def components(block: Block, field: str) -> list[tuple[int, float]]:
    """Components of a block that a field belongs to, each with its weight."""
    parts = enumerate(block.macro + block.micro)
    return [(i, part[field]) for i, part in parts if part.get(field)]


def body_loads(
    stack: Stack, sources: Sequence[Any], periodic: bool, inertial: bool = False
) -> list[Load]:
    """Loads of body sources and initial values on a block; round a ring, their images as well.

    Those of initial values are as viscous stress leaves them, or else inertial alone.
    """
    units, found = stack.units, []
    for source in sources:
        acts = acts_of(source)
        if acts not in ("body", "initial") or source.field not in stack.block.fields:
            continue
        width = float(source.width)
        if acts == "initial" and width == 0:
            raise ValueError("width = 0 m: an initial value needs a width; give one > 0")
        strength = np.asarray(source.spectrum(stack.omega), dtype=complex)
        if acts == "initial":
            # The value is not normalised; φ̈ + ω₀²φ = φ(0) δ′(t), whose transform is −iω φ(0).
            strength = strength * (units.time**2 * math.sqrt(2 * math.pi) * width / units.length)
            strength = strength / units.unit(source.field)
            strength = strength if inertial else strength * _let_go(stack, source)[0]
        else:
            strength = strength / (units.force(source.field) * units.length)
        length = stack.layers.length
        for shift in (0.0, -length, length) if periodic and width else (0.0,):
            x = (float(source.position) + shift) / units.length
            for component, weight in components(stack.block, source.field):
                found.append(
                    Load(component, x, width / units.length, weight * strength, acts == "initial")
                )
    return found


def _let_go(stack: Stack, source: Any) -> tuple[Any, Any]:
    """m_r/m and β_d/m_r (s) where an initial value is, shape (N,).

    Raises:
        ValueError: layers that lose by viscosity in different ways meet there.
    """
    x, width, length = float(source.position), float(source.width), stack.layers.length
    laws = {
        layer.medium.damping
        for layer in stack.layers.layers
        for shift in (0.0, -length, length)
        if layer.start < x + shift + REACH * width and layer.end > x + shift - REACH * width
    }
    if len(laws) > 1 and any(law.stiffness for law in laws):
        raise ValueError(
            f"position = {x:g} m: an initial value in layers of different stiffness damping is not "
            "known exactly; place it within one layer, or give all the same losses"
        )
    law = next(iter(laws))
    if not law.stiffness:
        return 1.0, 0.0
    m = law.modulus(stack.omega)
    elastic = m + 1j * stack.omega * law.stiffness
    return elastic / m, law.stiffness / elastic


def held_back(stack: Stack, sources: Sequence[Any], periodic: bool, x: float) -> Any:
    """(β_d/m) u₀ at x (m) on each component of the block, shape (N, components)."""
    block = stack.block
    found = np.zeros((len(stack.scaled), len(block.macro) + len(block.micro)), dtype=complex)
    for source in sources:
        if acts_of(source) != "initial" or source.field not in block.fields:
            continue
        share = _let_go(stack, source)[1]
        if np.any(share):
            for load in body_loads(stack, [source], periodic):
                u = load.strength / (-1j * stack.omega * stack.units.time**2)
                g = density(x / stack.units.length, load.position, load.width)
                found[:, load.component] += share * u * g
    return found


def check_within(layers: Layers, sources: Sequence[Any], periodic: bool) -> None:
    """Hold Gaussians to the bar.

    Raises:
        ValueError: one stands out over an end, or laps itself on a ring.
    """
    for source in sources:
        x, width = float(source.position), float(source.width)
        if not 0 <= x <= layers.length:
            raise ValueError(f"position = {x:g} m: must be in 0 to {layers.length:g} m")
        if acts_of(source) not in ("body", "initial"):
            continue
        room = layers.length / 2 if periodic else min(x, layers.length - x)
        if width > 0 and room < REACH * width:
            raise ValueError(
                f"width = {width:g} m: the Gaussian at {x:g} m stands out over "
                f"{'itself round the ring' if periodic else 'an end of the bar'}; take at most "
                f"{room / REACH:.3g} m, or move it inward"
            )


def end_drives(stack: Stack, sources: Sequence[Any], left: str, right: str) -> Any:
    """p of the ends (``stack.returned``), shape (N, 2n): g/√z of a load, −iω√z g of a prescribed φ.

    Raises:
        ValueError: a load is not at a free end, or a prescribed φ not at a fixed one.
    """
    n = len(stack.impedance)
    p = np.zeros((len(stack.scaled), 2 * n), dtype=complex)
    for source in sources:
        acts, word = acts_of(source), known_field(source.field).family.words[0]
        if acts not in ("surface", "prescribed") or source.field not in stack.block.fields:
            continue
        if not is_macro(source.field):
            raise ValueError(
                f"field = {source.field!r}: a {source.drive} at an end acts on a {word}"
            )
        length, x = stack.layers.length, float(source.position)
        at_right = x > length / 2
        if abs(x - (length if at_right else 0.0)) > 1e-9 * length:
            raise ValueError(
                f"drive = {source.drive!r} at {x:g} m: acts at an end; give it position = 0 or "
                f"{length:g} m"
            )
        end, needed = right if at_right else left, "free" if acts == "surface" else "fixed"
        if end != needed:
            raise ValueError(
                f"drive = {source.drive!r} at {source.position:g} m: needs a {needed} end, "
                f"not {end!r}"
            )
        g = np.asarray(source.spectrum(stack.omega), dtype=complex)
        root = math.sqrt(stack.impedance[0])
        unit = stack.units.macro
        if acts == "surface":
            p[:, n if at_right else 0] += g * unit / (stack.units.energy * root)
        else:
            p[:, n if at_right else 0] += -1j * stack.scaled * root * g / unit
    return p
