"""The case file as a JSON schema, from which editors complete, check and explain its keys."""

from __future__ import annotations

from typing import Any

from wavesim.case.schema import learned
from wavesim.grid.stencils import ORDERS
from wavesim.material.family import known_fields
from wavesim.material.medium import families
from wavesim.material.parameter import PARAMETERS

# What a key means; those of the medium have theirs from its parameters.
_MEANS = {
    "title": "what the case is",
    "family": "of media, which says what fields there are",
    "closure": 'which equations: "printed" (Eqs. 26–37 of the paper) or "consistent"',
    "mass_damping": "Rayleigh damping by mass (1/s)",
    "stiffness_damping": "Rayleigh damping by stiffness (s)",
    "quality_factor": "Q, constant over quality_band",
    "quality_band": "[f1, f2] (Hz) over which Q is constant",
    "length": "of the bar (m); with layers, their sum",
    "cells": "of the grid, in place of length",
    "spacing": "of the grid (m); an eighth of the branch length by default",
    "order": "of the finite differences",
    "left": "what the left end is",
    "right": "what the right end is",
    "absorber": "length of the absorbing layer at an absorbing end (m)",
    "thickness": "of the layer (m), in place of from and to",
    "from": "where the layer begins (m)",
    "to": "where the layer ends (m)",
    "grading": "how a pair [at from, at to] goes from one to the other",
    "repeat": "how often the group of [[layers.layers]] stands",
    "field": "what the source drives",
    "position": "along the bar (m)",
    "end": "that is driven, in place of position",
    "drive": '"body"; on a free end "moment" or "traction"; of a fixed one "rotation" or '
    '"displacement"',
    "amplitude": "N·m/m² on a rotation, N on a micro-curvature, N/m² on a displacement, N/m on a "
    "micro-strain; rad or m of a fixed end that is moved",
    "width": "standard deviation of a Gaussian (m); 0 is a point",
    "kind": "of the source",
    "peak_frequency": "of the pulse's spectrum (Hz)",
    "frequency": "of the burst (Hz)",
    "cycles": "of the burst",
    "delay": "time of the pulse's middle (s)",
    "start": "when the signal begins (s)",
    "name": "of the receiver",
    "duration": "s",
    "solver": '"auto", "propagator", "chebyshev", or one of diffrax: "Tsit5", "Dopri8", …',
    "step": "longest time step (s)",
    "samples": "frames that are stored",
    "k_min": "lowest wavenumber judged (rad/m)",
    "k_max": "highest wavenumber judged (rad/m)",
    "frequencies": "of the attenuation curve",
    "damping": "σT of the exponential window",
    "sector": "whose waves, such as longitudinal",
    "at_most": "|T| (dB)",
    "at_least": "|T| (dB)",
    "length_at_most": "of all that stands between the half-spaces (m)",
    "thickness_at_least": "of each layer there (m)",
    "tolerance": "of each variable as it is made, relative",
}
# What from and to are of tables that have such a key, and no layers.
_ENDS = {
    "sector": {"from": "lowest frequency (Hz)", "to": "highest frequency (Hz)"},
    "key": {"from": "least, in the key's unit", "to": "most, in the key's unit"},
}


def _meaning(key: str) -> str | None:
    known = PARAMETERS.get(key)
    if known is None:
        return _MEANS.get(key)
    return known.symbol + (f" ({known.unit})" if known.unit else "")


def json_schema() -> dict[str, Any]:
    """The schema (JSON Schema, draft 2020-12); what it lets through wavesim may yet refuse."""
    made: dict[str, Any] = _told(learned().model_json_schema(by_alias=True))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A case of wavesim",
        "description": "SI units throughout",
    } | {key: value for key, value in made.items() if key not in ("title", "description")}


def _told(part: Any) -> Any:
    """Without what TOML has not, null, and without names of classes; each key with its meaning."""
    if isinstance(part, list):
        return [_told(one) for one in part]
    if not isinstance(part, dict):
        return part
    made = {key: _told(value) for key, value in part.items()}
    if "anyOf" in made:
        rest = [one for one in made["anyOf"] if one != {"type": "null"}]
        made = {key: value for key, value in made.items() if key != "anyOf"}
        made |= rest[0] if len(rest) == 1 else {"anyOf": rest}
    if "default" in made and not isinstance(made["default"], str | int | float | bool):
        del made["default"]
    keys = made.get("properties")
    if isinstance(keys, dict):
        made.pop("title", None)
        made.pop("description", None)
        allowed = {"order": ORDERS, "field": known_fields(), "family": families()}
        ends = next((ends for key, ends in _ENDS.items() if key in keys), {})
        for name, one in keys.items():
            one.pop("title", None)
            meaning = ends.get(name) or _meaning(name)
            if meaning is not None and "$ref" not in one:
                one["description"] = meaning
            for kind in one.get("anyOf", [one]) if name in allowed else ():
                kind.get("items", kind)["enum"] = list(allowed[name])
    return made
