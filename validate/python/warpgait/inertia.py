"""Moments of inertia that a body can have."""

from __future__ import annotations

import numpy as np

from .arrays import Array

MENDED = "no body has its moments of inertia; the nearest that a body has take their place (--mend-inertias)"

THIN = 1e-4  # least mean square distance from a plane, of the sum of those from three, so that rounding makes no inertia impossible again


def nearest_moments(moments: Array) -> Array:
    """The nearest principal moments (3,) kg m² of a body: none larger than the sum of the other two, which is to say that no mass has a negative
    mean square distance from a principal plane."""
    squares = np.sum(moments) / 2 - np.asarray(moments, float)  # mass by mean square distance from each principal plane
    squares = np.maximum(squares, THIN * np.sum(np.maximum(squares, 0)))
    nearest: Array = np.sum(squares) - squares
    return nearest


def nearest_inertia(inertia: Array) -> Array:
    """The nearest inertia (3, 3) kg m² of a body, about the same principal axes."""
    moments, axes = np.linalg.eigh(inertia)
    nearest: Array = (axes * nearest_moments(moments)) @ axes.T
    return nearest
