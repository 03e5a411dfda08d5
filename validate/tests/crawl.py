"""A hand-made plan: a robot that stands, or crawls slowly over a terrain given as a function. Obeys the plan format and the centroidal laws.

The body shifts over the next support triangle, stops, and one foot steps; forces come from one small quadratic program a sample.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import daqp
import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from warpgait.model import Composite, composite, find_model, foot_names, indices, load_spec, stand
from warpgait.plan import Array

Height = Callable[[Any, Any], Any]
RATE = 200.0
GRAVITY = 9.81


def flat(x: Any, y: Any) -> Any:
    return 0.0 * (x + y)


def ripple(x: Any, y: Any) -> Any:
    """5 cm, oblique, so that all four feet stand at different heights."""
    return 0.05 * np.sin(2 * np.pi * (x + 0.35 * y) / 1.2 + 0.7)


def slope(degrees: float) -> Height:
    return lambda x, y: np.tan(np.deg2rad(degrees)) * x + 0.0 * y


def normal(height: Height, p: Array) -> Array:
    e = 1e-5
    gx = (height(p[0] + e, p[1]) - height(p[0] - e, p[1])) / (2 * e)
    gy = (height(p[0], p[1] + e) - height(p[0], p[1] - e)) / (2 * e)
    n = np.array([-gx, -gy, 1.0])
    n /= np.linalg.norm(n)
    return n


def smooth_step(s: Array) -> Array:
    return s**3 * (10 - 15 * s + 6 * s * s)


def body_of(name: str) -> tuple[Composite, Array, tuple[str, ...]]:
    """The rigid body, the nominal contact points (E, 3) from the centre of mass, and the feet."""
    model = load_spec(find_model(name)).compile()
    data = mujoco.MjData(model)
    stand(model, data)
    feet = foot_names(model)
    index = indices(model, feet)
    body = composite(model, data)
    contact = data.site_xpos[index.site] - [0, 0, index.radius] - data.xpos[index.base] - body.center_of_mass
    return body, contact, feet


def distribute(wrench: Array, arms: Array, normals: Array, weight: Array, friction: float, pull: Array) -> Array:
    """Forces (k, 3) of the feet with `arms` (k, 3) that make up `wrench` (6,), inside friction pyramids; least squares, weighted."""
    k = len(arms)
    G = np.zeros((6, 3 * k))
    C, lower = [], []
    for j, (r, n) in enumerate(zip(arms, normals, strict=True)):
        G[:3, 3 * j : 3 * j + 3] = np.eye(3)
        G[3:, 3 * j : 3 * j + 3] = [[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]]
        tx = np.cross([0, 1, 0], n)
        tx /= np.linalg.norm(tx)
        ty = np.cross(n, tx)
        for row, least in [
            *((friction / np.sqrt(2) * n - s, -friction / np.sqrt(2) * pull[j]) for s in (tx, -tx, ty, -ty)),
            (n, -pull[j]),
        ]:
            C.append(np.zeros(3 * k))
            C[-1][3 * j : 3 * j + 3] = row
            lower.append(least)
    scale = np.array([1, 1, 1, 3, 3, 3.0])
    H = 1e6 * G.T @ (scale[:, None] ** 2 * G) + np.diag(np.repeat(weight, 3))
    x, _, flag, _ = daqp.solve(
        H, -1e6 * G.T @ (scale**2 * wrench), np.array(C), np.full(len(C), 1e30), np.array(lower), np.zeros(len(C), np.int32)
    )
    assert flag > 0
    return np.asarray(x).reshape(k, 3)


def make(
    path: Path,
    robot: str = "anymal_c",
    height: Height = flat,
    steps: int = 4,
    stride: float = 0.10,
    clearance: float = 0.06,
    friction: float = 0.6,
    adhesive: tuple[str, ...] = (),
    shift: float = 0.75,
    swing: float = 0.40,
    tilt: float = 0.0,
    extent: tuple[float, float, float, float] = (-1.5, 2.0, -1.2, 1.2),
    spacing: float = 0.025,
) -> Path:
    """Write a plan of `steps` single steps (0: standing for 1 s) along x and return its path; the trunk is pitched up by `tilt` rad."""
    body, nominal, feet = body_of(robot)
    E = len(feet)
    order = [feet.index(f) for f in ("RH", "RF", "LH", "LF")]
    rest = 0.4
    duration = 1.0 if steps == 0 else rest + 1.0 + steps * (shift + swing)
    N = round(duration * RATE) + 1
    t = np.arange(N) / RATE

    up = Rotation.from_rotvec([0.0, -tilt, 0.0])
    above = up.apply([0.0, 0.0, -nominal[:, 2].mean()])  # the centre of mass, from the feet's mean
    holds = up.apply(nominal) + above
    holds[:, 2] = [height(p[0], p[1]) for p in holds]
    foot, contact = np.repeat(holds[None], N, 0), np.ones((N, E), bool)
    ends = np.full((N, E, 2), [-1.0, duration + 1.0])  # of the running stance
    waypoints = [(0.0, holds.mean(0)), (rest, holds.mean(0))]
    for k in range(steps):
        i = order[k % 4]
        start = rest + k * (shift + swing) + shift
        others = [j for j in range(E) if j != i]
        target = 0.5 * holds.mean(0) + 0.5 * holds[others].mean(0)
        waypoints += [(start, target), (start + swing, target)]
        goal = holds[i] + [stride, 0, 0]
        goal[2] = height(goal[0], goal[1])
        inside = (t > start + 1e-9) & (t < start + swing - 1e-9)
        s = ((t[inside] - start) / swing)[:, None]
        lift = clearance + abs(goal[2] - holds[i, 2])
        foot[inside, i] = (
            holds[i]
            + (goal - holds[i]) * smooth_step(s)
            + 64 * s**3 * (1 - s) ** 3 * lift * normal(height, (goal + holds[i]) / 2)
        )
        contact[inside, i] = False
        ends[t <= start + 1e-9, i, 1] = np.minimum(ends[t <= start + 1e-9, i, 1], start)
        after = t >= start + swing - 1e-9
        ends[after, i] = [start + swing, duration + 1.0]
        foot[after, i] = goal
        holds[i] = goal
    waypoints += [(duration - 0.1, holds.mean(0)), (duration, holds.mean(0))] if steps else [(duration, holds.mean(0))]

    com = np.zeros((N, 3))
    for (t0, a), (t1, b) in itertools.pairwise(waypoints):
        inside = (t >= t0 - 1e-9) & (t <= t1 + 1e-9)
        com[inside] = a + (b - a) * smooth_step(((t[inside] - t0) / max(t1 - t0, 1e-9))[:, None])
    com += above
    angle = 0.03 * smooth_step(t / duration)  # a little pitch, so that the orientation is put to use
    rotation = Rotation.from_rotvec(angle[:, None] * [0.0, 1.0, 0.0]) * up

    def derivatives(values: Array) -> tuple[Array, Array]:
        spline = CubicSpline(t, values, bc_type="clamped")
        return spline(t, 1), spline(t, 2)

    velocity, acceleration = derivatives(com)
    rate, rate2 = derivatives(angle)
    omega, alpha = rate[:, None] * [0, 1.0, 0], rate2[:, None] * [0, 1.0, 0]
    foot_velocity, foot_acceleration = derivatives(foot)
    foot_velocity[contact], foot_acceleration[contact] = 0.0, 0.0
    normals = np.array([[normal(height, p) for p in row] for row in foot])
    R = rotation.as_matrix()
    force = np.zeros((N, E, 3))
    pull = np.array([1.2 * body.mass * GRAVITY if f in adhesive else 0.0 for f in feet])
    for k in range(N):
        inertia = R[k] @ body.inertia @ R[k].T
        wrench = np.r_[
            body.mass * (acceleration[k] + [0, 0, GRAVITY]), inertia @ alpha[k] + np.cross(omega[k], inertia @ omega[k])
        ]
        stance = np.flatnonzero(contact[k])
        ramp = np.clip(np.minimum(t[k] - ends[k, stance, 0], ends[k, stance, 1] - t[k]) / 0.12, 0.03, 1.0)
        force[k, stance] = distribute(wrench, foot[k, stance] - com[k], normals[k, stance], ramp**-2, friction, pull[stance])

    x_min, x_max, y_min, y_max = extent
    xs, ys = np.arange(x_min, x_max + spacing / 2, spacing), np.arange(y_min, y_max + spacing / 2, spacing)
    meta = {
        "schema": 1,
        "robot": {
            "name": robot,
            "mass": body.mass,
            "inertia": body.inertia.tolist(),
            "friction": friction,
            "gravity": [0, 0, -GRAVITY],
        },
        "solver": {"status": "made by hand", "success": True},
        "scenario": "",
    }
    np.savez_compressed(
        path,
        t=t,
        base_position=com,
        base_quaternion_wxyz=np.roll(rotation.as_quat(), 1, axis=1),
        base_linear_velocity=velocity,
        base_linear_acceleration=acceleration,
        base_angular_velocity=omega,
        base_angular_acceleration=alpha,
        foot_position=foot,
        foot_velocity=foot_velocity,
        foot_acceleration=foot_acceleration,
        foot_force=force,
        foot_contact=contact,
        foot_normal=normals,
        foot_names=np.array(feet),
        foot_adhesive=np.array([f in adhesive for f in feet]),
        heightfield=np.asarray(height(xs[None, :], ys[:, None]), float),
        heightfield_origin=np.array([x_min, y_min]),
        heightfield_spacing=np.array([spacing, spacing]),
        meta=np.array(json.dumps(meta)),
    )
    return path


def altered(source: Path, target: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of a plan with its members changed by `change`."""
    with np.load(source) as archive:
        members = {name: archive[name] for name in archive.files}
    change(members)
    np.savez_compressed(target, **members)
    return target
