"""Dual numbers: arrays that carry their derivatives through formulas written for numpy.

    f(x + Σ_i ε_i x_i) = f(x) + Σ_i ε_i f′(x) x_i,    ε_i ε_j = 0,

so that what is worked out on them has exact derivatives. Of a matrix A, with its inverse and its
eigenvectors V of eigenvalues λ,

    dA⁻¹ = −A⁻¹ dA A⁻¹,    dλ = diag M,    dV = V (M_ij/(λ_j − λ_i))_i≠j,    M = V⁻¹ dA V.

What has no rule here raises TypeError: no derivative is ever left out in silence.

Griewank & Walther, Evaluating Derivatives (2008), chapter 3; Magnus, Econom. Theory 1, 179 (1985).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

# Derivatives of a function of one or two numbers, from its value and its arguments.
_PARTIALS: dict[str, Callable[..., tuple[Any, ...]]] = {
    "add": lambda f, a, b: (1.0, 1.0),
    "subtract": lambda f, a, b: (1.0, -1.0),
    "multiply": lambda f, a, b: (b, a),
    "divide": lambda f, a, b: (1 / b, -f / b),
    "power": lambda f, a, b: (b * a ** (b - 1),),  # of numbers as exponents
    "negative": lambda f, a: (-1.0,),
    "sqrt": lambda f, a: (0.5 / f,),
    "exp": lambda f, a: (f,),
    "expm1": lambda f, a: (f + 1,),
    "wofz": lambda f, a: (2j / np.sqrt(np.pi) - 2 * a * f,),
}
_PLAIN = {"equal", "not_equal", "less", "less_equal", "greater", "greater_equal", "isfinite"}
_LINEAR = {
    "block", "broadcast_to", "concatenate", "diag", "expand_dims", "stack", "sum", "swapaxes",
    "where", "zeros_like",
}  # fmt: skip
_OF_SHAPE = {"ones_like", "shape", "size"}


class Dual(np.lib.mixins.NDArrayOperatorsMixin):
    """An array with its derivatives.

    Args:
        value: the array, or a number.
        slopes: its derivatives by p parameters, shape (p, …).
    """

    def __init__(self, value: Any, slopes: Any) -> None:
        self.value, self.slopes = np.asarray(value), np.asarray(slopes)

    shape = property(lambda self: self.value.shape)
    ndim = property(lambda self: self.value.ndim)
    dtype = property(lambda self: self.value.dtype)
    real = property(lambda self: Dual(self.value.real, self.slopes.real))

    def __len__(self) -> int:
        return len(self.value)

    def __float__(self) -> float:
        return float(self.value)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __hash__(self) -> int:
        return hash(float(self))

    def __getitem__(self, key: Any) -> Dual:
        return Dual(self.value[key], self.slopes[_behind(key)])

    def __setitem__(self, key: Any, other: Any) -> None:
        self.value[key] = value_of(other)
        ndim = np.ndim(self.value[key])
        self.slopes[_behind(key)] = other._aligned(ndim) if isinstance(other, Dual) else 0.0

    def _aligned(self, ndim: int) -> Any:
        """Slopes for an array of so many axes: from behind, the parameters before all others."""
        ones = (1,) * (ndim - self.ndim)
        return self.slopes.reshape(len(self.slopes), *ones, *self.shape)

    def __format__(self, how: str) -> str:
        return format(float(self), how)

    def copy(self) -> Dual:
        """Its own arrays."""
        return Dual(self.value.copy(), self.slopes.copy())

    def reshape(self, *shape: int) -> Dual:
        """In another shape."""
        value = self.value.reshape(*shape)
        return Dual(value, self.slopes.reshape(len(self.slopes), *value.shape))

    def transpose(self, *axes: int) -> Dual:
        """With its axes in another order."""
        return Dual(self.value.transpose(*axes), self.slopes.transpose(0, *(1 + i for i in axes)))

    def __array_ufunc__(self, ufunc: Any, method: str, *given: Any, out: Any = None) -> Any:
        values, name = [value_of(one) for one in given], ufunc.__name__
        if method != "__call__" or not (out is None or isinstance(out[0], Dual)):
            return NotImplemented
        if name == "matmul" and any(isinstance(one, Dual) and one.ndim < 2 for one in given):
            return NotImplemented  # slopes of a vector are a matrix
        f = ufunc(*values)
        if name in _PLAIN:
            return f
        ndim = max(np.ndim(one) for one in values)
        slopes: Any = 0.0
        for i, one in enumerate(given):
            if not isinstance(one, Dual):
                continue
            d = one._aligned(ndim)
            if name == "matmul":
                slopes = slopes + (values[0] @ d if i else d @ values[1])
            elif name == "conjugate":
                slopes = np.conj(d)
            elif name in _PARTIALS:
                slopes = slopes + _PARTIALS[name](f, *values)[i] * d
            else:
                return NotImplemented
        if slopes[0].shape != np.shape(f):
            slopes = slopes + np.zeros(np.shape(f))
        found = Dual(f, slopes)
        if out is None:
            return found
        out[0][...] = found
        return out[0]

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        name = function.__name__
        if name in _OF_SHAPE:
            return function(*_mapped(args, value_of), **kwargs)
        if name in _LINEAR:
            each = [function(*_tangents(args, i), **kwargs) for i in range(len(self.slopes))]
            return Dual(function(*_mapped(args, value_of), **kwargs), np.stack(each))
        if name == "einsum":  # by each of its factors
            text, *parts = args
            values = [value_of(one) for one in parts]
            carrying = [at for at, one in enumerate(parts) if isinstance(one, Dual)]
            ways = [
                [
                    function(text, *values[:at], slope, *values[at + 1 :])
                    for slope in parts[at].slopes
                ]
                for at in carrying
            ]
            return Dual(function(text, *values), np.sum(ways, axis=0))
        if name in ("inv", "solve", "eig"):
            return globals()[f"_{name}"](*args)
        return NotImplemented


def value_of(x: Any) -> Any:
    """An array without its derivatives."""
    return x.value if isinstance(x, Dual) else x


def parameters(values: Any) -> list[Dual]:
    """Numbers, each a parameter that derivatives are taken by."""
    return [Dual(x, row) for x, row in zip(values, np.eye(len(values)), strict=True)]


def _behind(key: Any) -> Any:
    """An index behind that of the parameters."""
    return (slice(None), *key) if isinstance(key, tuple) else (slice(None), key)


def _mapped(args: Any, change: Callable[[Any], Any]) -> Any:
    if isinstance(args, tuple | list):
        return type(args)(_mapped(one, change) for one in args)
    return change(args)


def _tangents(args: Any, i: int) -> Any:
    """Arguments by their derivatives; numbers that are no indices have none."""

    def of(one: Any) -> Any:
        if isinstance(one, Dual):
            return one.slopes[i]
        told = isinstance(one, float | complex) or getattr(one, "dtype", np.dtype(int)).kind in "fc"
        return 0 * one if told else one

    return _mapped(args, of)


def _inv(a: Any) -> Dual:
    inverse = np.linalg.inv(a.value)
    return Dual(inverse, -inverse @ a.slopes @ inverse)


def _solve(a: Any, b: Any) -> Dual:
    x = np.linalg.solve(value_of(a), value_of(b))
    right = b.slopes if isinstance(b, Dual) else np.zeros((len(a.slopes), *b.shape))
    if isinstance(a, Dual):
        right = right - a.slopes @ x
    return Dual(x, np.linalg.solve(value_of(a), right))


def _eig(a: Any) -> tuple[Dual, Dual]:
    values, V = np.linalg.eig(a.value)
    M = np.linalg.solve(V, a.slopes @ V)
    apart = values[..., None, :] - values[..., :, None]
    own = np.eye(values.shape[-1], dtype=bool)
    mixed = np.where(own, 0.0, M / np.where(own, 1.0, apart))
    return Dual(values, np.diagonal(M, axis1=-2, axis2=-1)), Dual(V, V @ mixed)
