"""A check from outside the model: chains and a beam, from closed forms, recovered like any record.

None of these relations shares a line with the granular medium or its solver.
"""

from __future__ import annotations

import numpy as np
import pytest
from chains import Beam, Diatomic, MassInMass

from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.synthetic import Pulse, positions, synthesize
from wavesim.verdict.recovered_points import match, match_in_space

A = 0.01
CHAINS = {
    "mass in mass": MassInMass(A, 1e6, 0.01, 2e5, 0.005),
    "diatomic": Diatomic(A, 1e6, 0.01, 0.005),
}
CELLS = 401


@pytest.fixture(scope="module", params=CHAINS)
def chain(request):
    """A chain of 401 cells struck at one site, four samples to the shortest period's half."""
    relation = CHAINS[request.param]
    length = CELLS * A
    highest = relation.omega(np.array([np.pi / A, 1e-3])).max()
    t = np.arange(0, 0.08, np.pi / highest / 4)
    pulse = Pulse(highest / (3 * np.pi), 200 * A)
    return relation, synthesize(
        relation, t, positions(CELLS, A), pulse, length, ring=True, lattice=True
    )


def test_both_branches_of_a_chain(chain):
    # 200 wavenumbers, two branches. Tolerance 1e-8 asked; measured 2.5e-15 and 1.7e-13.
    relation, record = chain
    points = in_time(record)
    matched = match(points, record, ("acoustic", "optical"), relation)
    assert len(points.branches) == 2
    assert matched.present.sum() == matched.found.sum() == 2 * (CELLS // 2)
    assert len(matched.false_k) == 0
    assert np.nanmax(matched.error(True)) < 1e-8


def test_decay_in_the_gap_of_a_chain(chain):
    # 40 frequencies through both bands, the gap between and the stop band above. Tolerance 1e-4
    # asked; measured 5e-11 and 2e-9. k is known up to a reciprocal lattice vector: by cos(ka).
    relation, record = chain
    edges = np.sort(relation.omega(np.array([1e-6, np.pi / A])).ravel())
    omega = np.linspace(0.1, 1.2, 40) * edges[-1]
    points = in_space(record, omega, damping=24)
    assert points.valid.all()
    exact = relation.wavenumber(points.omega)
    error = np.abs((np.cos(points.k * A) - np.cos(exact * A)) / np.sin(exact * A) / (exact * A))
    assert error.max() < 1e-6
    gap = (omega > edges[1]) & (omega < edges[2])
    assert gap.sum() >= 2
    # In the gap it decays, by the closed form, to 1e-4 in the imaginary part alone.
    assert np.abs(points.k.imag[gap] / exact.imag[gap] - 1).max() < 1e-4
    assert (points.k.imag[gap] * A > 0.1).all()


def test_a_beam_in_time():
    # ω = c k²: 100 frequencies over four decades on one ring. Measured 1.7e-13.
    beam, count = Beam(5.0), 128
    k = 2 * np.pi * np.arange(1, count // 2 + 1) / 4.0
    highest = beam.omega(k).max()
    t = np.arange(0, 0.25, np.pi / highest / 1.5)
    record = synthesize(
        beam, t, positions(count, 4.0 / count), Pulse(highest / (16 * np.pi), 1.0), 4.0, ring=True
    )
    points = in_time(record)
    matched = match(points, record, ("flexural",), beam)
    assert len(points.branches) == 1
    assert matched.found.sum() > 30
    assert matched.missed.sum() == 0
    assert len(matched.false_k) == 0
    assert np.nanmax(matched.error(True)) < 1e-8


def test_a_beam_in_space_with_its_near_field():
    """Twelve receivers 0.2 m to 0.42 m from the source see the travelling wave and the near field.

    Law: k = √(ω/c) and ik. With one pair the near field spoils k by up to 1e-2; with two both are
    found. Tolerance 1e-4 on the travelling wave; measured 8e-6.
    """
    beam = Beam(5.0)
    record = synthesize(
        beam, np.linspace(0, 0.02, 1000), positions(12, 0.02, 0.2),
        Pulse(1500.0, 0.0, width=0.01), 60.0, k_max=860.0,
    )  # fmt: skip
    omega = 2 * np.pi * np.linspace(300, 2000, 12)
    errors = []
    for pairs in (1, 2):
        points = in_space(record, omega, pairs=pairs, damping=18, clear=0.08)
        exact = beam.wavenumber(points.omega)
        off = np.abs(points.k / exact - 1)
        errors.append(np.array([off[points.omega.real == w].min() for w in omega]))
    assert errors[0].max() > 1e-4
    assert errors[1].max() < 1e-4
    assert match_in_space(points, beam).error(True)[points.valid].min() < 1e-4
