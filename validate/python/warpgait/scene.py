"""The world of a replay: robot, terrain, adhesion, and the disturbances that change them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.interpolate import RectBivariateSpline

from .arrays import Array
from .model import adhesion_name, load_spec
from .plan import Heightfield
from .settings import CELL, PHYSICS_RATES, Disturbance

MARGIN = 0.5  # m: beyond the heightfield, the ground goes on by this much, level with the rim
BASE_THICKNESS = 0.5  # m of ground below the lowest point, which MuJoCo asks for
LEAST_RISE = 1e-3  # m between lowest and highest point, so that a level terrain is not normalized to 0/0
TORSIONAL_FRICTION, ROLLING_FRICTION = 0.02, 0.01  # m, of a foot, as MuJoCo defines them
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


def _add_ground(spec: Any, terrain: Heightfield, shift: tuple[float, float, float]) -> None:
    """The terrain with a level margin around it, as a heightfield, moved by `shift` m."""
    margin = np.ceil(MARGIN / terrain.spacing).astype(int)
    heights = np.pad(terrain.heights, ((margin[1], margin[1]), (margin[0], margin[0])), mode="edge")
    low, high = float(heights.min()), float(heights.max())
    rise = max(high - low, LEAST_RISE)
    half = (np.array(heights.shape)[::-1] - 1) * terrain.spacing / 2
    center = terrain.origin - margin * terrain.spacing + half
    size = [*half, rise, BASE_THICKNESS]
    field = spec.add_hfield(name="terrain", nrow=heights.shape[0], ncol=heights.shape[1], size=size)
    field.userdata = ((heights - low) / rise).astype(np.float32).ravel().tolist()
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="terrain",
        pos=np.array([center[0], center[1], low]) + shift,
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


def _add_adhesion(spec: Any, geom: Any, strength: float) -> None:
    """An actuator that presses the foot `geom` onto the ground with up to `strength` N."""
    actuator = spec.add_actuator(name=adhesion_name(geom.name), target=geom.parent.name, trntype=mujoco.mjtTrn.mjTRN_BODY)
    actuator.ctrllimited = True
    actuator.ctrlrange = [0, 1]
    actuator.forcelimited = False  # the model's default is the joint motors' limit
    actuator.set_to_adhesion(strength)


def world_spec(
    path: Path,
    terrain: Heightfield,
    friction: float,
    gravity: Array,
    adhesive: tuple[str, ...] = (),
    adhesion: float = 0.0,
    disturbance: Disturbance | None = None,
    cell: float = CELL,
) -> Any:
    """Robot and terrain as an editable `MjSpec`. Feet in `adhesive` get an adhesion actuator of strength `adhesion` N."""
    disturbance = disturbance or Disturbance()
    spec = load_spec(path)
    spec.option.timestep = 1 / PHYSICS_RATES[0]
    spec.option.gravity = gravity
    _add_ground(spec, refine(terrain, cell), disturbance.terrain_shift)
    _add_sky(spec)
    base = spec.body("base")
    base.mass *= disturbance.mass_factor
    base.fullinertia = np.asarray(base.fullinertia) * disturbance.mass_factor
    feet = {site.name for site in spec.sites}
    mu = friction if disturbance.friction is None else disturbance.friction
    for geom in spec.geoms:
        if geom.name in feet:
            geom.friction = [mu, TORSIONAL_FRICTION, ROLLING_FRICTION]
            if geom.name in adhesive:
                _add_adhesion(spec, geom, adhesion)
    return spec


def build_world(*arguments: Any, **options: Any) -> Any:
    """The compiled model of `world_spec`, with the same arguments."""
    return world_spec(*arguments, **options).compile()
