"""What the page shows of a plan, as plain data. Arrays are base64 of little-endian numbers; quaternions are scalar-first."""

from __future__ import annotations

import base64
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from ..archive import Archive
from ..arrays import Array, Bools, runs
from ..criteria import LEVER
from ..errors import InputError
from ..files import stem_of
from ..laws import check, explained
from ..motions import Motion, motion_of_plan, motion_of_replay
from ..motions.certificate import report_of
from ..openloop import centroidal_residual
from ..plan import Heightfield, Plan, read_plan
from .warping import Warping, grid, warping_of

RATE = 50.0  # Hz; the page interpolates
_COLORS = ("#c8352c", "#2166ac", "#e08214", "#1b8a5a", "#7b3fa0", "#6b6b6b")  # as in src/report/color.rs
MOST_NODES = 240  # of the ground along each axis
AROUND = 1.5  # m of ground around the way
_STEPS = 65535  # of heights
_THIN = 1e-3  # m, the least half size of a box
_ROBOT_COLOR = (0.75, 0.14, 0.12, 1.0)
_RESIDUAL_LIMIT = 3.0  # %, of `newton_max` and `euler_max`


def packed(values: npt.NDArray[Any]) -> dict[str, str]:
    """An array for the page: floats in single precision, or whole numbers of one or two bytes."""
    kind = {"f": "<f4", "b": "|u1", "u": values.dtype.str}[values.dtype.kind]
    content = np.ascontiguousarray(values, kind)
    return {"type": kind[1:], "data": base64.b64encode(content.tobytes()).decode()}


def _shapes(motion: Motion) -> list[dict[str, Any]]:
    """The bodies of the robot with their primitive shapes; a mesh is shown as its bounding box."""
    model = motion.model
    kinds = {
        mujoco.mjtGeom.mjGEOM_BOX: ("box", (0, 1, 2)),
        mujoco.mjtGeom.mjGEOM_SPHERE: ("sphere", (0, 0, 0)),
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: ("sphere", (0, 1, 2)),
        mujoco.mjtGeom.mjGEOM_CYLINDER: ("cylinder", (0, 0, 1)),
        mujoco.mjtGeom.mjGEOM_CAPSULE: ("cylinder", (0, 0, 1)),
    }
    bodies: list[dict[str, Any]] = [{"name": name, "shapes": []} for name in motion.body_names]
    for g in range(model.ngeom):
        body = int(model.geom_bodyid[g])
        if body == 0:
            continue
        place, turn, size = model.geom_pos[g].copy(), model.geom_quat[g], model.geom_size[g]
        found = kinds.get(int(model.geom_type[g]))
        if found is None:
            kind, half = "box", np.maximum(model.geom_aabb[g, 3:], _THIN)
            place += Rotation.from_quat(np.roll(turn, -1)).apply(model.geom_aabb[g, :3])
        else:
            kind, half = found[0], size[list(found[1])]
        shape = {"kind": kind, "place": place, "turn": turn, "size": half, "color": model.geom_rgba[g]}
        bodies[body - 1]["shapes"].append(
            {k: v if isinstance(v, str) else np.asarray(v, float).tolist() for k, v in shape.items()}
        )
        if int(model.geom_type[g]) == mujoco.mjtGeom.mjGEOM_CAPSULE:
            for side in (-1, 1):
                end = place + Rotation.from_quat(np.roll(turn, -1)).apply([0, 0, side * size[1]])
                ball = {"kind": "sphere", "place": end.tolist(), "turn": turn.tolist(), "size": [float(size[0])] * 3}
                bodies[body - 1]["shapes"].append(ball | {"color": model.geom_rgba[g].tolist()})
    return bodies


def _motion(motion: Motion) -> dict[str, Any]:
    """A motion for the page. Bodies are 7 numbers each; a robot without joints has one, its base."""
    places, turns = motion.body_position, motion.body_quaternion_wxyz
    if not motion.body_names:
        places, turns = motion.base_position[:, None], motion.base_quaternion_wxyz[:, None]
    return {
        "bodies": packed(np.concatenate([places, turns], -1)),
        "center": packed(motion.center_of_mass),
        "touch": packed(motion.contact_position),
        "force": packed(motion.foot_force),
        "normal": packed(motion.foot_normal),
        "contact": packed(motion.foot_contact),
    }


