"""Gap edges of many media at once, held against one medium at a time."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from wavesim import planewave
from wavesim.material.medium import Medium
from wavesim.material.rotation_equations import ROTATION, SPECTRAL_CLOSURES
from wavesim.material.several_families import together
from wavesim.planewave.eigenproblem import spectral_form
from wavesim.planewave.gaps_of_many_media import all_edges, edge_families
from wavesim.planewave.many_media import block_forms


@pytest.mark.parametrize("closure", SPECTRAL_CLOSURES)
def test_a_family_has_the_coefficients_of_each_of_its_media(closure, rng):
    """Two routes: from four corner media, and from the equations. All ten parameters vary.

    Tolerance 1e-13 of the largest entry; measured 5e-15.
    """
    shape = (3, 4)
    ranges = {
        "anisotropy": (-1.0, 2.0),
        "stiffness_ratio": (0.0, 2.0),
        "branch_length": (5e-4, 2e-3),
        "particle_radius": (3e-4, 8e-4),
        "contact_density": (5e8, 2e9),
        "density": (1e3, 3e3),
        "G_n_a": (1.0, 9.0),
        "G_n_r": (1.0, 9.0),
        "G_n_g": (0.0, 9.0),
        "rotation_inertia": (1e-8, 1e-6),
        "curvature_inertia": (1e-15, 1e-13),
    }
    values = {name: rng.uniform(*ends, shape) for name, ends in ranges.items()}
    for block in ROTATION.blocks:
        family = block_forms(Medium(closure=closure, **values), block)
        for i in np.ndindex(shape):
            one = Medium(closure=closure, **{name: float(v[i]) for name, v in values.items()})
            form = spectral_form(one, block)
            for name in ("c_pp", "c_pb", "c_bp", "c_bb", "gamma"):
                expected = getattr(form, name)
                error = np.abs(getattr(family, name)[i] - expected).max(initial=0)
                assert error <= 1e-13 * np.abs(expected).max(initial=0)


def over(medium, **plane):
    """Lower and upper edges over a plane of two parameters, the first along the last axis."""
    (x, along), (y, up) = plane.items()
    family = dataclasses.replace(medium, **{x: np.array(along), y: np.array(up)[:, None]})
    shape = len(up), len(along)
    return [{n: np.broadcast_to(v, shape) for n, v in side.items()} for side in all_edges(family)]


@pytest.mark.parametrize("closure", SPECTRAL_CLOSURES)
def test_a_map_holds_the_gaps_of_each_medium(closure):
    """Edges and the widest full gap, against planewave.gaps and full_gaps, to 1e-12."""
    ratios, radii = np.array([0.1, 0.5, 0.9]), np.array([4e-4, 6e-4])
    base = Medium(anisotropy=0.4, closure=closure)
    lower, upper = over(base, particle_radius=radii, stiffness_ratio=ratios)
    for i, ratio in enumerate(ratios):
        for j, radius in enumerate(radii):
            one = dataclasses.replace(
                base, stiffness_ratio=float(ratio), particle_radius=float(radius)
            )
            for sector in ("longitudinal", "transverse2", "inplane"):
                for gap in planewave.gaps(one, sector):
                    assert lower[gap.name][i, j] == pytest.approx(gap.lower, rel=1e-12)
                    assert upper[gap.name][i, j] == pytest.approx(gap.upper, rel=1e-12)
            widest = max((b - a for a, b in planewave.full_gaps(one)), default=0.0)
            width = upper["full"][i, j] - lower["full"][i, j]
            assert width == pytest.approx(widest, rel=1e-9, abs=1e-6)


@pytest.fixture(scope="module")
def both():
    """Of two families at once, over a parameter of both and one of translation alone."""
    medium = together(Medium(closure="consistent"), Medium(family="translation", K_n_a=1.2e7))
    return medium, *over(medium, anisotropy=[0.0, 0.6], K_n_r=[5e5, 2e6, 1.2e7])


def test_a_map_of_two_families_holds_the_gaps_of_either(both):
    """Against planewave.gaps of each medium of its own family, and full_gaps of both; 1e-12."""
    _, lower, upper = both
    for i, K in enumerate((5e5, 2e6, 1.2e7)):
        for j, a in enumerate((0.0, 0.6)):
            moved = Medium(family="translation", anisotropy=a, K_n_a=1.2e7, K_n_r=K)
            turned = Medium(closure="consistent", anisotropy=a)
            for one in (moved, turned):
                for sector in one.family.sectors:
                    for gap in planewave.gaps(one, sector):
                        assert lower[gap.name][i, j] == pytest.approx(gap.lower, rel=1e-12)
                        assert upper[gap.name][i, j] == pytest.approx(gap.upper, rel=1e-12)
            full = {f"{one.family.name}-full": one for one in (moved, turned)}
            for name, one in (full | {"full": together(turned, moved)}).items():
                widest = max((b - a for a, b in planewave.full_gaps(one)), default=0.0)
                width = upper[name][i, j] - lower[name][i, j]
                assert width == pytest.approx(widest, rel=1e-9, abs=1e-6)
    assert (upper["full"] - lower["full"]).max() > 0


def test_edges_of_two_families_bear_their_names(both):
    assert edge_families(both[0])["DSB"] == "translation"


def test_bad_parameters_are_refused():
    with pytest.raises(ValueError, match="anisotropy = 3: must be between -1 and 2"):
        over(Medium(), anisotropy=[0.1, 3.0], stiffness_ratio=[0.1])
