"""Strict settings for every test: double precision, no silent promotion of types."""

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "allow")


@pytest.fixture
def rng():
    import numpy as np

    return np.random.default_rng(6129)