def _ground(archive: Archive, plan: Plan, motion: Motion) -> dict[str, Any]:
    """The ground around the way, thinned; `raw` is the other surface, if there is one."""
    x_y = np.concatenate([motion.center_of_mass[:, :2], motion.foot_position[..., :2].reshape(-1, 2)])
    terrain = plan.terrain
    limits = [int(n) - 1 for n in terrain.heights.shape[::-1]]
    first = np.clip(np.floor((x_y.min(0) - AROUND - terrain.origin) / terrain.spacing).astype(int), 0, limits)
    last = np.clip(np.ceil((x_y.max(0) + AROUND - terrain.origin) / terrain.spacing).astype(int), 0, limits)
    last = np.maximum(last, np.minimum(first + 1, limits))
    first = np.minimum(first, last - 1)
    thin = np.maximum(1, np.ceil((last - first + 1) / MOST_NODES).astype(int))
    window = slice(first[1], last[1] + 1, thin[1]), slice(first[0], last[0] + 1, thin[0])
    other, label = plan.terrain_raw, "raw ground"
    if "patch_corners" in archive and "heightfield_raw" in archive:  # planned for the raw ground
        other, label = Heightfield(archive["heightfield"], terrain.origin, terrain.spacing), "smoothed ground"
    unknown = None
    if "heightfield_unknown" in archive:
        flags = archive["heightfield_unknown"]
        if flags.shape != terrain.heights.shape or flags.dtype != np.bool_:
            raise InputError(f"{plan.path}: member heightfield_unknown: expected {terrain.heights.shape} of true or false")
        unknown = packed(flags[window])
    origin, spacing = terrain.origin + first * terrain.spacing, terrain.spacing * thin
    shown = ground(terrain.heights[window], origin, spacing, None if other is None else other.heights[window])
    return shown | {"raw_label": label, "unknown": unknown}


def ground(heights: Array, origin: Array, spacing: Array, others: Array | None = None) -> dict[str, Any]:
    """Heights (rows along y, columns along x) m of a grid for the page; `others` are those of another surface."""
    every = heights if others is None else np.concatenate([heights, others])
    low, high = float(every.min()), float(every.max())
    rise = max(high - low, 1e-6)

    def steps(values: Array) -> dict[str, str]:
        return packed(np.rint((values - low) / rise * _STEPS).astype("<u2"))

    return {
        "rows": heights.shape[0],
        "columns": heights.shape[1],
        "origin": origin.tolist(),
        "spacing": spacing.tolist(),
        "low": low,
        "high": low + rise,
        "heights": steps(heights),
        "raw": None if others is None else steps(others),
        "raw_label": "",
        "raw_first": False,
        "unknown": None,
    }


def footholds(t: Array, contact: Bools, position: Array, normal: Array) -> list[dict[str, Any]]:
    """Where feet stand, and when: from times (N,), contacts (N, E), places and normals of the ground (N, E, 3)."""
    holds = []
    for e in range(contact.shape[1]):
        for first, end in runs(contact[:, e]):
            middle = (first + end) // 2
            holds.append(
                {
                    "foot": e,
                    "start": float(t[first]),
                    "end": float(t[end - 1]),
                    "place": position[middle, e].tolist(),
                    "normal": normal[middle, e].tolist(),
                }
            )
    return holds


def feet(names: tuple[str, ...]) -> list[dict[str, str]]:
    """Names and colors."""
    return [{"name": name, "color": _COLORS[e % len(_COLORS)]} for e, name in enumerate(names)]


def _patches(archive: Archive) -> list[dict[str, Any]]:
    if "patch_corners" not in archive:
        return []
    corners = archive["patch_corners"]  # judged by `read_plan`
    return [
        {"foot": e, "corners": corners[e, s].tolist()}
        for e in range(corners.shape[0])
        for s in range(corners.shape[1])
        if np.isfinite(corners[e, s]).all()
    ]


