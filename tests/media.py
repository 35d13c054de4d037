"""Media for tests: random admissible ones, and the twelve equations as one matrix."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from wavesim.material.medium import Medium

MEDIUM = Medium(anisotropy=0.25)


def unit_wavenumber(medium):
    """Wavenumber of k̄ = 1."""
    return 2 * np.pi / float(medium.length_scale)


def _spread(low, high):
    """Positive numbers, even in their logarithm."""
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


def media(closure="consistent", a=(-1.0, 2.0), eta=(0.0, 2.0), G_n_g=None, **fixed):
    """Media with every parameter free within about a factor of ten of Table 1."""
    free = {
        "anisotropy": st.floats(*a),
        "stiffness_ratio": st.floats(*eta),
        "branch_length": _spread(3e-4, 3e-3),
        "particle_radius": _spread(2e-4, 1e-3),
        "contact_density": _spread(3e8, 3e9),
        "density": _spread(500.0, 5000.0),
        "G_n_a": _spread(0.5, 50.0),
        "G_n_r": _spread(0.5, 50.0),
        "G_n_g": _spread(1e-12, 5.0) if G_n_g is None else G_n_g,
    }
    free |= {name: st.just(value) for name, value in fixed.items()}
    return st.builds(Medium, closure=st.just(closure), **free)


# Where the printed equations are hyperbolic, with a gradient stiffness too small to matter: with
# more of it some of them are not (see test_planewave).
def printed_media(eta=(0.0, 1.0), G_n_g=None, **options):
    small = _spread(1e-12, 1e-6) if G_n_g is None else G_n_g
    return media("printed", a=(0.0, 1.0), eta=eta, G_n_g=small, **options)


def any_media(**options):
    return st.one_of(media("consistent", **options), printed_media(**options))


def twelve_by_twelve(medium, k):
    """K(k) of all twelve equations in SI, each field times the root of its inertia; ω² v = K v.

    Complex Hermitian where the closure is symmetric; shape (…, 12, 12) for k of shape (…). It
    shares no sector, block or scaled unknown with the program's own route. Returns K and the root.
    """
    flux = medium.flux_form()
    k = np.asarray(k)[..., None, None]
    K = np.zeros((*k.shape[:-2], 12, 12), dtype=complex)
    K[..., :3, :3] = k**2 * flux.C_phi_phi
    K[..., :3, 3:] = 1j * k * flux.C_phi_B
    K[..., 3:, :3] = -1j * k * flux.C_B_phi
    K[..., 3:, 3:] = flux.C_B_B + k**2 * flux.Gamma
    root = np.sqrt(np.concatenate([np.full(3, flux.m_phi), np.full(9, flux.m_B)]))
    return K / np.outer(root, root), root
