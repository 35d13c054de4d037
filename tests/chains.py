"""Relations of classical waves in closed form, from outside the model of the program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.records.relations import Complex, Float


def outgoing(k: Any) -> Complex:
    """The root of ±k that decays towards +x."""
    return np.asarray(np.where(np.imag(k) < 0, -k, k))


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


@dataclass(frozen=True)
class MassInMass:
    """Chain of masses m₁, each with a mass m₂ on a spring inside, recorded on m₁.

        4 sin²(ka/2) K = m(ω) ω²,    m(ω) = m₁ + m₂ ω₂²/(ω₂² − ω²),  ω₂² = k₂/m₂

    (Huang, Sun & Huang, Int. J. Eng. Sci. 47, 610 (2009).) A gap where m(ω) < 0 and above.

    Args:
        spacing: a, m.
        spring, inner_spring: K and k₂, N/m.
        mass, inner_mass: m₁ and m₂, kg.
    """

    spacing: float
    spring: float
    mass: float
    inner_spring: float
    inner_mass: float

    def _squares(self, k: Float) -> tuple[Float, Float]:
        stiff = 4 * self.spring * np.sin(np.asarray(k) * self.spacing / 2) ** 2 / self.mass
        inner, ratio = self.inner_spring / self.inner_mass, self.inner_mass / self.mass
        half = (stiff + inner * (1 + ratio)) / 2
        # The smaller root from the product of both, which loses nothing at long waves.
        upper = half + np.sqrt(half**2 - stiff * inner)
        return np.stack([stiff * inner / upper, upper], axis=-1), np.full_like(stiff, inner)

    def omega(self, k: Float) -> Float:
        """Acoustic and optical branch."""
        return np.sqrt(self._squares(k)[0])

    def weights(self, k: Float) -> Float:
        """Part of each mode on the outer mass: 1/(1 + (m₂/m₁)(ω₂²/(ω₂² − ω²))²)."""
        squares, inner = self._squares(k)
        ratio = inner[:, None] / (inner[:, None] - squares)
        return 1 / (1 + self.inner_mass / self.mass * ratio**2)

    def wavenumber(self, omega: Complex) -> Complex:
        """k = (2/a) arcsin √(m(ω) ω²/4K)."""
        square = np.asarray(omega, complex) ** 2
        inner = self.inner_spring / self.inner_mass
        effective = self.mass + self.inner_mass * inner / (inner - square)
        return outgoing(
            2 / self.spacing * np.arcsin(np.sqrt(effective * square / (4 * self.spring)))
        )
