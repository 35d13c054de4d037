"""The wave equations (26)–(37) as the paper prints them against the flux form, and their blocks.

The equations are transcribed here term by term, from docs/physics.md section 3, as sympy
expressions in the fields' derivatives; the program assembles its matrices from the tensors and a
table instead. Both are divided by l²N_p.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from wavesim.material.family import known_field
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.material.scaling import block_coefficients, scales

a, el = sp.symbols("a l")
b1, b2, p1, p2, w1, w2 = sp.symbols("b1 b2 p1 p2 w1 w2")
quarter = el**2 / 4

phi = {n: sp.Symbol(n) for n in ROTATION.macro}
B = {n: sp.Symbol(n) for n in ROTATION.micro}
# Derivatives along x₁: D(·) is ′, DD(·) is ″.
first = {s: sp.Symbol(f"{s}_x") for s in (*phi.values(), *B.values())}
second = {s: sp.Symbol(f"{s}_xx") for s in (*phi.values(), *B.values())}


def D(symbol: sp.Symbol) -> sp.Symbol:
    return first[symbol]


def DD(symbol: sp.Symbol) -> sp.Symbol:
    return second[symbol]


def printed_equations() -> dict[str, sp.Expr]:
    """Left-hand sides of (26)–(37); the right-hand sides are m_φ φ̈ and m_B B̈."""
    f1, f2, f3 = phi["phi1"], phi["phi2"], phi["phi3"]
    B11, B12, B13 = B["B11"], B["B12"], B["B13"]
    B21, B22, B23 = B["B21"], B["B22"], B["B23"]
    B31, B32, B33 = B["B31"], B["B32"], B["B33"]
    eq = {}
    # (26)
    eq["phi1"] = (
        ((5 + 2 * a) * (b1 + p1) + (16 + 10 * a) * (b2 + p2)) * DD(f1)
        - ((5 + 2 * a) * p1 + (16 + 10 * a) * p2) * D(B11)
        - (7 + a) * p2 * (D(B22) + D(B33))
    )
    # (27), (28)
    for f, own, other in ((f2, B21, B12), (f3, B31, B13)):
        eq[str(f)] = (
            ((5 + 2 * a) * (b1 + p1) + (2 - a) * (b2 + p2)) * DD(f)
            - ((5 + 2 * a) * p1 + (2 - a) * p2) * D(own)
            - (7 + a) * p2 * D(other)
        )
    # (29)
    eq["B11"] = (
        quarter
        * (
            (21 * w1 + 114 * w2 + 12 * w1 * a + 78 * w2 * a) * DD(B11)
            + (27 + 9 * a) * w2 * (DD(B22) + DD(B33))
        )
        + (5 * p1 + 16 * p2 + 4 * p1 * a + 8 * p2 * a) * (D(f1) - B11)
        - (7 + a) * p2 * (B22 + B33)
    )
    # (30), (31)
    for own, other in ((B22, B33), (B33, B22)):
        eq[str(own)] = (
            quarter
            * (
                (7 * w1 + 20 * w2 - w2 * a + w1 * a) * DD(own)
                + (27 + 9 * a) * w2 * DD(B11)
                + 9 * w2 * DD(other)
            )
            + (7 + a) * p2 * (D(f1) - B11)
            - (5 * p1 + 16 * p2 - 2 * p1 * a - 4 * p2 * a) * own
            - (7 - 2 * a) * p2 * other
        )
    # (32)–(35)
    for f, one, two in ((f2, B12, B21), (f3, B13, B31)):
        eq[str(one)] = (
            quarter
            * ((7 * w1 + 20 * w2 + 8 * w2 * a + w1 * a) * DD(one) + (27 + 9 * a) * w2 * DD(two))
            + (7 + a) * p2 * (D(f) - two)
            - (5 * p1 + 2 * p2 + p1 * a) * one
        )
        eq[str(two)] = (
            quarter
            * (3 * (7 * w1 + 2 * w2 - w2 * a + 4 * w1 * a) * DD(two) + (27 + 9 * a) * w2 * DD(one))
            + (5 * p1 + 2 * p2 + p1 * a) * (D(f) - two)
            - (7 + a) * p2 * one
        )
    # (36), (37)
    for own, other in ((B23, B32), (B32, B23)):
        eq[str(own)] = (
            quarter * ((7 * w1 + 2 * w2 - w2 * a + w1 * a) * DD(own) + 9 * w2 * DD(other))
            - (5 * p1 + 2 * p2 - 2 * p1 * a) * own
            - (7 - 2 * a) * p2 * other
        )
    return {name: sp.expand(expression) for name, expression in eq.items()}


@pytest.fixture(scope="module")
def printed():
    """{matrix: function of (a, l, b1, b2, p1, p2, w1, w2)} collected from the printed equations."""
    equations = printed_equations()
    every = [*first.values(), *second.values(), *B.values()]
    for name, expression in equations.items():
        rest = expression.subs(dict.fromkeys(every, 0))
        assert rest == 0, f"equation of {name} has a term in no field: {rest}"

    def collect(rows, symbols):
        return sp.Matrix([[equations[r].coeff(s) for s in symbols] for r in rows])

    slots = {
        "C_phi_phi": collect(ROTATION.macro, [DD(phi[n]) for n in ROTATION.macro]),
        "C_phi_B": -collect(ROTATION.macro, [D(B[n]) for n in ROTATION.micro]),
        "C_B_phi": collect(ROTATION.micro, [D(phi[n]) for n in ROTATION.macro]),
        "C_B_B": -collect(ROTATION.micro, [B[n] for n in ROTATION.micro]),
        "Gamma": collect(ROTATION.micro, [DD(B[n]) for n in ROTATION.micro]),
    }
    # No derivative of another kind hides in an equation.
    for name, expression in equations.items():
        seen = expression.free_symbols & set(every)
        allowed = (
            {DD(s) for s in phi.values()} | {D(s) for s in B.values()}
            if name in ROTATION.macro
            else {D(s) for s in phi.values()} | {DD(s) for s in B.values()} | set(B.values())
        )
        assert seen <= allowed
    arguments = (a, el, b1, b2, p1, p2, w1, w2)
    return {name: sp.lambdify(arguments, matrix) for name, matrix in slots.items()}


def shorthand(medium: Medium) -> tuple:
    """(a, l, b₁, b₂, p₁, p₂, w₁, w₂) of Appendix B."""
    eta = medium.stiffness_ratio

    def pair(modulus, tangential, whole):
        return (modulus + tangential * eta * modulus) / whole, (modulus - eta * modulus) / whole

    return (
        medium.anisotropy,
        medium.branch_length,
        *pair(medium.G_n_a, 6, 105),
        *pair(medium.G_n_r, 6, 105),
        *pair(medium.G_n_g, 8, 945),
    )


MATRICES = ("C_phi_phi", "C_phi_B", "C_B_phi", "C_B_B", "Gamma")

some_parameters = {
    "anisotropy": st.floats(-1, 2),
    "stiffness_ratio": st.floats(0, 3),
    "branch_length": st.floats(1e-4, 1e-2),
    "particle_radius": st.floats(1e-4, 1e-2),
    "contact_density": st.floats(1e7, 1e11),
    "density": st.floats(100, 1e4),
    "G_n_a": st.floats(0.1, 50),
    "G_n_r": st.floats(0.1, 50),
    "G_n_g": st.floats(0.1, 50),
}
some_media = st.builds(
    Medium, **some_parameters, closure=st.sampled_from(["printed", "consistent"])
)


def same(made, expected, part):
    """Entries agree to this part of the largest."""
    size = np.abs(expected).max()
    np.testing.assert_allclose(made, expected, rtol=0, atol=part * size)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(medium=some_media)
def test_closure_printed_is_the_printed_equations(printed, medium):
    """Entry by entry, to 1e-14 of the largest; measured 5e-16."""
    form = (dataclasses.replace(medium, closure="printed")).flux_form()
    for name in MATRICES:
        same(getattr(form, name), printed[name](*shorthand(medium)), 1e-14)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(medium=some_media)
def test_closure_consistent_differs_in_the_curvature_equations_alone(printed, medium):
    """The φ equations (26)–(28) and the gradient terms are printed as the tensors give them;
    measured 8e-16."""
    form = (dataclasses.replace(medium, closure="consistent")).flux_form()
    for name in ("C_phi_phi", "C_phi_B", "Gamma"):
        same(getattr(form, name), printed[name](*shorthand(medium)), 1e-14)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(medium=some_media)
def test_consistent_is_symmetric(medium):
    """C_Bφ = C_φBᵀ, and C_φφ, C_BB, Γ are symmetric, to rounding; measured 0."""
    form = (dataclasses.replace(medium, closure="consistent")).flux_form()
    same(form.C_B_phi, form.C_phi_B.T, 1e-15)
    for name in ("C_phi_phi", "C_B_B", "Gamma"):
        same(getattr(form, name), getattr(form, name).T, 1e-15)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(medium=some_media)
def test_closures_coincide_in_an_isotropic_medium(medium):
    isotropic = dataclasses.replace(medium, anisotropy=0.0)
    one, other = (
        (dataclasses.replace(isotropic, closure=closure)).flux_form()
        for closure in ("printed", "consistent")
    )
    for name in MATRICES:
        same(getattr(one, name), getattr(other, name), 1e-15)


def test_printed_is_not_symmetric_where_the_fabric_is_not_isotropic():
    """The force of B on φ and that of φ on B differ, by 2a p₁ − 2a p₂ in (26) against (29)."""
    medium = Medium(anisotropy=0.5, closure="printed")
    form = medium.flux_form()
    *_, P1, P2, _, _ = shorthand(medium)
    difference = form.C_B_phi[0, 0] - form.C_phi_B[0, 0]
    assert difference == pytest.approx(0.5 * (2 * P1 - 2 * P2), rel=1e-13)
    assert abs(difference) > 0.05 * form.C_phi_B[0, 0]


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    medium=some_media,
    beta=st.none() | st.floats(1e-9, 1e-3),
    gamma=st.none() | st.floats(1e-15, 1e-6),
)
def test_inertia(medium, beta, gamma):
    """m_φ = ρβ/(l²N_p), m_B = ργ/(l²N_p); β = 2R²/5 and γ = 12R⁴/35 unless given."""
    medium = dataclasses.replace(medium, rotation_inertia=beta, curvature_inertia=gamma)
    form = medium.flux_form()
    R = medium.particle_radius
    per_volume = medium.branch_length**2 * medium.contact_density
    expected = medium.density * (0.4 * R**2 if beta is None else beta) / per_volume
    assert form.m_phi == pytest.approx(expected, rel=1e-14)
    expected = medium.density * (12 / 35 * R**4 if gamma is None else gamma) / per_volume
    assert form.m_B == pytest.approx(expected, rel=1e-14)


def test_names_and_units_of_the_twelve_fields():
    rotations, curvatures = "phi1 phi2 phi3", "B11 B12 B13 B21 B22 B23 B31 B32 B33"
    assert tuple(f"{rotations} {curvatures}".split()) == ROTATION.fields
    assert {known_field(name).unit for name in ROTATION.macro} == {"rad"}
    assert {known_field(name).unit for name in ROTATION.micro} == {"1/m"}


# Blocks


def block_basis() -> tuple[np.ndarray, list[tuple[int, str]]]:
    """Matrix from the twelve fields to all blocks' components, and each row's block and kind."""
    rows, owners = [], []
    for number, block in enumerate(ROTATION.blocks):
        for component in block.macro:
            rows.append([component.get(name, 0.0) for name in ROTATION.fields])
            owners.append((number, "phi"))
        for component in block.micro:
            rows.append([component.get(name, 0.0) for name in ROTATION.fields])
            owners.append((number, "B"))
    return np.array(rows), owners


def test_blocks_are_an_orthonormal_basis_of_the_twelve_fields():
    basis, owners = block_basis()
    assert basis.shape == (12, 12)
    np.testing.assert_allclose(basis @ basis.T, np.eye(12), rtol=0, atol=1e-15)
    assert sum(len(block.branches) for block in ROTATION.blocks) == 12
    for block in ROTATION.blocks:
        assert len(block.branches) == len(block.macro) + len(block.micro)
    # A component never mixes rotations and micro-curvatures, which live on different points.
    for row, (_, kind) in zip(basis, owners, strict=True):
        assert np.any(row[:3]) == (kind == "phi")
        assert np.any(row[3:]) == (kind == "B")


def stiffness(medium: Medium, k: float) -> np.ndarray:
    """K of ω² v = K(k) v, (12, 12), SI, on (φ, B/i), from the flux form's matrices."""
    form = medium.flux_form()
    K = np.zeros((12, 12))
    K[:3, :3] = k**2 * form.C_phi_phi / form.m_phi
    K[:3, 3:] = -k * form.C_phi_B / form.m_phi
    K[3:, :3] = -k * form.C_B_phi / form.m_B
    K[3:, 3:] = (form.C_B_B + k**2 * form.Gamma) / form.m_B
    return K


