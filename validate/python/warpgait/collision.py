"""Do the legs hit each other or the trunk? The simulation has no contacts between parts of the robot; its motion is looked at afterward."""

from __future__ import annotations

from typing import Any

import mujoco

from .arrays import Array
from .model import Indices, foot_of
from .replay import Incident

DEPTH = 1e-3  # m: parts that overlap less only touch
PERIOD = 0.02  # s between the postures that are looked at
_BASE = 1 << 20  # bit of the trunk; those of the legs come before it


def _bits(spec: Any, index: Indices) -> None:
    """Let shapes of different legs collide, and the bodies that carry the feet with the trunk. (Hips and thighs are mounted on it.)"""
    shanks = {spec.geom(foot).parent.name for foot in index.feet}
    every_leg = (1 << len(index.feet)) - 1
    for geom in spec.geoms:
        body = geom.parent.name
        foot = foot_of(body, index.feet)
        if foot is not None:
            own = 1 << index.feet.index(foot)
            geom.contype, geom.conaffinity = own | (_BASE if body in shanks else 0), every_leg & ~own
        else:
            geom.contype, geom.conaffinity = 0, _BASE if body == "base" else 0


class SelfCollision:
    """Finds the collisions of a robot with itself."""

    def __init__(self, spec: Any, index: Indices) -> None:
        """`spec` is changed."""
        _bits(spec, index)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._feet = index.feet

    def find(self, t: Array, qpos: Array) -> list[Incident]:
        """Collisions in postures `qpos` (K, nq) at times `t` (K,), one for each posture that has one; every `PERIOD` is looked at."""
        stride = max(1, round(PERIOD / float(t[1] - t[0])))
        model, data, found = self._model, self._data, []
        for k in range(0, len(t), stride):
            data.qpos[:] = qpos[k]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            for c in range(data.ncon):
                if data.contact.dist[c] < -DEPTH:
                    names = [model.body(model.geom_bodyid[g]).name for g in data.contact.geom[c]]
                    foot = foot_of(names[0], self._feet) or foot_of(names[1], self._feet)
                    found.append(Incident(float(t[k]), f"{names[0]} hits {names[1]}", foot))
                    break
        return found
