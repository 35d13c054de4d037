"""Functions that jax has compiled, kept for runs of the same shape."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from contextlib import suppress
from threading import Lock
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

# Compiled functions, by all that they depend on: a second run of one shape compiles nothing. The
# last ones are kept: each takes 12 MB and two hundred mappings of memory, of which a process has
# 65,530. What jax keeps of its own, 4 MB for each, is let go as often.
_COMPILED: dict[Any, Any] = {}
_KEPT = 32
_made = 0
# What XLA leaves out for a CPU where it is to be quick: a third of the time. Elementwise loops then
# take up to twice as long, products of matrices, which are a library's, as long as before. Of what
# is compiled in more parts, beside each other, each part costs a start. The last one jax 0.10
# knows, 0.11 does not.
_QUICK = {"xla_backend_optimization_level": 1, "xla_cpu_parallel_codegen_split_count": 4}
_QUICKEST = _QUICK | {"xla_cpu_use_fusion_emitters": False}
_ALONE = Lock()


def compiled(
    function: Callable[..., Any],
    arguments: Any,
    meanwhile: Callable[[], object] = lambda: None,
    quickly: bool = False,
    **settings: Any,
) -> Any:
    """A function compiled for arguments of these shapes and for settings, its keywords.

    ``meanwhile`` is called when it has been traced: from there on Python has nothing to do.
    ``quickly`` is for what is products of matrices above all: it compiles sooner, and runs as fast.
    """
    leaves, structure = jax.tree.flatten(arguments)
    shapes = tuple((np.shape(leaf), str(jnp.result_type(leaf))) for leaf in leaves)
    key = (function, structure, shapes, quickly, tuple(settings.items()))
    if key not in _COMPILED:
        whole = functools.partial(function, **settings)
        lowered = jax.jit(whole).lower(*arguments)
        meanwhile()
        _COMPILED[key] = _of_xla(lowered, quickly)
        _let_go()
    else:
        meanwhile()
    with _ALONE:
        made = _COMPILED[key] = _COMPILED.pop(key)  # to the end, as the last one used
        while len(_COMPILED) > _KEPT:
            del _COMPILED[next(iter(_COMPILED))]
    return made


def _of_xla(lowered: Any, quickly: bool) -> Any:
    if quickly and jax.default_backend() == "cpu":
        for options in (_QUICKEST, _QUICK):
            with suppress(jax.errors.JaxRuntimeError):  # an XLA that knows no such option
                return lowered.compile(compiler_options=options)
    return lowered.compile()


def _let_go() -> None:
    """Let go of what jax keeps of functions that were compiled, once in so many."""
    global _made
    with _ALONE:
        _made += 1
        due = _made % _KEPT == 0
    if due:
        jax.clear_caches()


def keep_compiled() -> None:
    """Let jax keep compiled functions from one process to the next, unless it was told where to.

    Equinox's checks call back to Python, and jax keeps nothing on disk that does: they are set to
    turn into values that are not finite, which the integration looks for. Best called before
    equinox is loaded.
    """
    os.environ.setdefault("EQX_ON_ERROR", "nan")
    from platformdirs import user_cache_path

    if jax.config.values["jax_compilation_cache_dir"] is None:
        jax.config.update("jax_compilation_cache_dir", str(user_cache_path("wavesim") / "jax"))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