@settings(max_examples=60, deadline=None, derandomize=True)
@given(medium=some_media)
def test_blocks_do_not_exchange_anything(medium):
    """In the blocks' basis each matrix of the flux form is zero outside the blocks, to 1e-15 of its
    largest entry, in both closures; measured 4e-16."""
    basis, owners = block_basis()
    form = medium.flux_form()
    number = np.array([owner for owner, _ in owners])
    kind = np.array([kind for _, kind in owners])
    rotations, curvatures = basis[kind == "phi", :3], basis[kind == "B", 3:]
    of = {"phi": number[kind == "phi"], "B": number[kind == "B"]}
    sides = {
        "C_phi_phi": (rotations, rotations, "phi", "phi"),
        "C_phi_B": (rotations, curvatures, "phi", "B"),
        "C_B_phi": (curvatures, rotations, "B", "phi"),
        "C_B_B": (curvatures, curvatures, "B", "B"),
        "Gamma": (curvatures, curvatures, "B", "B"),
    }
    for name, (left, right, row, column) in sides.items():
        matrix = getattr(form, name)
        turned = left @ matrix @ right.T
        outside = of[row][:, None] != of[column][None, :]
        assert np.abs(turned[outside]).max() <= 1e-15 * np.abs(matrix).max(), name
        assert np.abs(turned[~outside]).max() > 0.1 * np.abs(matrix).max()


