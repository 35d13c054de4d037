"""From recovered points back to the material: least squares for chosen parameters of the medium.

    minimise Σ |(ω_b(k_i; θ) − ω_i)/e_i|²  or  Σ |(k(ω_i; θ) − k_i)/e_i|²

with exact derivatives. From ω² v = K(k; θ) v and its left eigenvector u, uᵀv = 1,

    ∂ω²/∂θ = uᵀ (∂K/∂θ) v,    ∂k/∂θ = −uᵀ (∂K/∂θ) v / uᵀ (∂K/∂k) v,

and ∂K/∂θ is taken through the constitutive tensors by dual numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from wavesim.material import dual
from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, block_coefficients, scales
from wavesim.planewave.eigenproblem import stiffness, stiffness_slope
from wavesim.readings.dispersion.points import BAR, BranchPoints
from wavesim.records.relations import OfMedium
from wavesim.studies.fit_terms import Held
from wavesim.studies.least_squares import FitError

Float = NDArray[Any]

# Rounds of naming the points' branches anew by the parameters found.
_ROUNDS = 6
# More than the points' errors is left over where χ² per degree of freedom is above this.
_EXCESS = 2.0
# Wavenumbers are changed by this part, to see what that does.
_CHANGED = 1e-6


@dataclass(frozen=True)
class Observed:
    """Points of one block.

    Attributes:
        block: the block.
        points: recovered; only valid ones are used.
        grid: the stencil that they obey, as an order and a spacing in ``OfMedium``; None for the
            continuum.
        common: relative error that all of its ω or k have alike, one standard deviation, –: of an
            interval or a spacing that is known to so much, which no number of points averages away.
    """

    block: Block
    points: BranchPoints
    grid: Any = None
    common: float = 0.0


@dataclass(frozen=True)
class Fitted:
    """Parameters of a medium with their uncertainties.

    Attributes:
        medium: with the fitted values.
        values: {parameter: value}, SI.
        errors: {parameter: standard error}, SI.
        covariance: shape (p, p), in the order of values.
        systematic: whether what is left over is more than the errors; the standard errors are then
            as much as it could move each parameter.
        chi_square: Σ of squared residuals over degrees of freedom; about 1 where the medium and
            the points' errors are right. Errors are stretched by its root where it is above 1.
        points: number of points used.
        held: the medium's other parameters, and the wavenumbers of all points.
        left: what is left over of ω, or of k, weighted by the errors, –.
    """

    medium: Medium
    values: dict[str, float]
    errors: dict[str, float]
    covariance: Float
    chi_square: float
    points: int
    systematic: bool
    held: Held
    left: float

    @property
    def bars(self) -> dict[str, float]:
        """Half-widths of the 95 % bars."""
        return {name: BAR * error for name, error in self.errors.items()}


def fit(
    observed: Sequence[Observed],
    start: Medium,
    parameters: Sequence[str],
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> Fitted:
    """Fit parameters of a medium to recovered points.

    Args:
        observed: points by block; their branches are named anew as the fit goes, so that only
            roughly the right medium is needed to start from.
        start: the medium with first guesses, and with all that is known.
        parameters: names of the parameters to fit, such as ("anisotropy", "stiffness_ratio").
        bounds: limits of parameters, SI.

    Returns:
        The fit.

    Raises:
        FitError: a parameter is unknown, a valid point is no number or has no error above 0, or
            the points can't tell the parameters apart.
    """
    unknown = [name for name in parameters if name not in start.known()]
    if unknown or not parameters:
        raise FitError(
            f"parameters = {', '.join(unknown) or 'none'}: must be of {', '.join(start.known())}"
        )
    limits = {name: (known.low, known.high) for name, known in start.known().items()}
    limits |= dict(bounds or {})
    low, high = np.array([limits[name] for name in parameters]).T
    first = np.array([float(start.parameters[name]) for name in parameters])
    unit = np.where(np.abs(first) > 0, np.abs(first), 1.0)
    kept = [replace(o, points=o.points.take(o.points.valid)) for o in observed]
    total = sum(len(o.points) * (2 if o.points.in_space else 1) for o in kept)
    if total <= len(parameters):
        raise FitError(
            f"{total} valid points for {len(parameters)} parameters: more points are needed"
        )
    for o in kept:
        told = np.abs(o.points.k) + np.abs(o.points.omega)
        for bad in np.flatnonzero(~(np.isfinite(told) & (o.points.error > 0)))[:1]:
            raise FitError(
                f"point k = {np.abs(o.points.k[bad]):.4g} rad/m, ω = "
                f"{np.real(o.points.omega[bad]):.4g} rad/s, error {o.points.error[bad]:g}: must be "
                "numbers, with a standard error above 0; give it one, or mark the point valid = "
                "False"
            )
    scaled = np.clip(first / unit, low / unit, high / unit)
    names = _named(kept, start)
    for _ in range(_ROUNDS):
        model = _Model(kept, start, tuple(parameters), unit, names)
        answer = least_squares(
            model.residuals,
            scaled,
            jac=model.slopes,
            bounds=(low / unit, high / unit),
            x_scale="jac",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        )
        scaled = answer.x
        again = _named(kept, model.medium(scaled))
        if all(np.array_equal(a, b) for a, b in zip(names, again, strict=True)):
            break
        names = again
    # Along what is not told a fit may run to where something else tells it.
    for jac in (model.slopes(np.clip(first / unit, low / unit, high / unit)), answer.jac):
        _check_told(jac, parameters, len(kept) == 1)
    chi_square = 2 * answer.cost / (total - len(parameters))
    inverse = np.linalg.inv(answer.jac.T @ answer.jac)
    covariance = inverse * max(1.0, chi_square)
    systematic = bool(chi_square > _EXCESS)
    if systematic:
        # Each parameter by as much as what is left over could move it, whatever its signs.
        most = np.abs(inverse @ answer.jac.T) @ np.abs(answer.fun)
        wider = np.maximum(most / np.sqrt(np.diag(covariance)), 1.0)
        covariance = covariance * wider[:, None] * wider
    held = Held.of(answer.jac / unit, _held_columns(model, scaled))
    sizes = [_sizes(o.points) for o in kept]
    common = [o.common * size for o, size in zip(kept, sizes, strict=True)]
    shared = inverse @ answer.jac.T @ np.concatenate(common)
    covariance = (covariance + np.outer(shared, shared)) * unit[:, None] * unit
    values: dict[str, Any] = dict(zip(parameters, map(float, scaled * unit), strict=True))
    errors = dict(zip(parameters, map(float, np.sqrt(np.diag(covariance))), strict=True))
    left = float(np.linalg.norm(answer.fun) / np.linalg.norm(np.concatenate(sizes)))
    return Fitted(replace(start, **values), values, errors, covariance, chi_square, total,
                  systematic, held, left)  # fmt: skip


def _check_told(jac: Float, parameters: Sequence[str], alone: bool) -> None:
    """Refuse parameters along a combination of which residuals do not change.

    Raises:
        FitError: there is one; the message names them.
    """
    felt = np.linalg.norm(jac, axis=0) + 1e-300
    _, singular, rows = np.linalg.svd(jac / felt)
    if not singular[-1] > 1e-9 * singular[0]:
        part = np.abs(rows[-1] / felt)
        apart = [n for n, one in zip(parameters, part / part.max(), strict=True) if one > 0.15]
        which = (f"{', '.join(apart)} apart", "one of them") if apart[1:] else (apart[0], "it")
        beside = ", or see whether points of another sector tell, with --also FILE"
        raise FitError(
            f"the points do not tell {which[0]}: leave {which[1]} out of --vary"
            + (beside if alone else "")
        )


def _held_columns(model: _Model, scaled: Float) -> dict[str, Float]:
    """{what is held: how residuals change as it grows by all of its size}."""
    fitted = model.medium(scaled)
    values = {n: float(getattr(fitted, n) or 0.0) for n in fitted.known()}
    sizes = {n: abs(v) or float(not fitted.known()[n].unit) for n, v in values.items()}
    held = tuple(n for n, size in sizes.items() if size and n not in model.parameters)
    unit, at = (np.array([of[n] for n in held]) for of in (sizes, values))
    slopes = replace(model, start=fitted, parameters=held, unit=unit).slopes(at / unit)
    found = {f"medium.{n}": slope for n, slope in zip(held, slopes.T, strict=True)}
    moved = [
        replace(o, points=replace(o.points, k=o.points.k * (1 + _CHANGED))) for o in model.observed
    ]
    there = replace(model, observed=moved).residuals(scaled)
    return found | {"spacing": (there - model.residuals(scaled)) / _CHANGED}


def _sizes(points: BranchPoints) -> Float:
    """ω, or both parts of k, over the errors, as residuals are."""
    if points.in_space:
        of = points.k / points.error * np.sqrt(2)
        return np.concatenate([of.real, of.imag])
    return points.omega / points.error


def _relation(one: Observed, medium: Medium) -> OfMedium:
    return OfMedium(medium, one.block, one.grid)


def _named(observed: Sequence[Observed], medium: Medium) -> list[Any]:
    """Branch of each point: that of most of its joined branch's points, by nearness."""
    names = []
    for one in observed:
        points = one.points
        if points.in_space:
            names.append(np.zeros(len(points), int))
            continue
        exact = np.real(_relation(one, medium).omega(points.k))
        nearest = np.argmin(np.abs(exact - points.omega[:, None]), axis=1)
        for branch in points.branches:
            own = points.branch == branch
            nearest[own] = np.bincount(nearest[own]).argmax()
        names.append(nearest)
    return names


