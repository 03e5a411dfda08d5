"""From what happened to metrics and incidents.

Force metrics and the open loop are there because a whole-body controller tracks a bad plan well: it silently corrects the plan's errors.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from . import criteria
from .arrays import Array, Bools, since_start
from .criteria import LEVER, Metric, Verdict
from .model import Indices, foot_of
from .openloop import OpenLoop
from .plan import Plan
from .reference import Reference
from .replay import Incident, Replay

OPEN_LOOP = "open loop"
FORCE_WINDOW = 0.02  # s: forces are averaged over this time, so that an impact of 2 ms does not hide the rest
PATIENCE = 0.05  # s: a wrong contact or a saturated motor is an incident after this time
SLIP_INCIDENT = 0.02  # m of slip in one stance
SATURATED = 0.98  # fraction of the torque limit from which a motor counts as being at its limit
LEAST_SPREAD = 1.0  # N, standard deviation below which a force is constant and a correlation means nothing


def _rms(vectors: Any) -> float:
    """Root of the mean squared length of vectors (..., d)."""
    return float(np.sqrt((vectors**2).sum(-1).mean())) if vectors.size else float("nan")


def _first_by_foot(layer: str, t: Array, feet: tuple[str, ...], found: Iterable[tuple[Any, str]]) -> list[Incident]:
    """For each pair of flags (K, E) and words, an incident at the first true flag, if there is one."""
    incidents = []
    for flags, what in found:
        at = np.argwhere(flags)
        if len(at):
            k, e = map(int, at[0])
            incidents.append(Incident(float(t[k]), f"{layer}: {what}", feet[e]))
    return incidents


def judge_open_loop(plan: Plan, result: OpenLoop, index: Indices) -> tuple[list[Metric], list[Incident]]:
    """Metrics of the open loop, and what went wrong in it."""
    mg = plan.weight
    torque = np.abs(result.torque) / index.torque_limit
    speed = np.abs(result.qvel[:, index.qvel]) / index.speed_limit
    plan_force, plan_torque = result.plan_residual[:, :3], result.plan_residual[:, 3:]
    values = (
        (criteria.UNREACHABLE, float(result.unreachable.sum())),
        (criteria.BEYOND_LIMITS, float(result.beyond_limits.sum())),
        (criteria.IN_GROUND, float(len(result.in_ground))),
        (criteria.PLAN_FORCE, 100 * _rms(plan_force) / mg),
        (criteria.PLAN_TORQUE, 100 * _rms(plan_torque) / (mg * LEVER)),
        (criteria.BODY_FORCE, _rms(result.body_residual[:, :3]) / mg),
        (criteria.BODY_TORQUE, _rms(result.body_residual[:, 3:]) / (mg * LEVER)),
        (criteria.PEAK_TORQUE, float(torque.max())),
        (criteria.PEAK_SPEED, float(speed.max())),
    )
    metrics = [Metric(OPEN_LOOP, criterion, value) for criterion, value in values]
    verdicts = {metric.criterion: metric.verdict for metric in metrics}

    incidents = []
    for criterion, vectors, scale, what in (
        (criteria.PLAN_FORCE, plan_force, mg, "the planned forces do not explain the motion of the center of mass"),
        (criteria.PLAN_TORQUE, plan_torque, mg * LEVER, "the planned forces do not explain the rotation"),
    ):
        if verdicts[criterion] is not Verdict.PASS:
            beyond = 100 * np.linalg.norm(vectors, axis=1) / scale > criterion.passes
            incidents.append(Incident(float(plan.t[np.argmax(beyond)]), f"{OPEN_LOOP}: {what}"))
    by_foot = (
        (result.unreachable, "out of reach"),
        (result.beyond_limits, "a joint past its limit"),
        ((torque > 1).any(-1), "the planned forces need more torque than a motor has"),
        ((speed > 1).any(-1), "a joint faster than its limit"),
    )
    incidents += _first_by_foot(OPEN_LOOP, plan.t, plan.foot_names, by_foot)
    if result.in_ground:
        k, body = result.in_ground[0]
        incidents.append(Incident(float(plan.t[k]), f"{OPEN_LOOP}: {body} is in the ground", foot_of(body, plan.foot_names)))
    return metrics, incidents


@dataclass(frozen=True)
class FilteredForces:
    """Simulated and planned forces of the feet, averaged over `FORCE_WINDOW`, (K, E, 3) N."""

    simulated: Array
    planned: Array

    @property
    def difference(self) -> Array:
        """(K, E, 3) N."""
        return self.simulated - self.planned

    @property
    def vertical_correlation(self) -> float:
        """Correlation of the vertical forces; 1 if one of them is constant."""
        both = np.stack([self.simulated[..., 2].ravel(), self.planned[..., 2].ravel()])
        return float(np.asarray(np.corrcoef(both))[0, 1]) if both.std(1).min() > LEAST_SPREAD else 1.0


def filtered_forces(replay: Replay, reference: Reference) -> FilteredForces:
    """Average both over `FORCE_WINDOW`."""
    width = max(1, round(FORCE_WINDOW / reference.t[1]))
    planned = reference.force[: len(replay.t)]
    return FilteredForces(
        uniform_filter1d(replay.force, width, axis=0, mode="nearest"),
        uniform_filter1d(planned, width, axis=0, mode="nearest"),
    )


def judge_closed_loop(
    layer: str, plan: Plan, replay: Replay, reference: Reference, index: Indices
) -> tuple[list[Metric], list[Incident]]:
    """Metrics of a simulation, and what went wrong in it."""
    K, mg = len(replay.t), plan.weight
    if K < 2:  # nothing to measure
        return [Metric(layer, criteria.FALL, 1.0)], _incidents_of(replay)
    com = np.linalg.norm(replay.com - reference.com[:K], axis=1)  # m
    turn = np.degrees(np.linalg.norm(replay.rotation_error, axis=1))
    planned = reference.contact[:K]
    stances = int(planned[0].sum() + (planned[1:] & ~planned[:-1]).sum())
    forces = filtered_forces(replay, reference)
    difference = forces.difference
    saturated = np.abs(replay.torque) > SATURATED * index.torque_limit
    values = (
        (criteria.FALL, 0.0 if replay.fall is None else 1.0),
        (criteria.STRAY_CONTACTS, float((replay.stray_contacts > 0).sum())),
        (criteria.NO_SOLUTION, 100.0 * replay.controller_failures / K),
        (criteria.COM_RMS, 1e3 * float(np.sqrt((com**2).mean()))),
        (criteria.COM_MAX, 1e3 * float(com.max())),
        (criteria.ROTATION_RMS, float(np.sqrt((turn**2).mean()))),
        (criteria.ROTATION_MAX, float(turn.max())),
        (criteria.FEET_RMS, 1e3 * _rms(replay.foot - reference.foot[:K])),
        (criteria.SLIP, 1e3 * float(replay.slip.sum()) / max(stances, 1)),
        (criteria.CONTACT_MISMATCH, 100 * float((replay.contact != planned).mean())),
        (criteria.SATURATION, 100 * float(saturated.mean())),
        (criteria.FOOT_FORCES, float(np.sqrt(np.sum(difference**2, axis=(1, 2)).mean())) / mg),
        (criteria.NET_FORCE, _rms(np.sum(difference, axis=1)) / mg),
        (criteria.FORCE_CORRELATION, forces.vertical_correlation),
    )
    metrics = [Metric(layer, criterion, value) for criterion, value in values]
    net = np.linalg.norm(np.sum(difference, axis=1), axis=1) / mg
    incidents = _incidents_of(replay)
    incidents += _incidents_by_foot(layer, replay, planned, saturated.any(-1), index)
    incidents += _incidents_of_tracking(layer, replay.t, com, turn, net)
    return metrics, incidents


def _incidents_of(replay: Replay) -> list[Incident]:
    """What the simulation itself recorded."""
    return [incident for incident in (replay.fall, replay.first_stray) if incident]


def _incidents_by_foot(layer: str, replay: Replay, planned: Bools, saturated: Any, index: Indices) -> list[Incident]:
    """Wrong contacts, slip, and saturated motors; flags are (K, E)."""
    samples = max(1, round(PATIENCE / float(replay.t[1])))
    ones = np.ones(planned.shape)

    def lasting(flags: Bools) -> Bools:
        """True where flags have been true for `samples` in a row."""
        result: Bools = since_start(flags, ones) >= samples
        return result

    time = f"for {1e3 * PATIENCE:g} ms"
    found = (
        (lasting(planned & ~replay.contact), f"no contact {time} where contact is planned"),
        (lasting(replay.contact & ~planned), f"contact {time} where a swing is planned"),
        (since_start(planned, replay.slip) > SLIP_INCIDENT, f"slips by {1e3 * SLIP_INCIDENT:g} mm in one stance"),
        (lasting(saturated), f"a motor at its limit {time}"),
    )
    return _first_by_foot(layer, replay.t, index.feet, found)


def _incidents_of_tracking(layer: str, t: Array, com: Array, turn: Array, net: Array) -> list[Incident]:
    """Where errors of center of mass (K,) m, rotation (K,) degrees and net force (K,) m g first exceed a limit for marginal."""
    com_limit, turn_limit = criteria.COM_MAX.marginal / 1e3, criteria.ROTATION_MAX.marginal
    net_limit = criteria.NET_FORCE.marginal
    incidents = []
    for errors, limit, what in (
        (com, com_limit, f"the center of mass is {com_limit:g} m from the plan"),
        (turn, turn_limit, f"the trunk is turned by {turn_limit:g}° from the plan"),
        (net, net_limit, f"the net force of the feet differs from the plan by {100 * net_limit:g} % of m g"),
    ):
        if errors.max() > limit:
            incidents.append(Incident(float(t[np.argmax(errors > limit)]), f"{layer}: {what}"))
    return incidents