@settings(max_examples=40, deadline=None, derandomize=True)
@given(medium=some_media, kl=st.floats(0.01, 30))
def test_scaled_blocks_are_the_equations_in_si(medium, kl):
    """Entry by entry: with φ and B in the scaled form's units, K(k) of each block over time² is the
    part of the 12 × 12 K(k) in SI that the blocks' basis cuts out. To 1e-13 of the largest entry of
    the whole; measured 5e-16."""
    basis, owners = block_basis()
    units = scales(medium)
    unit = np.array([units.macro if kind == "phi" else units.micro for _, kind in owners])
    whole = basis @ stiffness(medium, kl / medium.branch_length) @ basis.T
    whole = whole / unit[:, None] * unit[None, :]
    size = np.abs(whole).max()
    for number, block in enumerate(ROTATION.blocks):
        form = block_coefficients(medium, block, scales(medium))
        mine = [i for i, (owner, _) in enumerate(owners) if owner == number]
        p = len(block.macro)
        K = np.zeros((len(mine), len(mine)))
        K[:p, :p] = kl**2 * form.c_pp
        K[:p, p:] = -kl * form.c_pb
        K[p:, :p] = -kl * form.c_bp
        K[p:, p:] = form.c_bb + kl**2 * form.gamma
        np.testing.assert_allclose(
            K / units.time**2, whole[np.ix_(mine, mine)], rtol=0, atol=1e-13 * size
        )