@dataclass(frozen=True)
class _Model:
    """Residuals and their derivatives at scaled parameters."""

    observed: Sequence[Observed]
    start: Medium
    parameters: tuple[str, ...]
    unit: Float
    names: list[Any]

    def medium(self, scaled: Float) -> Medium:
        values: dict[str, Any] = dict(
            zip(self.parameters, map(float, scaled * self.unit), strict=True)
        )
        return replace(self.start, **values)

    def residuals(self, scaled: Float) -> Float:
        medium = self.medium(scaled)
        parts = []
        for one, name in zip(self.observed, self.names, strict=True):
            points, relation = one.points, _relation(one, medium)
            if points.in_space:
                # The standard error is that of |k|: each part has its half of the variance.
                off = (relation.wavenumber(points.omega) - points.k) / points.error * np.sqrt(2)
                parts += [off.real, off.imag]
            else:
                exact = relation.omega(points.k)[np.arange(len(points)), name].real
                parts.append((exact - points.omega) / points.error)
        return np.concatenate(parts)

    def slopes(self, scaled: Float) -> Float:
        medium = self.medium(scaled)
        parts = []
        for one, name in zip(self.observed, self.names, strict=True):
            points = one.points
            form, tangents = _tangents(medium, one.block, self.parameters, self.start)
            length, time = float(self.start.length_scale), float(self.start.time_scale)
            relation = _relation(one, medium)
            if points.in_space:
                k = OfMedium(medium, one.block).wavenumber(points.omega)
                right, left = _mode(form, k * length, (points.omega * time) ** 2)
                rise = _form(left, stiffness_slope(form, k * length), right)
                grid = relation.wavenumber(points.omega)
                ratio = relation.stretch(grid)
                columns = []
                for tangent in tangents:
                    change = -_form(left, stiffness(tangent, k * length), right) / rise
                    off = change / length / ratio / points.error * np.sqrt(2)
                    columns.append(np.concatenate([off.real, off.imag]))
            else:
                k = relation.modified(points.k) * length
                omega = relation.omega(points.k)[np.arange(len(points)), name] * time
                right, left = _mode(form, k, omega**2)
                columns = [
                    (_form(left, stiffness(tangent, k), right) / (2 * omega)).real
                    / time
                    / points.error
                    for tangent in tangents
                ]
            parts.append(np.stack(columns, axis=1))
        return np.concatenate(parts) * self.unit


