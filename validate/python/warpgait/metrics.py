"""From what happened to numbers, from numbers to a verdict.

Limits: between what good plans of Table I and six spoilings of them come to (`warpgait.calibrate`; README). A metric passes up to
`passes`, is marginal up to `marginal`, and fails beyond. Force metrics and the open loop are there because a whole-body controller tracks bad plans well: it repairs them silently.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from .model import Indices
from .openloop import OpenLoop
from .plan import Array, Bools, Plan
from .reference import Reference
from .replay import Incident, Replay


class Verdict(IntEnum):
    """Ordered, so that the worst is the largest."""

    PASS = 0
    MARGINAL = 1
    FAIL = 2

    @property
    def word(self) -> str:
        """pass, marginal or fail."""
        return self.name.lower()


@dataclass(frozen=True)
class Metric:
    """One line of the report."""

    layer: str  # open loop | closed loop
    name: str
    value: float
    unit: str
    passes: float  # limit for a pass
    marginal: float  # limit for marginal
    at_least: bool = False  # the limits are lower bounds

    @property
    def verdict(self) -> Verdict:
        """NaN fails."""
        value, passes, marginal = (
            (-self.value, -self.passes, -self.marginal) if self.at_least else (self.value, self.passes, self.marginal)
        )
        if value <= passes:
            return Verdict.PASS
        return Verdict.MARGINAL if value <= marginal else Verdict.FAIL


LEVER = 0.3  # m: torques are judged against m g times this


def _rms(vectors: Any) -> float:
    """Root of the mean squared length of vectors (..., d)."""
    return float(np.sqrt((vectors**2).sum(-1).mean())) if vectors.size else float("nan")


def _first(flags: Any) -> tuple[int, int] | None:
    """Sample and foot of the first true entry of (N, E) flags."""
    found = np.argwhere(flags)
    return (int(found[0][0]), int(found[0][1])) if len(found) else None


def open_loop(plan: Plan, result: OpenLoop, index: Indices) -> tuple[list[Metric], list[Incident]]:
    """Metrics of the open loop, and what went wrong in it."""
    mg = plan.weight
    layer = "open loop"
    share = np.abs(result.torque) / index.torque_limit
    speed = np.abs(result.qvel[:, index.qvel]) / index.speed_limit
    metrics = [
        Metric(layer, "postures out of reach", float(result.unreachable.sum()), "", 0, 0),
        Metric(layer, "postures past a joint limit", float(result.beyond_limits.sum()), "", 0, 0),
        Metric(layer, "postures with other parts in the ground", float(len(result.in_ground)), "", 0, 0),
        Metric(layer, "plan: unexplained force, rms", 100 * _rms(result.plan_residual[:, :3]) / mg, "% m g", 0.5, 5),
        Metric(
            layer, "plan: unexplained torque, rms", 100 * _rms(result.plan_residual[:, 3:]) / (mg * LEVER), "% m g·0.3 m", 0.5, 5
        ),
        Metric(layer, "full body: unexplained force, rms", _rms(result.body_residual[:, :3]) / mg, "m g", 0.05, 0.20),
        Metric(
            layer, "full body: unexplained torque, rms", _rms(result.body_residual[:, 3:]) / (mg * LEVER), "m g·0.3 m", 0.10, 0.20
        ),
        Metric(layer, "peak joint torque", float(share.max()), "of limit", 0.9, 1.0),
        Metric(layer, "peak joint speed", float(speed.max()), "of limit", 0.9, 1.0),
    ]
    incidents = []
    force, torque = np.linalg.norm(result.plan_residual[:, :3], axis=1), np.linalg.norm(result.plan_residual[:, 3:], axis=1)
    for metric, course, scale, what in (
        (metrics[3], force, mg, "the planned forces do not explain the motion of the centre of mass"),
        (metrics[4], torque, mg * LEVER, "the planned forces do not explain the rotation"),
    ):
        if metric.verdict is not Verdict.PASS:
            incidents.append(Incident(float(plan.t[np.argmax(100 * course / scale > metric.passes)]), f"open loop: {what}"))
    for flags, what in (
        (result.unreachable, "out of reach"),
        (result.beyond_limits, "a joint past its limit"),
        ((share > 1).any(-1), "planned forces need more torque than a motor has"),
        ((speed > 1).any(-1), "a joint faster than its limit"),
    ):
        at = _first(flags)
        if at:
            incidents.append(Incident(float(plan.t[at[0]]), f"open loop: {what}", plan.foot_names[at[1]]))
    if result.in_ground:
        k, body = result.in_ground[0]
        foot = next((f for f in plan.foot_names if body.startswith(f)), None)
        incidents.append(Incident(float(plan.t[k]), f"open loop: {body} is in the ground", foot))
    return metrics, incidents


@dataclass(frozen=True)
class Filtered:
    """Simulated against planned forces, both averaged over 20 ms, (K, E, 3) N."""

    simulated: Array
    planned: Array


def filtered_forces(replay: Replay, reference: Reference) -> Filtered:
    """Average both over 20 ms, so that an impact of two milliseconds does not hide the rest."""
    K = len(replay.t)
    width = max(1, round(0.02 / reference.t[1]))
    return Filtered(
        uniform_filter1d(replay.force, width, axis=0, mode="nearest"),
        uniform_filter1d(reference.force[:K], width, axis=0, mode="nearest"),
    )


def _persistent(flags: Any, samples: int) -> Bools:
    """True where flags (K, E) have been true for `samples` in a row."""
    run = np.zeros(flags.shape, int)
    for k in range(len(flags)):
        run[k] = np.where(flags[k], (run[k - 1] if k else 0) + 1, 0)
    result: Bools = run >= samples
    return result


def closed_loop(
    plan: Plan, replay: Replay, reference: Reference, index: Indices, layer: str = "closed loop"
) -> tuple[list[Metric], list[Incident]]:
    """Metrics of the simulation, and what went wrong in it."""
    incidents = [i for i in (replay.fall, replay.first_stray) if i]
    K = len(replay.t)
    fell = 0.0 if replay.fall is None else 1.0
    if K < 2:
        return [Metric(layer, "fall", 1.0, "", 0, 0)], incidents
    mg, period = plan.weight, float(reference.t[1])
    com = np.linalg.norm(replay.com - reference.com[:K], axis=1)
    turn = np.degrees(np.linalg.norm(replay.rotation_error, axis=1))
    planned = reference.contact[:K]
    contact = np.linalg.norm(replay.force, axis=2) > 3.0
    forces = filtered_forces(replay, reference)
    difference = forces.simulated - forces.planned
    stances = int(planned[0].sum() + (planned[1:] & ~planned[:-1]).sum())
    saturated = np.abs(replay.torque) > 0.98 * index.torque_limit
    both = np.stack([forces.simulated[..., 2].ravel(), forces.planned[..., 2].ravel()])
    correlation = float(np.asarray(np.corrcoef(both))[0, 1]) if both.std(1).min() > 1.0 else 1.0
    metrics = [
        Metric(layer, "fall", fell, "", 0, 0),
        Metric(layer, "contacts other than feet", float((replay.stray_contacts > 0).sum()), "samples", 0, 0),
        Metric(layer, "controller without solution", 100.0 * replay.controller_failures / K, "% of steps", 0, 1),
        Metric(layer, "centre of mass, rms", 1e3 * float(np.sqrt((com**2).mean())), "mm", 7, 40),
        Metric(layer, "centre of mass, max", 1e3 * float(com.max()), "mm", 20, 100),
        Metric(layer, "rotation, rms", float(np.sqrt((turn**2).mean())), "°", 1, 3),
        Metric(layer, "rotation, max", float(turn.max()), "°", 3, 8),
        Metric(layer, "feet, rms", 1e3 * _rms(replay.foot - reference.foot[:K]), "mm", 5, 25),
        Metric(layer, "slip per step", 1e3 * float(replay.slip.sum()) / max(stances, 1), "mm", 3, 10),
        Metric(layer, "contact mismatch", 100 * float((contact != planned).mean()), "% of samples", 1.5, 4),
        Metric(layer, "torque at its limit", 100 * float(saturated.mean()), "% of samples", 0.5, 6),
        Metric(layer, "foot forces, rms", float(np.sqrt(np.sum(difference**2, axis=(1, 2)).mean())) / mg, "m g", 0.08, 0.15),
        Metric(layer, "net force, rms", _rms(np.sum(difference, axis=1)) / mg, "m g", 0.07, 0.15),
        Metric(layer, "vertical force, correlation", correlation, "", 0.98, 0.95, at_least=True),
    ]
    patience = max(1, round(0.05 / period))
    for flags, what in (
        (_persistent(planned & ~contact, patience), "no contact for 50 ms where contact is planned"),
        (_persistent(contact & ~planned, patience), "contact for 50 ms where a swing is planned"),
        (_slipped(replay.slip, planned, 0.02), "slips by 20 mm in one stance"),
        (_persistent(saturated.any(-1), patience), "a motor at its limit for 50 ms"),
    ):
        at = _first(flags)
        if at:
            incidents.append(Incident(float(replay.t[at[0]]), f"{layer}: {what}", index.feet[at[1]]))
    net = np.linalg.norm(np.sum(difference, axis=1), axis=1) / mg
    for course, limit, what in (
        (com, 0.1, "centre of mass 0.1 m off"),
        (turn, 8.0, "the trunk is turned by 8° from the plan"),
        (net, 0.15, "the feet's net force is off by 15 % of m g"),
    ):
        if course.max() > limit:
            incidents.append(Incident(float(replay.t[np.argmax(course > limit)]), f"{layer}: {what}"))
    return metrics, incidents


def _slipped(slip: Array, planned: Bools, limit: float) -> Bools:
    """Where a foot (K, E) has slipped by more than `limit` since its stance began."""
    total = np.zeros(slip.shape)
    for k in range(len(slip)):
        total[k] = np.where(planned[k], (total[k - 1] if k else 0.0) + slip[k], 0.0)
    result: Bools = total > limit
    return result
