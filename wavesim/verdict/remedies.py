"""What to change in a case where a check falls short: the key, which way, and by how much."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.grid.stencils import ORDERS
from wavesim.material.sectors import Block
from wavesim.planewave.dispersion_relation import block_oscillations
from wavesim.records.relations import OfMedium
from wavesim.simulation.field import Field

# What explains this part of an error is what to change first.
_EXPLAINS = 0.3
# What is lost is a sum over nodes of a step, which is exact if the step is shorter by this.
_SHORTER = 5


def finer(field: Field) -> str:
    """A finer grid, or a higher order of its differences where there is one."""
    bar = field.bar
    text = f"take [bar] spacing = {bar.spacing / 2:.6g} or finer (now {bar.spacing:.6g} m)"
    return text + (f", or a higher [bar] order (now {bar.order})" if bar.order < ORDERS[-1] else "")


def longer_run(field: Field, why: str) -> str:
    """A longer record."""
    last = float(field.t[-1])
    return f"lengthen [time] duration to {2 * last:.3g} or more (now {last:.3g} s): {why}"


def shorter_step(field: Field) -> str:
    """A shorter time step."""
    return f"take [time] step = {field.step / _SHORTER:.2g} or shorter (now {field.step:.2g} s)"


def _exact_in_time(field: Field) -> str:
    return shorter_step(field) + ', or leave [time] solver at "auto"'


def grid_error(field: Field, block: Block, k: Any) -> Any:
    """|ω_grid/ω − 1| of each branch at k, shape (n, branches): what the differences slow down."""
    k = np.atleast_1d(np.asarray(k, dtype=float))
    exact = block_oscillations(field.medium, block, k)
    modified = OfMedium(field.medium, block, field.bar).modified(k)
    slowed = block_oscillations(field.medium, block, modified)
    return np.abs(slowed / np.where(exact > 0, exact, np.inf) - 1)


def of_frequencies(field: Field, block: Block, k: Any, branch: int, error: float) -> str:
    """Where ω(k) of a branch is off by this part of itself, or is not found (not a number).

    Args:
        field: the field.
        block: whose branch.
        k: wavenumbers judged, rad/m.
        branch: its number.
        error: largest |Δω|/ω.
    """
    if len(np.atleast_1d(k)) and np.isfinite(error):
        if grid_error(field, block, k)[:, branch].max() >= _EXPLAINS * error:
            return finer(field)
        omega = float(block_oscillations(field.medium, block, k)[:, branch].max())
        if field.stepper == "verlet" and (field.step * omega) ** 2 / 24 >= _EXPLAINS * error:
            return _exact_in_time(field)
    return longer_run(field, "its frequency bins do not tell this branch from its neighbours")


def of_wavenumbers(field: Field, block: Block, omega: NDArray[Any], error: Any) -> str:
    """Where complex k(ω) is off by these parts of itself.

    Args:
        field: of an endless bar.
        block: whose wave was measured.
        omega: ω + iσ, shape (n,), rad/s.
        error: |Δk|/|k| at each, shape (n,).
    """
    if wavenumber_grid_error(field, block, omega, error) >= _EXPLAINS:
        return finer(field)
    return (
        f"lengthen [bar] length (now {field.bar.length:.4g} m), so that waves that went round the "
        "bar come back later, or raise [analysis] damping, which weighs them down"
    )


def wavenumber_grid_error(
    field: Field, block: Block, omega: NDArray[Any], error: NDArray[Any]
) -> float:
    """Part of the largest error of k(ω) that the grid's own relation explains, –."""
    worst = int(np.nanargmax(error))
    at = np.asarray(omega)[worst : worst + 1]
    medium = field.medium
    exact = OfMedium(medium, block).wavenumber(at)
    on_grid = OfMedium(medium, block, field.bar).wavenumber(at)
    return float(np.abs(on_grid / exact - 1)[0] / error[worst])


def of_energy(field: Field) -> str:
    """Where the balance of energy does not close."""
    if field.stepper == "verlet":
        return _exact_in_time(field)
    return shorter_step(field)
