"""From the sources of a run to loads on the components of a block, scaled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from wavesim.layered.stack import Load, Stack
from wavesim.material.sectors import Block
from wavesim.material.wave_equations import CURVATURES, ROTATIONS

DRIVES = ("body", "moment", "rotation", "initial")


def drive_of(source: Any) -> str:
    """How a source acts: body, moment, rotation or initial.

    Raises:
        ValueError: it says something else.
    """
    drive = str(getattr(source, "drive", "body"))
    if drive not in DRIVES:
        raise ValueError(f"drive = {drive!r}: must be one of {', '.join(DRIVES)}")
    return drive


def components(block: Block, field: str) -> list[tuple[int, float]]:
    """Components of a block that a field belongs to, each with its weight."""
    names = ROTATIONS + CURVATURES
    both = np.zeros((len(block.rotations) + len(block.curvatures), len(names)))
    both[: len(block.rotations), :3] = block.weights(ROTATIONS)
    both[len(block.rotations) :, 3:] = block.weights(CURVATURES)
    column = both[:, names.index(field)]
    return [(int(i), float(column[i])) for i in np.flatnonzero(column)]


def body_loads(stack: Stack, sources: Sequence[Any], periodic: bool) -> list[Load]:
    """Loads of body sources and initial values on a block; round a ring, their images as well."""
    units, found = stack.units, []
    for source in sources:
        drive = drive_of(source)
        if drive not in ("body", "initial") or source.field not in stack.block.fields:
            continue
        width = float(source.width)
        if drive == "initial" and width == 0:
            raise ValueError("width = 0 m: an initial value needs a width; give one > 0")
        strength = np.asarray(source.spectrum(stack.omega), dtype=complex)
        if drive == "initial":
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
                    Load(component, x, width / units.length, weight * strength, drive == "initial")
                )
    return found


def end_drives(stack: Stack, sources: Sequence[Any], left: str, right: str) -> Any:
    """p of the ends (``ends``), shape (N, 2n): g/√z of a moment, −iω√z g of a rotation.

    Raises:
        ValueError: a moment is not at a free end, or a rotation not at a fixed one.
    """
    n = len(stack.impedance)
    p = np.zeros((len(stack.scaled), 2 * n), dtype=complex)
    for source in sources:
        drive = drive_of(source)
        if drive not in ("moment", "rotation") or source.field not in stack.block.fields:
            continue
        if source.field not in ROTATIONS:
            raise ValueError(f"field = {source.field!r}: a {drive} at an end acts on a rotation")
        at_right = source.position > stack.layers.length / 2
        end, needed = right if at_right else left, "free" if drive == "moment" else "fixed"
        if end != needed:
            raise ValueError(
                f"drive = {drive!r} at {source.position:g} m: needs a {needed} end, not {end!r}"
            )
        g = np.asarray(source.spectrum(stack.omega), dtype=complex)
        root = math.sqrt(stack.impedance[0])
        if drive == "moment":
            p[:, n if at_right else 0] += g / (stack.units.energy * root)
        else:
            p[:, n if at_right else 0] += -1j * stack.scaled * root * g
    return p
