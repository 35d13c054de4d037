"""Strict settings for every test: double precision, no silent promotion of types."""

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "allow")


@pytest.fixture(scope="module", autouse=True)
def forgotten():
    """What a module compiled is not kept: a process may map 65,530 pieces of memory, no more."""
    yield
    jax.clear_caches()


@pytest.fixture
def rng():
    import numpy as np

    return np.random.default_rng(6129)


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
def small_run(small_case, tmp_path_factory):
    """That case run whole: (problem, outcome, field)."""
    from wavesim import runner
    from wavesim.case.problem import load
    from wavesim.io import result_reader as resultfile

    problem = load(small_case)
    outcome = runner.run(problem, tmp_path_factory.mktemp("small"))
    return problem, outcome, resultfile.read(outcome.folder / "result.h5", problem)


@pytest.fixture(scope="session")
def small_held(small_run):
    """What is measured from it, beside the theory, block by block."""
    from wavesim.readings.dispersion.extract import extract
    from wavesim.verdict.endless import hold

    problem, _, field = small_run
    return [hold(field, m, problem.k_range) for m in extract(field, problem.k_range[1])]
