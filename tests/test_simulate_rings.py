"""Runs on uniform rings: against the exact modal solution of the same semi-discrete equations.

The exact route (``exact.py``: FFT in space, eigenvectors of the 12 × 12 problem in SI, Gauss sums
over the pulses) shares no stepper, block or scaled unknown with the program: what is left to differ
is the integration in time alone.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from exact import modal_field

import wavesim as ws
from wavesim.material.granular_equations import ROTATION
from wavesim.material.scaling import scales

CELL = 2.5e-4
DURATION = 12e-6
# Two in the longitudinal sector that overlap in time and space, a point and a Gaussian; one in
# transverse 2 and one in two in-plane blocks, at other times; the amplitudes make all of them tell.
SOURCES = (
    ws.Ricker("phi1", 3.03e-3, 600e3, amplitude=200.0),
    ws.Ricker("B11", 3.4e-3, 450e3, width=6e-4, delay=3.9e-6),
    ws.Ricker("B12", 8.1e-3, 400e3, amplitude=2.0, width=5e-4, delay=4e-6),
    ws.Ricker("B23", 3.2e-3, 700e3, delay=3.5e-6),
)
# A moment on every field, each at a place and a time of its own; every other one a Gaussian.
EVERY = tuple(
    ws.Ricker(
        name,
        (1.07 + 1.1 * n) * 1e-3,
        600e3,
        amplitude=200.0 if name in ROTATION.macro else 1.0,
        width=n % 2 * 5e-4,
        delay=(2.5 + 0.1 * n) * 1e-6,
    )
    for n, name in enumerate(ROTATION.fields)
)
# Astride of the ring's ends.
ASTRIDE = (
    ws.Ricker("phi1", 0.9 * CELL, 600e3, amplitude=200.0),
    ws.Ricker("B22", 255.3 * CELL, 450e3, width=6e-4, delay=3.9e-6),
)
# (closure, bar, sources, duration, frames, solver)
CASES = {
    "every field": ("printed", ws.Bar(64, CELL, 8), EVERY, DURATION, 13, "auto"),
    "short steps": ("printed", ws.Bar(256, CELL, 2), ASTRIDE, DURATION, 97, "chebyshev"),
    "long steps": ("consistent", ws.Bar(64, CELL, 8), SOURCES, DURATION, 13, "chebyshev"),
    "propagator": ("consistent", ws.Bar(257, CELL, 12), SOURCES[:3], DURATION, 25, "propagator"),
}
CONSERVING = [name for name, case in CASES.items() if case[0] == "consistent"]


@cache
def run(name):
    closure, bar, sources, duration, frames, solver = CASES[name]
    medium = ws.Medium(anisotropy=0.4, closure=closure)
    return ws.simulate(medium, bar, sources, duration, frames, solver)


@pytest.mark.parametrize("name", CASES)
def test_it_is_the_exact_semi_discrete_solution(name):
    """Law: a step is exact, whatever its length, in both closures, with sources on every field.

    Every field at up to 6 times, to 1e-10 of its largest value; measured 1.5e-13 to 6e-12.
    """
    field = run(name)
    frames = np.unique(np.linspace(0, len(field.t) - 1, 7).astype(int)[1:])
    expected = modal_field(field.medium, field.bar, field.sources, field.t[frames])
    for made in field.names:
        size = np.abs(expected[made]).max()
        assert size > 0
        assert np.abs(field[made][frames] - expected[made]).max() <= 1e-10 * size, made
    # Sectors that no source drives are at rest, and are not integrated.
    largest = {
        kind: max(np.abs(expected[n]).max() for n in kind)
        for kind in (ROTATION.macro, ROTATION.micro)
    }
    for kind, size in largest.items():
        for idle in set(kind) - set(field.names):
            assert np.abs(expected[idle]).max() <= 1e-12 * size


@pytest.mark.parametrize(
    ("duration", "frames"), [(2000, 2), (1200, 3001)], ids=["one interval", "3000 steps"]
)
def test_a_long_run_stays_exact(duration, frames):
    """A pulse that leaves a mean rotation behind, which nothing holds back: after so many units of
    time every field to 1e-9 of its largest value. Measured 1e-10: rounding could grow as n^{3/2}
    over n steps, and a sum of weights left to rounding made the mean drift by 3e-9."""
    medium, bar = ws.Medium(anisotropy=0.4, closure="consistent"), ws.Bar(256, CELL / 2)
    sources = [ws.GaussianDerivative("phi1", 16e-3, 700e3)]
    field = ws.simulate(medium, bar, sources, duration * medium.time_scale, frames)
    expected = modal_field(medium, bar, sources, field.t[-1:])
    rotation = expected["phi1"][0]
    assert abs(rotation.mean()) > 0.1 * np.abs(rotation).max()
    for name in field.names:
        error = np.abs(field[name][-1] - expected[name]).max()
        assert error <= 1e-9 * np.abs(expected[name]).max(), name


# Energy


@pytest.mark.parametrize("name", CONSERVING)
def test_energy_is_the_work_of_the_sources(name):
    """Law: in the consistent closure kinetic and deformation energy change by the sources' work.

    The work is integrated from the sources and the velocities, not from the energy. To 1e-9 of the
    largest energy at all times and 1e-10 after the last pulse; measured 1e-13 and 4e-14.
    """
    field = run(name)
    energy, largest = field.energy, field.energy.total.max()
    assert energy.work[-1] > 0.5 * largest > 0
    assert np.abs(energy.total - energy.work).max() <= 1e-9 * largest
    after = field.t > field.quiet_from
    assert after.sum() >= 3
    assert np.ptp(energy.total[after]) <= 1e-10 * largest
    assert np.ptp(energy.kinetic[after]) > 1e-3 * largest


def test_no_such_balance_in_the_printed_closure():
    """The counterpart: the printed equations have no deformation energy; they miss by far more."""
    energy = run("short steps").energy
    assert np.abs(energy.total - energy.work).max() > 1e-4 * energy.total.max()


def test_kinetic_energy_is_that_of_the_exact_rates():
    """½∫ ρβφ̇² + ργḂ² dx of the modal solution's rates, summed in SI; to 1e-10, measured 6e-14."""
    field = run("every field")
    frames = [4, 8, 12]
    rates = modal_field(field.medium, field.bar, field.sources, field.t[frames], rate=True)
    medium = field.medium
    inertia = dict.fromkeys(ROTATION.macro, medium.beta) | dict.fromkeys(
        ROTATION.micro, medium.gamma
    )
    expected = sum(
        0.5 * medium.density * inertia[name] * field.bar.spacing * (rate**2).sum(axis=1)
        for name, rate in rates.items()
    )
    np.testing.assert_allclose(field.energy.kinetic[frames], expected, rtol=1e-10)


