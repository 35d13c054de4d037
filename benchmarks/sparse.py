"""The staggered operator as SciPy sparse matrices on a flat state of 12 components."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from problem import Problem


def difference_matrix(problem: Problem) -> sp.csr_array:
    """D, nodes to half-nodes of the periodic bar: (D u)_i = Σ_j c_j (u_{i+j} − u_{i+1−j})/h."""
    n = problem.bar.cells
    rows = np.arange(n)
    parts = []
    for j, c in enumerate(problem.weights, start=1):
        for shift, sign in ((j, c), (1 - j, -c)):
            parts.append(sp.csr_array((np.full(n, sign), (rows, (rows + shift) % n)), (n, n)))
    return sp.csr_array(sum(parts[1:], start=parts[0]))


def operator_matrix(problem: Problem) -> sp.csr_array:
    """L, shape (12 N, 12 N), assembled: one product is one multiplication."""
    D = difference_matrix(problem)
    unit = sp.eye_array(problem.bar.cells)
    blocks = []
    for form in problem.forms:
        blocks.append(
            sp.bmat(
                [
                    [-sp.kron(form.c_pp, D.T @ D), sp.kron(form.c_pb, D.T)],
                    [sp.kron(form.c_bp, D), -sp.kron(form.c_bb, unit)],
                ]
            )
            if len(form.c_pp)
            else -sp.kron(form.c_bb, unit)
        )
    return sp.csr_array(sp.block_diag(blocks))
