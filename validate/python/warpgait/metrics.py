"""From what happened to metrics and incidents.

Force metrics and the open loop are there because a whole-body controller tracks a bad plan well: it silently corrects the plan's errors.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from . import criteria
from .arrays import Array, Bools, runs, since_start
from .criteria import LEVER, Criterion, Metric
from .geometry import rotation_from_wxyz
from .model import SAGITTAL, Indices, foot_of
from .openloop import OpenLoop
from .plan import Plan
from .reference import Reference
from .replay import Incident, Replay

OPEN_LOOP, ROBUST = "open loop", "robust"  # layers
FORCE_WINDOW = 0.02  # s: forces are averaged over this time, so that an impact of 2 ms does not hide the rest
LANDING = 0.003  # m, for a robot of ANYmal's size: a foot this close to where it lands or lifts off may touch the ground
PATIENCE = 0.05  # s: a wrong contact or a saturated motor is an incident after this time
SLIP_INCIDENT = 0.02  # m of slip in one stance, for a robot of ANYmal's size
SATURATED = 0.98  # fraction of the torque limit from which a motor counts as being at its limit
LEAST_SPREAD = 0.002  # of m g, standard deviation below which a force is constant and a correlation means nothing


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


@dataclass(frozen=True)
class _Worst:
    """The largest of values over time, and of which foot."""

    value: float
    time: float | None
    foot: str | None

    def metric(self, layer: str, criterion: Criterion, value: float | None = None, what: str = "") -> Metric:
        """A metric at this place; `value` is a mean, where that is judged."""
        return Metric(layer, criterion, self.value if value is None else value, self.time, self.foot, what)


def _worst(t: Array, values: Any, feet: tuple[str, ...] = ()) -> _Worst:
    """Of values (K,), or (K, E, …) for `feet`. NaN counts as larger than everything."""
    if not values.size:
        return _Worst(float("nan"), None, None)
    at = np.unravel_index(int(np.argmax(values)), values.shape)  # argmax takes NaN for the largest
    return _Worst(float(values[at]), float(t[at[0]]), feet[at[1]] if feet else None)


def _count(t: Array, flags: Any, feet: tuple[str, ...] = ()) -> _Worst:
    """How many flags (K,) or (K, E) are true, and the first of them."""
    found = np.argwhere(flags)
    if not len(found):
        return _Worst(0.0, None, None)
    return _Worst(float(len(found)), float(t[found[0][0]]), feet[found[0][1]] if feet else None)


def judge_collisions(layer: str, found: list[Incident]) -> Metric:
    """Whether the robot hits itself."""
    return _happened(layer, criteria.COLLISIONS, float(len(found)), found[0] if found else None)


def judge_open_loop(plan: Plan, result: OpenLoop, index: Indices) -> list[Metric]:
    """Metrics of the open loop, in the order of causes."""
    mg, t, feet = plan.weight, plan.t, plan.foot_names
    torque = np.abs(result.torque) / index.torque_limit
    speed = np.abs(result.qvel[:, index.qvel]) / index.speed_limit
    power = np.abs(result.torque * result.qvel[:, index.qvel]) / index.power_limit
    metrics = [
        _count(t, result.unreachable, feet).metric(OPEN_LOOP, criteria.UNREACHABLE, what="out of reach"),
        _count(t, result.beyond_limits, feet).metric(OPEN_LOOP, criteria.BEYOND_LIMITS, what="a joint past its limit"),
    ]
    in_ground = result.in_ground
    k, body = in_ground[0] if in_ground else (0, "")
    what = f"{body} is in the ground" if in_ground else ""
    first = float(t[k]) if in_ground else None
    metrics.append(Metric(OPEN_LOOP, criteria.IN_GROUND, float(len(in_ground)), first, foot_of(body, feet), what))
    for vectors, scale, mean, largest, what in (
        (result.plan_residual[:, :3], mg / 100, criteria.PLAN_FORCE, criteria.PLAN_FORCE_MAX, "the center of mass"),
        (result.plan_residual[:, 3:], mg * LEVER / 100, criteria.PLAN_TORQUE, criteria.PLAN_TORQUE_MAX, "the rotation"),
        (result.body_residual[:, :3], mg, criteria.BODY_FORCE, criteria.BODY_FORCE_MAX, ""),
        (result.body_residual[:, 3:], mg * LEVER, criteria.BODY_TORQUE, criteria.BODY_TORQUE_MAX, ""),
    ):
        worst = _worst(t, np.linalg.norm(vectors, axis=1) / scale)
        words = f"the planned forces do not explain the motion of {what}" if what else ""
        words = words.replace("motion of the rotation", "rotation")
        metrics.append(worst.metric(OPEN_LOOP, mean, _rms(vectors) / scale, words))
        metrics.append(worst.metric(OPEN_LOOP, largest, what=words))
    metrics.append(_worst(t, torque, feet).metric(OPEN_LOOP, criteria.PEAK_TORQUE))
    metrics.append(_worst(t, speed, feet).metric(OPEN_LOOP, criteria.PEAK_SPEED))
    metrics.append(_worst(t, power, feet).metric(OPEN_LOOP, criteria.PEAK_POWER))
    return metrics


@dataclass(frozen=True)
class FilteredForces:
    """Simulated and planned forces of the feet, averaged over `FORCE_WINDOW`, (K, E, 3) N."""

    simulated: Array
    planned: Array

    @property
    def difference(self) -> Array:
        """(K, E, 3) N."""
        return self.simulated - self.planned

    def vertical_correlation(self, weight: float) -> float:
        """Correlation of the vertical forces; 1 if one of them is constant. `weight` is m g, N."""
        both = np.stack([self.simulated[..., 2].ravel(), self.planned[..., 2].ravel()])
        return float(np.asarray(np.corrcoef(both))[0, 1]) if both.std(1).min() > LEAST_SPREAD * weight else 1.0


def filtered_forces(replay: Replay, reference: Reference) -> FilteredForces:
    """Average both over `FORCE_WINDOW`."""
    width = max(1, round(FORCE_WINDOW / reference.t[1]))
    planned = reference.force[: len(replay.t)]
    return FilteredForces(
        uniform_filter1d(replay.force, width, axis=0, mode="nearest"),
        uniform_filter1d(planned, width, axis=0, mode="nearest"),
    )


def _commanded(force: Array, replay: Replay, index: Indices) -> Array:
    """The part of forces of feet (K, E, 3) that joints bring about: all of it but for legs of two joints, whose structure bears what is across
    the plane of the leg.
    """
    if index.qvel.shape[1] != SAGITTAL:
        return force
    across = rotation_from_wxyz(replay.qpos[:, 3:7]).as_matrix()[:, :, 1]
    part: Array = force - np.einsum("kec,kc->ke", force, across)[..., None] * across[:, None]
    return part


def _happened(layer: str, criterion: Criterion, value: float, incident: Incident | None) -> Metric:
    """A metric whose place and words are those of an incident, if there was one."""
    if incident is None:
        return Metric(layer, criterion, value)
    return Metric(layer, criterion, value, incident.time, incident.foot, incident.what)


def _phases(planned: Bools) -> list[tuple[int, int, int]]:
    """Every stance and swing in flags (K, E): foot, first sample, and one past the last."""
    return [
        (e, first, end)
        for e in range(planned.shape[1])
        for flags in (planned[:, e], ~planned[:, e])
        for first, end in runs(flags)
    ]


def _about_to_switch(reference: Reference, samples: int, distance: float) -> Bools:
    """Swinging feet (K, E) within `distance`, m, of where they stood or will stand by the plan: there they may touch the ground."""
    near = np.zeros(reference.contact.shape, bool)
    for e, first, end in _phases(reference.contact):
        if not reference.contact[first, e]:
            for place in (reference.foot[max(first - 1, 0), e], reference.foot[min(end, len(reference.t) - 1), e]):
                near[first:end, e] |= np.linalg.norm(reference.foot[first:end, e] - place, axis=1) < distance
    return near[:samples]


def _worst_phase(t: Array, planned: Bools, values: Array, feet: tuple[str, ...]) -> _Worst:
    """The largest root mean square of values (K, E) in one stance or swing of a foot; the time is that of the largest value in it."""
    found = _Worst(0.0, None, None)
    for e, first, end in _phases(planned):
        value = float(np.sqrt((values[first:end, e] ** 2).mean()))
        if not value <= found.value:
            found = _Worst(value, float(t[first + int(np.argmax(values[first:end, e]))]), feet[e])
    return found


def judge_closed_loop(
    layer: str, plan: Plan, replay: Replay, reference: Reference, index: Indices
) -> tuple[list[Metric], list[Incident]]:
    """Metrics of a simulation, in the order of severity, and what happened in it."""
    K, mg, t, feet = len(replay.t), plan.weight, replay.t, index.feet
    fall = replay.fall
    fell = _happened(layer, criteria.FALL, float(fall is not None), fall)
    if K < 2:  # nothing to measure
        return [fell], _incidents_of(replay)
    com = np.linalg.norm(replay.com - reference.com[:K], axis=1)  # m
    turn = np.degrees(np.linalg.norm(replay.rotation_error, axis=1))
    apart = np.linalg.norm(replay.foot - reference.foot[:K], axis=2)  # (K, E) m
    planned = reference.contact[:K]
    stances = int(planned[0].sum() + (planned[1:] & ~planned[:-1]).sum())
    slid = since_start(planned, replay.slip)
    period, ones = float(reference.t[1]), np.ones(planned.shape)
    mismatch = replay.contact != planned
    mistaken = mismatch & ~_about_to_switch(reference, K, LANDING * index.size)
    forces = filtered_forces(replay, reference)
    difference = forces.difference
    off_feet, off_net = (
        np.linalg.norm(_commanded(difference, replay, index), axis=2) / mg,
        np.linalg.norm(np.sum(difference, axis=1), axis=1) / mg,
    )
    torque = np.abs(replay.torque)
    saturated = torque > SATURATED * index.torque_limit
    velocity = np.abs(replay.qvel[:, index.qvel])
    center, trunk, wrong = _worst(t, com), _worst(t, turn), _worst(t, period * since_start(mismatch, ones), feet)
    slip, first_saturated = _worst(t, slid, feet), _count(t, saturated.any(-1), feet)
    metrics = [
        fell,
        _happened(layer, criteria.STRAY_CONTACTS, float((replay.stray_contacts > 0).sum()), replay.first_stray),
        Metric(layer, criteria.NO_SOLUTION, 100.0 * replay.controller_failures / K),
        center.metric(layer, criteria.COM_RMS, 1e3 * float(np.sqrt((com**2).mean()))),
        center.metric(layer, criteria.COM_MAX, 1e3 * center.value),
        trunk.metric(layer, criteria.ROTATION_RMS, float(np.sqrt((turn**2).mean()))),
        trunk.metric(layer, criteria.ROTATION_MAX),
        _worst(t, apart, feet).metric(layer, criteria.FEET_RMS, 1e3 * float(np.sqrt((apart**2).mean()))),
        _worst_phase(t, planned, 1e3 * apart, feet).metric(layer, criteria.FEET_WORST),
        slip.metric(layer, criteria.SLIP, 1e3 * float(replay.slip.sum()) / max(stances, 1)),
        slip.metric(layer, criteria.SLIP_WORST, 1e3 * slip.value),
        wrong.metric(layer, criteria.CONTACT_MISMATCH, 100 * float(mistaken.mean())),
        wrong.metric(layer, criteria.CONTACT_WORST, 1e3 * wrong.value),
        first_saturated.metric(layer, criteria.SATURATION, 100 * float(saturated.mean())),
        _worst(t, velocity / index.speed_limit, feet).metric(layer, criteria.REPLAY_SPEED),
        _worst(t, torque * velocity / index.power_limit, feet).metric(layer, criteria.REPLAY_POWER),
        _worst(t, off_feet, feet).metric(layer, criteria.FOOT_FORCES, float(np.sqrt((off_feet**2).sum(1).mean()))),
        _worst(t, off_net).metric(layer, criteria.NET_FORCE, float(np.sqrt((off_net**2).mean()))),
        _worst(t, off_feet, feet).metric(layer, criteria.FORCE_CORRELATION, forces.vertical_correlation(mg)),
    ]
    metrics = [replace(m, criterion=m.criterion.for_size(index.size)) for m in metrics]
    incidents = _incidents_of(replay)
    incidents += _incidents_by_foot(layer, replay, planned, saturated.any(-1), index)
    incidents += _incidents_of_tracking(layer, t, com, turn, off_net, index.size)
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

    time, slip = f"for {1e3 * PATIENCE:g} ms", SLIP_INCIDENT * index.size
    found = (
        (lasting(planned & ~replay.contact), f"no contact {time} where contact is planned"),
        (lasting(replay.contact & ~planned), f"contact {time} where a swing is planned"),
        (since_start(planned, replay.slip) > slip, f"slips by {1e3 * slip:g} mm in one stance"),
        (lasting(saturated), f"a motor at its limit {time}"),
    )
    return _first_by_foot(layer, replay.t, index.feet, found)


def _incidents_of_tracking(layer: str, t: Array, com: Array, turn: Array, net: Array, size: float) -> list[Incident]:
    """Where errors of center of mass (K,) m, rotation (K,) degrees and net force (K,) m g first exceed a limit for marginal."""
    com_limit, turn_limit = criteria.COM_MAX.for_size(size).marginal / 1e3, criteria.ROTATION_MAX.marginal
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
