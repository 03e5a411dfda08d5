"""The report's data: `P.report.json` and `P.replay.npz`."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .criteria import Metric
from .errors import REPORT_SCHEMA
from .files import replacing, write_text
from .replay import Incident
from .robust import Attempt
from .validation import Trial, Validation


def _metric(m: Metric) -> dict[str, Any]:
    c = m.criterion
    return {
        "name": c.name,
        "value": float(m.value) if math.isfinite(m.value) else None,  # JSON has no NaN
        "unit": c.unit,
        "limit": "at least" if c.at_least else "at most",
        "pass": c.passes,
        "marginal": c.marginal,
        "verdict": m.verdict.word,
        "time": None if m.time is None else round(m.time, 4),
        "foot": m.foot,
    }


def _incident(i: Incident) -> dict[str, Any]:
    return {"time": None if i.time is None else round(i.time, 4), "foot": i.foot, "what": i.what}


def _trial(t: Trial) -> dict[str, Any]:
    return {
        "name": t.name,
        "verdict": t.verdict.word,
        "metrics": [_metric(m) for m in t.metrics],
        "incidents": [_incident(i) for i in sorted(t.incidents, key=lambda i: i.time or 0.0)],
    }


def _attempt(a: Attempt) -> dict[str, Any]:
    return {"name": a.world, "tracked": a.tracked, "worst": _metric(a.worst)}


def _robust(v: Validation) -> dict[str, Any] | None:
    """None where these replays were left out."""
    if not v.attempts:
        return None
    return {"metrics": [_metric(m) for m in v.robust_metrics], "worlds": [_attempt(a) for a in v.attempts]}


def as_dict(v: Validation) -> dict[str, Any]:
    """The report as plain data."""
    d = v.settings.disturbance
    first = v.first_failure
    return {
        "schema": REPORT_SCHEMA,
        "plan": v.plan.path.name,
        "plan_sha256": v.plan.sha256,
        "verdict": v.verdict.word,
        "trackable": v.trackable,
        "first_failure": None if first is None else _incident(first),
        "notes": v.notes,
        "robot": {"planned": v.plan.robot.name, "replayed": v.model_path.stem},
        "settings": {
            "rate_hz": v.settings.rate,
            "quick": v.settings.quick,
            "mujoco": mujoco.__version__,
            "friction": v.plan.robot.friction if d.friction is None else d.friction,
            "mass_factor": d.mass_factor,
            "body_factor": d.body_factor,
            "com_shift": list(d.com_shift),
            "payload": None if d.payload is None else list(d.payload),
            "drives": list(d.drives),
            "terrain_shift": list(d.terrain_shift),
            "terrain_tilt": list(d.terrain_tilt),
            "push": None if d.push is None else list(d.push),
            "noise": d.noise,
            "delay": d.delay,
            "seed": d.seed,
        },
        "check": {"metrics": [_metric(m) for m in v.laws.metrics]},
        "open_loop": {"metrics": [_metric(m) for m in v.metrics]},
        "replays": [_trial(t) for t in v.trials],
        "robust": _robust(v),
        "figures": {f.key: f.value if math.isfinite(f.value) else None for f in v.figures},
        "seconds": round(v.seconds, 3),
    }


def write_json(v: Validation, target: Path) -> None:
    """Write the report as JSON."""
    write_text(target, json.dumps(as_dict(v), indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def write_replay(v: Validation, target: Path) -> None:
    """Write the whole-body replay on the planned heightfield, at the control rate, for people who want joint trajectories.

    Members: `t` (K,) s; `base_position` (K,3) m, the origin of the base body (not the center of mass); `base_quaternion_wxyz` (K,4);
    `base_linear_velocity` (K,3) m/s, world; `base_angular_velocity` (K,3) rad/s, base frame; `center_of_mass` (K,3) m;
    `q`, `qd`, `tau` (K,EJ) rad, rad/s, N m in the order of `joint_names`; `foot_contact` (K,E); `foot_force` (K,E,3) N, ground on robot;
    `foot_position` (K,E,3) m, the feet's centers; `foot_names` (E,); `plan_sha256`, of the plan file.
    """
    r, index = v.trials[0].replay, v.index
    members: dict[str, Any] = {
        "t": r.t,
        "base_position": r.qpos[:, :3],
        "base_quaternion_wxyz": r.qpos[:, 3:7],
        "base_linear_velocity": r.qvel[:, :3],
        "base_angular_velocity": r.qvel[:, 3:6],
        "center_of_mass": r.com,
        "q": r.qpos[:, index.qpos.ravel()],
        "qd": r.qvel[:, index.qvel.ravel()],
        "tau": r.torque.reshape(len(r.t), -1),
        "foot_contact": r.contact,
        "foot_force": r.force,
        "foot_position": r.foot,
        "plan_sha256": np.array(v.plan.sha256),
        "joint_names": np.array(index.joint_names),
        "foot_names": np.array(index.feet),
    }
    with replacing(target) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **members)
