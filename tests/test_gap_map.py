"""Gap edges of many media at once, held against one medium at a time."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from wavesim import planewave
from wavesim.figures.sweep import sweep_figures
from wavesim.material.granular_equations import ROTATION, SPECTRAL_CLOSURES
from wavesim.material.medium import Medium
from wavesim.material.several_families import together
from wavesim.planewave.eigenproblem import spectral_form
from wavesim.planewave.gap_map import gap_map, room, table
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


def edge(found, side, name):
    return found[side].sel(gap=name).values


def width(found, name):
    return edge(found, "upper", name) - edge(found, "lower", name)


@pytest.mark.parametrize("closure", SPECTRAL_CLOSURES)
def test_a_map_holds_the_gaps_of_each_medium(closure):
    """Edges and the widest full gap, against planewave.gaps and full_gaps, to 1e-12."""
    ratios, radii = np.array([0.1, 0.5, 0.9]), np.array([4e-4, 6e-4])
    base = Medium(anisotropy=0.4, closure=closure)
    found = gap_map(base, ("particle_radius", radii), ("stiffness_ratio", ratios))
    for i, ratio in enumerate(ratios):
        for j, radius in enumerate(radii):
            one = dataclasses.replace(
                base, stiffness_ratio=float(ratio), particle_radius=float(radius)
            )
            for sector in ("longitudinal", "transverse2", "inplane"):
                for gap in planewave.gaps(one, sector):
                    assert edge(found, "lower", gap.name)[j, i] == pytest.approx(
                        gap.lower, rel=1e-12
                    )
                    assert edge(found, "upper", gap.name)[j, i] == pytest.approx(
                        gap.upper, rel=1e-12
                    )
            widest = max((b - a for a, b in planewave.full_gaps(one)), default=0.0)
            assert width(found, "full")[j, i] == pytest.approx(widest, rel=1e-9, abs=1e-6)


def test_a_gap_holds_a_band_where_the_medium_s_own_does():
    """By planewave.gaps and full_gaps of each medium, one by one."""
    ratios, stiffnesses = np.linspace(0.2, 0.9, 4), np.linspace(0.05, 0.4, 5)
    base = Medium(closure="consistent", anisotropy=0.2)
    found = gap_map(base, ("G_n_a", stiffnesses), ("stiffness_ratio", ratios))
    band = 2e3 * np.pi * 200, 2e3 * np.pi * 300
    inside = room(found, (2e5, 3e5)) >= 0
    held = {name: inside.sel(gap=name).values.T for name in ("RLB1", "RTB1", "full")}
    assert all(some.any() and not some.all() for some in held.values())
    for i, ratio in enumerate(ratios):
        for j, G in enumerate(stiffnesses):
            one = dataclasses.replace(base, stiffness_ratio=float(ratio), G_n_a=float(G))
            for name, sector in (("RLB1", "longitudinal"), ("RTB1", "transverse2")):
                gap = next(g for g in planewave.gaps(one, sector) if g.name == name)
                own = gap.lower <= band[0] and band[1] <= gap.upper
                assert held[name][i, j] == own
            full = planewave.full_gaps(one)
            assert held["full"][i, j] == any(a <= band[0] and band[1] <= b for a, b in full)


def test_a_map_is_drawn_with_a_panel_for_each_gap():
    axis = np.linspace(0.1, 0.9, 5)
    found = gap_map(Medium(), ("anisotropy", axis), ("stiffness_ratio", axis))
    found.attrs["band"] = 6.8e5, 7e5
    figure = sweep_figures(found)["gaps"]()
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    named = [f"width of {name}" for name in ("RLB1", "RLB2", "RTB1", "RTB2", "RSB")]
    assert titles == [*named, "widest full gap"]


@pytest.fixture(scope="module")
def both():
    """Of two families at once, over a parameter of both and one of translation alone."""
    medium = together(Medium(closure="consistent"), Medium(family="translation", K_n_a=1.2e7))
    x, y = ("anisotropy", np.array([0.0, 0.6])), ("K_n_r", np.array([5e5, 2e6, 1.2e7]))
    return gap_map(medium, x, y)


def test_a_map_of_two_families_holds_the_gaps_of_either(both):
    """Against planewave.gaps of each medium of its own family, and full_gaps of both; 1e-12."""
    for i, K in enumerate((5e5, 2e6, 1.2e7)):
        for j, a in enumerate((0.0, 0.6)):
            moved = Medium(family="translation", anisotropy=a, K_n_a=1.2e7, K_n_r=K)
            turned = Medium(closure="consistent", anisotropy=a)
            for one in (moved, turned):
                for sector in one.family.sectors:
                    for gap in planewave.gaps(one, sector):
                        assert edge(both, "lower", gap.name)[j, i] == pytest.approx(
                            gap.lower, rel=1e-12
                        )
                        assert edge(both, "upper", gap.name)[j, i] == pytest.approx(
                            gap.upper, rel=1e-12
                        )
            full = {f"{one.family.name}-full": one for one in (moved, turned)}
            for name, one in (full | {"full": together(turned, moved)}).items():
                widest = max((b - a for a, b in planewave.full_gaps(one)), default=0.0)
                assert width(both, name)[j, i] == pytest.approx(widest, rel=1e-9, abs=1e-6)
    assert width(both, "full").max() > 0


def test_a_map_of_two_families_names_them(both):
    assert both["family"].sel(gap="DSB") == "translation"
    titles = [axes.get_title() for axes in sweep_figures(both)["gaps"]().axes]
    assert {"width of RLB1", "width of DLB1", "widest full gap, translation"} <= set(titles)
    header, _ = table(both)
    assert header[1] == "K_n_r (N/m)"
    assert "DTB2_upper (kHz)" in header


def test_bad_axes_are_refused():
    with pytest.raises(ValueError, match="parameter 'eta': must be one of anisotropy"):
        gap_map(Medium(), ("eta", [0.1]), ("anisotropy", [0.1]))
    with pytest.raises(ValueError, match="both axes"):
        gap_map(Medium(), ("anisotropy", [0.1]), ("anisotropy", [0.1]))
    with pytest.raises(ValueError, match="anisotropy = 3: must be between -1 and 2"):
        gap_map(Medium(), ("anisotropy", [0.1, 3.0]), ("stiffness_ratio", [0.1]))


def test_a_map_as_a_table_keeps_each_medium_in_one_row():
    ratios, values = np.array([0.2, 0.8]), np.array([0.0, 0.3, 0.6])
    found = gap_map(Medium(), ("anisotropy", values), ("stiffness_ratio", ratios))
    header, rows = table(found)
    assert header[:3] == ["anisotropy", "stiffness_ratio", "RLB1_lower (kHz)"]
    assert header[-2:] == ["full_lower (kHz)", "full_upper (kHz)"]
    row = rows[3]
    assert row[:2].tolist() == [0.3, 0.8]
    gap = planewave.gaps(Medium(anisotropy=0.3, stiffness_ratio=0.8), "transverse2")[1]
    edges = [row[header.index(f"RTB2_{side} (kHz)")] for side in ("lower", "upper")]
    kHz = 2e3 * np.pi
    assert edges == pytest.approx([gap.lower / kHz, gap.upper / kHz], rel=1e-12)
