"""The world of a replay: robot, terrain, adhesion, and the disturbances that change them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.spatial.transform import Rotation

from .arrays import Array
from .conditions import Payload
from .model import adhesion_name, load_spec
from .plan import Heightfield
from .settings import CELL, PHYSICS_RATES, Disturbance

MARGIN = 0.5  # m: beyond the heightfield, the ground goes on by this much, level with the rim
BASE_THICKNESS = 0.5  # m of ground below the lowest point, which MuJoCo asks for
LEAST_RISE = 1e-3  # m between lowest and highest point, so that a level terrain is not normalized to 0/0
TORSIONAL_FRICTION, ROLLING_FRICTION = 0.02, 0.01  # m, of a foot, as MuJoCo defines them
PAYLOAD, PAYLOAD_RADIUS = "payload", 0.1  # the body, and its radius of gyration, m
# Of friction, relative to the normal force. MuJoCo's friction is soft: at 10, feet on a wall creep by 6 mm/s without reaching the cone.
FRICTION_STIFFNESS = 100.0
GROUND_COLOR = [0.55, 0.5, 0.42, 1.0]
ZENITH_COLOR, HORIZON_COLOR = [0.72, 0.82, 0.92], [0.95, 0.96, 0.98]


def refine(terrain: Heightfield, cell: float = CELL) -> Heightfield:
    """The terrain on a grid no coarser than `cell` m, by bicubic interpolation. A terrain that is fine enough is returned as it is."""
    if (terrain.spacing <= cell * 1.001).all():  # rounding of the spacing must not refine the terrain
        return terrain
    rows, columns = terrain.heights.shape
    y, x = np.arange(rows) * terrain.spacing[1], np.arange(columns) * terrain.spacing[0]
    counts = np.ceil([x[-1] / cell, y[-1] / cell]).astype(int) + 1
    spline = RectBivariateSpline(y, x, terrain.heights, kx=min(3, rows - 1), ky=min(3, columns - 1), s=0)
    heights = spline(np.linspace(0, y[-1], counts[1]), np.linspace(0, x[-1], counts[0]))
    return Heightfield(heights, terrain.origin, np.array([x[-1], y[-1]]) / (counts - 1))


def _add_ground(spec: Any, terrain: Heightfield, disturbance: Disturbance, pivot: Array) -> None:
    """The terrain with a level margin around it, as a heightfield, moved, and tilted about `pivot` (3,) m, as the disturbance has it."""
    margin = np.ceil(MARGIN / terrain.spacing).astype(int)
    heights = np.pad(terrain.heights, ((margin[1], margin[1]), (margin[0], margin[0])), mode="edge")
    low, high = float(heights.min()), float(heights.max())
    rise = max(high - low, LEAST_RISE)
    half = (np.array(heights.shape)[::-1] - 1) * terrain.spacing / 2
    center = terrain.origin - margin * terrain.spacing + half
    size = [*half, rise, BASE_THICKNESS]
    field = spec.add_hfield(name="terrain", nrow=heights.shape[0], ncol=heights.shape[1], size=size)
    field.userdata = ((heights - low) / rise).astype(np.float32).ravel().tolist()
    tilt = Rotation.from_euler("xy", disturbance.terrain_tilt, degrees=True)
    place = np.array([center[0], center[1], low]) + disturbance.terrain_shift
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="terrain",
        pos=pivot + tilt.apply(place - pivot),
        quat=tilt.as_quat(scalar_first=True),
        contype=0,
        conaffinity=1,
        rgba=GROUND_COLOR,
    )


def _add_sky(spec: Any) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=ZENITH_COLOR,
        rgb2=HORIZON_COLOR,
        width=64,
        height=64,
    )


def _make_adhesive(spec: Any, foot: Any, strength: float) -> None:
    """Give the geom `foot` an actuator that presses it onto the ground with up to `strength` N.

    MuJoCo's adhesion acts on all geoms of a body, so the foot gets a body of its own.
    """
    body = foot.parent.add_body(name=f"{foot.name}_FOOT", pos=foot.pos)
    kept = ("type", "size", "condim", "priority", "contype", "conaffinity", "friction", "solref", "solimp", "solmix", "rgba")
    values = {key: np.copy(value) if np.ndim(value := getattr(foot, key)) else value for key in kept}
    name = foot.name
    spec.delete(foot)
    body.add_geom(name=name, mass=0.0, **values)
    actuator = spec.add_actuator(name=adhesion_name(name), target=body.name, trntype=mujoco.mjtTrn.mjTRN_BODY)
    actuator.ctrllimited = True
    actuator.ctrlrange = [0, 1]
    actuator.forcelimited = False  # the model's default is the joint motors' limit
    actuator.set_to_adhesion(strength)


def _change_robot(spec: Any, disturbance: Disturbance) -> None:
    """Masses, center of mass, payload and drives as the disturbance has them."""
    base = spec.body("base")
    total = sum(body.mass for body in spec.bodies)
    base.ipos = np.asarray(base.ipos) + np.asarray(disturbance.com_shift) * total / base.mass
    for body in spec.bodies:
        factor = disturbance.body_factor * (disturbance.mass_factor if body.name == base.name else 1.0)
        body.mass *= factor
        body.fullinertia = np.asarray(body.fullinertia) * factor
    if disturbance.payload is not None and disturbance.payload[0] > 0:
        mass, *place = disturbance.payload
        base.add_body(
            name=PAYLOAD, pos=place, ipos=[0, 0, 0], mass=mass, inertia=[mass * PAYLOAD_RADIUS**2] * 3, explicitinertial=True
        )
    inertia, friction = disturbance.drives
    driven = {motor.target for motor in spec.actuators}
    for joint in spec.joints:
        if joint.name in driven:
            joint.armature += inertia
            joint.frictionloss += friction


def world_spec(
    path: Path,
    terrain: Heightfield,
    friction: float,
    gravity: Array,
    adhesive: tuple[str, ...] = (),
    adhesion: float = 0.0,
    disturbance: Disturbance | None = None,
    pivot: Array | None = None,
    cell: float = CELL,
    payload: Payload | None = None,
) -> Any:
    """Robot and terrain as an editable `MjSpec`. Feet in `adhesive` get an adhesion actuator of strength `adhesion` N.

    `pivot` (3,) m is the point about which the disturbance tilts the ground; `payload` is what the robot carries as planned.
    """
    disturbance = disturbance or Disturbance()
    spec = load_spec(path, payload)
    spec.option.timestep = 1 / PHYSICS_RATES[0]
    spec.option.gravity = gravity
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # contacts.py reads the forces as such cones have them
    spec.option.impratio = FRICTION_STIFFNESS
    _add_ground(spec, refine(terrain, cell), disturbance, np.zeros(3) if pivot is None else pivot)
    _add_sky(spec)
    _change_robot(spec, disturbance)
    feet = {site.name for site in spec.sites}
    mu = friction if disturbance.friction is None else disturbance.friction
    for geom in [geom for geom in spec.geoms if geom.name in feet]:
        geom.friction = [mu, TORSIONAL_FRICTION, ROLLING_FRICTION]
        if geom.name in adhesive:
            _make_adhesive(spec, geom, adhesion)
    return spec


def build_world(*arguments: Any, **options: Any) -> Any:
    """The compiled model of `world_spec`, with the same arguments."""
    return world_spec(*arguments, **options).compile()
