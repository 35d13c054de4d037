"""One cross-section of a bar in the frequency domain: coefficients of a block, and y′ = A(ω) y.

In SI, with I_φ = ρβ, I_B = ργ and exp(−iωt), a block obeys

    −ω² ι I_φ φ = ∂ₓσ + k,    σ = m (C_φφ φ′ − C_φB B),
    −ω² ι I_B B = m (C_Bφ φ′ − C_BB B) + ∂ₓV + Π,    V = m Γ ∂ₓB,

with the loss law's m and ι (material/damping). Where Γ is kept the state is v = −iω(φ, B) and
f = −(σ, V). With Γ → 0 the micro-curvature follows the rotation,

    B = X (C_Bφ φ′ + Π/m),  X = (C_BB − Ω² I_B)⁻¹,    σ = 𝒟 φ′ − C_φB X Π,
    𝒟 = m (C_φφ − C_φB X C_Bφ),

and v = −iωφ, f = −σ are one number each: a wave of k² = ι I_φ ω²/𝒟 and impedance Z = k𝒟/ω, f = Zv.
The mean energy flux is ½ Re f*v. Lengths are in l, times in τ, forces in their units of a reference
medium, and v and f are multiplied by √z and 1/√z, z a reference impedance near that of the bar.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from wavesim.material.damping import Damping
from wavesim.material.medium import Medium
from wavesim.material.sectors import Block, scales
from wavesim.material.wave_equations import CURVATURES, ROTATIONS, flux_form


@dataclass(frozen=True)
class Units:
    """What one unit is in SI: m, s, 1/m, N·m/m² (σ), N (V), all of a reference medium."""

    length: float
    time: float
    curvature: float
    moment: float

    @property
    def double_moment(self) -> float:
        """Unit of V, N: that of σ over that of B, so that fB and σφ are one energy."""
        return self.moment / self.curvature


def units_of(medium: Medium) -> Units:
    """Units of a medium: l, τ, 1/(r l), ρβ l/τ²."""
    own = scales(medium)
    return Units(own.length, own.time, own.curvature, float(own.moment * own.length))


@dataclass(frozen=True)
class Section:
    """Coefficients of one block in one medium, in the units of a reference.

    Attributes:
        inertia_p, inertia_b: I_φ, I_B.
        c_pp, c_pb, c_bp, c_bb, gamma: shapes (p, p), (p, b), (b, p), (b, b), (b, b).
        damping: the loss law; frequency: what one unit of it is, rad/s.
        kept: whether Γ is kept.
        impedance: z of each unknown, shape (n,).
    """

    inertia_p: float
    inertia_b: float
    c_pp: Any
    c_pb: Any
    c_bp: Any
    c_bb: Any
    gamma: Any
    damping: Damping
    frequency: float
    kept: bool
    impedance: Any = None

    @property
    def rotations(self) -> int:
        """p, how many rotations the block has: 0 or 1."""
        return len(self.c_pp)

    @property
    def size(self) -> int:
        """n, how many pairs of waves: p + b with Γ, p without."""
        return self.rotations + (len(self.c_bb) if self.kept else 0)

    @cached_property
    def natural_impedance(self) -> Any:
        """√(I_φ C_φφ) and √(I_B Γ_jj), shape (n,): what z is made of."""
        own = np.sqrt(self.inertia_p * np.diag(self.c_pp))
        if not self.kept:
            return own
        return np.concatenate([own, np.sqrt(self.inertia_b * np.diag(self.gamma))])

    def losses(self, omega: Any) -> tuple[Any, Any]:
        """(m, ι) at scaled ω, shape of omega each."""
        return self.damping.modulus(omega * self.frequency), self.damping.inertia(
            omega * self.frequency
        )


def section(medium: Medium, block: Block, units: Units, kept: bool) -> Section:
    """Coefficients of a block in a medium, in given units; z is left to the caller."""
    flux = flux_form(medium)
    own = medium.branch_length**2 * medium.contact_density
    rotation, curvature = block.weights(ROTATIONS), block.weights(CURVATURES)
    inertia = units.moment * units.time**2 / units.length
    per_pp = own / (units.length * units.moment)
    per_pb = own * units.curvature / units.moment
    per_bb = own * units.curvature**2 * units.length / units.moment
    return Section(
        inertia_p=medium.density * medium.beta / inertia,
        inertia_b=medium.density * medium.gamma * units.curvature**2 / inertia,
        c_pp=per_pp * (rotation @ flux.C_phi_phi @ rotation.T),
        c_pb=per_pb * (rotation @ flux.C_phi_B @ curvature.T),
        c_bp=per_pb * (curvature @ flux.C_B_phi @ rotation.T),
        c_bb=per_bb * (curvature @ flux.C_B_B @ curvature.T),
        gamma=per_bb / units.length**2 * (curvature @ flux.Gamma @ curvature.T),
        damping=medium.damping,
        frequency=1 / units.time,
        kept=kept,
    )


def with_impedance(one: Section, impedance: Any) -> Section:
    """The same with a reference impedance z, shape (n,)."""
    return replace(one, impedance=impedance)


@dataclass(frozen=True)
class Limit:
    """Γ → 0 at each ω: X (N, b, b), 𝒟 (N,), C_φB X (N, b), X C_Bφ (N, b), m and ι (N,)."""

    X: Any
    D: Any
    pX: Any
    Xp: Any
    modulus: Any
    inertia: Any


def limit(one: Section, omega: Any) -> Limit:
    """The micro-curvature eliminated; omega (N,), scaled, complex."""
    m, iota = one.losses(omega)
    square = omega**2 * iota / m
    X = np.linalg.inv(one.c_bb - square[:, None, None] * one.inertia_b * np.eye(len(one.c_bb)))
    if not one.rotations:
        empty = np.zeros((len(omega), len(one.c_bb)))
        return Limit(X, np.zeros(len(omega)), empty, empty, m, iota)
    pX, Xp = (one.c_pb @ X)[:, 0, :], (X @ one.c_bp)[:, :, 0]
    return Limit(X, m * (one.c_pp[0, 0] - pX @ one.c_bp[:, 0]), pX, Xp, m, iota)


def halves(one: Section, omega: Any) -> tuple[Any, Any]:
    """P and Q of e′ = P o, o′ = Q e, e = (v_φ, f_B), o = (f_φ, v_B); A is odd under x → −x.

    Args:
        one: a section with its impedance.
        omega: scaled, shape (N,), complex.

    Returns:
        Shapes (N, n, n), weighted by √z.
    """
    p, n = one.rotations, one.size
    P = np.zeros((len(omega), n, n), dtype=complex)
    Q = np.zeros_like(P)
    at = 1j * omega
    if not one.kept:
        local = limit(one, omega)
        P[:, 0, 0] = at / local.D
        Q[:, 0, 0] = at * local.inertia * one.inertia_p
    else:
        m, iota = one.losses(omega)
        relaxed, unit = one.c_bb, np.eye(len(one.c_bb))
        if p:
            relaxed = relaxed - one.c_bp @ one.c_pb / one.c_pp
            P[:, 0, 0] = at / (m * one.c_pp[0, 0])
            P[:, 0, 1:] = one.c_pb / one.c_pp
            P[:, 1:, 0] = -one.c_bp[:, 0] / one.c_pp[0, 0]
            Q[:, 0, 0] = at * iota * one.inertia_p
        dynamic = m[:, None, None] * relaxed
        dynamic -= (omega**2 * iota * one.inertia_b)[:, None, None] * unit
        P[:, p:, p:] = -(1j / omega)[:, None, None] * dynamic
        Q[:, p:, p:] = (at / m)[:, None, None] * np.linalg.inv(one.gamma)
    even, odd = weights(one)
    return P * (even[:, None] / odd), Q * (odd[:, None] / even)


def weights(one: Section) -> tuple[Any, Any]:
    """By what e and o are multiplied: √z for a v, 1/√z for an f."""
    root = np.sqrt(one.impedance)
    even, odd = 1 / root, root.copy()
    even[: one.rotations], odd[: one.rotations] = root[: one.rotations], 1 / root[: one.rotations]
    return even, odd


def to_vf(one: Section, even: Any, odd: Any) -> tuple[Any, Any]:
    """(v, f) from (e, o), along axis 1."""
    p = one.rotations
    return (
        np.concatenate([even[:, :p], odd[:, p:]], axis=1),
        np.concatenate([odd[:, :p], even[:, p:]], axis=1),
    )


def generator(one: Section, omega: Any) -> Any:
    """A of y′ = A y, y = (√z v, f/√z), shape (N, 2n, 2n)."""
    n, p = one.size, one.rotations
    P, Q = halves(one, omega)
    place_even = [*range(p), *range(n + p, 2 * n)]
    place_odd = [*range(n, n + p), *range(p, n)]
    A = np.zeros((len(omega), 2 * n, 2 * n), dtype=complex)
    A[np.ix_(range(len(omega)), place_even, place_odd)] = P
    A[np.ix_(range(len(omega)), place_odd, place_even)] = Q
    return A
