"""Relations of classical waves in closed form, beside ``wavesim.records.relations.MassInMass``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wavesim.records.relations import Complex, Float, outgoing


@dataclass(frozen=True)
class Beam:
    """Bernoulli–Euler beam: ω = c k², no gap (Graff, Wave Motion in Elastic Solids, §3.1).

    Args:
        stiffness: c = √(EI/ρA), m²/s.
    """

    stiffness: float

    def omega(self, k: Float) -> Float:
        """ω = c k²."""
        return (self.stiffness * np.asarray(k) ** 2)[:, None]

    def weights(self, k: Float) -> Float:
        """One branch."""
        return np.ones((len(k), 1))

    def wavenumber(self, omega: Complex) -> Complex:
        """k = √(ω/c), the travelling one; ik is the other."""
        return outgoing(np.sqrt(np.asarray(omega, complex) / self.stiffness))


@dataclass(frozen=True)
class Diatomic:
    """Chain of alternating masses m₁, m₂ on equal springs K, recorded on m₁, a apart.

        m₁m₂ω⁴ − 2K(m₁ + m₂)ω² + 4K² sin²(ka/2) = 0

    (Brillouin, Wave Propagation in Periodic Structures, ch. IV.)

    Args:
        spacing: a, between two masses m₁, m.
        spring: K, N/m.
        mass, other_mass: m₁ and m₂, kg.
    """

    spacing: float
    spring: float
    mass: float
    other_mass: float

    def _squares(self, k: Float) -> Float:
        half = self.spring * (1 / self.mass + 1 / self.other_mass)
        product = (
            4 * self.spring**2 * np.sin(np.asarray(k) * self.spacing / 2) ** 2
            / (self.mass * self.other_mass)
        )  # fmt: skip
        upper = half + np.sqrt(half**2 - product)
        return np.stack([product / upper, upper], axis=-1)

    def omega(self, k: Float) -> Float:
        """Acoustic and optical branch."""
        return np.sqrt(self._squares(k))

    def weights(self, k: Float) -> Float:
        """Part of each mode on m₁: d(ω²)/d(2K/m₁), (ω² − 2K/m₂)/(2ω² − 2K/m₁ − 2K/m₂)."""
        squares = self._squares(k)
        one, two = 2 * self.spring / self.mass, 2 * self.spring / self.other_mass
        return (squares - two) / (2 * squares - one - two)

    def wavenumber(self, omega: Complex) -> Complex:
        """k = (2/a) arcsin √((2K(m₁ + m₂)ω² − m₁m₂ω⁴)/4K²)."""
        square = np.asarray(omega, complex) ** 2
        inside = 2 * self.spring * (self.mass + self.other_mass) * square
        inside = inside - self.mass * self.other_mass * square**2
        return outgoing(2 / self.spacing * np.arcsin(np.sqrt(inside) / (2 * self.spring)))