@settings(max_examples=40, deadline=None, derandomize=True)
@given(medium=some_media, kl=st.floats(0.01, 30))
def test_frequencies_of_the_blocks_are_those_of_the_twelve_equations(medium, kl):
    """The 12 × 12 SI problem and the scaled blocks have the same ω². Both closures where ω² is real
    (0 ≤ a ≤ 1, 0 ≤ η ≤ 1 for "printed"). To 1e-12 of the largest; measured 2e-15."""
    if medium.closure == "printed":
        assume(0 <= medium.anisotropy <= 1 and medium.stiffness_ratio <= 1)
    form = medium.flux_form()
    root = np.sqrt(np.r_[np.full(3, form.m_phi), np.full(9, form.m_B)])
    K = stiffness(medium, kl / medium.branch_length)
    expected = np.linalg.eigvals(K * root[:, None] / root[None, :])
    size = np.abs(expected).max()
    assert np.abs(expected.imag).max() < 1e-6 * size
    made = []
    for block in ROTATION.blocks:
        form = block_coefficients(medium, block, scales(medium))
        matrix = np.block(
            [
                [kl**2 * form.c_pp, -kl * form.c_pb],
                [-kl * form.c_bp, form.c_bb + kl**2 * form.gamma],
            ]
        )
        made.append(np.linalg.eigvals(matrix).real / scales(medium).time ** 2)
    np.testing.assert_allclose(
        np.sort(np.concatenate(made)), np.sort(expected.real), rtol=0, atol=1e-12 * size
    )


