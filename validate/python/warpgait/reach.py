"""The reach box of a foot: the largest axis-aligned box inside the set that the leg reaches.

The set is sampled on a grid by inverse kinematics. A contact point counts as reached if the leg reaches the foot's center, one
radius along the terrain's normal, on level ground and on ground tilted in four directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools, Integers
from .kinematics import Leg, PlanarLeg, is_redundant
from .serial import SerialLeg


@dataclass(frozen=True)
class ReachRules:
    """What counts as reached, beyond the joint limits."""

    knee: tuple[float, float] = (0.35, 2.6)  # rad, least and greatest bend: neither stretched (singular) nor folded
    flexion: float = float(np.deg2rad(100.0))  # rad, of the thigh from straight down
    tilt: float = float(np.deg2rad(30.0))  # rad, of the ground
    side: float = 0.03  # m, of a foot inside its own quadrant
    play: float = 0.0025  # m, to each side of the plane in which the foot of a leg of two joints moves
    clearance: float = 0.0  # m, between foot and trunk


Cells = tuple[Integers, Integers]  # first and last index of a range along each axis


@dataclass(frozen=True)
class Box:
    """Axis-aligned, m."""

    center: Array  # (3,)
    half_size: Array  # (3,)


def reached(leg: Leg, contact: Array, radius: float, trunk: Box, rules: ReachRules) -> Bools:
    """Whether contact points (..., 3), base frame, m, belong to the reach set of `leg`."""
    s, c = np.sin(rules.tilt), np.cos(rules.tilt)
    points = contact.reshape(-1, 3)
    ok: Bools = np.linalg.norm(points - leg.hip, axis=1) <= leg.span + radius
    for axis in range(3):
        ok &= _on_its_side(leg, axis, points[:, axis], trunk, rules)
    for normal in ([0, 0, 1], [s, 0, c], [-s, 0, c], [0, s, c], [0, -s, c]):
        left = np.flatnonzero(ok)
        center = points[left] + radius * np.asarray(normal, float)
        gap = np.abs(center - trunk.center) - trunk.half_size - radius - rules.clearance
        clear: Bools = np.any(gap > 0, axis=-1)
        if isinstance(leg, SerialLeg):  # whose inverse kinematics takes long
            clear[clear] = leg.may_reach(center[clear])
        ok[left[~clear]] = False
        left, center = left[clear], center[clear]
        q, good = leg.inverse(center)
        good &= leg.within_limits(q)
        good[good] = _bends(leg, q[good], rules)
        good[good] = leg.thigh_angle(q[good]) <= rules.flexion
        good[good] = leg.is_regular(q[good])
        ok[left] = good
    reached: Bools = ok.reshape(contact.shape[:-1])
    return reached


def _on_its_side(leg: Leg, axis: int, places: Array, trunk: Box, rules: ReachRules) -> Bools:
    """Which coordinates (M,) along an axis are below the trunk, or in the quadrant of a leg."""
    if axis == 2:
        below: Bools = places < trunk.center[2] - trunk.half_size[2]  # level ground any higher is in the trunk
        return below
    if abs(leg.hip[axis]) <= rules.side:  # a leg in the middle has no side
        return np.ones(len(places), bool)
    outward: Bools = places * np.sign(leg.hip[axis]) > rules.side
    return outward


def _bends(leg: Leg, q: Array, rules: ReachRules) -> Bools:
    """Whether the knee of a leg is neither stretched nor folded, for joint angles (M, J). More than three joints do not hang on one of them."""
    if is_redundant(leg):
        return np.ones(len(q), bool)
    knee = leg.knee_angle(q)
    bends: Bools = (knee >= rules.knee[0]) & (knee <= rules.knee[1])
    return bends


def largest_rectangle(mask: Bools, least: tuple[int, int] = (1, 1), hold: Cells | None = None) -> tuple[int, int, int, int, int]:
    """Area and inclusive bounds (area, i0, i1, j0, j1) of the largest all-true rectangle with at least `least` cells along each axis and with
    `hold` in it; the area is 0 if there is none. By histograms and a stack, in O(cells): they have all rectangles that cannot be extended.
    """
    heights = np.zeros(mask.shape[1], int)
    best = (0, 0, 0, 0, 0)
    for i, row in enumerate(mask):
        heights = np.where(row, heights + 1, 0)
        stack: list[tuple[int, int]] = []  # (first column, height), heights increasing
        for j, height in enumerate([*heights.tolist(), 0]):
            start = j
            while stack and stack[-1][1] >= height:
                start, h = stack.pop()
                bounds = (i - h + 1, i, start, j - 1)
                if h * (j - start) > best[0] and h >= least[0] and j - start >= least[1] and _holds(bounds, hold):
                    best = (h * (j - start), *bounds)
            stack.append((start, height))
    return best


def _holds(bounds: tuple[int, int, int, int], hold: Cells | None) -> bool:
    i0, i1, j0, j1 = bounds
    return hold is None or bool(i0 <= hold[0][0] and hold[1][0] <= i1 and j0 <= hold[0][1] and hold[1][1] <= j1)


def _greatest_area(mask: Bools, least: tuple[int, int], hold: Cells | None) -> int:
    """Area of the rectangle that `largest_rectangle` finds, for all rows and columns at once."""
    rows, columns = np.arange(mask.shape[0]), mask.shape[1]
    # True cells above and at each cell, by column and row; then the least of them over each run of `width` columns.
    heights = (rows[:, None] - np.maximum.accumulate(np.where(mask, -1, rows[:, None]), axis=0)).T.astype(np.uint16)
    needed = np.full(len(rows), least[0], np.uint16)
    if hold is not None:
        needed = np.maximum(needed, np.where(rows >= hold[1][0], rows - hold[0][0] + 1, len(rows) + 1)).astype(np.uint16)
    lowest, best = heights, 0
    for width in range(1, columns + 1):
        if width > 1:
            lowest = np.minimum(lowest[:-1], heights[width - 1 :])
        if int(lowest.max()) * columns <= best:
            break
        if width < least[1]:
            continue
        runs = lowest if hold is None else lowest[max(0, int(hold[1][1]) - width + 1) : int(hold[0][1]) + 1]
        highest = int(np.where(runs >= needed, runs, 0).max(initial=0))
        best = max(best, highest * width)
    return best


def largest_cuboid(
    mask: Bools, least: tuple[int, int, int] = (1, 1, 1), hold: Cells | None = None
) -> tuple[Integers, Integers] | None:
    """First and last index (3,) of the largest all-true cuboid with at least `least` cells along each axis and with `hold` in it, or None.

    For each range of layers, it takes the largest rectangle in their intersection.
    """
    best, found = 0, None
    layers = mask.shape[2]
    layer = np.ascontiguousarray(mask.transpose(2, 0, 1))
    for z0 in range(layers if hold is None else int(hold[0][2]) + 1):
        common = np.ones(mask.shape[:2], bool)
        most = common.size  # no rectangle in `common` is larger
        for z1 in range(z0, layers):
            common &= layer[z1]
            most = min(most, int(np.count_nonzero(common)))
            if most * (layers - z0) <= best:
                break
            thick = z1 - z0 + 1
            if thick < least[2] or most * thick <= best or not (hold is None or hold[1][2] <= z1):
                continue
            most = _greatest_area(common, least[:2], hold)
            if most * thick > best:
                best, found = most * thick, (z0, z1)
    if found is None:
        return None
    z0, z1 = found
    common = np.logical_and.reduce(layer[z0 : z1 + 1])
    _, i0, i1, j0, j1 = largest_rectangle(common, least[:2], hold)
    return np.array([i0, j0, z0]), np.array([i1, j1, z1])


def reach_box(
    leg: Leg, radius: float, trunk: Box, rules: ReachRules, least: Array, resolution: float, hold: Box | None = None
) -> Box | None:
    """The largest box of contact points of `leg`, base frame, with edges of at least those of the first of `least` (N, 3) m for which there is one,
    and with `hold` in it.

    The grid points at both ends of the box are reached, so its edges are the distances between them.
    """
    reach = leg.span + radius
    axes = [np.arange(np.floor((h - reach) / resolution), (h + reach) / resolution) * resolution for h in leg.hip]
    axes = [places[_on_its_side(leg, axis, places, trunk, rules)] for axis, places in enumerate(axes)]
    axes[2] = axes[2][axes[2] < leg.hip[2]]
    cells = np.ceil(least / resolution - 1e-9).astype(int) + 1  # rounding must not add a cell
    if isinstance(leg, PlanarLeg) and not leg.abducts:
        cells[:, 1] = 2
        axes[1] = leg.hip[1] + leg.lateral + np.array([-rules.play, rules.play])
    mask = reached(leg, np.stack(np.meshgrid(*axes, indexing="ij"), -1), radius, trunk, rules)
    held = None
    if hold is not None:
        low, high = hold.center - hold.half_size, hold.center + hold.half_size
        held = (
            np.array([np.searchsorted(axis, at, "right") - 1 for axis, at in zip(axes, low, strict=True)]),
            np.array([np.searchsorted(axis, at, "left") for axis, at in zip(axes, high, strict=True)]),
        )
        if (held[0] < 0).any() or (held[1] >= mask.shape).any():
            return None
    bounds = next((found for x, y, z in cells.tolist() if (found := largest_cuboid(mask, (x, y, z), held)) is not None), None)
    if bounds is None:
        return None
    low, high = (np.array([axis[k] for axis, k in zip(axes, index, strict=True)]) for index in bounds)
    return Box((low + high) / 2, (high - low) / 2)
