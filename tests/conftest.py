"""Strict settings for every test, and the costly runs that tests and workers share."""

import os
from functools import cache
from importlib.metadata import version
from pathlib import Path

WORKER = os.environ.get("PYTEST_XDIST_WORKER")
# Set before the workers start, which inherit it: a core is a worker's share, and threads that wait
# for each other there take ten times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("EQX_ON_ERROR", "nan")  # as a run has it, so that compiled functions are kept
# Most of what tests wait for is compilation; these save a quarter of it, where runs are short. (An
# XLA ends at an option that it does not know: of this version it is known that it does.)
if version("jaxlib").startswith("0.10."):
    os.environ.setdefault(
        "XLA_FLAGS", "--xla_cpu_use_fusion_emitters=false --xla_backend_optimization_level=1"
    )

import jax  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "allow")


def pytest_addoption(parser, pluginmanager):
    """Without pytest-xdist its options, which stand in pyproject.toml, are without effect."""
    if not pluginmanager.hasplugin("xdist"):
        for option in ("--numprocesses", "--maxprocesses", "--dist"):
            parser.addoption(option, help="ignored: pytest-xdist is not loaded")


# Modules whose programs take far longer to compile than to run: optimised less, a third is saved.
COMPILED_MOST = {
    "test_differentiable_transmission",
    "test_gradients",
    "test_receivers_in_batches",
}


@pytest.fixture(scope="module", autouse=True)
def forgotten(request):
    """What a module compiled is not kept: a process may map 65,530 pieces of memory, no more."""
    jax.config.update("jax_disable_most_optimizations", request.module.__name__ in COMPILED_MOST)
    yield
    jax.clear_caches()


@pytest.fixture
def rng():
    return np.random.default_rng(6129)


@pytest.fixture(scope="session")
def shared(tmp_path_factory) -> Path:
    """A folder that all workers see."""
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if WORKER else own) / "shared"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session", autouse=True)
def compiled(shared, pytestconfig):
    """What is compiled is kept for all workers and processes, and for the next time."""
    known = getattr(pytestconfig, "cache", None)
    kept = {
        "compilation_cache_dir": str(known.mkdir("jax") if known else shared / "jax"),
        "compilation_cache_max_size": 2**30,
        "persistent_cache_min_compile_time_secs": 0.1,
    }
    for name, value in kept.items():
        jax.config.update(f"jax_{name}", value)
        os.environ[f"JAX_{name.upper()}"] = str(value)


@pytest.fixture(scope="session")
def shipped(shared):
    """Runs of the shipped cases, by name."""
    from runs import shipped

    return cache(lambda name: shipped(name, shared))


CLOSURES = {"printed": "bandgap_pulse", "consistent": "consistent"}


@pytest.fixture(scope="session")
def simulated(shipped):
    """Fields of the shipped case of a closure: all twelve waves on the default grid."""
    return lambda closure: shipped(CLOSURES[closure]).field


@pytest.fixture(scope="session")
def recovered(simulated, shared):
    """Of such a field [(block, record, points up to k̄ = 1)], by closure and method."""
    from media import unit_wavenumber
    from runs import once

    from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
    from wavesim.records.of_medium import block_record

    @cache
    def found(closure, method="harmonic"):
        field = simulated(closure)
        records = [(block, block_record(field, block)) for block in field.blocks]
        highest = unit_wavenumber(field.medium)
        points = once(
            shared / f"points_{closure}_{method}.pickle",
            lambda: [in_time(record, highest, method) for _, record in records],
        )
        return [(*pair, of) for pair, of in zip(records, points, strict=True)]

    return found


SMALL = """\
title = "A small bar"

[medium]
closure = "consistent"
anisotropy = 0.25

[bar]
length = 0.128
spacing = 1.25e-4

[[sources]]
field = "phi1"
position = 0.064
peak_frequency = 1.0e6

[[sources]]
field = "B22"
position = 0.064
peak_frequency = 1.0e6
amplitude = 3.0e-4

[[receivers]]
name = "near"
position = 0.0681

[[receivers]]
name = "far"
position = 0.0802

[time]
duration = 5.0e-5
"""


@pytest.fixture(scope="session")
def small_case(tmp_path_factory):
    """File of a case whose run takes seconds: longitudinal and in-plane waves, 1024 cells."""
    path = tmp_path_factory.mktemp("case") / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture(scope="session")
def small_run(small_case, shared):
    """That case run whole."""
    from runs import run

    return run(small_case, shared)


@pytest.fixture(scope="session")
def small_held(small_run):
    """What is measured from it, beside the theory, block by block."""
    from wavesim.readings.dispersion.extract import extract
    from wavesim.verdict.branches import hold

    field, k_range = small_run.field, small_run.loaded.k_range
    return [hold(field, m, k_range) for m in extract(field, k_range[1])]
