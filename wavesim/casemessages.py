"""What is wrong with a case file, in one line: where, key, value, and what is allowed."""

from __future__ import annotations

import difflib
import typing
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

_PLAIN = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "string_type": "must be text in quotes",
    "list_type": "must be an array of tables, [[…]]",
    "finite_number": "must be finite",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be {ge:g} or greater",
    "less_than_equal": "must be {le:g} or less",
}
_LONGEST = 60


def place(parts: Sequence[Any]) -> str:
    """[medium] or [[sources]] number 1, from a path through the tables."""
    table, *rest = (str(part) for part in parts)
    if rest and rest[0].isdigit():
        return f"[[{table}]] number {int(rest[0]) + 1}:"
    return f"[{table}]"


def sentence(schema: type[BaseModel], error: ValidationError) -> str:
    """The error to tell of a case that does not fit its schema.

    An unknown key is told first, as it is often why another one is missing.

    Args:
        schema: the model of the whole file.
        error: what validation said.
    """
    errors: list[Any] = list(error.errors())
    first = next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])
    # Where a value may be a number or a word, validation tells of each; one line says both.
    words = [e for e in errors if e["type"] == "literal_error" and e is not first]
    path = _keys(first)
    also = next((e["ctx"]["expected"] for e in words if _keys(e) == path), None)
    text = _told(schema, first, path)
    return text if also is None else f"{text}, or {_quoted(also)}"


def _keys(error: Any) -> list[Any]:
    """The path to a key, without the names that validation gives to members of a union."""
    return [
        part
        for part in error["loc"]
        if not (isinstance(part, str) and ("[" in part or part.startswith("constrained-")))
    ]


def _told(schema: type[BaseModel], error: Any, parts: list[Any]) -> str:
    kind, value = error["type"], error["input"]
    key = str(parts[-1])
    where = place(parts[:-1]) + " " if len(parts) > 1 else ""
    given = f"{where}{key} = {shown(value)}"
    if kind == "extra_forbidden":
        allowed = list(_model(schema, parts[:-1]).model_fields)
        near = difflib.get_close_matches(key, allowed, 1)
        hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(allowed)}"
        return f"{given}: unknown key; {hint}"
    if kind == "missing":
        what = _heading(schema, key) if len(parts) == 1 else key
        return f"{where}{what}: required, but not given; add it"
    if kind in ("model_type", "model_attributes_type"):
        if key.isdigit():
            return f"{place(parts)} {shown(value)}: must be a table, [[{parts[0]}]]"
        return f"{given}: must be a table, [{key}]"
    if kind == "value_error":
        text = str(error["ctx"]["error"])
        if isinstance(value, dict):
            return f"{place(parts)} {text}"
        if isinstance(value, list):
            return f"[[{key}]] {text}"
        return f"{given}: {text}"
    if kind == "too_short":
        return f"{given}: at least one is needed; add {_heading(schema, key)}"
    if kind == "literal_error":
        return f"{given}: must be {_quoted(error['ctx']['expected'])}"
    context = error.get("ctx", {})
    return f"{given}: {_PLAIN[kind].format(**context) if kind in _PLAIN else error['msg']}"


def _quoted(expected: str) -> str:
    return expected.replace("'", '"')


def _heading(schema: type[BaseModel], key: str) -> str:
    """[bar] or [[sources]]: how a table of the file is begun."""
    several = typing.get_origin(schema.model_fields[key].annotation) is list
    return f"[[{key}]]" if several else f"[{key}]"


def _model(schema: type[BaseModel], parts: Sequence[Any]) -> type[BaseModel]:
    """The model of the table at a path."""
    model: Any = schema
    for part in parts:
        if isinstance(part, str):
            annotation = model.model_fields[part].annotation
            model = (*typing.get_args(annotation), annotation)[0]
    return model


def shown(value: Any) -> str:
    """A value as TOML spells it, cut if it is long."""
    if isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, str):
        text = f'"{value}"'.replace("\n", "\\n")
    else:
        text = repr(value).replace("\n", " ")
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
