"""Writes the full model of an imported robot: `NAME.xml`, in the form that `model.py` describes."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

from .arrays import Array
from .skeleton import Leg, Link, Shape, Skeleton

LINKS = ("HIP", "THIGH", "SHANK")  # without the first in legs of two joints; links of legs with more have numbers
SIDES = {1: ("",), 2: ("F", "H"), 3: ("F", "M", "H"), 4: ("1", "2", "3", "4")}  # of the legs of one side, from the front
_ALIGNED = 1e-6
FOOT_SOFTNESS = 0.01  # s, MuJoCo's solref of a foot


def foot_names(feet: list[Array]) -> list[str]:
    """Names by place: LF, RF, LH, RH for four feet, L and R for two, with M in the middle of six."""
    if len(feet) == 1:
        return ["FOOT"]
    names = [""] * len(feet)
    for side, letter in ((1.0, "L"), (-1.0, "R")):
        here = sorted((e for e in range(len(feet)) if (feet[e][1] >= 0) == (side > 0)), key=lambda e: -feet[e][0])
        places = SIDES.get(len(here)) or tuple(str(k + 1) for k in range(len(here)))
        for e, where in zip(here, places, strict=True):
            names[e] = letter + where
    return names


def order(feet: list[Array]) -> list[int]:
    """Of the legs in a file: from front to back, left before right."""
    rank = {name: k for k, name in enumerate(foot_names(feet))}
    by_name = sorted(rank, key=lambda name: ("FM1H234".find(name[-1]), name))
    return [rank[name] for name in by_name]


def _numbers(values: Array) -> str:
    return " ".join(f"{v + 0.0:.7g}" for v in np.round(values, 7) + 0.0)


def _quaternion(R: Array) -> Array:
    from scipy.spatial.transform import Rotation

    quaternion: Array = Rotation.from_matrix(R).as_quat(scalar_first=True)
    return quaternion


def _geom(shape: Shape, origin: Array) -> str:
    place = f'pos="{_numbers(shape.center - origin)}"'
    turn = "" if np.abs(shape.rotation - np.eye(3)).max() < _ALIGNED else f' quat="{_numbers(_quaternion(shape.rotation))}"'
    return f'<geom type="{shape.kind}" {place}{turn} size="{_numbers(shape.size)}"/>'


def _inertial(link: Link) -> str:
    I = link.inertia  # noqa: E741
    full = np.array([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])
    tensor = " ".join(f"{v + 0.0:.8g}" for v in full)
    return f'<inertial mass="{link.mass:.7g}" pos="{_numbers(link.center - link.anchor)}" fullinertia="{tensor}"/>'


def _leg(leg: Leg, foot: str) -> list[str]:
    lines, before, depths = [], np.zeros(3), len(leg.links)
    names = LINKS[-depths:] if depths <= len(LINKS) else [f"LINK{depth + 1}" for depth in range(depths)]
    for depth, (link, part) in enumerate(zip(leg.links, names, strict=True)):
        space = "  " * (depth + 3)
        low, high = link.limits.range or (-np.pi, np.pi)
        lines.append(f'{space}<body name="{foot}_{part}" pos="{_numbers(link.anchor - before)}">')
        lines.append(f'{space}  <joint name={quoteattr(link.joint)} axis="{_numbers(link.axis)}" range="{low:.6g} {high:.6g}"/>')
        lines.append(f"{space}  {_inertial(link)}")
        lines += [f"{space}  {_geom(shape, link.anchor)}" for shape in link.shapes]
        before = link.anchor
    last = "  " * (depths + 3)
    where = _numbers(leg.foot - before)
    lines.append(f'{last}<geom name="{foot}" class="foot" pos="{where}" size="{leg.radius:.6g}"/>')
    lines.append(f'{last}<site name="{foot}" class="foot" pos="{where}"/>')
    lines += ["  " * (depth + 3) + "</body>" for depth in reversed(range(depths))]
    return lines


def write_mjcf(
    skeleton: Skeleton, name: str, feet: list[str], stance: list[Array], height: float, cycle: float, source: str
) -> str:
    """The model's text; the base's origin is `height` m above the ground in the stance (E, J)."""
    base, legs = skeleton.base, skeleton.legs
    joints = [link for leg in legs for link in leg.links]
    size = max(height, 0.05)
    motors = [
        f'    <motor name={quoteattr(link.joint)} joint={quoteattr(link.joint)} ctrlrange="-{t:.6g} {t:.6g}" forcerange="-{t:.6g} {t:.6g}"/>'
        for link in joints
        if (t := link.limits.torque) is not None
    ]
    speeds = " ".join(f"{link.limits.speed:.6g}" for link in joints)
    angles = " ".join(_numbers(q) for q in stance)
    comment = source.replace("--", "- -")
    lines = [
        "<!--",
        f"{name} for MuJoCo, written by `warpgait robot import`. {comment}".rstrip(),
        "Inertias of links that move together are summed. SI units, radians; x forward, y left, z up; every frame is parallel to the base frame at zero",
        "joint angles. Boxes take the place of meshes. The terrain is added by the program that replays: its geom needs conaffinity 1.",
        "-->",
        f"<mujoco model={quoteattr(name)}>",
        '  <compiler angle="radian" inertiafromgeom="false" autolimits="true"/>',
        '  <option timestep="0.002" cone="elliptic" impratio="10" integrator="implicitfast"/>',
        f'  <statistic center="0 0 {0.8 * size:.3g}" extent="{3 * size:.3g}"/>',
        '  <visual><global offwidth="1280" offheight="720"/><map shadowclip="2"/><quality shadowsize="2048"/></visual>',
        "  <default>",
        '    <geom contype="1" conaffinity="0" friction="0.75 0.02 0.01" rgba="0.35 0.42 0.5 1"/>',
        '    <joint damping="0" armature="0" frictionloss="0"/>',
        '    <default class="foot">',
        f'      <geom type="sphere" condim="3" priority="1" solref="{FOOT_SOFTNESS:g} 1" rgba="0.1 0.1 0.1 1"/>',
        '      <site size="0.008" rgba="0 0.8 0.2 1"/>',
        "    </default>",
        "  </default>",
        "  <worldbody>",
        '    <light pos="0 0 4" dir="0.2 0.1 -1" type="directional" diffuse="0.6 0.6 0.6"/>',
        f'    <body name="base" pos="0 0 {height:.6g}">',
        '      <freejoint name="root"/>',
        f"      {_inertial(base)}",
        *(f"      {_geom(shape, base.anchor)}" for shape in base.shapes),
    ]
    for leg, foot in zip(legs, feet, strict=True):
        lines += ["", *_leg(leg, foot)]
    lines += [
        "    </body>",
        "  </worldbody>",
        "",
        "  <actuator>",
        *motors,
        "  </actuator>",
        "",
        "  <custom>",
        "    <!-- rad/s, leg by leg from the base down -->",
        f'    <numeric name="joint_speed_limit" data="{speeds}"/>',
        "    <!-- s, default -->",
        f'    <numeric name="gait_cycle" data="{cycle:g}"/>',
        f'    <text name="source" data={quoteattr(source)}/>',
        "  </custom>",
        "",
        "  <keyframe>",
        f'    <key name="stand" qpos="0 0 {height:.6g} 1 0 0 0  {angles}"/>',
        "  </keyframe>",
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n"
