"""MJCF made ready for import: what is there to be seen only is left out, and the base is found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .errors import InputError
from .inertia import MENDED, nearest_moments

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


def read_mjcf(path: Path, without_meshes: bool, mend_inertias: bool, notes: list[str]) -> Any:
    """The model in a file, ready to be compiled; `without_meshes`: without all meshes; `mend_inertias`: with the nearest inertias that bodies
    have."""
    spec = mujoco.MjSpec.from_file(str(path))
    for geom in [g for g in spec.geoms if int(g.type) == _MESH]:
        collides = bool(geom.contype or geom.conaffinity)
        has_mass = geom.parent.explicitinertial == 0
        if collides and without_meshes:
            notes.append(f'link "{geom.parent.name}": its collision mesh {geom.meshname} is left out')
        if (without_meshes or not collides) and not has_mass:
            spec.delete(geom)
    used = {g.meshname for g in spec.geoms if int(g.type) == _MESH}
    for unused in [m for m in spec.meshes if m.name not in used]:
        spec.delete(unused)
    _strip_looks(spec)
    _float(path, spec, notes)
    if mend_inertias:
        _mend(spec, notes)
    return spec


def _strip_looks(spec: Any) -> None:
    """Leave out materials, textures and skins, whose files need not be there, and what looks at or measures bodies that may be left out."""
    for element in [*spec.geoms, *spec.sites, *spec.tendons]:
        element.material = ""
    for looks in [*spec.skins, *spec.materials, *spec.textures, *spec.cameras, *spec.lights, *spec.sensors]:
        spec.delete(looks)


def _float(path: Path, spec: Any, notes: list[str]) -> None:
    """Leave one body that floats, the base: a scene's other floating bodies, on which nothing moves, are left out; the only body with legs floats if
    the file says nothing."""
    first = list(spec.worldbody.bodies)
    free = [b for b in first if any(int(j.type) == _FREE for j in b.joints)]
    legged = [b for b in first if _moves(b)]
    if not free and len(legged) == 1 and not len(legged[0].joints):
        legged[0].add_freejoint()
        notes.append(f'body "{legged[0].name}" floats, though the file does not say so')
        _forget_keyframes(spec, notes)
    elif not free and len(legged) > 1 and len(spec.worldbody.geoms):
        names = ", ".join(f'"{b.name}"' for b in legged[:4])
        raise InputError(
            f"{path}: what moves ({names}) hangs on the world, so there is no base; put it and the shapes of the base into one <body> with <freejoint/> and "
            "<inertial>, or import the URDF that the file was made from"
        )
    elif len(free) > 1 and [b for b in free if _moves(b)]:
        props = [b for b in free if not _moves(b)]
        for prop in props:
            notes.append(f'body "{prop.name}" floats and nothing moves on it; it is no part of the robot and is left out')
            spec.delete(prop)
        if props:
            _forget_keyframes(spec, notes)


def _moves(body: Any) -> bool:
    """Whether anything moves on a body."""
    return any(any(int(j.type) != _FREE for j in b.joints) for b in [body, *body.find_all("body")])


def _forget_keyframes(spec: Any, notes: list[str]) -> None:
    """Leave out keyframes, which have the positions of other joints."""
    keys = list(spec.keys)
    for key in keys:
        spec.delete(key)
    if keys:
        notes.append("the file's keyframes are for other joints and are left out")


def _mend(spec: Any, notes: list[str]) -> None:
    """Put the nearest moments that a body has in the place of impossible ones."""
    for body in spec.bodies:
        moments = np.array(body.inertia)
        if body.explicitinertial and np.isnan(body.fullinertia[0]) and 2 * moments.max() > moments.sum():
            notes.append(f'link "{body.name}": {MENDED}')
            body.inertia = nearest_moments(moments)


def refuse_loops(path: Path, model: Any) -> None:
    """Refuse constraints that tie bodies to each other."""
    loops = [int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)]
    for e in range(model.neq):
        if model.eq_type[e] in loops and model.eq_active0[e]:
            name = model.equality(e).name or f"number {e}"
            ends = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
            if int(model.eq_objtype[e]) == int(mujoco.mjtObj.mjOBJ_SITE):
                ends = [int(model.site_bodyid[site]) for site in ends]
            bodies = " and ".join(f'"{model.body(b).name}"' for b in ends)
            raise InputError(f'{path}: equality "{name}" ties {bodies}: closed loops are not supported; remove it')
