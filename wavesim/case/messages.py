"""What is wrong with a case file, in one line: where, key, value, and what is allowed."""

from __future__ import annotations

import datetime
import difflib
import typing
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from wavesim.case.units import numbered, unit_of
from wavesim.material.shown import printable

_PLAIN = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "string_type": "must be text in quotes",
    "finite_number": "must be finite",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be {ge:g} or greater",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be {le:g} or less",
}
_LONGEST = 60
# Tables whose from and to are no lengths: the key whose unit they have.
_OWN_UNIT = {"bands": "frequency", "variables": "key"}


def place(parts: Sequence[Any]) -> str:
    """[medium], or [[sources]] number 1:, from a path through the tables."""
    told: list[str] = []
    names: list[str] = []
    for part in (printable(str(part), _LONGEST) for part in parts):
        if part.isdecimal() and names:
            told.append(f"[[{'.'.join(names)}]] number {int(part) + 1}")
        else:
            names.append(part)
    return f"{', '.join(told)}:" if told else f"[{names[0]}]"


def sentence(schema: type[BaseModel], error: ValidationError) -> str:
    """The error to tell of a case that does not fit its schema.

    An unknown key is told first, as it is often why another one is missing.
    """
    errors: list[Any] = list(error.errors())
    first = next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])
    # Where a value may be a number or a word, validation tells of each; one line says both.
    words = [e for e in errors if e["type"] == "literal_error" and e is not first]
    path = _keys(schema, first)
    also = next((e["ctx"]["expected"] for e in words if _keys(schema, e) == path), None)
    text = _told(schema, first, path)
    if also is not None:
        text = f"{text}, or {_quoted(also)}"
    return _as_number(text, first, path)


def _as_number(text: str, error: Any, path: Sequence[Any]) -> str:
    """The text, with unit and form where quotes stand about what should be a number."""
    value, key = error["input"], str(path[-1])
    if isinstance(path[-1], int) and len(path) > 2:
        key = str(path[-2])
    if len(path) > 2 and path[-3] in _OWN_UNIT and key in ("from", "to"):
        key = _OWN_UNIT[path[-3]]
    if not isinstance(value, str) or "must be a number" not in text:
        return text
    if '"' in text.split("must be a number")[1] and not value.strip()[:1].isdigit():
        return text  # a word may stand there too, and this one is none
    return numbered(key, text, value)


def _keys(schema: type[BaseModel], error: Any) -> list[Any]:
    """The path to a key, without the names that validation gives to members of a union."""
    loc = error["loc"]
    # In an array of tables of several kinds the kind follows the number.
    field = schema.model_fields.get(str(loc[0]))
    table = _table(field.annotation) if field else None
    kinds = table if isinstance(table, dict) else ()

    def named(part: Any, before: Any) -> bool:
        return isinstance(part, str) and (
            "[" in part
            or part.startswith("constrained-")
            or (isinstance(before, int) and part in kinds)
        )

    path = [
        part for part, before in zip(loc, (None, *loc), strict=False) if not named(part, before)
    ]
    # An unknown key may look like any of those names.
    return [*path, loc[-1]] if error["type"] == "extra_forbidden" and named(loc[-1], None) else path