def contact_energy(medium, length, kappa, B, slope):
    """Deformation energy per area, from the contacts themselves.

    ½ N_p ∫∫ ξ(n) [l²(κn)·G^a(κn) + l²(Dn)·G^r(Dn) + l⁴/4 (∇B:nn)·G^g(∇B:nn)] dΩ dx with
    D = κ − B and ∇B along x₁: no tensor is formed. A Gauss sum over the sphere, exact for the
    polynomials in n that stand here, and the mean over even points, exact for waves they resolve.

    Args:
        kappa, B, slope: κ_ij, B_ij, ∂ₓB_ij at even points of the bar, shape (points, 3, 3), SI.
    """
    c, weight = np.polynomial.legendre.leggauss(8)
    angle = 2 * np.pi * np.arange(12) / 12
    s = np.sqrt(1 - c**2)
    n = np.stack(
        [
            np.repeat(c, 12),
            np.multiply.outer(s, np.cos(angle)).ravel(),
            np.multiply.outer(s, np.sin(angle)).ravel(),
        ],
        axis=1,
    )
    a, eta, el = medium.anisotropy, medium.stiffness_ratio, medium.branch_length
    xi = np.repeat(weight / 24, 12) * (1 + a * (n[:, 0] ** 2 - (n[:, 1] ** 2 + n[:, 2] ** 2) / 2))

    def stored(vector, modulus):
        """∫ ξ u·G u, u of shape (points, directions, 3): the part along n and the rest."""
        along = np.einsum("xdi,di->xd", vector, n) ** 2
        rest = (vector**2).sum(axis=-1) - along
        return modulus * ((along + eta * rest) @ xi)

    total = stored(el * np.einsum("xij,dj->xdi", kappa, n), medium.G_n_a)
    total += stored(el * np.einsum("xij,dj->xdi", kappa - B, n), medium.G_n_r)
    bend = el**2 / 2 * np.einsum("xij,dj,d->xdi", slope, n, n[:, 0])
    total += stored(bend, medium.G_n_g)
    return 0.5 * medium.contact_density * total.mean() * length


