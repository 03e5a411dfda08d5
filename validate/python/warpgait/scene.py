"""The world of a replay: robot, terrain, adhesion and whatever is wrong with them on purpose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.interpolate import RectBivariateSpline

from .model import load_spec
from .plan import Array, Heightfield

CELL = 0.025  # m: coarser terrain is refined to this before MuJoCo cuts it into prisms
MARGIN = 0.5  # m: the terrain goes on, level with its rim, by this much
TIMESTEP = 0.002  # s


@dataclass(frozen=True)
class Disturbance:
    """What differs from the plan's world. The controller does not know."""

    friction: float | None = None  # of the ground, instead of the plan's
    mass_factor: float = 1.0  # of the base body
    terrain_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m
    push: tuple[float, float, float, float, float] | None = None  # start s, duration s, force x, y, z N on the base
    noise: float = 0.0  # standard deviations: 1 = 1 mm, 0.1°, 2 cm/s, 1°/s, joints 0.1°, 1°/s
    delay: float = 0.0  # s, between measurement and control
    seed: int = 0


def refine(terrain: Heightfield, cell: float = CELL) -> Heightfield:
    """The terrain on a grid no coarser than `cell`, by bicubic interpolation; as it is where it is fine enough."""
    if (terrain.spacing <= cell * 1.001).all():
        return terrain
    rows, columns = terrain.heights.shape
    y, x = np.arange(rows) * terrain.spacing[1], np.arange(columns) * terrain.spacing[0]
    counts = np.ceil([x[-1] / cell, y[-1] / cell]).astype(int) + 1
    spline = RectBivariateSpline(y, x, terrain.heights, kx=min(3, rows - 1), ky=min(3, columns - 1), s=0)
    heights = spline(np.linspace(0, y[-1], counts[1]), np.linspace(0, x[-1], counts[0]))
    return Heightfield(heights, terrain.origin, np.array([x[-1], y[-1]]) / (counts - 1))


def build(
    path: Path,
    terrain: Heightfield,
    friction: float,
    gravity: Array,
    adhesive: tuple[str, ...] = (),
    adhesion: float = 0.0,
    disturbance: Disturbance | None = None,
    cell: float = CELL,
) -> Any:
    """Compile the MuJoCo model of robot and terrain. Adhesive feet get an actuator `adhesion_FOOT` of strength `adhesion` N."""
    disturbance = disturbance or Disturbance()
    mu = friction if disturbance.friction is None else disturbance.friction
    spec = load_spec(path)
    spec.option.timestep = TIMESTEP
    spec.option.gravity = gravity

    fine = refine(terrain, cell)
    pad = np.ceil(MARGIN / fine.spacing).astype(int)
    heights = np.pad(fine.heights, ((pad[1], pad[1]), (pad[0], pad[0])), mode="edge")
    low, high = float(heights.min()), float(heights.max())
    rise = max(high - low, 1e-3)
    half = (np.array(heights.shape)[::-1] - 1) * fine.spacing / 2
    center = fine.origin - pad * fine.spacing + half
    field = spec.add_hfield(name="terrain", nrow=heights.shape[0], ncol=heights.shape[1], size=[*half, rise, 0.5])
    # MuJoCo normalises the heights to [0, 1] itself; a level terrain must not be normalised to 0/0.
    field.userdata = ((heights - low) / rise).astype(np.float32).ravel().tolist()
    position = np.array([center[0], center[1], low]) + disturbance.terrain_shift
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="terrain",
        pos=position,
        contype=0,
        conaffinity=1,
        rgba=[0.55, 0.5, 0.42, 1.0],
    )
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.72, 0.82, 0.92],
        rgb2=[0.95, 0.96, 0.98],
        width=64,
        height=64,
    )
    base = spec.body("base")
    base.mass *= disturbance.mass_factor
    base.fullinertia = np.asarray(base.fullinertia) * disturbance.mass_factor
    for geom in spec.geoms:
        if geom.name in {site.name for site in spec.sites}:
            geom.friction = [mu, 0.02, 0.01]
            if geom.name in adhesive:
                motor = spec.add_actuator(name=f"adhesion_{geom.name}", target=geom.parent.name, trntype=mujoco.mjtTrn.mjTRN_BODY)
                motor.ctrllimited = True
                motor.ctrlrange = [0, 1]
                motor.forcelimited = False  # the model's default is the joint motors' limit
                motor.set_to_adhesion(adhesion)
    return spec.compile()
