"""What a format is to the command, and what exporters share."""

from __future__ import annotations

import importlib
import io
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..files import write_bytes
from .motion import Motion

Members = Mapping[str, npt.ArrayLike]


@dataclass(frozen=True)
class Format:
    """One target of `warpgait export`."""

    name: str
    purpose: str  # in a few words
    ending: str  # of the file or folder
    write: Callable[[Motion, Path], None]
    conventions: Mapping[str, str]  # orders and frames that differ from `motion.FRAMES`, or add to it
    rate: float | None = None  # Hz, if no other is asked for; none: the source's own
    joints: bool = True  # needs joint angles
    ground: bool = False  # the ground is inside; else it lies beside, as NAME.ground.npz
    extra: str = "export"  # of the package warpgait, with which the modules that it needs come
    files: tuple[str, ...] = field(default=())  # in the folder that the format is; none: it is one file

    def outputs(self, target: Path) -> list[Path]:
        """The files that are written."""
        return [target / name for name in self.files] or [target]

    def facts(self, motion: Motion) -> dict[str, Any]:
        """`Motion.facts`, with what is particular to this format."""
        return motion.facts | {"format": {"name": self.name, **self.conventions}}

    def facts_json(self, motion: Motion) -> str:
        """The facts on one line."""
        return json.dumps(self.facts(motion), allow_nan=False)

    def require(self, module: str, package: str | None = None) -> ModuleType:
        """An optional module, or an error that says what to install."""
        try:
            return importlib.import_module(module)
        except ImportError as error:
            name = package or module.split(".")[0]
            raise InputError(
                f'--to {self.name} needs {name}: pip install "warpgait[{self.extra}]", or pip install {name}'
            ) from error


def write_npz(target: Path, members: Members) -> None:
    """A compressed archive of arrays, without pickled objects."""
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **members)
    write_bytes(target, content.getvalue())


def leg_joints(motion: Motion) -> dict[str, list[int]]:
    """For each foot, the joints between the base and it, from the hip down, as places in `joint_names`."""
    model = motion.model
    legs = {}
    for foot in motion.foot_names:
        body = int(model.geom_bodyid[model.geom(foot).id])
        chain: list[int] = []
        while body > 0:
            first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            chain = [*range(first, first + count), *chain] if count else chain
            body = int(model.body_parentid[body])
        legs[foot] = [joint - 1 for joint in chain if joint > 0]
    return legs


def corners(motion: Motion) -> dict[str, str]:
    """The feet of a robot with four legs as FR, FL, RR and RL, by where they are at the start, seen from the base."""
    first = motion.in_base(motion.foot_position[:1])[0]
    names = {}
    for foot, (x, y, _) in zip(motion.foot_names, first - first.mean(0), strict=True):
        names[("F" if x > 0 else "R") + ("L" if y > 0 else "R")] = foot
    if len(motion.foot_names) != 4 or len(names) != 4:
        raise InputError(
            f"this format is for robots with four legs, one at each corner; {motion.robot} has {len(motion.foot_names)}"
        )
    return names
