"""The report's data: `P.report.json` and `P.replay.npz`."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import mujoco
import numpy as np

from .metrics import Metric, Verdict
from .replay import Incident
from .validation import Trial, Validation


def _number(value: float) -> float | None:
    """JSON has no NaN."""
    return float(value) if math.isfinite(value) else None


def _metric(m: Metric) -> dict[str, Any]:
    return {
        "name": m.name,
        "value": _number(m.value),
        "unit": m.unit,
        "limit": "at least" if m.at_least else "at most",
        "pass": m.passes,
        "marginal": m.marginal,
        "verdict": m.verdict.word,
    }


def _incident(i: Incident | None) -> dict[str, Any] | None:
    return None if i is None else {"time": round(i.time, 4), "foot": i.foot, "what": i.what}


def _trial(t: Trial) -> dict[str, Any]:
    return {
        "name": t.name,
        "counts": t.counts,
        "verdict": t.verdict.word,
        "metrics": [_metric(m) for m in t.metrics],
        "incidents": [_incident(i) for i in sorted(t.incidents, key=lambda i: i.time)],
    }


def trackable(v: Validation) -> bool:
    """Whether the robot walks it: passed, or marginal."""
    return v.verdict is not Verdict.FAIL


def as_dict(v: Validation) -> dict[str, Any]:
    """The report as plain data."""
    d = v.settings.disturbance
    return {
        "schema": 1,
        "plan": v.plan.path.name,
        "verdict": v.verdict.word,
        "trackable": trackable(v),
        "first_failure": _incident(v.first_failure),
        "notes": v.notes,
        "robot": {"planned": v.plan.robot.name, "replayed": v.model_path.stem},
        "settings": {
            "rate_hz": v.settings.rate,
            "mujoco": mujoco.__version__,
            "friction": v.plan.robot.friction if d.friction is None else d.friction,
            "mass_factor": d.mass_factor,
            "terrain_shift": list(d.terrain_shift),
            "push": None if d.push is None else list(d.push),
            "noise": d.noise,
            "delay": d.delay,
            "seed": d.seed,
        },
        "open_loop": {"metrics": [_metric(m) for m in v.metrics], "incidents": [_incident(i) for i in v.incidents]},
        "replays": [_trial(t) for t in v.trials],
        "seconds": round(v.seconds, 3),
    }


def write_safely(target: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write beside the target and rename, so that a killed process leaves no half file."""
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with temporary.open("wb") as file:
            write(file)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(v: Validation, target: Path) -> None:
    """Write the report as JSON."""
    text = json.dumps(as_dict(v), indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    write_safely(target, lambda file: file.write(text.encode()))


def write_error(target: Path, plan: str, message: str) -> None:
    """A report that says why there is none."""
    text = json.dumps(
        {"schema": 1, "plan": plan, "verdict": "error", "trackable": False, "error": message}, indent=2, ensure_ascii=False
    )
    write_safely(target, lambda file: file.write((text + "\n").encode()))


def write_replay(v: Validation, target: Path) -> None:
    """The whole-body replay on the planned heightfield at control rate, for people who want joint trajectories.

    Members: `t` (K,) s; `base_position` (K,3) m, the base body's origin (not the centre of mass); `base_quaternion_wxyz` (K,4);
    `base_linear_velocity` (K,3) m/s, world; `base_angular_velocity` (K,3) rad/s, base frame; `center_of_mass` (K,3);
    `q`, `qd`, `tau` (K,3E) rad, rad/s, N m in the order of `joint_names`; `foot_contact` (K,E); `foot_force` (K,E,3) N, ground on robot;
    `foot_position` (K,E,3) m, feet's centres; `foot_names` (E,).
    """
    trial = v.trials[0]
    r, index = trial.replay, v.index
    flat, K = index.qvel.ravel(), len(r.t)
    members: dict[str, Any] = {
        "t": r.t,
        "base_position": r.qpos[:, :3],
        "base_quaternion_wxyz": r.qpos[:, 3:7],
        "base_linear_velocity": r.qvel[:, :3],
        "base_angular_velocity": r.qvel[:, 3:6],
        "center_of_mass": r.com,
        "q": r.qpos[:, index.qpos.ravel()],
        "qd": r.qvel[:, flat],
        "tau": r.torque.reshape(K, -1),
        "foot_contact": np.linalg.norm(r.force, axis=2) > 3.0,
        "foot_force": r.force,
        "foot_position": r.foot,
        "joint_names": np.array([f"{foot}_{joint}" for foot in index.feet for joint in ("HAA", "HFE", "KFE")]),
        "foot_names": np.array(index.feet),
    }
    write_safely(target, lambda file: np.savez_compressed(file, **members))
