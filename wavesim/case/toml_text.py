"""The tables of a case file's text, and values laid over them; whatever is written there."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from typing import Any

from wavesim.material.shown import printable


class CaseError(ValueError):
    """A case can't be used; the message names file, key, value and remedy."""


def toml_tables(text: str, name: str, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """The tables of a case file's text, with values laid over them.

    Raises:
        CaseError: it isn't TOML, or more than anyone means: nested deeper, numbers longer than
            Python reads.
    """
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise CaseError(f"{name}: not valid TOML: {_why(error)}") from None
    for override in overrides:
        lay_over(tables, override)
    return tables


def _why(error: Exception) -> str:
    if isinstance(error, tomllib.TOMLDecodeError):
        return printable(str(error))
    if isinstance(error, RecursionError):
        return "nested too deep; a case has tables and arrays of numbers only"
    return "a number of more digits than can be read; write it as a float, such as 1e9"


def lay_over(tables: dict[str, Any], override: str) -> None:
    """Lay "table.key=value", value in TOML, over the tables of a case.

    Args:
        tables: changed in place.
        override: "sources.0.position=0.1", or sources[0], for a table of an array.

    Raises:
        CaseError: it is no such text, or names a table that is not there.
    """
    shown = f"--set {printable(override)}"
    if any("\ud800" <= character <= "\udfff" for character in override):
        raise CaseError(f"{shown}: holds bytes that are not text in UTF-8; take them out")
    key, equals, value = override.partition("=")
    parts = re.sub(r"\[(\d+)\]", r".\1", key.strip()).split(".")
    if not equals or not all(part.strip() for part in parts):
        raise CaseError(f"{shown}: must be table.key=value, such as bar.order=10")
    table: Any = tables
    for depth, part in enumerate(parts[:-1]):
        table = _inside(table, part, parts[:depth], shown)
    parsed = _value(value, shown)
    last = parts[-1]
    if isinstance(table, list):
        table[_index(table, last, parts[:-1], shown)] = parsed
    elif isinstance(table, dict):
        table[last] = parsed
    else:
        raise _no_keys(parts[:-1], shown)


def _value(text: str, shown: str) -> Any:
    """A value in TOML, or the text itself where it is none, as quotes are lost to a shell."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    except (ValueError, RecursionError) as error:
        raise CaseError(f"{shown}: {_why(error)}") from None
    if len(parsed) > 1:
        raise CaseError(f"{shown}: must be one line; give --set once for each key")
    return parsed["value"]


def _inside(table: Any, part: str, before: list[str], shown: str) -> Any:
    if isinstance(table, list):
        return table[_index(table, part, before, shown)]
    if isinstance(table, dict):
        return table.setdefault(part, {})
    raise _no_keys(before, shown)


def _index(table: list[Any], part: str, before: list[str], shown: str) -> int:
    # Longer than any array's, and digits of other scripts, are no numbers.
    if part.isascii() and part.isdecimal() and len(part) < 10 and int(part) < len(table):
        return int(part)
    known = f"entries 0 to {len(table) - 1}" if table else "no entries"
    raise CaseError(
        f"{shown}: {printable('.'.join(before))} has {known}, not {printable(repr(part))}; name "
        "one that is there, or add it to the file"
    )


def _no_keys(before: list[str], shown: str) -> CaseError:
    return CaseError(
        f"{shown}: {printable('.'.join(before))} is a value and has no keys; must be "
        "table.key=value, such as bar.order=10"
    )
