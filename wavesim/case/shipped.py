"""The cases that come with wavesim, by name, wherever it is installed."""

from __future__ import annotations

import difflib
import os
import tomllib
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]


def folder() -> Path:
    """Where they are: in an installed package, or beside it in a clone."""
    installed = _PACKAGE / "cases"
    return installed if installed.is_dir() else _PACKAGE.parent / "cases"


def shipped() -> dict[str, Path]:
    """Their files, by name."""
    return {path.stem: path for path in sorted(folder().glob("*.toml"))}


def found(case: str | Path) -> Path:
    """The file of a case: that of the path, or where there is none the shipped one of that name.

    Args:
        case: a path, or a name such as "slab".
    """
    path = Path(case)
    if str(case) == path.name and not path.suffix and not os.path.exists(path):
        return shipped().get(str(case), path)
    return path


def like(case: str | Path) -> str:
    """What to name in place of a case that is not there, in words."""
    near = difflib.get_close_matches(Path(case).stem, shipped(), 1)
    meant = f"; did you mean {near[0]}, which comes with wavesim?" if near else ""
    return f"a case file, or a shipped case (wavesim cases lists them){meant}"


def title(path: Path) -> str:
    """What a case file says that it is."""
    return str(tomllib.loads(path.read_text(encoding="utf-8")).get("title", ""))
