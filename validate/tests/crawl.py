"""A handmade plan: a robot that stands, or crawls slowly over a terrain given as a function. It obeys the plan format and the centroidal laws.

The body moves over the next support triangle and stops, and then one foot steps. A small quadratic program finds the forces at each sample.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import daqp
import mujoco
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from warpgait.arrays import Array, Bools
from warpgait.geometry import Floats, smootherstep
from warpgait.model import Composite, composite, find_model, foot_names, indices, load_spec, stand

Height = Callable[[Any, Any], Any]
RATE = 200.0  # Hz
G = 9.81  # m/s²
GRAVITY = np.array([0.0, 0.0, -G])
PULL_LIMIT = 1.2  # fraction of m g, the largest pull of an adhesive foot
STEP_ORDER = ("RH", "RF", "LH", "LF")
REST = 0.4  # s before the first step
RAMP = 0.12  # s over which a foot takes up its load


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


def body_of(name: str) -> tuple[Composite, Array, tuple[str, ...]]:
    """The rigid body, the nominal contact points (E, 3) from the center of mass, and the feet."""
    model = load_spec(find_model(name)).compile()
    data = mujoco.MjData(model)
    stand(model, data)
    feet = foot_names(model)
    index = indices(model, feet)
    body = composite(model, data)
    contact = data.site_xpos[index.site] - [0, 0, index.radius] - data.xpos[index.base] - body.center_of_mass
    return body, contact, feet


def distribute(wrench: Array, arms: Array, normals: Array, weight: Array, friction: float, pull: Array) -> Array:
    """Forces (k, 3) of the feet with `arms` (k, 3) that produce `wrench` (6,), inside friction pyramids, by weighted least squares."""
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


@dataclass(frozen=True)
class Crawl:
    """How the robot crawls."""

    steps: int = 4  # of single feet; 0: standing for 1 s
    stride: float = 0.10  # m along x
    clearance: float = 0.06  # m
    shift: float = 0.75  # s for the body to move over the next support triangle
    swing: float = 0.40  # s

    @property
    def duration(self) -> float:
        return 1.0 if self.steps == 0 else REST + 1.0 + self.steps * (self.shift + self.swing)


@dataclass
class Feet:
    """What the feet do. N samples, E feet."""

    position: Array  # (N, E, 3)
    contact: Bools  # (N, E)
    stance: Array  # (N, E, 2) s, begin and end of the current stance
    support: list[tuple[float, Array]]  # times, and where the mean of the feet, or the middle of a support triangle, is then


def walk(crawl: Crawl, height: Height, holds: Array, order: list[int], t: Array) -> Feet:
    """Paths of the feet from `holds` (E, 3), which are moved to the last footholds."""
    N, E = len(t), len(holds)
    after_end = crawl.duration + 1.0
    feet = Feet(np.repeat(holds[None], N, 0), np.ones((N, E), bool), np.full((N, E, 2), [-1.0, after_end]), [])
    feet.support += [(0.0, holds.mean(0)), (REST, holds.mean(0))]
    for k in range(crawl.steps):
        i = order[k % len(order)]
        start = REST + k * (crawl.shift + crawl.swing) + crawl.shift
        end = start + crawl.swing
        others = [j for j in range(E) if j != i]
        target = 0.5 * holds.mean(0) + 0.5 * holds[others].mean(0)
        feet.support += [(start, target), (end, target)]
        goal = holds[i] + [crawl.stride, 0, 0]
        goal[2] = height(goal[0], goal[1])
        inside, before, after = (t > start + 1e-9) & (t < end - 1e-9), t <= start + 1e-9, t >= end - 1e-9
        s = ((t[inside] - start) / crawl.swing)[:, None]
        lift = (crawl.clearance + abs(goal[2] - holds[i, 2])) * normal(height, (goal + holds[i]) / 2)
        feet.position[inside, i] = holds[i] + smootherstep(s, goal - holds[i]) + 64 * s**3 * (1 - s) ** 3 * lift
        feet.position[after, i] = goal
        feet.contact[inside, i] = False
        feet.stance[before, i, 1] = np.minimum(feet.stance[before, i, 1], start)
        feet.stance[after, i] = [end, after_end]
        holds[i] = goal
    end = crawl.duration
    feet.support += [(end - 0.1, holds.mean(0)), (end, holds.mean(0))] if crawl.steps else [(end, holds.mean(0))]
    return feet


def between(waypoints: list[tuple[float, Array]], t: Array) -> Array:
    """A smooth path (N, 3) that stops at each waypoint."""
    path = np.zeros((len(t), 3))
    for (t0, a), (t1, b) in itertools.pairwise(waypoints):
        inside = (t >= t0 - 1e-9) & (t <= t1 + 1e-9)
        path[inside] = a + smootherstep(((t[inside] - t0) / max(t1 - t0, 1e-9))[:, None], b - a)
    return path


@dataclass(frozen=True)
class Derived:
    """A quantity over time with its first and second derivatives."""

    value: Floats
    first: Array
    second: Array


def derived(t: Array, values: Floats) -> Derived:
    spline = CubicSpline(t, values, bc_type="clamped")
    return Derived(values, spline(t, 1), spline(t, 2))


def make(
    path: Path,
    robot: str = "anymal_c",
    height: Height = flat,
    friction: float = 0.6,
    adhesive: tuple[str, ...] = (),
    tilt: float = 0.0,
    extent: tuple[float, float, float, float] = (-1.5, 2.0, -1.2, 1.2),
    spacing: float = 0.025,
    **crawl_options: Any,
) -> Path:
    """Write a plan and return its path. The trunk is pitched up by `tilt` rad; `crawl_options` are those of `Crawl`."""
    crawl = Crawl(**crawl_options)
    body, nominal, names = body_of(robot)
    t = np.arange(round(crawl.duration * RATE) + 1) / RATE
    up = Rotation.from_rotvec([0.0, -tilt, 0.0])
    above = up.apply([0.0, 0.0, -nominal[:, 2].mean()])  # the center of mass, from the mean of the feet
    holds = up.apply(nominal) + above
    holds[:, 2] = [height(p[0], p[1]) for p in holds]
    feet = walk(crawl, height, holds, [names.index(f) for f in STEP_ORDER], t)
    foot = derived(t, feet.position)
    foot.first[feet.contact], foot.second[feet.contact] = 0.0, 0.0
    com = derived(t, between(feet.support, t) + above)
    pitch = derived(t, 0.03 * smootherstep(t / crawl.duration))  # rad, a little, so that the orientation matters
    axis = np.array([0.0, 1.0, 0.0])
    rotation = Rotation.from_rotvec(pitch.value[:, None] * axis) * up
    omega, alpha = pitch.first[:, None] * axis, pitch.second[:, None] * axis
    normals = np.array([[normal(height, p) for p in row] for row in feet.position])
    pull = np.array([PULL_LIMIT * body.mass * G if f in adhesive else 0.0 for f in names])
    R = rotation.as_matrix()
    force = np.zeros(feet.position.shape)
    for k in range(len(t)):
        inertia = R[k] @ body.inertia @ R[k].T
        moment = inertia @ alpha[k] + np.cross(omega[k], inertia @ omega[k])
        wrench = np.r_[body.mass * (com.second[k] - GRAVITY), moment]
        stance = np.flatnonzero(feet.contact[k])
        since, until = t[k] - feet.stance[k, stance, 0], feet.stance[k, stance, 1] - t[k]
        weight = np.clip(np.minimum(since, until) / RAMP, 0.03, 1.0) ** -2
        arms = feet.position[k, stance] - com.value[k]
        force[k, stance] = distribute(wrench, arms, normals[k, stance], weight, friction, pull[stance])
    x_min, x_max, y_min, y_max = extent
    xs, ys = np.arange(x_min, x_max + spacing / 2, spacing), np.arange(y_min, y_max + spacing / 2, spacing)
    np.savez_compressed(
        path,
        t=t,
        base_position=com.value,
        base_quaternion_wxyz=np.roll(rotation.as_quat(), 1, axis=1),
        base_linear_velocity=com.first,
        base_linear_acceleration=com.second,
        base_angular_velocity=omega,
        base_angular_acceleration=alpha,
        foot_position=foot.value,
        foot_velocity=foot.first,
        foot_acceleration=foot.second,
        foot_force=force,
        foot_contact=feet.contact,
        foot_normal=normals,
        foot_names=np.array(names),
        foot_adhesive=np.array([f in adhesive for f in names]),
        heightfield=np.asarray(height(xs[None, :], ys[:, None]), float),
        heightfield_origin=np.array([x_min, y_min]),
        heightfield_spacing=np.array([spacing, spacing]),
        meta=np.array(json.dumps(meta_of(robot, body, friction))),
    )
    return path


def meta_of(robot: str, body: Composite, friction: float) -> dict[str, Any]:
    return {
        "schema": 1,
        "robot": {
            "name": robot,
            "mass": body.mass,
            "inertia": body.inertia.tolist(),
            "friction": friction,
            "gravity": GRAVITY.tolist(),
        },
        "limits": {"pull_limit": PULL_LIMIT},
        "solver": {"status": "made by hand", "success": True},
        "scenario": "",
    }


def altered(source: Path, target: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of a plan with its members changed by `change`."""
    with np.load(source) as archive:
        members = {name: archive[name] for name in archive.files}
    change(members)
    np.savez_compressed(target, **members)
    return target