def _warped(archive: Archive, plan: Plan, warping: Warping, at: npt.NDArray[np.intp]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The grid in both spaces, and the motion in the warped one; where the base is not warped, its ambient place stands for it."""
    E, N = len(plan.foot_names), len(plan.t)

    def member(name: str, shape: tuple[int, ...]) -> Array:
        if name not in archive:
            raise InputError(f"{plan.path}: member {name}: is missing")
        values = archive[name]
        if values.shape != shape or values.dtype != np.float64 or not np.isfinite(values).all():
            raise InputError(f"{plan.path}: member {name}: expected finite numbers of shape {shape}")
        return np.asarray(values)

    feet, force = member("warped_foot_position", (N, E, 3))[at], member("warped_foot_force", (N, E, 3))[at]
    has_base = "warped_base_position" in archive
    base, turns = plan.base_position[at], plan.base_quaternion_wxyz[at]
    if has_base:
        base = member("warped_base_position", (N, 3))[at]
        turns = turns_of(member("warped_base_euler", (N, 3))[at])
    drawn = warped_space(warping, np.concatenate([base, feet.reshape(-1, 3)])) | {"has_base": has_base}
    return drawn, box_motion(base, turns, feet, force, np.broadcast_to([0.0, 0.0, 1.0], feet.shape), plan.foot_contact[at])


def turns_of(euler: Array) -> Array:
    """Quaternions (N, 4), scalar first, of roll, pitch and yaw (N, 3): yaw about z, then pitch, then roll."""
    turns: Array = np.roll(Rotation.from_euler("ZYX", euler[:, ::-1]).as_quat(), 1, axis=-1)
    return turns


def warped_space(warping: Warping, around: Array) -> dict[str, Any]:
    """The map's grid in both spaces, near points (N, 3) of the warped one."""
    lines = grid(warping, around)
    low, high = warping.lower[:2], warping.upper[:2]
    return {
        "straight": [packed(line) for line in lines],
        "lines": [packed(warping(line)) for line in lines],
        "extent": [float(low[0]), float(high[0]), float(low[1]), float(high[1])],
    }


def box_motion(base: Array, turns: Array, touch: Array, force: Array, normal: Array, contact: Bools) -> dict[str, Any]:
    """A motion of the base (N, 3) and (N, 4) and of the feet (N, E, 3), without links."""
    return {
        "bodies": packed(np.hstack([base, turns])),
        "center": packed(base),
        "touch": packed(touch),
        "force": packed(force),
        "normal": packed(normal),
        "contact": packed(contact),
    }


def _worst(values: Array, at: npt.NDArray[np.intp]) -> Array:
    """For each of the samples `at`, the greatest of the values (N,) from it to the next."""
    return np.maximum.reduceat(values, at)


def _curves(plan: Plan, at: npt.NDArray[np.intp], planned: Motion, replayed: Motion | None) -> list[dict[str, Any]]:
    residual = centroidal_residual(plan)
    force = 100 * np.linalg.norm(residual[:, :3], axis=1) / plan.weight
    torque = 100 * np.linalg.norm(residual[:, 3:], axis=1) / (plan.weight * LEVER)
    limit = {"limit": _RESIDUAL_LIMIT, "replay": False}
    curves = [
        {"name": "unexplained force", "unit": "% m g", "values": packed(_worst(force, at)), **limit},
        {"name": "unexplained torque", "unit": f"% m g·{LEVER:g} m", "values": packed(_worst(torque, at)), **limit},
    ]
    if replayed is not None:
        K = min(len(replayed.t), len(planned.t))
        away = 1e3 * np.linalg.norm(replayed.center_of_mass[:K] - planned.center_of_mass[:K], axis=1)
        curves.append({"name": "replay: center of mass", "unit": "mm", "values": packed(away), "limit": None, "replay": True})
    return curves


def _number(value: float, unit: str, limit: str) -> str:
    return "not a number" if not np.isfinite(value) else f"{value:.2g} {limit} {unit}".strip()


def _laws(plan: Plan) -> list[dict[str, Any]]:
    """The laws, those that do not hold first."""
    rows = [
        {
            "name": m.name,
            "value": _number(m.value, m.criterion.unit, f"{m.criterion.sign} {m.criterion.passes:g}"),
            "time": m.time,
            "foot": m.foot,
            "good": m.verdict.value == 0,
        }
        for m in check(plan.path).metrics
    ]
    return sorted(rows, key=lambda row: bool(row["good"]))


def _replay_metrics(plan: Plan) -> list[dict[str, Any]]:
    """The metrics of the report beside the plan, those that do not pass first."""
    rows = [
        {
            "name": f"{m['layer']}: {m['name']}",
            "value": _number(m["value"], m["unit"], m["limit"]),
            "time": m["time"] if m["time"] is None or 0 <= m["time"] <= plan.duration else None,
            "foot": m["foot"],
            "good": m["verdict"] == "pass",
        }
        for m in report_of(plan).metrics
    ]
    return sorted(rows, key=lambda row: bool(row["good"]))


def _summary(motion: Motion, note: str) -> list[dict[str, str]]:
    certificate = motion.certificate
    laws = "Every law of the check holds." if certificate["all_laws_hold"] else "The plan breaks laws of the check."
    lines = [{"text": laws, "kind": "pass" if certificate["all_laws_hold"] else "fail"}]
    replay = certificate["replay"]
    if replay["verdict"]:
        words = f"Replay: {replay['verdict']}" + (f" ({replay['first_failure']})" if replay["first_failure"] else "")
        lines.append({"text": words, "kind": replay["verdict"]})
    else:
        lines.append({"text": f"Replay: no verdict; {replay['note']}.", "kind": "soft"})
    if note:
        lines.append({"text": note, "kind": "soft"})
    left = {"friction": "friction", "joint_torque": "joint torque", "joint_speed": "joint speed"}
    margins = [
        f"{words} {100 * certificate['margins'][key]:.1f} %"
        for key, words in left.items()
        if certificate["margins"].get(key) is not None
    ]
    lines.append({"text": f"Left of the limits: {', '.join(margins) or 'nothing to tell'}.", "kind": "soft"})
    return lines


def _replayed(plan: Plan) -> tuple[Motion | None, str]:
    """The replay beside the plan, or why it is not shown."""
    if not plan.path.with_name(f"{stem_of(plan.path)}.replay.npz").is_file():
        return None, ""
    try:
        return motion_of_replay(plan, RATE), ""
    except InputError as error:
        return None, f"The replay is not shown: {error}"


def torso_of(robot: dict[str, Any]) -> dict[str, list[float]]:
    """Center and half size of the trunk's box, from the center of mass; `robot` is that of a plan's `meta`."""
    torso = robot.get("torso") or {}
    try:
        center, half = (np.array(torso[key], float).reshape(3) for key in ("center", "half_size"))
    except (KeyError, TypeError, ValueError):
        center, half = np.zeros(3), np.array([0.3, 0.1, 0.08])
    return {"center": center.tolist(), "half": half.tolist()}


def box_robot(
    torso: dict[str, list[float]], base: Array, turn: Array, foot_position: Array
) -> tuple[list[dict[str, Any]], list[list[float]]]:
    """A robot without links: a box, and where the lines to its feet begin, in the base frame.

    `base` (3,), `turn` (4,) and `foot_position` (E, 3) are those at the start.
    """
    box = {
        "kind": "box",
        "place": torso["center"],
        "turn": [1.0, 0.0, 0.0, 0.0],
        "size": torso["half"],
        "color": list(_ROBOT_COLOR),
    }
    first = Rotation.from_quat(np.roll(turn, -1)).inv().apply(foot_position - base)
    corner = np.clip(first - torso["center"], -np.array(torso["half"]), torso["half"]) + torso["center"]
    corner[:, 2] = torso["center"][2]
    return [{"name": "base", "shapes": [box]}], corner.tolist()


def scene_of(path: Any) -> dict[str, Any]:
    """Everything that the page of a plan shows; raises `InputError`."""
    plan = read_plan(path)
    with explained(plan.path):
        return _scene_of(plan)


def _scene_of(plan: Plan) -> dict[str, Any]:
    archive = Archive(plan.path)
    motion = motion_of_plan(plan, RATE)
    replayed, note = _replayed(plan)
    at = np.clip(np.rint(motion.t / plan.t[1]).astype(np.intp), 0, len(plan.t) - 1)
    torso = torso_of(plan.meta["robot"])
    if motion.body_names:
        bodies, legs = _shapes(motion), None
    else:
        bodies, legs = box_robot(torso, plan.base_position[0], plan.base_quaternion_wxyz[0], plan.foot_position[0])
    warping = warping_of(archive, plan)
    drawn, warped = (None, None) if warping is None else _warped(archive, plan, warping, at)
    laws, metrics = _laws(plan), _replay_metrics(plan)
    tables = [["Laws of the check, and when each is worst", laws, True]]
    if metrics:
        tables.append(["Metrics of the replay, and when each is worst", metrics, True])
    x = plan.base_position
    return {
        "name": motion.name,
        "duration": motion.duration,
        "rate": RATE,
        "frames": len(motion.t),
        "feet": feet(plan.foot_names),
        "friction": plan.robot.friction,
        "weight": plan.weight,
        "center": ((x.min(0) + x.max(0)) / 2).tolist(),
        "bodies": bodies,
        "legs": legs,
        "torso": torso,
        "plan": _motion(motion),
        "replay": None if replayed is None else _motion(replayed),
        "ground": _ground(archive, plan, motion),
        "footholds": footholds(plan.t, plan.foot_contact, plan.foot_position, plan.foot_normal),
        "patches": _patches(archive),
        "map": drawn,
        "warped": warped,
        "curves": _curves(plan, at, motion, replayed),
        "moments": [{"time": row["time"], "good": row["good"]} for row in [*laws, *metrics] if row["time"] is not None],
        "tables": tables,
        "summary": _summary(motion, note),
        "facts": motion.facts,
    }
