"""What a key of a case file reaches: which parameter, of which layers of the bar. No jax.

Studies vary "layers.1.layers.0.thickness" or "medium.density" without reading the case anew.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import Literal

from wavesim.case.layered_case import BarLayers


@dataclass(frozen=True)
class VariedKey:
    """A key and what it reaches.

    Attributes:
        key: as it is written, such as "layers.1.layers.0.thickness".
        name: "thickness" or a parameter of Medium.
        layers: indices of the layers of the bar, counted from 0, buffers of half-spaces too.
        end: of graded layers "first" or "last" where one number of a pair is meant, else "both".
    """

    key: str
    name: str
    layers: tuple[int, ...]
    end: Literal["first", "last", "both"] = "both"


def varied_key(known: BarLayers, key: str) -> VariedKey:
    """What a key reaches.

    Args:
        known: of :func:`wavesim.case.layered_case.load_layers`.
        key: "medium.NAME", "layers.N.NAME", "layers.N.layers.M.NAME", numbers from 0; of a graded
            parameter "….NAME.0" and "….NAME.1" are its two ends.

    Raises:
        ValueError: it reaches nothing; the message says what there is.
    """
    parts = key.split(".")
    end: Literal["first", "last", "both"] = "both"
    if len(parts) > 2 and parts[-1] in ("0", "1") and not parts[-2].isdigit():
        end = "first" if parts[-1] == "0" else "last"
        parts = parts[:-1]
    *table, name = parts
    names = ("thickness", *known.medium.known())
    if name not in names:
        near = difflib.get_close_matches(name, names, 1)
        hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(names)}"
        raise ValueError(f'key = "{key}": {name!r} can\'t be varied; {hint}')
    if table == ["medium"] and name != "thickness":
        found = [n for n, p in enumerate(known.places) if getattr(p.table, name) is None]
        if not found:
            raise ValueError(
                f'key = "{key}": reaches nothing, as every layer has {name} of its own; name a '
                "layer's, such as layers.0." + name
            )
    else:
        found = [n for n, p in enumerate(known.places) if list(p.where) == table]
        if not found:
            tables = dict.fromkeys(".".join(p.where) for p in known.places if p.where[0] != "bar")
            some = list(tables)
            shown = ", ".join(some[:6]) + (", …" if len(some) > 6 else "")
            raise ValueError(
                f'key = "{key}": no layer stands at {".".join(table) or "the top"}; there are '
                f"{shown or 'none'}" + ("" if name == "thickness" else ", and medium")
            )
    own = [known.places[n].table for n in found]
    if name == "thickness" and any(t.thickness is None for t in own):
        raise ValueError(
            f'key = "{key}": the layer has from and to; give it thickness in place of them'
        )
    if end != "both" and not all(isinstance(getattr(t, name), list) for t in own):
        raise ValueError(f'key = "{key}": {name} is no pair there; leave .{key[-1]} out')
    return VariedKey(key, name, tuple(found), end)
