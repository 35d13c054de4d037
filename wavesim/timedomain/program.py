"""The compiled program of a run: the only caller of ``diffrax.diffeqsolve``."""

from __future__ import annotations

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.steppers import TERM
from wavesim.timedomain.timestep import Leg


def advance(
    equation: Any,
    stepper: Any,
    motion: Any,
    start: jax.Array,
    step: float,
    leg: Leg,
    stepper_state: Any = None,
    adjoint: Any = None,
) -> Any:
    """Integrate the frames of a leg from a state; pure, so that jax transforms go through.

    The stepper's own state, of :func:`prepare`, is made here if it is not given.

    Args:
        equation, stepper, motion: as for :func:`program`.
        start: number of steps h before.
        step: h.
        leg: how many frames, and how each is stepped.
        stepper_state, adjoint: see diffrax.
    """

    def observe(t: Any, y: Any, args: Any) -> Any:
        return equation.observe(y)

    count = leg.frames * leg.taken
    frame, within = jnp.divmod(jnp.arange(count + 1), leg.taken)
    times = (start + frame * (leg.steps + leg.stride) + within).astype(float) * step
    solution = diffrax.diffeqsolve(
        TERM,
        stepper,
        t0=times[0],
        t1=times[-1],
        dt0=None,
        y0=motion,
        args=equation,
        saveat=diffrax.SaveAt(
            subs=(
                diffrax.SubSaveAt(steps=leg.taken, fn=observe),
                diffrax.SubSaveAt(t1=True),
            ),
        ),
        stepsize_controller=diffrax.StepTo(ts=times),
        max_steps=count,
        solver_state=stepper_state,
        adjoint=diffrax.RecursiveCheckpointAdjoint() if adjoint is None else adjoint,
    )
    seen, last = solution.ys
    return seen, jax.tree.map(lambda a: a[-1], last)


def prepare(equation: Any, stepper: Any, motion: Any, start: jax.Array, step: float) -> Any:
    """The stepper's own state at a motion.

    It is made anew for each chunk: a run that is carried on from a stored motion is the
    uninterrupted one to the last bit.
    """
    t = jnp.asarray(start).astype(float) * step
    return stepper.init(TERM, t, t + step, motion, equation)


# Compiled functions, by all that they depend on: a second run of one shape compiles nothing. The
# last ones are kept: each takes some hundred mappings of memory, of which a process has 65,530.
_COMPILED: dict[Any, Any] = {}
_KEPT = 64
_ALONE = Lock()


def _compiled(function: Callable[..., Any], arguments: Any, **settings: Any) -> Any:
    """A function compiled for arguments of these shapes and for settings, its keywords."""
    leaves, structure = jax.tree.flatten(arguments)
    shapes = tuple((np.shape(leaf), str(jnp.result_type(leaf))) for leaf in leaves)
    key = (function, structure, shapes, tuple(settings.items()))
    if key not in _COMPILED:
        whole = functools.partial(function, **settings)
        _COMPILED[key] = jax.jit(whole).lower(*arguments).compile()
    with _ALONE:
        made = _COMPILED[key] = _COMPILED.pop(key)  # to the end, as the last one used
        while len(_COMPILED) > _KEPT:
            del _COMPILED[next(iter(_COMPILED))]
    return made


def program(equation: Any, stepper: Any, motion: Any, step: float, leg: Leg) -> Any:
    """What integrates the frames of a leg from a motion and a number of steps, compiled.

    The compiler works in one thread: two functions beside each other take less than one.

    Args:
        equation, stepper: of :mod:`assembly`.
        motion: one of their states, for its shape.
        step: h.
        leg: how many frames, and how each is stepped.

    Returns:
        A function of a motion and of the number of steps before it, which gives what
        :func:`advance` does.
    """
    known = (equation, stepper, motion, jnp.asarray(0))
    kept = jax.eval_shape(functools.partial(prepare, step=step), *known)
    with ThreadPoolExecutor(1) as other:
        first = other.submit(_compiled, prepare, known, step=step)
        then = _compiled(_carried, (*known, kept), step=step, leg=leg)
        begin = first.result()

    def run(motion: Any, at: jax.Array) -> Any:
        return then(equation, stepper, motion, at, begin(equation, stepper, motion, at))

    return run


def observed(equation: Any, motion: Any) -> Any:
    """A motion as one frame, in plain arrays of shape (1, …)."""
    seen = _compiled(_frame, (equation, motion))(equation, motion)
    return jax.tree.map(lambda a: np.asarray(a)[None], seen)


def _frame(equation: Any, motion: Any) -> Any:
    return equation.observe(motion)


def _carried(
    equation: Any,
    stepper: Any,
    motion: Any,
    start: jax.Array,
    stepper_state: Any,
    **settings: Any,
) -> Any:
    return advance(equation, stepper, motion, start, stepper_state=stepper_state, **settings)
