"""OpenUSD: the robot's shapes, moving, and the ground as a mesh. Meters, z up."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..files import write_bytes
from ..plan import Heightfield
from .format import Format
from .motion import Motion


def _name(text: str) -> str:
    """A name that USD accepts."""
    plain = "".join(c if c.isascii() and c.isalnum() else "_" for c in text)
    return plain if plain and not plain[0].isdigit() else f"_{plain}"


def _add_ground(usd: Any, stage: Any, ground: Heightfield) -> None:
    geometry, gf, vt = usd
    rows, columns = ground.heights.shape
    x = ground.origin[0] + ground.spacing[0] * np.arange(columns)
    y = ground.origin[1] + ground.spacing[1] * np.arange(rows)
    points = np.stack([*np.meshgrid(x, y), ground.heights], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], -1).astype(np.int32)
    mesh = geometry.Mesh.Define(stage, "/World/ground")
    mesh.CreatePointsAttr(vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(vt.IntArray.FromNumpy(np.full(len(faces), 4, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(vt.IntArray.FromNumpy(faces.ravel()))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateDisplayColorAttr([gf.Vec3f(0.55, 0.5, 0.42)])


def _add_shape(usd: Any, stage: Any, path: str, model: Any, g: int) -> None:
    """A primitive shape of the robot, in the frame of its body; other kinds are left out."""
    geometry, gf, _ = usd
    size = [float(s) for s in model.geom_size[g]]
    kind = int(model.geom_type[g])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        shape = geometry.Cube.Define(stage, path)
        shape.CreateSizeAttr(2.0)
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        shape = geometry.Sphere.Define(stage, path)
        shape.CreateRadiusAttr(size[0])
    elif kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE):
        define = geometry.Cylinder if kind == mujoco.mjtGeom.mjGEOM_CYLINDER else geometry.Capsule
        shape = define.Define(stage, path)
        shape.CreateRadiusAttr(size[0])
        shape.CreateHeightAttr(2 * size[1])
        shape.CreateAxisAttr("Z")
    else:
        return
    w, x, y, z = (float(part) for part in model.geom_quat[g])
    shape.AddTranslateOp().Set(gf.Vec3d(*(float(p) for p in model.geom_pos[g])))
    shape.AddOrientOp(geometry.XformOp.PrecisionDouble).Set(gf.Quatd(w, x, y, z))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        shape.AddScaleOp().Set(gf.Vec3f(*size))
    shape.CreateDisplayColorAttr([gf.Vec3f(*(float(c) for c in model.geom_rgba[g, :3]))])


def _write(motion: Motion, target: Path) -> None:
    core, geometry = FORMAT.require("pxr.Usd", "usd-core"), FORMAT.require("pxr.UsdGeom", "usd-core")
    gf, vt = FORMAT.require("pxr.Gf", "usd-core"), FORMAT.require("pxr.Vt", "usd-core")
    usd, model = (geometry, gf, vt), motion.model
    with tempfile.TemporaryDirectory() as folder:  # USD opens files by name
        file = Path(folder) / "motion.usdc"
        stage = core.Stage.CreateNew(str(file))
        geometry.SetStageUpAxis(stage, geometry.Tokens.z)
        geometry.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(motion.rate)
        stage.SetFramesPerSecond(motion.rate)
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(len(motion.t) - 1)
        world = geometry.Xform.Define(stage, "/World")
        stage.SetDefaultPrim(world.GetPrim())
        world.GetPrim().SetCustomDataByKey("warpgait", FORMAT.facts_json(motion))
        _add_ground(usd, stage, motion.ground)
        for b, name in enumerate(motion.body_names):
            path = f"/World/{_name(motion.robot)}/{_name(name)}"
            body = geometry.Xform.Define(stage, path)
            move, turn = body.AddTranslateOp(), body.AddOrientOp(geometry.XformOp.PrecisionDouble)
            for k in range(len(motion.t)):
                move.Set(gf.Vec3d(*(float(p) for p in motion.body_position[k, b])), k)
                turn.Set(gf.Quatd(*(float(q) for q in motion.body_quaternion_wxyz[k, b])), k)
            for g in np.flatnonzero(model.geom_bodyid == b + 1):
                _add_shape(usd, stage, f"{path}/shape_{g}", model, int(g))
        stage.GetRootLayer().Save()
        write_bytes(target, file.read_bytes())


FORMAT = Format(
    name="usd",
    purpose="OpenUSD viewers, Isaac Sim, Blender: shapes of the robot, moving, and the ground as a mesh",
    ending=".usdc",
    write=_write,
    conventions={
        "bodies": "one Xform each under /World/ROBOT, not nested; one time code a frame",
        "facts": "custom data warpgait of /World",
    },
    rate=50.0,
    ground=True,
)
