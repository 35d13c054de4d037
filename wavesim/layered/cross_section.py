"""One cross-section of a bar in the frequency domain: coefficients of a block, and y′ = A(ω) y.

In SI, with I_φ = ρβ, I_B = ργ and exp(−iωt), a block obeys

    −ω² ι I_φ φ = ∂ₓσ + k,    σ = m (C_φφ φ′ − C_φB B),
    −ω² ι I_B B = m (C_Bφ φ′ − C_BB B) + ∂ₓV + Π,    V = m Γ ∂ₓB,

with the loss law's m and ι (material/damping). Where Γ is kept the state is v = −iω(φ, B) and
f = −(σ, V). With Γ → 0 the micro-field follows the macro-field,

    B = X (C_Bφ φ′ + Π/m),  X = (C_BB − Ω² I_B)⁻¹,    σ = 𝒟 φ′ − C_φB X Π,
    𝒟 = m (C_φφ − C_φB X C_Bφ),

and v = −iωφ, f = −σ are one number each: a wave of k² = ι I_φ ω²/𝒟 and impedance Z = k𝒟/ω, f = Zv.
The mean energy flux is ½ Re f*v. Lengths are in l, times in τ, forces in their units of a reference
medium, and v and f are multiplied by √z and 1/√z, z a reference impedance near that of the bar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from wavesim.material.damping import Damping
from wavesim.material.dual import value_of
from wavesim.material.scaling import BlockCoefficients

_NEXT = 1 + 2e-15


@dataclass(frozen=True)
class Section:
    """One block in one medium, in the units of a reference; or in several, one behind another.

    Attributes:
        own: its coefficients, without m and ι; of several media of one loss law they begin with
            axes (media, 1), as does all that is made of them at N frequencies with (media, N).
        damping: the loss law; frequency: what one unit of it is, rad/s.
        kept: whether Γ is kept.
        impedance: z of each unknown, shape (n,).
    """

    own: BlockCoefficients
    damping: Damping
    frequency: float
    kept: bool
    impedance: Any = None

    @property
    def macro(self) -> int:
        """p, how many macro-fields the block has: 0 or 1."""
        return int(np.shape(self.own.c_pp)[-1])

    @property
    def size(self) -> int:
        """n, how many pairs of waves: p + b with Γ, p without."""
        return self.macro + (int(np.shape(self.own.c_bb)[-1]) if self.kept else 0)

    @cached_property
    def natural_impedance(self) -> Any:
        """√(I_φ C_φφ) and √(I_B Γ_jj), shape (n,): what z is made of."""
        of_phi = np.sqrt(self.own.i_phi * np.diag(self.own.c_pp))
        if not self.kept:
            return of_phi
        return np.concatenate([of_phi, np.sqrt(self.own.i_B * np.diag(self.own.gamma))])

    def losses(self, omega: Any) -> tuple[Any, Any]:
        """(m, ι) at scaled ω, shape of omega each."""
        return self.damping.modulus(omega * self.frequency), self.damping.inertia(
            omega * self.frequency
        )


def joined(sections: Sequence[Section]) -> Section:
    """Several sections of one loss law as one, shape (media, 1)."""
    names = [field.name for field in fields(BlockCoefficients)]
    own = {name: np.stack([getattr(one.own, name) for one in sections])[:, None] for name in names}
    return replace(sections[0], own=BlockCoefficients(**own))


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
    """The micro-field eliminated; omega (N,), scaled, complex."""
    own = one.own
    m, iota = one.losses(omega)
    square = _wide(omega**2 * iota / m) * _wide(own.i_B) * np.eye(np.shape(own.c_bb)[-1])
    # At a cutoff itself 𝒟 is infinite, and k = 0: taken a rounding beside it.
    at_cutoff = np.linalg.det(value_of(own.c_bb - square)) == 0
    square = np.where(_wide(at_cutoff), square * _NEXT, square)
    X = np.linalg.inv(own.c_bb - square)
    if not one.macro:
        empty = np.zeros(X.shape[:-1])
        return Limit(X, np.zeros(X.shape[:-2]), empty, empty, m, iota)
    pX, Xp = (own.c_pb @ X)[..., 0, :], (X @ own.c_bp)[..., 0]
    stiff = own.c_pp[..., 0, 0] - np.sum(pX * own.c_bp[..., 0], axis=-1)
    return Limit(X, m * stiff, pX, Xp, m, iota)


def _wide(values: Any) -> Any:
    """Numbers that multiply matrices."""
    return np.expand_dims(values, (-2, -1))


def halves(one: Section, omega: Any) -> tuple[Any, Any]:
    """P and Q of e′ = P o, o′ = Q e, e = (v_φ, f_B), o = (f_φ, v_B); A is odd under x → −x.

    Returns:
        Shapes (N, n, n), weighted by √z.
    """
    own, p, n = one.own, one.macro, one.size
    at = 1j * omega
    if not one.kept:
        local = limit(one, omega)
        P, Q = _wide(at / local.D), _wide(at * local.inertia * own.i_phi)
    else:
        shape = (*np.broadcast_shapes(np.shape(own.i_B), np.shape(omega)), n, n)
        m, iota = one.losses(omega)
        relaxed, unit = own.c_bb, np.eye(np.shape(own.c_bb)[-1])
        if p:
            relaxed = relaxed - own.c_bp @ own.c_pb / own.c_pp
        dynamic = _wide(m) * relaxed - _wide(omega**2 * iota * own.i_B) * unit
        # It carries derivatives if anything does.
        alike = dynamic + sum(np.sum(part) for part in (own.c_pp, own.gamma, own.i_phi))
        P, Q = (np.zeros_like(alike, dtype=complex, shape=shape) for _ in range(2))
        if p:
            P[..., 0, 0] = at / (m * own.c_pp[..., 0, 0])
            P[..., 0, 1:] = (own.c_pb / own.c_pp)[..., 0, :]
            P[..., 1:, 0] = -(own.c_bp / own.c_pp)[..., 0]
            Q[..., 0, 0] = at * iota * own.i_phi
        P[..., p:, p:] = -_wide(1j / omega) * dynamic
        Q[..., p:, p:] = _wide(at / m) * np.linalg.inv(own.gamma)
    even, odd = weights(one)
    return P * (even[:, None] / odd), Q * (odd[:, None] / even)


def weights(one: Section) -> tuple[Any, Any]:
    """By what e and o are multiplied: √z for a v, 1/√z for an f."""
    root = np.sqrt(one.impedance)
    even, odd = 1 / root, root.copy()
    even[: one.macro], odd[: one.macro] = root[: one.macro], 1 / root[: one.macro]
    return even, odd


def to_vf(one: Section, even: Any, odd: Any) -> tuple[Any, Any]:
    """(v, f) from (e, o), along axis 1."""
    p = one.macro
    return (
        np.concatenate([even[:, :p], odd[:, p:]], axis=1),
        np.concatenate([odd[:, :p], even[:, p:]], axis=1),
    )


def generator(one: Section, omega: Any) -> Any:
    """A of y′ = A y, y = (√z v, f/√z), shape (N, 2n, 2n)."""
    n, p = one.size, one.macro
    P, Q = halves(one, omega)
    place_even = np.r_[:p, n + p : 2 * n]
    place_odd = np.r_[n : n + p, p:n]
    A = np.zeros_like(P, shape=(*P.shape[:-2], 2 * n, 2 * n))
    A[..., place_even[:, None], place_odd] = P
    A[..., place_odd[:, None], place_even] = Q
    return A
