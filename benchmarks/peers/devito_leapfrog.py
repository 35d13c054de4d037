"""Leapfrog in Devito: space order 8 on a staggered grid, one C loop over all steps.

σ is a function of its own, so that each derivative is one eight-point stencil; B and σ at index i
stand at the half-node i + ½. The halo stays 0: nothing reaches the ends of the ring.
"""

from __future__ import annotations

import numpy as np
from devito import (
    ConditionalDimension,
    Constant,
    Eq,
    Function,
    Grid,
    Operator,
    SparseTimeFunction,
    TimeFunction,
    configuration,
    solve,
)

configuration["log-level"] = "ERROR"
# Compiled operators, of which medium and step are arguments.
_made: dict = {}


def _model(given, per_frame: int, frames: int):
    """The operator, its coefficients, pulses, fields and frames."""
    n, steps = given.points, per_frame * (frames - 1)
    spacing = 1225 / 1024 / given.w[0]  # the first weight of order 8 is 1225/1024h
    grid = Grid((n,), ((n - 1) * spacing,), dtype=np.float64)
    (x,) = grid.dimensions
    half = x.spacing / 2
    c = np.array([Constant(name=f"c{k}", dtype=np.float64) for k in range(30)])
    kept = ConditionalDimension("kept", parent=grid.time_dim, factor=per_frame)
    u = [TimeFunction(name=f"u{i}", grid=grid, space_order=8, time_order=2) for i in range(12)]
    seen = [TimeFunction(name=f"w{i}", grid=grid, time_dim=kept, save=frames) for i in range(12)]
    equations = []
    accelerations = [None] * 12
    for b in range(3):
        rows = c[9 * b : 9 * b + 9].reshape(3, 3)
        sigma = Function(name=f"sigma{b}", grid=grid, space_order=8)
        slope = u[b].dx(x0=x + half)
        strains = slope, u[3 + b], u[6 + b]
        stress = [sum(r * e for r, e in zip(row, strains, strict=True)) for row in rows]
        equations.append(Eq(sigma, stress[0]))
        accelerations[b] = sigma.dx(x0=x - half)
        accelerations[3 + b], accelerations[6 + b] = stress[1:]
        accelerations[9 + b] = c[27 + b] * u[9 + b]
    for field, acceleration in zip(u, accelerations, strict=True):
        equations.append(Eq(field.forward, solve(field.dt2 - acceleration, field.forward)))
    pulses = []
    for number, at in enumerate(np.flatnonzero(given.g[given.rates])):
        component, point = divmod(int(at), n)
        pulse = SparseTimeFunction(name=f"s{number}", grid=grid, npoint=1, nt=steps + 1)
        pulse.coordinates.data[0, 0] = point * spacing
        equations += pulse.inject(field=u[component].forward, expr=pulse)
        pulses.append(pulse)
    equations += [Eq(frame, field) for frame, field in zip(seen, u, strict=True)]
    operator = Operator(equations, name="Leapfrog")
    operator.cfunction  # noqa: B018  (compiles it)
    return operator, c, pulses, u, seen


class Peer:
    """Setting: steps from one frame to the next."""

    def __init__(self, given, setting: float) -> None:
        self.given, self.per_frame = given, int(setting)

    def compile(self, frames: int) -> None:
        key = self.per_frame, frames
        if key not in _made:
            _made[key] = _model(self.given, *key)

    def run(self, frames: int) -> np.ndarray:
        given, per_frame = self.given, self.per_frame
        operator, c, pulses, u, seen = _made[per_frame, frames]
        for constant, value in zip(c, [*given.c[0, :3].ravel(), *given.c[0, 3, 0]], strict=True):
            constant.data = value
        for field in u:
            field.data_with_halo[:] = 0.0
        force, signal = given.g[given.rates], given.driven(per_frame, frames)
        for pulse, strength in zip(pulses, force[np.flatnonzero(force)], strict=True):
            pulse.data[:] = 0.0
            pulse.data[: len(signal), 0] = strength * signal
        operator.apply(time_m=0, time_M=per_frame * (frames - 1), dt=given.interval / per_frame)
        return np.stack([np.asarray(frame.data) for frame in seen], axis=1).reshape(frames, -1)
