"""From the sources of a run to loads on the components of a block, scaled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from wavesim.layered.stack import Load, Stack
from wavesim.material.family import Acts, Block, is_macro, known_field


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


def body_loads(stack: Stack, sources: Sequence[Any], periodic: bool) -> list[Load]:
    """Loads of body sources and initial values on a block; round a ring, their images as well."""
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


def end_drives(stack: Stack, sources: Sequence[Any], left: str, right: str) -> Any:
    """p of the ends (``ends``), shape (N, 2n): g/√z of a load, −iω√z g of a prescribed φ.

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
        at_right = source.position > stack.layers.length / 2
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
