"""What a caller gives, held to type hints: one kind of error, that names key, value and remedy.

A name that is not known, one that is missing, a value of another type, a number that is not finite:
ValueError for all, as for a value out of its range. What jax holds is let through.
"""

from __future__ import annotations

import collections.abc
import difflib
import functools
import inspect
import math
import numbers
import os
import sys
import types
import typing
from collections.abc import Callable, Iterable
from typing import Any, Literal, TypeVar

import numpy as np

from wavesim.material.shown import printable

# What spectra may be asked for: frequencies, and σT of the exponential window.
FREQUENCIES, WINDOW = (8, 4096), (4.0, 30.0)

Made = TypeVar("Made", bound=Callable[..., Any])
_LONGEST = 60
_PASS = ""


def checked(made: Made, name: str = "") -> Made:
    """A function, or a data class, that holds its arguments to its type hints.

    Args:
        made: the function, or the class, whose ``__init__`` is replaced.
        name: that it is known by; its own where "".
    """
    if isinstance(made, type):
        made.__init__ = _checked(made.__init__, made.__name__, made)  # type: ignore[misc]
        return made
    return typing.cast(Made, _checked(made, name or made.__name__, made))


def _checked(function: Callable[..., Any], name: str, told: Any) -> Callable[..., Any]:
    signature = inspect.signature(function)

    @functools.cache
    def hints() -> dict[str, Any]:
        return {key: hint for key, hint in _hints(told).items() if key in signature.parameters}

    @functools.wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        try:
            bound = signature.bind(*args, **given)
        except TypeError:
            raise ValueError(_unbound(name, signature, args, given)) from None
        for key, hint in hints().items():
            if key in bound.arguments and signature.parameters[key].kind not in (
                inspect.Parameter.VAR_POSITIONAL,
                inspect.Parameter.VAR_KEYWORD,
            ):
                value = bound.arguments[key]
                wanted = _missed(value, hint) or _odd(key, value)
                if wanted and value is not signature.parameters[key].default:
                    raise ValueError(f"{key} = {_shown(value)}: must be {wanted}")
        return function(*args, **given)

    return call


def unknown(name: str, given: Iterable[str], known: Iterable[str]) -> str:
    """What is said of the first keyword that is none of those known; "" where all are."""
    known = list(known)
    for key in given:
        if key not in known:
            near = difflib.get_close_matches(key, known, 1, 0.5)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            return f"{key}: is no argument of {name}; {hint}"
    return ""


def _unbound(
    name: str, signature: inspect.Signature, args: tuple[Any, ...], given: dict[str, Any]
) -> str:
    known = [key for key in signature.parameters if key != "self"]
    said = unknown(name, given, known)
    if said:
        return said
    missing = [
        key
        for key, one in list(signature.parameters.items())[len(args) :]
        if one.default is inspect.Parameter.empty
        and one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)
        and key not in given
    ]
    if missing:
        return f"{missing[0]}: required by {name}, but not given; it takes {', '.join(known)}"
    return f"{name}: got more values than it takes, or one twice; it takes {', '.join(known)}"


def _hints(told: Any) -> dict[str, Any]:
    try:
        return typing.get_type_hints(told)
    except NameError:  # what is imported for type checkers only
        space = vars(sys.modules[told.__module__])
        found = {}
        for key, hint in getattr(told, "__annotations__", {}).items():
            try:
                found[key] = eval(hint, space) if isinstance(hint, str) else hint
            except (NameError, TypeError):
                continue
        return found


def _missed(value: Any, hint: Any) -> str:
    """What a value should be and is not, in words; "" where it fits, or nothing is known."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any or isinstance(hint, TypeVar):
        return _PASS
    if origin in (typing.Union, types.UnionType):
        if "_SupportsArray" in repr(inner):  # numpy's ArrayLike
            return _PASS if value is None and type(None) in inner else _no_numbers(value)
        missed = [_missed(value, one) for one in inner]
        return _PASS if not all(missed) else " or ".join(dict.fromkeys(missed))
    if origin is Literal:
        fits = isinstance(value, str | numbers.Real) and value in inner
        return _PASS if fits else f"one of {', '.join(map(str, inner))}"
    if hint is float:
        return _no_number(value)
    if hint is int:
        whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
        return _PASS if whole or _held_by_jax(value) else "a whole number"
    if hint is None or hint is type(None):
        return _PASS if value is None else "None"
    if origin is np.ndarray or hint is np.ndarray:
        return _no_numbers(value)
    kind = origin or hint
    if not isinstance(kind, type):
        return _PASS
    if getattr(kind, "_is_protocol", False):
        asked = [name for name in vars(kind) if not name.startswith("_")]
        return _PASS if all(hasattr(value, name) for name in asked) else f"of type {kind.__name__}"
    if kind is str:
        return _PASS if isinstance(value, str) else "text"
    if kind is os.PathLike:
        return _PASS if isinstance(value, os.PathLike) else "a path"
    if issubclass(kind, collections.abc.Mapping):
        if not isinstance(value, collections.abc.Mapping):
            return "a dictionary"
        own = inner[1] if len(inner) == 2 else Any
        return next((f"{m} at {_shown(k)}" for k, v in value.items() if (m := _missed(v, own))), "")
    if issubclass(kind, list | tuple) or kind in (
        collections.abc.Sequence,
        collections.abc.Iterable,
        collections.abc.Collection,
    ):
        return _no_list(value, kind, inner)
    if kind is collections.abc.Callable or kind.__module__ == "typing":
        return _PASS if callable(value) else "a function"
    return _PASS if isinstance(value, kind) else f"of type {kind.__name__}"


def _held_by_jax(value: Any) -> bool:
    """Whether it is a number that jax, or numpy, holds."""
    return getattr(value, "shape", None) == () and getattr(value, "dtype", None) is not None


def _no_number(value: Any) -> str:
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        return _PASS if math.isfinite(value) else "a finite number"
    return _PASS if _held_by_jax(value) else "a finite number"


def _no_numbers(value: Any) -> str:
    if isinstance(value, str | bytes):
        return "numbers"
    try:
        kind = getattr(value, "dtype", None) or np.asarray(value).dtype
    except (ValueError, TypeError):
        return "an array of numbers"
    return "an array of numbers" if getattr(kind, "kind", "f") in "OSUMm" else _PASS


def _no_list(value: Any, kind: type, inner: tuple[Any, ...]) -> str:
    if isinstance(value, str | bytes) or not isinstance(value, collections.abc.Iterable):
        return "a list" if not inner else f"a list, each {_word(inner[0])}"
    if not isinstance(value, list | tuple) or (kind is tuple and inner[1:] != (...,)):
        if kind is tuple and inner and ... not in inner:
            some = list(value)
            if len(some) != len(inner):
                return f"{len(inner)} values"
            return next((m for v, h in zip(some, inner, strict=True) if (m := _missed(v, h))), "")
        return _PASS
    own = inner[0] if inner else Any
    return next((f"a list, each {m}" for v in value if (m := _missed(v, own))), "")


def _odd(key: str, value: Any) -> str:
    """What k, ω, t and x should be and are not; ω may be complex, records may have holes."""
    if key not in ("k", "t", "x", "omega") or value is None:
        return _PASS
    some = np.asarray(value)
    if key != "omega" and np.iscomplexobj(some):
        return "real"
    return _PASS if key in ("t", "x") or np.isfinite(some).all() else "finite"


def _word(hint: Any) -> str:
    return getattr(hint, "__name__", str(hint))


def _shown(value: Any) -> str:
    text = repr(value)
    return printable(" ".join(text.split()), _LONGEST)
