"""The truth that a synthetic record carries, as a relation: ω at any k, complex k at any ω.

Between the wavenumbers at which it is given, ω² is interpolated: it is an even, smooth function of
k, while ω itself has a corner at k = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from wavesim.records.record import Record, RecordError

Float = NDArray[Any]
Complex = NDArray[np.complex128]

# Of the spline through ω² at real k.
_DEGREE_AT_REAL_K = 7
# A polynomial that is continued to complex k is fitted over so many times its imaginary part.
_REACH = 2.5
_DEGREE = 10
_STEPS = 30
# What two degrees differ by, over k, where the continuation is believed.
_AGREE = 1e-4


@dataclass(frozen=True)
class Truth:
    """ω of each branch over k, as a record carries it.

    Attributes:
        k: from 0 on, even, shape (n,), rad/m.
        waves: ω, complex ω − iγ where waves decay, shape (n, branches), rad/s.
    """

    k: Float
    waves: Any

    @property
    def branches(self) -> int:
        """How many there are."""
        return int(self.waves.shape[1])

    def _mirrored(self) -> tuple[Float, Any]:
        inner = self.k > 0
        k = np.concatenate([-self.k[inner][::-1], self.k])
        return k, np.concatenate([self.waves[inner][::-1], self.waves]) ** 2

    def omega(self, k: Float) -> Any:
        """ω of each branch at k of shape (m,), rad/m; NaN beyond what is given; (m, branches)."""
        nodes, squares = self._mirrored()
        degree = min(_DEGREE_AT_REAL_K, (len(nodes) - 2) | 1)
        found = make_interp_spline(nodes, squares, degree)(np.clip(k, nodes[0], nodes[-1]))
        root = np.sqrt(found.astype(complex))
        root = np.where(root.real < 0, -root, root)
        outside = (np.abs(k) > self.k[-1] * (1 + 1e-9))[:, None]
        root = np.where(outside, np.nan, root)
        return root if np.iscomplexobj(self.waves) else root.real

    def wavenumber(self, omega: Complex) -> Complex:
        """k of the branch that passes near each ω + iσ, shape (m,); NaN where none does.

        Inside a gap the truth at real k says nothing.
        """
        found = [self._root(w) for w in np.asarray(omega, complex)]
        return np.array(found, complex)

    def _root(self, omega: complex) -> complex:
        best = complex(np.nan, np.nan)
        nodes, squares = self._mirrored()
        for branch in range(self.branches):
            real = self.waves[:, branch].real
            if not real.min() < omega.real < real.max():
                continue
            at = int(np.argmin(np.abs(real - omega.real)))
            slope = np.gradient(real, self.k)[at]
            if not slope:
                continue
            start = complex(self.k[at] + (omega - real[at]) / slope)
            reach = max(_REACH * abs(start.imag), 16 * (self.k[1] - self.k[0]))
            near = np.abs(nodes - start.real) <= reach
            roots = [
                _newton(nodes[near], squares[near, branch], omega**2, start, degree)
                for degree in (_DEGREE - 2, _DEGREE)
            ]
            if abs(roots[0] - roots[1]) < _AGREE * abs(roots[1]):
                best = roots[1]
        return best


def _newton(nodes: Float, values: Any, target: complex, start: complex, degree: int) -> complex:
    middle, scale = float(nodes.mean()), float(np.ptp(nodes)) / 2
    fit = np.polynomial.Polynomial(
        np.polynomial.polynomial.polyfit((nodes - middle) / scale, values, degree)
    )
    slope = fit.deriv()
    z = (start - middle) / scale
    for _ in range(_STEPS):
        step = (fit(z) - target) / slope(z)
        z -= step
        if abs(step) < 1e-14 * (1 + abs(z)):
            break
    return complex(middle + scale * z) if abs(z) < 2 else complex(np.nan, np.nan)


def truth_of(record: Record) -> Truth:
    """The truth that a record carries.

    Raises:
        RecordError: it carries none.
    """
    answer = record.answer or {}
    if "k" not in answer or "omega" not in answer:
        raise RecordError(
            "carries no truth (arrays truth_k and truth_omega): make one with wavesim synthesize"
        )
    k, omega = np.asarray(answer["k"], float), np.asarray(answer["omega"])
    omega = omega[:, None] if omega.ndim == 1 else omega
    if k.ndim != 1 or omega.shape[0] != len(k) or len(k) < 2 or (np.diff(k) <= 0).any():
        raise RecordError(
            f"truth_k of shape {k.shape} and truth_omega of shape {omega.shape}: must be (n,), "
            "ascending, and (n, branches)"
        )
    return Truth(k, omega)
