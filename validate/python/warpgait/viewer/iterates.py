"""What the page of a solve shows: the ground, the warped space, and the motion so far, a box with lines to its feet."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from .. import _native
from ..arrays import Array
from .page import page_of_scene
from .scene import AROUND, MOST_NODES, box_motion, box_robot, feet, footholds, ground, torso_of, turns_of, warped_space
from .warping import Warping

_ROWS = 15  # iterations in the table
_LEAST_SPACING = 0.02  # m of the ground's grid


def _ground(terrain: _native.Terrain, x_y: Array) -> dict[str, Any]:
    """The ground around points (N, 2)."""
    lower, upper = np.reshape(terrain.extent, (2, 2)).T
    inside = np.clip(x_y, lower, upper)
    low, high = np.maximum(inside.min(0) - AROUND, lower), np.minimum(inside.max(0) + AROUND, upper)
    spacing = max(_LEAST_SPACING, float((high - low).max()) / (MOST_NODES - 1))
    x, y = (low[axis] + spacing * np.arange(max(2, int((high - low)[axis] / spacing) + 1)) for axis in (0, 1))
    heights = terrain.height(np.stack(np.meshgrid(x, y), -1))
    return ground(heights, low, np.full(2, spacing))


class Iterates:
    """The scene of a solve, made anew for each stage, and what changes in it from one iterate to the next."""

    def __init__(self, name: str) -> None:
        """`name` is that of the scenario."""
        self.name = name
        self._number = 0  # of the scene
        self._stage = ""
        self._rows: deque[dict[str, Any]] = deque(maxlen=_ROWS)
        self._scene: dict[str, Any] = {}

    def shown(self, at: _native.Iterate) -> tuple[Callable[[], str], dict[str, Any]]:
        """The page at an iterate, made when it is asked for, and what a page that is open is told of it."""
        row = {"name": f"{at.stage}, {at.iteration}", "value": f"{at.violation:.1e}", "time": None, "foot": None, "good": True}
        self._rows.appendleft(row)
        normal = at.terrain.normal(at.foot_position[..., :2])
        told = {
            "plan": box_motion(
                at.base_position, at.base_quaternion_wxyz, at.foot_position, at.foot_force, normal, at.foot_contact
            ),
            "warped": self._warped(at),
            "footholds": footholds(at.t, at.foot_contact, at.foot_position, normal),
            "summary": [
                {"text": f"Iteration {at.iteration}: {at.stage}", "kind": "marginal"},
                {"text": f"Largest violation {at.violation:.1e}, objective {at.objective:.3e}.", "kind": "soft"},
            ],
            "tables": [["Iterations, and the largest violation", list(self._rows), True]],
        }
        if at.stage != self._stage:
            self._stage = at.stage
            self._number += 1
            self._scene = self._still(at)
        news = told | {"scene": self._number}
        scene = self._scene | news | {"live": True}
        title, subtitle = f"{self.name}: warpgait at work", "Iterates of the solve as they come"
        return lambda: page_of_scene(scene, title, subtitle, "; connect-src 'self'"), news

    def _warped(self, at: _native.Iterate) -> dict[str, Any] | None:
        if at.warped_foot_position is None or at.warped_foot_force is None:
            return None
        base, turns = at.base_position, at.base_quaternion_wxyz
        if at.warped_base is not None:
            base, turns = at.warped_base[:, :3], turns_of(at.warped_base[:, 3:])
        up = np.broadcast_to([0.0, 0.0, 1.0], at.foot_position.shape)
        return box_motion(base, turns, at.warped_foot_position, at.warped_foot_force, up, at.foot_contact)

    def _still(self, at: _native.Iterate) -> dict[str, Any]:
        """What stays the same during a stage."""
        robot = json.loads(at.robot)
        torso = torso_of(robot)
        bodies, legs = box_robot(torso, at.base_position[0], at.base_quaternion_wxyz[0], at.foot_position[0])
        x_y = np.concatenate([at.base_position[:, :2], at.foot_position[..., :2].reshape(-1, 2)])
        drawn = None
        if at.warped_box is not None and at.warped_foot_position is not None:
            lower, upper = np.array(at.warped_box)
            base = at.base_position if at.warped_base is None else at.warped_base[:, :3]
            around = np.concatenate([base, at.warped_foot_position.reshape(-1, 3)])
            drawn = warped_space(Warping(at.ambient, lower, upper), around) | {"has_base": at.warped_base is not None}
        return {
            "name": self.name,
            "duration": float(at.t[-1]),
            "rate": (len(at.t) - 1) / float(at.t[-1]),
            "frames": len(at.t),
            "feet": feet(at.foot_names),
            "friction": robot["friction"],
            "weight": -robot["mass"] * robot["gravity"][2],
            "center": at.base_position[[0, -1]].mean(0).tolist(),
            "bodies": bodies,
            "legs": legs,
            "torso": torso,
            "replay": None,
            "ground": _ground(at.terrain, x_y),
            "patches": [],
            "map": drawn,
            "curves": [],
            "moments": [],
        }
