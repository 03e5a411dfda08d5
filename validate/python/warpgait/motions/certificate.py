"""What is known about a motion: the laws that it obeys, how much of each limit it leaves, and the verdict of its replay."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from .._native import COMMIT
from ..arrays import Array, Bools
from ..files import stem_of
from ..laws import check
from ..model import Indices
from ..plan import Plan

_MOST_REPORT = 64 << 20  # bytes of a report that is read
_LEAST_LOAD = 0.01  # of m g: a foot with less normal force does not count for the margin of friction


@dataclass(frozen=True)
class Report:
    """What the report beside a plan says about it."""

    verdict: str | None = None  # pass, marginal or fail; none where there is no report of this plan
    first_failure: str | None = None
    robot: str | None = None  # the model that it was replayed on
    note: str = "there is no report; warpgait validate makes one"
    metrics: tuple[dict[str, Any], ...] = ()  # of the open loop and the replays, as in the report, with `layer`


def _metric(layer: str, found: dict[str, Any]) -> dict[str, Any]:
    """A metric of a report, its types as they should be."""
    time, value = found["time"], found["value"]
    return {
        "layer": layer,
        "name": str(found["name"]),
        "value": math.nan if value is None else float(value),
        "unit": str(found["unit"]),
        "limit": f"{'≥' if found['limit'] == 'at least' else '≤'} {float(found['pass']):g}",
        "verdict": str(found["verdict"]),
        "time": None if time is None else float(time),
        "foot": None if found["foot"] is None else str(found["foot"]),
    }


def report_of(plan: Plan) -> Report:
    """The report of exactly this plan, if it lies beside it."""
    path = plan.path.with_name(f"{stem_of(plan.path)}.report.json")
    if not path.is_file():
        return Report()
    try:
        if path.stat().st_size > _MOST_REPORT:
            raise ValueError("too large")
        found = json.loads(path.read_text())
        if found["verdict"] == "error":
            return Report(note=f"the last replay ended with an error: {found['error']}")
        if found.get("plan_sha256") != plan.sha256:
            return Report(note="the report is of another version of the plan")
        if found["verdict"] not in ("pass", "marginal", "fail"):
            return Report(note="the replay gave no verdict")
        failure = found["first_failure"]
        layers = [("open loop", found["open_loop"]), *((str(trial["name"]), trial) for trial in found["replays"])]
        metrics = tuple(_metric(layer, m) for layer, part in layers for m in part["metrics"])
        what = None if failure is None else str(failure["what"])
        return Report(str(found["verdict"]), what, str(found["robot"]["replayed"]), "", metrics)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return Report(note="the report cannot be read")


def _least(values: Array) -> float | None:
    return float(values.min()) if values.size else None


def friction_margin(plan: Plan, force: Array, contact: Bools, normal: Array) -> float | None:
    """The least of 1 − |shear| / (ν · normal force) of a loaded foot that does not adhere; none if there is no such foot."""
    along = (force * normal).sum(-1)
    shear = np.linalg.norm(force - along[..., None] * normal, axis=-1)
    loaded = contact & (along > _LEAST_LOAD * plan.weight) & ~plan.foot_adhesive
    return _least(1 - shear[loaded] / (plan.robot.friction * along[loaded]))


@dataclass(frozen=True)
class Joints:
    """What the joints of a full model do at K frames."""

    model: Any
    index: Indices
    qpos: Array  # (K, nq)
    qvel: Array  # (K, nv)
    torque: Array  # (K, J) N m

    def margins(self) -> dict[str, float | None]:
        """How much is left of the limits of torque and speed, as a fraction, and of the range of angles, in rad."""
        order = self.index.qvel.ravel()
        lower, upper = self.model.jnt_range[1:].T
        q = self.qpos[:, 7:]
        return {
            "joint_torque": _least(1 - np.abs(self.torque[:, order - 6]) / self.index.torque_limit.ravel()),
            "joint_speed": _least(1 - np.abs(self.qvel[:, order]) / np.ravel(self.index.speed_limit)),
            "joint_range_rad": _least(np.minimum(q - lower, upper - q)),
        }


def certify(
    plan: Plan, source: str, report: Report, force: Array, contact: Bools, normal: Array, joints: Joints | None = None
) -> dict[str, Any]:
    """The certificate of a motion with these forces (K, E, 3), contacts (K, E) and normals (K, E, 3), as plain data."""
    laws = check(plan.path)
    margins: dict[str, float | None] = {"friction": friction_margin(plan, force, contact, normal)}
    if joints is not None:
        margins |= joints.margins()
    return {
        "program": "warpgait",
        "version": metadata.version("warpgait"),
        "commit": COMMIT,
        "plan": {
            "file": plan.path.name,
            "sha256": plan.sha256,
            "warpgait_version": plan.meta.get("warpgait_version"),
            "warpgait_commit": plan.meta.get("warpgait_commit") or "unknown",
            "created": plan.meta.get("created"),
            "formulation": plan.meta.get("formulation"),
            "robot": plan.robot.name,
            "solved": plan.solved,
        },
        "source": source,
        "laws": [
            {
                "name": m.name,
                "value": None if np.isnan(m.value) else float(m.value),
                "unit": m.criterion.unit,
                "limit": m.criterion.passes,
                "passed": m.verdict.value == 0,
            }
            for m in laws.metrics
        ],
        "all_laws_hold": not laws.broken,
        "remarks": list(laws.remarks),
        "margins": margins,
        "replay": {"verdict": report.verdict, "first_failure": report.first_failure, "note": report.note},
    }
