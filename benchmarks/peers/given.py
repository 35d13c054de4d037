"""What a peer is handed, ready-made: ẏ = A y + g s(t), scaled, and for leapfrogs q̈ = L q."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp


class Given:
    """A problem, of the arrays of ``problems.for_peers``, which are its attributes."""

    def __init__(self, arrays: Mapping[str, Any]) -> None:
        self._arrays = {name: np.asarray(array) for name, array in arrays.items()}

    def __getattr__(self, name: str) -> Any:
        array = self._arrays[name]
        return array if array.ndim else array.item()

    @cached_property
    def A(self) -> sp.csr_array:
        """The first-order matrix."""
        return self._matrix("A")

    @cached_property
    def L(self) -> sp.csr_array:
        """The second-order matrix of a bar without losses."""
        return self._matrix("L")

    def _matrix(self, name: str) -> sp.csr_array:
        parts = (self._arrays[f"{name}_{part}"] for part in ("data", "indices", "indptr"))
        n = len(self._arrays[f"{name}_indptr"]) - 1
        return sp.csr_array(tuple(parts), shape=(n, n))

    def signal(self, t: Any) -> Any:
        """s(t), a Ricker pulse."""
        u = (self.peak * (t - self.delay)) ** 2
        return (1 - 2 * u) * np.exp(-u)

    def driven(self, per_frame: int, frames: int) -> Any:
        """h² s at the steps of a leapfrog, for as long as the pulse acts."""
        h = self.interval / per_frame
        count = min(int(self.quiet_from / h) + 1, per_frame * (frames - 1))
        return h**2 * self.signal(h * np.arange(count))
