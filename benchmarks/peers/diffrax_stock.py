"""diffrax's own Tsit5 and Dopri8, adaptive, on a right-hand side written plainly in jax."""

from __future__ import annotations

from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)
_MOST_STEPS = 1_000_000
_compiled: dict = {}


def _rate(t, y, args):
    """(q̇, v̇) = (v, L q + f), stencils of the ring by ``jnp.roll``."""
    w, c, own, g, peak, delay = args
    q, v = y
    phi, b1, b2, oscillators = q[:3], q[3:6], q[6:9], q[9:]
    kappa = sum(w[j - 1] * (jnp.roll(phi, -j, 1) - jnp.roll(phi, j - 1, 1)) for j in range(1, 5))
    sigma, on_b1, on_b2 = (c[i, 0] * kappa + c[i, 1] * b1 + c[i, 2] * b2 for i in range(3))
    on_phi = sum(
        w[j - 1] * (jnp.roll(sigma, 1 - j, 1) - jnp.roll(sigma, j, 1)) for j in range(1, 5)
    )
    u = (peak * (t - delay)) ** 2
    force = (1 - 2 * u) * jnp.exp(-u) * g
    return v, jnp.concatenate([on_phi, on_b1, on_b2, own * oscillators]) + force


@partial(jax.jit, static_argnames="solver")
def _solve(solver, tolerance, t, rest, args):
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(_rate),
        getattr(diffrax, solver)(),
        t0=t[0],
        t1=t[-1],
        dt0=1e-2,
        y0=(rest, rest),
        args=args,
        saveat=diffrax.SaveAt(ts=t, fn=lambda t, y, args: y[0]),
        # From rest nothing else keeps the first steps from passing over the pulse.
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance, dtmax=1.0),
        max_steps=_MOST_STEPS,
    )
    return found.ys


class Tsit5:
    """Setting: relative and absolute tolerance."""

    def __init__(self, given, setting: float) -> None:
        self.given, self.tolerance = given, setting
        c = given.c[0]
        coupled = np.moveaxis(c[:3], 0, -1)[..., None]  # row, factor, block, point
        g = given.g[given.rates].reshape(12, -1)
        self.args = given.w, coupled, c[3, 0][:, None], g, given.peak, given.delay

    def _known(self, frames: int):
        t = self.given.interval * np.arange(frames)
        solver = type(self).__name__
        return solver, self.tolerance, t, jnp.zeros((12, self.given.points)), self.args

    def compile(self, frames: int) -> None:
        key = type(self), frames
        if key not in _compiled:
            _compiled[key] = _solve.lower(*self._known(frames)).compile()

    def run(self, frames: int) -> np.ndarray:
        made = _compiled[type(self), frames](*self._known(frames)[1:])
        return np.asarray(made).reshape(frames, -1)


class Dopri8(Tsit5):
    """As Tsit5, of order 8."""
