"""Dispersion relations as functions: of a medium, of its grid, or given.

A relation gives ω of its branches at real k, how strongly a unit source at a point excites each,
and where it is known k at complex ω.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import difference_weights
from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import block_frequencies, wavenumber
from wavesim.planewave.eigenproblem import solve, spectral_form

Float = NDArray[Any]
Complex = NDArray[np.complex128]


class Relation(Protocol):
    """ω(k) of some waves."""

    def omega(self, k: Float) -> Any:
        """ω of each branch, shape (n, branches), rad/s, at k of shape (n,), rad/m.

        Complex ω − iγ where waves decay in time.
        """

    def weights(self, k: Float) -> Float:
        """Part of each branch in the response to a source of its own kind, (n, branches), –."""

    def wavenumber(self, omega: Complex) -> Complex:
        """k (Im k ≥ 0) at ω of shape (n,), rad/m; Im ω > 0 picks the outgoing one."""


@dataclass(frozen=True)
class Given:
    """A relation given as a function, all branches excited alike.

    Args:
        function: ω of k: arrays (n,) to (n,) or (n, branches), rad/m to rad/s; complex ω − iγ
            where waves decay in time.
    """

    function: Callable[[Float], Any]

    def omega(self, k: Float) -> Float:
        """ω of each branch."""
        found = np.asarray(self.function(k))
        return found[:, None] if found.ndim == 1 else found

    def weights(self, k: Float) -> Float:
        """All branches alike."""
        size = self.omega(k).shape
        return np.full(size, 1 / size[1])

    def wavenumber(self, omega: Complex) -> Complex:
        """Not known."""
        raise ValueError("a relation given as a function of k has no k(ω) of its own")


@dataclass(frozen=True)
class OfMedium:
    """Waves of one block of a medium, the source and the record on its first component.

    Args:
        medium: the medium.
        block: one of its family's blocks.
        bar: with a bar, its exact semi-discrete relation: the medium's at k̃(k) of the bar's
            stencil, k̃ = (2/h) Σ c_j sin((j−½)kh).
    """

    medium: Medium
    block: Block
    bar: Bar | None = None

    def modified(self, k: Any) -> Any:
        """k̃(k) of the stencil, real or complex; k itself without a bar."""
        if self.bar is None:
            return k
        h = self.bar.spacing
        weights = difference_weights(self.bar.order)
        return sum(2 / h * c * np.sin((j - 0.5) * k * h) for j, c in enumerate(weights, 1))

    def stretch(self, k: Any) -> Any:
        """dk̃/dk = Σ (2j−1) c_j cos((j−½)kh); 1 without a bar."""
        if self.bar is None:
            return np.ones_like(k)
        h = self.bar.spacing
        weights = difference_weights(self.bar.order)
        return sum((2 * j - 1) * c * np.cos((j - 0.5) * k * h) for j, c in enumerate(weights, 1))

    def omega(self, k: Float) -> Any:
        """ω of each branch, ascending; ω − iγ of a medium with losses, Ω(ω) = ω₀(k̃(k))."""
        lossless = block_frequencies(self.medium, self.block, self.modified(np.asarray(k)))
        return self.medium.damping.lossy(lossless)

    def weights(self, k: Float) -> Float:
        """Left times right eigenvector on the first component."""
        scaled = np.asarray(self.modified(np.asarray(k))) * self.medium.length_scale
        modes = solve(spectral_form(self.medium, self.block), scaled)
        return np.asarray((modes.left * modes.right)[:, 0].real)

    def wavenumber(self, omega: Complex) -> Complex:
        """k(ω) in the limit Γ → 0; with a bar, solved for its stencil by Newton's method."""
        exact = wavenumber(self.medium, self.block.sector, np.asarray(omega))
        if self.bar is None:
            return exact
        k = exact.copy()
        for _ in range(30):
            k = k - (self.modified(k) - exact) / self.stretch(k)
        return np.asarray(k)