def test_potential_energy_is_what_the_contacts_store():
    """Law: the deformation energy is that of the contacts, all twelve fields moving.

    Wide sources, so that derivatives of the fields by FFT and the differences of order 12 agree;
    the gradient term as large as the rest. (Without it, it is the work less the kinetic energy,
    both held above.) To 1e-9; measured 1e-13 to 1e-11.
    """
    given = {"branch_length": 1.3e-3, "density": 900.0, "G_n_a": 9.0, "G_n_g": 6.0}
    medium = ws.Medium(closure="consistent", anisotropy=1.6, **given)
    bar = ws.Bar(96, CELL, 12)
    sources = [dataclasses.replace(source, width=1.2e-3) for source in EVERY]
    field = ws.simulate(medium, bar, sources, 8e-6, 5)
    assert set(field.names) == set(ROTATION.fields)
    k = 2 * np.pi * np.fft.rfftfreq(bar.cells, CELL)

    def along(name, frame, derivative=0):
        hat = np.fft.rfft(field[name][frame]) * (1j * k) ** derivative
        shift = 0.0 if name in ROTATION.macro else CELL / 2
        return np.fft.irfft(hat * np.exp(-1j * k * shift), bar.cells)

    for frame in (2, 4):
        kappa = np.zeros((bar.cells, 3, 3))
        kappa[:, :, 0] = np.stack([along(name, frame, 1) for name in ROTATION.macro], axis=-1)
        B, slope = (
            np.stack([along(n, frame, d) for n in ROTATION.micro], -1).reshape(-1, 3, 3)
            for d in (0, 1)
        )
        expected = contact_energy(medium, bar.length, kappa, B, slope)
        assert field.energy.potential[frame] == pytest.approx(expected, rel=1e-9)
    without = dataclasses.replace(medium, G_n_g=0.0)
    assert contact_energy(without, bar.length, kappa, B, slope) < 0.99 * expected


# What is settled before, and the field that a run leaves


def test_frames_by_default_and_progress():
    """Frames hold twice the band of the highest source; what is told of a run ends at 1."""
    seen, receivers, pulse = [], {"a": 1e-3}, ws.Ricker("phi1", 4.3e-3, 600e3)
    medium, bar = ws.Medium(anisotropy=0.4), ws.Bar(64, CELL, 4)
    field = ws.simulate(medium, bar, [pulse], 3e-5, receivers=receivers, progress=seen.append)
    assert 2 * pulse.band <= np.pi / field.t[1] < 2.3 * pulse.band
    assert len(seen) > 2
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert field.receivers == receivers


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sources": ()}, r"sources = \[\]: at least one"),
        ({"duration": 0.0}, r"duration = 0 s: must be greater than 0"),
        ({"samples": 1}, r"samples = 1: must be at least 2"),
        ({"solver": "euler"}, r"solver = 'euler': must be one of auto"),
    ],
)
def test_what_can_not_be_run_is_refused(change, message):
    asked = {
        "medium": ws.Medium(),
        "bar": ws.Bar(64, CELL),
        "sources": SOURCES,
        "duration": 1e-6,
        "samples": 9,
    }
    with pytest.raises(ValueError, match=message):
        ws.simulate(**(asked | change))


def test_field_knows_its_axes():
    field = run("long steps")
    assert field.t[0] == 0
    assert field.t[-1] == DURATION
    assert field.interval == pytest.approx(DURATION / 12)
    assert set(field.names) == {"phi1", "B11", "B22", "B33", "phi2", "B12", "B21", "B23", "B32"}
    assert field.quiet_from == max(s.end for s in SOURCES)
    np.testing.assert_allclose(
        field.positions("B11") - field.positions("phi1"), CELL / 2, rtol=1e-9
    )
    for name in field.names:
        assert field[name].shape == (13, 64)
        assert not np.any(field[name][0])
    assert field.unit("phi2") == "rad"
    assert field.unit("B32") == "1/m"


def test_receiver_interpolates_to_the_bars_order():
    """On a grid point the stored value; between, the modal field's trigonometric polynomial.

    At seven points to a wavelength eight-point Lagrange interpolation, 0.4 of a cell past a point,
    errs by ∏|0.4 − i|/8! (2π/7)⁸ = 4e-4; most of the field is longer waves. Measured 5e-5.
    """
    field = run("long steps")
    for name, cell in (("phi1", 20), ("B12", 33)):
        np.testing.assert_array_equal(
            field.at(float(field.positions(name)[cell]), name), field[name][:, cell]
        )
    frame = 8
    for name in ("phi1", "B12"):
        values = field[name][frame]
        k = 2 * np.pi * np.fft.fftfreq(64, CELL)
        position = float(field.positions(name)[30]) + 0.4 * CELL
        shift = position - field.positions(name)[0]
        expected = (np.fft.fft(values) @ np.exp(1j * k * shift)).real / 64
        assert field.at(position, name)[frame] == pytest.approx(
            expected, abs=4e-4 * np.abs(values).max()
        )


def test_components_are_the_fields_in_their_own_units():
    """The components of all blocks are orthonormal combinations of the fields, each over its unit:
    the sum of their squares is the fields', at every time, and each lives where its fields do."""
    field = run("every field")
    unit = scales(field.medium).unit
    kinds = {False: 0.0, True: 0.0}
    for block in field.blocks:
        for values, staggered in field.components(block):
            kinds[staggered] = kinds[staggered] + (values**2).sum(axis=1)
    for staggered, names in ((False, ROTATION.macro), (True, ROTATION.micro)):
        expected = sum((field[name] ** 2).sum(axis=1) / unit(name) ** 2 for name in names)
        np.testing.assert_allclose(kinds[staggered], expected, rtol=1e-12)
