"""Which of several things continues which: the assignment of least total cost."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def assigned(cost: NDArray[np.float64]) -> tuple[Any, Any]:
    """Rows and columns that belong together, each at most once, as many as there can be.

    Where the nearest of each is no other's, as it nearly always is, that is the least there can be,
    and nothing is to be solved.

    Args:
        cost: of each pair, shape (rows, columns), finite.

    Returns:
        Indices of rows, ascending, and of the columns that go with them.
    """
    rows, columns = cost.shape
    if rows > columns:
        columns_of, rows_of = assigned(cost.T)
        order = np.argsort(rows_of)
        return rows_of[order], columns_of[order]
    nearest = cost.argmin(axis=1)
    if len(np.unique(nearest)) == rows:
        return np.arange(rows), nearest
    from scipy.optimize import linear_sum_assignment  # slow to import, and seldom needed

    return linear_sum_assignment(cost)
