"""The map φ of a plan from the warped space to the ambient one, and its grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import NdBSpline

from ..archive import Archive
from ..arrays import Array
from ..errors import InputError
from ..plan import Plan

_DEGREE = 3
_LINES = 18  # of the grid along x and y, at most
_LEVELS = (0.0, 0.5)  # m above the ground in the warped space
_POINTS = 80  # of each line
_MOST_CONTROL_POINTS = 1 << 22
_REACH = 0.8  # m around the way, where the grid is drawn


@dataclass(frozen=True)
class Warping:
    """φ inside its box."""

    spline: Callable[[Array], Array]  # of points (…, 3)
    lower: Array  # (3,) m, where φ is defined in the warped space
    upper: Array  # (3,)

    def __call__(self, points: Array) -> Array:
        """Points (…, 3) m of the warped space in ambient space."""
        return self.spline(np.clip(points, self.lower, self.upper))


def warping_of(archive: Archive, plan: Plan) -> Warping | None:
    """The map in a plan's file, if it has one; raises `InputError` if it is damaged."""
    if "map_control_points" not in archive:
        return None
    control = archive["map_control_points"]
    knots = tuple(archive[f"map_knots_{axis}"] if f"map_knots_{axis}" in archive else np.zeros(0) for axis in "xyz")
    sizes = tuple(len(k) - _DEGREE - 1 if k.ndim == 1 else -1 for k in knots)
    good = control.shape == (*sizes, 3) and control.size <= _MOST_CONTROL_POINTS and min(sizes) > _DEGREE
    if not good or not all(np.isfinite(a).all() and a.dtype == np.float64 for a in (control, *knots)):
        raise InputError(f"{plan.path}: member map_control_points: expected finite control points for the knots along x, y and z")
    if any((np.diff(k) <= 0).any() for k in knots):
        raise InputError(f"{plan.path}: member map_knots_x, _y or _z: expected increasing knots")
    ends = [(k[_DEGREE], k[-_DEGREE - 1]) for k in knots]
    return Warping(NdBSpline(knots, control, _DEGREE), np.array([e[0] for e in ends]), np.array([e[1] for e in ends]))


def grid(warping: Warping, around: Array) -> list[Array]:
    """Lines (P, 3) of a grid in the warped space, near points (N, 3) of it: along x and y, at some heights."""
    low = np.maximum(around[:, :2].min(0) - _REACH, warping.lower[:2])
    high = np.minimum(around[:, :2].max(0) + _REACH, warping.upper[:2])
    spacing = max(0.1, float((high - low).max()) / _LINES)
    first, last = np.ceil(low / spacing), np.floor(high / spacing)
    xs, ys = (spacing * np.arange(a, b + 1) for a, b in zip(first, last, strict=True))
    lines = []
    for level in _LEVELS:
        if level > warping.upper[2]:
            continue
        lines += [np.stack([np.full(_POINTS, x), np.linspace(low[1], high[1], _POINTS), np.full(_POINTS, level)], -1) for x in xs]
        lines += [np.stack([np.linspace(low[0], high[0], _POINTS), np.full(_POINTS, y), np.full(_POINTS, level)], -1) for y in ys]
    return lines