def _told(schema: type[BaseModel], error: Any, parts: list[Any]) -> str:
    kind, value = error["type"], error["input"]
    key, table = printable(str(parts[-1]), _LONGEST), parts[:-1]
    if isinstance(parts[-1], int) and len(parts) > 2:
        # An entry of an array of numbers.
        key, table = f"{parts[-2]}[{key}]", parts[:-2]
    where = place(table) + " " if table else ""
    given = f"{where}{key} = {shown(value)}"
    if kind == "extra_forbidden":
        fields = _at(schema, error["loc"][:-1]).model_fields
        allowed = [field.alias or name for name, field in fields.items()]
        near = difflib.get_close_matches(key, allowed, 1)
        if not table and not near:
            near = [f"{name}.{key}" for name in allowed if _is_key(schema, name, key)]
        # Keys of [medium] are many; elsewhere they are said in three words.
        many = set(_at(schema, ("medium",)).model_fields) if "layers" in table else set()
        short = [name for name in allowed if name not in many]
        short += ["any key of [medium]"] if many else []
        hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(short)}"
        if not table and isinstance(value, dict | list):
            heading = f"[{key}]" if isinstance(value, dict) else f"[[{key}]]"
            return f"{heading}: unknown table; {hint}"
        tag = next((part for part in error["loc"] if part not in parts), None)
        of = f' of kind "{tag}"' if tag else ""
        return f"{given}: unknown key{of}; {hint}"
    if kind == "missing":
        what = _heading(schema, key) if len(parts) == 1 else key
        return f"{where}{what}: required, but not given; add it"
    if kind in ("model_type", "model_attributes_type"):
        if isinstance(parts[-1], int):
            return f"{place(parts)} {shown(value)}: must be a table, [[{_dotted(parts)}]]"
        return f"{given}: must be a table, [{key}]"
    if kind == "value_error":
        text = str(error["ctx"]["error"])
        if isinstance(value, dict) and _is_table(schema, error["loc"]):
            return f"{place(parts)} {text}"
        if isinstance(value, list) and len(parts) == 1:
            return f"[[{key}]] {text}"
        return f"{given}: {text}"
    if kind == "too_short":
        return f"{given}: at least one is needed; add {_heading(schema, key)}"
    if kind == "union_tag_invalid":
        kinds = _quoted(error["ctx"]["expected_tags"])
        return f"{place(parts)} kind = {shown(value['kind'])}: must be one of {kinds}"
    if kind == "list_type" and _is_table(schema, error["loc"]):
        return f"{given}: must be an array of tables, [[{_dotted(parts)}]]"
    if kind == "list_type":
        unit = f" in {unit_of(key)}" if unit_of(key) else ""
        return f"{given}: must be an array of numbers{unit}, […]"
    if kind == "literal_error":
        return f"{given}: must be {_quoted(error['ctx']['expected'])}"
    context = error.get("ctx", {})
    return f"{given}: {_PLAIN[kind].format(**context) if kind in _PLAIN else error['msg']}"


def _dotted(parts: Sequence[Any]) -> str:
    """A table's name as its heading has it, without the numbers."""
    return ".".join(str(part) for part in parts if not isinstance(part, int))


def _is_key(schema: type[BaseModel], table: str, key: str) -> bool:
    """Whether a key belongs in a table, [table], of the file."""
    field = schema.model_fields.get(table)
    return field is not None and key in getattr(_table(field.annotation), "model_fields", {})


def _quoted(expected: str) -> str:
    return expected.replace("'", '"')


def _heading(schema: type[BaseModel], key: str) -> str:
    """[bar] or [[sources]]: how a table of the file is begun."""
    several = typing.get_origin(schema.model_fields[key].annotation) is list
    return f"[[{key}]]" if several else f"[{key}]"


def _at(schema: type[BaseModel], loc: Sequence[Any]) -> Any:
    """What is known of a path, in which the kind, if any, follows a number: the model of its table,
    the models of an array's tables by kind, or what else its key holds."""
    model: Any = schema
    for part in loc:
        if isinstance(model, dict):
            model = model.get(part, model)
        elif isinstance(part, str):
            known = getattr(model, "model_fields", {}).get(part)
            model = _table(known.annotation) if known else None
    return model


def _is_table(schema: type[BaseModel], loc: Sequence[Any]) -> bool:
    """Whether a table belongs at a path, rather than a value that was given as one."""
    model = _at(schema, loc)
    return isinstance(model, dict) or (isinstance(model, type) and issubclass(model, BaseModel))


def _table(annotation: Any) -> Any:
    """The model of a table, or of the tables of an array; {kind: model} where there are several."""
    inner = typing.get_args(annotation)[0] if typing.get_origin(annotation) is list else annotation
    members = typing.get_args(typing.get_args(inner)[0]) if typing.get_args(inner) else ()
    if not all(hasattr(member, "__metadata__") for member in members) or not members:
        return inner
    return {member.__metadata__[0].tag: typing.get_args(member)[0] for member in members}


def shown(value: Any) -> str:
    """A value as TOML spells it, cut if it is long."""
    try:
        return printable(_spelled(value), _LONGEST)
    except RecursionError:  # deeper than Python goes
        return "a table" if isinstance(value, dict) else "an array"


def _spelled(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value[:_LONGEST]}"'
    if isinstance(value, int) and abs(value) >= 10**_LONGEST:
        return "a whole number of more than 60 digits"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_spelled(one) for one in value)}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_spelled(one)}' for key, one in value.items())}}}"
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return repr(value)