@settings(max_examples=40, deadline=None, derandomize=True)
@given(medium=some_media)
def test_scaled_blocks_are_symmetric_in_the_consistent_closure(medium):
    medium = dataclasses.replace(medium, closure="consistent")
    for block in ROTATION.blocks:
        form = block_coefficients(medium, block, scales(medium))
        if block.macro:
            same(form.c_bp, form.c_pb.T, 2e-15)
        same(form.c_bb, form.c_bb.T, 1e-15)
        same(form.gamma, form.gamma.T, 1e-15)


def test_reference_medium_sets_the_units():
    """Coefficients over another medium's units, converted back, are the same matrices in SI."""
    medium = Medium(anisotropy=0.3, G_n_a=8.0, particle_radius=4e-4, branch_length=9e-4)
    reference = Medium(closure="consistent")
    for block in ROTATION.blocks:
        si = []
        for units_of in (medium, reference):
            unit = scales(units_of)
            form = block_coefficients(medium, block, unit).per_inertia()
            per = unit.time**2
            si.append(
                (
                    form.c_pp * unit.length**2 / per,
                    form.c_pb * unit.length / unit.micro / per,
                    form.c_bp * unit.length * unit.micro / per,
                    form.c_bb / per,
                    form.gamma * unit.length**2 / per,
                )
            )
        for one, other in zip(*si, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-13)


def test_units_of_the_scaled_form():
    """Table 1: l = 1 mm; t = √(4πρR⁵/3G_n^a), so that ω̄ = 1 is about 785 kHz; B in 1/(r l) with
    r² = γ/(β l²); a body moment ρβ/t² makes φ̈ = 1; energy per area ρβ l/t²."""
    units = scales(Medium())
    R, rho = 5e-4, 1570.0
    time = np.sqrt(4 * np.pi * rho * R**5 / (3 * 5.0))
    beta, gamma = 2 * R**2 / 5, 12 * R**4 / 35
    assert units.length == 1e-3
    assert units.time == pytest.approx(time, rel=1e-14)
    assert 1 / (2 * np.pi * units.time) == pytest.approx(785e3, rel=1e-3)
    r = np.sqrt(gamma / beta) / 1e-3
    assert units.unit("phi2") == 1.0
    assert units.unit("B13") == pytest.approx(1 / (r * 1e-3), rel=1e-14)
    assert units.force("phi3") == pytest.approx(rho * beta / time**2, rel=1e-14)
    assert units.force("B22") == pytest.approx(rho * gamma / (r * 1e-3 * time**2), rel=1e-14)
    # The same energy by either unknown: ½ρβφ̇² and ½ργḂ² of one scaled unit each.
    assert rho * gamma * units.unit("B13") ** 2 == pytest.approx(rho * beta, rel=1e-14)
    assert units.energy == pytest.approx(rho * beta / time**2 * 1e-3, rel=1e-14)


def test_sectors_and_the_blocks_that_a_source_sets_in_motion():
    """B22 drives both the longitudinal block and the in-plane wave of B22 − B33."""
    assert {block.sector for block in ROTATION.blocks} == set(ROTATION.sectors)
    assert [len(ROTATION.blocks_of(sector)) for sector in ROTATION.sectors] == [1, 1, 1, 3]
    names = {field: [b.name for b in ROTATION.excited([field])] for field in ROTATION.fields}
    assert names["phi1"] == names["B11"] == ["longitudinal"]
    assert names["B22"] == names["B33"] == ["longitudinal", "inplane(22-33)"]
    assert names["phi2"] == names["B12"] == names["B21"] == ["transverse2"]
    assert names["phi3"] == names["B13"] == names["B31"] == ["transverse3"]
    assert names["B23"] == names["B32"] == ["inplane[23]", "inplane(23)"]
    # Independently: a unit force on a field has a part in a block just where the basis says so.
    basis, owners = block_basis()
    for column, field in enumerate(ROTATION.fields):
        driven = {owners[row][0] for row in np.nonzero(basis[:, column])[0]}
        assert names[field] == [ROTATION.blocks[number].name for number in sorted(driven)]
    with pytest.raises(
        ValueError, match=r"sector 'shear': must be one of longitudinal, transverse2"
    ):
        ROTATION.blocks_of("shear")