def _form(left: Any, matrix: Any, right: Any) -> Any:
    return np.einsum("ni,nij,nj->n", left, matrix, right)


def _mode(form: BlockCoefficients, k: Any, square: Any) -> tuple[Any, Any]:
    """Right and left eigenvector of K(k) with the eigenvalue nearest to ω², uᵀv = 1."""
    values, vectors = np.linalg.eig(stiffness(form, k))
    at = np.argmin(np.abs(values - square[:, None]), axis=1)
    inverse = np.linalg.inv(vectors)
    row = np.arange(len(at))
    return vectors[row, :, at], inverse[row, at, :]


def _tangents(
    medium: Medium, block: Block, parameters: tuple[str, ...], start: Medium
) -> tuple[BlockCoefficients, list[BlockCoefficients]]:
    """Scaled coefficients of a block, in the units of the start, and their derivatives."""
    at = dual.parameters([getattr(medium, name) for name in parameters])
    given: dict[str, Any] = dict(zip(parameters, at, strict=True))
    form = block_coefficients(replace(medium, **given), block, scales(start)).per_inertia()
    parts = [getattr(form, one.name) for one in fields(form)]
    tangents = (
        [one.slopes[i] if isinstance(one, dual.Dual) else np.zeros(np.shape(one)) for one in parts]
        for i in range(len(parameters))
    )
    values = BlockCoefficients(*map(dual.value_of, parts))
    return values, [BlockCoefficients(*one) for one in tangents]
