"""wavesim: waves in granular media with microstructure, in time and by plane waves.

    import wavesim as ws

    medium = ws.Medium(anisotropy=0.25)
    bar = ws.Bar(cells=2048, spacing=1.25e-4)
    pulse = ws.Ricker("phi1", position=0.128, peak_frequency=1e6)
    field = ws.simulate(medium, bar, [pulse], duration=8e-5)
    measured = ws.extract(field)

Names are loaded when they are first used, from where ``__init__.pyi`` says, so that ``import
wavesim`` is quick and the plane-wave solver needs no jax.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from typing import Any

# The scheme needs double precision, and so do the numbers that a user gives to jax beforehand.
os.environ["JAX_ENABLE_X64"] = "true"
if "jax" in sys.modules:
    sys.modules["jax"].config.update("jax_enable_x64", True)

# {name: (where it is at home, its name there)}, of each statement of import in the stub.
_HOMES: dict[str, tuple[str, str]] = {}
with open(f"{__file__}i", encoding="utf-8") as _file:
    _STUB = _file.read()
for _home, _several, _alone in re.findall(
    r"^from (\S+) import (?:\(([^)]*)\)|(.+))$", _STUB, re.MULTILINE
):
    for _own, _name in re.findall(r"(\w+)(?: as (\w+))?", _several or _alone):
        _HOMES[_name or _own] = _home, _own

__all__ = [*_HOMES]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("wavesim")
    if name not in _HOMES:
        raise AttributeError(f"module 'wavesim' has no attribute {name!r}")
    home, own = _HOMES[name]
    if home == __name__:  # a room
        return importlib.import_module(f"{home}.{own}")
    found = getattr(importlib.import_module(home), own)
    if not isinstance(found, type):
        checked = importlib.import_module("wavesim.material.arguments").checked
        found = checked(found, name)
        found.__module__, found.__qualname__ = __name__, name  # where pickle finds it
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__doc__", "__version__"])
