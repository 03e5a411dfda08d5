"""Figures by which roboticists compare walks, from a replay. README.md has the definitions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from .arrays import Array, Bools
from .metrics import filtered_forces
from .model import Indices
from .plan import Plan
from .reference import Reference
from .replay import Replay

LEAST_LOAD = 0.02  # of m g: a foot with less normal force is not counted for the use of friction
LEAST_DISTANCE = 0.1  # m: a shorter walk has no cost of transport
HIGH = 95  # percentile that is given beside the maximum


@dataclass(frozen=True)
class Figure:
    """One number. `key` is its name in JSON."""

    key: str
    name: str
    unit: str
    value: float  # NaN where it is not defined


def support_margin(points: Array, feet: Array, contact: Bools) -> Array:
    """Distance (K,) of `points` (K, 2) from the edge of the support polygon of `feet` (K, E, 2) in contact (K, E); negative outside.

    The polygon is the convex hull. On two feet it is a line, and the distance zero or less; with fewer there is none, and the result is NaN.
    """
    K, E = contact.shape
    margin = np.full(K, np.inf)
    for i in range(E):
        for j in range(E):
            if i == j:
                continue
            edge = feet[:, j] - feet[:, i]
            length = np.linalg.norm(edge, axis=1)
            inward = np.stack([-edge[:, 1], edge[:, 0]], 1) / np.maximum(length, 1e-12)[:, None]
            sides = np.einsum("kd,ked->ke", inward, feet - feet[:, None, i])
            is_edge = contact[:, i] & contact[:, j] & ((sides > -1e-9) | ~contact).all(1)
            distance = np.einsum("kd,kd->k", inward, points - feet[:, i])
            margin = np.where(is_edge, np.minimum(margin, distance), margin)
    return np.where(np.isfinite(margin), margin, np.nan)


def cycle_of(reference: Reference) -> float:
    """The median time, s, between touch-downs of the same foot; NaN if no foot touches down twice."""
    periods = [np.diff(reference.t[1:][contact[1:] & ~contact[:-1]]) for contact in reference.contact.T]
    every = np.concatenate(periods)
    return float(np.median(every)) if every.size else math.nan


def sway_of(com: Array, period: float, cycle: float) -> float:
    """Peak to peak, m, of how far the center of mass (K, 3) is to the side of its mean over a cycle; `period` s between samples."""
    width = round(cycle / period) if math.isfinite(cycle) else 0
    if not 1 < width < len(com):
        return math.nan
    mean = uniform_filter1d(com[:, :2], width, axis=0, mode="nearest")
    whole = slice(width // 2, len(com) - width // 2)  # where the window is within the walk
    velocity, off = np.gradient(mean, period, axis=0)[whole], (com[:, :2] - mean)[whole]
    speed = np.linalg.norm(velocity, axis=1)
    moving = speed > 0.1 * np.median(speed)
    if not moving.any():
        return math.nan
    side = (velocity[moving, 0] * off[moving, 1] - velocity[moving, 1] * off[moving, 0]) / speed[moving]
    return float(np.ptp(side))


def _peaks(values: Array) -> tuple[float, float]:
    """Maximum and 95th percentile of values; NaN of none."""
    return (float(values.max()), float(np.percentile(values, HIGH))) if values.size else (math.nan, math.nan)


def _least(values: Array) -> tuple[float, float]:
    """Minimum and median of the values that are numbers."""
    known = values[np.isfinite(values)]
    return (float(known.min()), float(np.median(known))) if known.size else (math.nan, math.nan)


def figures(plan: Plan, replay: Replay, reference: Reference, index: Indices) -> list[Figure]:
    """All figures of a replay; none of one with fewer than two samples."""
    K = len(replay.t)
    if K < 2:
        return []
    period, mg = float(reference.t[1]), plan.weight
    up = -plan.robot.gravity / np.linalg.norm(plan.robot.gravity)
    force, contact = filtered_forces(replay, reference).simulated, replay.contact
    acceleration = np.linalg.norm(force.sum(1) / plan.robot.mass + plan.robot.gravity, axis=1)
    power = replay.torque * replay.qvel[:, index.qvel]
    cycle = cycle_of(reference)
    distance = float(np.linalg.norm(np.diff(replay.com[:: max(1, round(0.1 / period)), :2], axis=0), axis=1).sum())
    work = float(np.maximum(power, 0).sum()) * period
    speed = np.linalg.norm(np.gradient(replay.foot, period, axis=0), axis=-1)
    normal = reference.normal[:K]
    along = (force * normal).sum(-1)
    across = np.linalg.norm(force - along[..., None] * normal, axis=-1)
    loaded = contact & reference.contact[:K] & (along > LEAST_LOAD * mg) & ~plan.foot_adhesive
    pressure = np.einsum("ked,d->ke", force, up)
    total = np.maximum(pressure.sum(1), LEAST_LOAD * mg)
    center = np.einsum("ke,ked->kd", pressure, replay.foot[..., :2]) / total[:, None]
    standing = contact & (pressure > 0)
    fastest, fast = _peaks(speed[~reference.contact[:K]])
    torque, high_torque = _peaks(np.abs(replay.torque) / index.torque_limit)
    friction, high_friction = _peaks(across[loaded] / (plan.robot.friction * along[loaded]))
    of_pressure, of_center = (_least(support_margin(p, replay.foot[..., :2], standing)) for p in (center, replay.com[:, :2]))
    return [
        Figure("speed", "mean speed", "m/s", distance / float(replay.t[-1])),
        Figure("sway", "sway of the center of mass, peak to peak", "m", sway_of(replay.com, period, cycle)),
        Figure("acceleration_max", "acceleration of the center of mass, max", "m/s²", float(acceleration.max())),
        Figure("acceleration_rms", "acceleration of the center of mass, rms", "m/s²", float(np.sqrt((acceleration**2).mean()))),
        Figure(
            "cost_of_transport",
            "mechanical cost of transport",
            "",
            work / (mg * distance) if distance > LEAST_DISTANCE else math.nan,
        ),
        Figure("foot_speed_max", "speed of swinging feet, max", "m/s", fastest),
        Figure("foot_speed_95", f"speed of swinging feet, {HIGH} %", "m/s", fast),
        Figure("torque_use_max", "joint torque, max", "of limit", torque),
        Figure("torque_use_95", f"joint torque, {HIGH} %", "of limit", high_torque),
        Figure("friction_use_max", "friction, max", "of cone", friction),
        Figure("friction_use_95", f"friction, {HIGH} %", "of cone", high_friction),
        Figure("pressure_margin_min", "center of pressure to the edge of support, min", "m", of_pressure[0]),
        Figure("pressure_margin_median", "center of pressure to the edge of support, median", "m", of_pressure[1]),
        Figure("center_margin_min", "center of mass to the edge of support, min", "m", of_center[0]),
        Figure("center_margin_median", "center of mass to the edge of support, median", "m", of_center[1]),
    ]
