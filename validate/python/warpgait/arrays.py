"""Types of arrays, and where an array of flags is true."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.intp]


def runs(flags: Bools) -> list[tuple[int, int]]:
    """Every run of true values in flags (N,): its first index, and one past its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def since_start(flags: Bools, increments: Array) -> Array:
    """Running sums (K, E) of `increments` (K, E) over each run of true `flags` (K, E); zero where a flag is false."""
    total = np.zeros(flags.shape)
    for k in range(len(flags)):
        total[k] = np.where(flags[k], (total[k - 1] if k else 0.0) + increments[k], 0.0)
    return total
