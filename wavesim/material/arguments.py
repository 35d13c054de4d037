"""What a caller gives, held to type hints: one kind of error, that names key, value and remedy.

A name that is not known, one that is missing, a value of another type, a number that is not finite:
ValueError for all, as for a value out of its range. What jax holds is let through.
"""

from __future__ import annotations

import builtins
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
# Whole numbers beyond are none that numpy holds.
_LARGEST = 2**63
# What waves are asked for at, whose squares are taken; and what is real.
_WAVE, _LARGEST_WAVE = ("k", "omega"), 1e100
_REAL = ("k", "t", "x", "sent", "received", "source", "input")
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
                    raise ValueError(f"{key} = {shown(value)}: must be {wanted}")
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
                found[key] = eval(hint, {}, _Known(space)) if isinstance(hint, str) else hint
            except (NameError, TypeError, AttributeError):
                continue
        return found


class _Known(dict[str, Any]):
    """Names of a module; what it does not have may be anything."""

    def __missing__(self, name: str) -> Any:
        return getattr(builtins, name, Any)


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
    if hint is bool:
        return _PASS if isinstance(value, bool | np.bool_) else "True or False"
    if hint is int:
        whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
        return _PASS if whole and abs(value) < _LARGEST else "a whole number"
    if hint is None or hint is type(None):
        return _PASS if value is None else "None"
    if origin is np.ndarray or hint is np.ndarray:
        if "bool" in repr(inner):
            return _PASS
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
        key, own = inner if len(inner) == 2 else (Any, Any)
        odd = next((k for k in value if _missed(k, key)), None)
        if odd is not None:
            return f"a dictionary whose keys are {_word(key)}, not {shown(odd)}"
        return next((f"{m} at {shown(k)}" for k, v in value.items() if (m := _missed(v, own))), "")
    if issubclass(kind, list | tuple) or kind in (
        collections.abc.Sequence,
        collections.abc.Iterable,
        collections.abc.Collection,
    ):
        return _no_list(value, kind, inner)
    if kind is collections.abc.Callable or kind.__module__ == "typing":
        return _PASS if callable(value) else "a function"
    return _PASS if isinstance(value, kind) else f"of type {kind.__name__}"


def real(value: Any) -> bool:
    """Whether it is a finite real number, or an array of them, which jax may hold; no bool."""
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        try:
            return math.isfinite(value)
        except OverflowError:  # a whole number of hundreds of digits
            return False
    kind = getattr(getattr(value, "dtype", None), "kind", "O")
    if isinstance(value, np.ndarray):
        return kind in "fiu" and bool(np.isfinite(value).all())
    return hasattr(value, "shape") and kind not in "bcOSUMm"


def _no_number(value: Any) -> str:
    return _PASS if real(value) and getattr(value, "shape", ()) == () else "a finite number"


def _no_numbers(value: Any) -> str:
    if isinstance(value, str | bytes):
        return "numbers"
    try:
        kind = getattr(value, "dtype", None) or np.asarray(value).dtype
    except (ValueError, TypeError):
        return "an array of numbers"
    return "an array of numbers" if getattr(kind, "kind", "f") in "bOSUMm" else _PASS


def _no_list(value: Any, kind: type, inner: tuple[Any, ...]) -> str:
    wanted = f"a list, each {_word(inner[0])}" if inner else "a list"
    if isinstance(value, str | bytes | collections.abc.Mapping):
        return wanted
    if kind is collections.abc.Iterable and isinstance(value, kind):
        return _PASS if hasattr(value, "__next__") else _no_elements(value, inner)
    if not hasattr(value, "__len__") or not hasattr(value, "__getitem__"):
        return wanted
    if getattr(value, "ndim", 1) != 1:
        return wanted
    if kind is tuple and inner and ... not in inner:
        if getattr(getattr(value, "dtype", None), "kind", "f") not in "iuf":
            return wanted
        if len(value) != len(inner):
            return f"{len(inner)} values"
        return next((m for v, h in zip(value, inner, strict=True) if (m := _missed(v, h))), "")
    return _no_elements(value, inner)


def _no_elements(value: Any, inner: tuple[Any, ...]) -> str:
    own = inner[0] if inner else Any
    if hasattr(value, "dtype") and own in (float, int):  # at once
        return _PASS if real(value) else f"a list, each {_word(own)}"
    if hasattr(value, "dtype") and own is not Any and value.dtype.kind not in "OU":
        return f"a list, each {_word(own)}"
    return next((f"a list, each {m}" for v in value if (m := _missed(v, own))), "")


def _odd(key: str, value: Any) -> str:
    """What k, ω, t, x and signals should be and are not; ω may be complex, records have holes."""
    if value is None or key not in (*_WAVE, *_REAL):
        return _PASS
    if key in _REAL and np.iscomplexobj(value):
        return "real"
    if key not in _WAVE or hasattr(value, "aval"):  # one that jax traces
        return _PASS
    wanted = _no_numbers(value)
    if wanted or np.ndim(value) > 1:
        return wanted or "a number, or a list of them"
    return (
        _PASS
        if (np.abs(np.asarray(value)).astype(float) < _LARGEST_WAVE).all()
        else f"finite, below {_LARGEST_WAVE:g}"
    )


def _word(hint: Any) -> str:
    return {float: "a number", int: "a whole number", str: "text"}.get(
        hint, getattr(hint, "__name__", str(hint))
    )


def shown(value: Any) -> str:
    """A value in a line of a message."""
    text = repr(value)
    return printable(" ".join(text.split()), _LONGEST)
