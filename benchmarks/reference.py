"""Write the exact fields at the final time to a file: python benchmarks/reference.py EXACT.npz"""

from __future__ import annotations

import sys

import numpy as np
from problem import exact_fields, problem

if __name__ == "__main__":
    np.savez(sys.argv[1], **exact_fields(problem()))
