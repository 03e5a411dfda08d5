"""`warpgait robot import FILE`: from a URDF or MJCF to `NAME.toml` (for the planner) and `NAME.xml` (for the replay).

MuJoCo's compiler reads the file. Feet, joints, stance, mass, torso and reach are found by computation and printed; what the file does not say,
such as the speed limits of an MJCF, is asked for by an option.
"""

from __future__ import annotations

import argparse
import json
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from . import stance as stances
from .arguments import Parser
from .arrays import Array
from .assemble import Imported, assemble, assemble_freest, note_hits
from .console import ERROR, complain, emit, run
from .errors import InputError
from .files import ensure_outputs, write_text
from .model import check_mujoco
from .read_mjcf import read_mjcf, refuse_loops
from .robots import CentroidalRobot, to_toml
from .skeleton import Leg, Link, Reader, Skeleton, find_feet, leg_of
from .text import is_name, visible
from .urdf import Limits, read_urdf

LARGEST_FILE = 64 << 20  # bytes
KEYS = ("stand", "home", "stance", "standing")  # names of keyframes that are a stance, best first
FORWARD = {"x": 0.0, "y": np.pi / 2, "-x": np.pi, "-y": -np.pi / 2}  # rad, from x toward y


def read(path: Path, options: argparse.Namespace) -> Skeleton:
    """The robot in a file, up to its stance."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path}: larger than {LARGEST_FILE >> 20} MiB; no robot's description is")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    try:
        tag = ET.fromstring(content).tag
    except ET.ParseError as error:
        raise InputError(f"{path}:{error.position[0]}: not XML: {error}") from error
    notes: list[str] = []
    mimics: dict[str, str] = {}
    limits: dict[str, Limits] | None = None
    if tag == "robot":
        urdf = read_urdf(path, content, options.without_meshes, options.mend_inertias)
        notes, mimics, limits = urdf.notes, urdf.mimics, urdf.limits
        model = _compile(path, lambda: _floating(urdf.text))
    elif tag == "mujoco":
        model = _compile(path, lambda: read_mjcf(path, options.without_meshes, options.mend_inertias, notes))
        refuse_loops(path, model)
        limits = _limits_of(model)
    else:
        raise InputError(f"{path}: the root element is <{visible(tag)}>; allowed: <robot> (URDF) or <mujoco> (MJCF)")
    reader = Reader(path, model, limits, mimics, notes)
    return _skeleton(reader, options)


def _compile(path: Path, make: Any) -> Any:
    """The compiled model; what MuJoCo objects to is the user's error."""
    try:
        return make().compile()
    except InputError:
        raise
    except (ValueError, RuntimeError) as error:
        raise InputError(f"{path}: MuJoCo cannot read it: {' '.join(str(error).split())}") from error


def _floating(text: str) -> Any:
    """The model of a URDF, whose root link floats."""
    spec = mujoco.MjSpec.from_string(text)
    spec.worldbody.first_body().add_freejoint()
    return spec


def _limits_of(model: Any) -> dict[str, Limits]:
    """Ranges and torques of an MJCF's joints. It has no speed limits."""
    found: dict[str, Limits] = {}
    for j in range(model.njnt):
        limits = Limits()
        if model.jnt_limited[j]:
            limits.range = (float(model.jnt_range[j, 0]), float(model.jnt_range[j, 1]))
        torques = [float(np.abs(model.jnt_actfrcrange[j]).max())] if model.jnt_actfrclimited[j] else []
        for a in np.flatnonzero((model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)) & (model.actuator_trnid[:, 0] == j)):
            gear = abs(float(model.actuator_gear[a, 0]))
            if model.actuator_forcelimited[a]:
                torques.append(gear * float(np.abs(model.actuator_forcerange[a]).max()))
            if model.actuator_ctrllimited[a] and model.actuator_biastype[a] == int(mujoco.mjtBias.mjBIAS_NONE):
                torques.append(gear * float(model.actuator_gainprm[a, 0]) * float(np.abs(model.actuator_ctrlrange[a]).max()))
        limits.torque = min((t for t in torques if t > 0), default=None)
        found[str(model.joint(j).name)] = limits
    return found


def _key(reader: Reader) -> dict[str, float]:
    """Joint angles of the keyframe that is most likely a stance."""
    m = reader.model
    names = [m.key(k).name for k in range(m.nkey)]
    best = next((names.index(name) for name in KEYS if name in names), 0 if names else None)
    if best is None:
        return {}
    hinges = [j for j in range(m.njnt) if m.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_HINGE)]
    return {reader.joint_name(j): float(m.key(best).qpos[m.jnt_qposadr[j]]) for j in hinges}


def _posture(reader: Reader, key: dict[str, float], central: float) -> Array:
    """All positions (nq,): each joint at the keyframe's angle, or in its range: from as near to zero as it goes (0) to the middle (1)."""
    m = reader.model
    q = np.zeros(m.nq)
    q[int(m.jnt_qposadr[reader.free]) + 3] = 1
    for j in range(m.njnt):
        name = reader.joint_name(j)
        limits = reader.limits.get(name, Limits()).range
        angle = 0.0 if limits is None else central * float(np.mean(limits)) + (1 - central) * float(np.clip(0.0, *limits))
        if m.jnt_type[j] in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
            q[int(m.jnt_qposadr[j])] = key.get(name, angle)
    return q


def _freeze(reader: Reader, words: list[str], posture: Array) -> None:
    """Hold the joints of --freeze JOINT=ANGLE still; without an angle, as in `posture` (nq,). JOINT may be a pattern."""
    names = [reader.joint_name(j) for j in range(reader.model.njnt)]
    for word in words:
        pattern, equals, angle = word.partition("=")
        joints = [j for j, name in enumerate(names) if fnmatchcase(name, pattern) and j != reader.free]
        if not joints:
            known = ", ".join(name for j, name in enumerate(names) if j != reader.free)
            raise InputError(f'--freeze: {reader.path} has no joint "{visible(pattern)}"; its joints are {known}')
        for j in joints:
            try:
                held = float(angle) if equals else float(posture[int(reader.model.jnt_qposadr[j])])
            except ValueError as error:
                raise InputError(f"--freeze {visible(word)}: allowed: JOINT or JOINT=ANGLE, rad") from error
            low, high = reader.limits.get(names[j], Limits()).range or (-np.inf, np.inf)
            if not low - 1e-6 <= held <= high + 1e-6:
                raise InputError(f"--freeze {visible(word)}: allowed for {names[j]}: its range, {low:.4g} to {high:.4g} rad")
            reader.freeze(j, held)


def _skeleton(reader: Reader, options: argparse.Namespace) -> Skeleton:
    m, key = reader.model, _key(reader)
    # A keyframe may be no stance, so the feet are looked for without it, too.
    postures = [_posture(reader, angles, central) for angles in (key, {}) for central in (0.0, 0.5, 1.0)]
    names = [reader.joint_name(j) for j in range(m.njnt)]
    _freeze(reader, options.freeze, postures[0])
    wanted = [name for word in options.feet for name in word.split(",") if name]
    leaves = find_feet(reader, wanted, postures)
    of_legs = {j for leaf in leaves for j in reader.joints_above(leaf)}
    held = []
    for j in range(m.njnt):
        if j != reader.free and j not in of_legs and j not in reader.frozen:
            if m.jnt_type[j] not in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
                raise InputError(f'{reader.path}: joint "{names[j]}" is a ball; only hinges and sliding joints can be held still')
            reader.freeze(j, float(postures[0][int(m.jnt_qposadr[j])]))
            held.append(names[j])
    if held:
        reader.notes.append(f"held still, because they belong to no leg: {', '.join(held)}")
    shared = [j for j in of_legs if sum(j in reader.joints_above(leaf) for leaf in leaves) > 1]
    if shared:
        raise InputError(
            f'{reader.path}: joint "{names[shared[0]]}" moves more than one leg; hold it still: --freeze {names[shared[0]]}'
        )
    reader.forward = FORWARD[options.forward]
    reader.pose()
    radius = options.foot_radius
    legs = [leg_of(reader, leaf, set(wanted), radius) for leaf in leaves]
    base = reader.link(reader.base, None)
    _judge_gyration(reader.path, base, legs)
    counts = {len(leg.links) for leg in legs}
    if len(counts) > 1:
        each = ", ".join(f'"{leg.foot_body}" {len(leg.links)}' for leg in legs)
        raise InputError(
            f"{reader.path}: the legs have different numbers of joints ({each}); hold some still: --freeze JOINT=ANGLE"
        )
    for flag, given in (("--speed-limit", options.speed_limit), ("--torque-limit", options.torque_limit)):
        if given is not None and len(given) not in (1, *counts):
            raise InputError(f"{flag}: {len(given)} numbers; allowed: 1, or {max(counts)}, one for each joint of a leg")
    legs = [replace(leg, links=[_limited(reader, link, k, options) for k, link in enumerate(leg.links)]) for leg in legs]
    largest = max(leg.radius for leg in legs)
    if any(leg.radius < 0.99 * largest for leg in legs):
        reader.notes.append(f"the feet differ; all get the largest radius, {largest:.4g} m")
    legs = [replace(leg, radius=largest) for leg in legs]
    return Skeleton(reader.path, base, legs, reader.notes, key)


def _judge_gyration(path: Path, base: Link, legs: list[Leg]) -> None:
    """Refuse a link whose inertia is that of something larger than the robot, such as 1 kg m² for everything."""
    places = [leg.foot for leg in legs] + [link.anchor for leg in legs for link in leg.links]
    places += [corner for shape in base.shapes for corner in shape.corners()]
    extent = float(np.linalg.norm(np.ptp(places, axis=0)))
    for link in [base, *(link for leg in legs for link in leg.links)]:
        moment = float(np.linalg.eigvalsh(link.inertia)[-1])
        gyration = float(np.sqrt(moment / link.mass))
        if gyration > extent:
            raise InputError(
                f'{path}: link "{link.body}": a moment of inertia of {moment:.3g} kg m² with {link.mass:.3g} kg, so that its mass is {gyration:.2g} m from its '
                f"middle, and the whole robot is {extent:.2g} m long; put its inertia right"
            )


def _limited(reader: Reader, link: Link, k: int, options: argparse.Namespace) -> Link:
    """The link with limits from the options where the file has none; refuses one that is left without."""
    limits = replace(link.limits)
    absent, flags = [], []
    for name, flag, unit in (("speed", "--speed-limit", "RAD/S"), ("torque", "--torque-limit", "NM")):
        given = options.speed_limit if name == "speed" else options.torque_limit
        if given:
            setattr(limits, name, given[min(k, len(given) - 1)])
        if not (getattr(limits, name) or 0) > 0:
            absent.append(f"{name} limit")
            flags.append(f"{flag} {unit}, or one for each joint of a leg from the base down: {flag} A,B,…")
    if limits.range is None and options.range is None:
        absent.append("range")
        flags.append("--range LEAST,GREATEST, rad, for all joints without one")
    if absent:
        raise InputError(
            f'{reader.path}: joint "{link.joint}": the file has no {" and no ".join(absent)}; give it: {"; and ".join(flags)}'
        )
    if limits.range is None:
        limits.range = (options.range[0], options.range[1])
    low, high = limits.range
    if high - low > 2 * np.pi:
        limits.range = (-np.pi, np.pi)
    return replace(link, limits=limits)


def build(path: Path, name: str, options: argparse.Namespace) -> Imported:
    """Read a file and derive the robot."""
    skeleton = read(path, options)
    words = options.source or f"from {path.name}"
    if options.stance:
        return note_hits(assemble(skeleton, name, stances.given(skeleton, options.stance), "--stance", words))
    found = stances.of_key(skeleton)
    if found is not None and stances.stands(skeleton.legs, found):
        return note_hits(assemble(skeleton, name, found, "keyframe", words))
    if found is not None:
        skeleton.notes.append(
            "the keyframe is not a stance, because not all of its feet are well below the hips; a stance is computed instead"
        )
    return assemble_freest(skeleton, name, stances.computed(skeleton.legs), words)


def _table(skeleton: Skeleton, robot: CentroidalRobot, source: str) -> list[str]:
    """What was found, for people."""
    lines = [
        f"mass {robot.body.mass:.4g} kg, center of mass {np.round(robot.body.center_of_mass, 4).tolist()} m from the base's origin ({skeleton.base.body})",
        f"torso {np.round(2 * robot.torso.half_size, 3).tolist()} m; stance ({source}) {-robot.nominal[:, 2].mean():.3f} m high; cycle {robot.gait_cycle:g} s",
    ]
    for e, (foot, leg) in enumerate(zip(robot.feet, skeleton.legs, strict=True)):
        box = 2 * robot.reach[e].half_size
        lines.append(
            f"{foot}: link {leg.foot_body}, radius {leg.radius:.4g} m, at {np.round(robot.nominal[e], 3).tolist()} m, reach box {np.round(box, 3).tolist()} m"
        )
        for link, angle in zip(leg.links, robot.legs[e].stance, strict=True):
            low, high = link.limits.range or (0.0, 0.0)
            lines.append(
                f"    {link.joint}: axis {np.round(link.axis, 3).tolist()}, {low:.3g} to {high:.3g} rad, stance {angle:.3g}, "
                f"{link.limits.speed:g} rad/s, {link.limits.torque:g} N m, link {link.mass:.3g} kg"
            )
    return lines + [f"note: {note}" for note in skeleton.notes]


def _numbers(text: str) -> list[float]:
    """Numbers with commas or blanks between them."""
    values = [float(word) for word in text.replace(",", " ").split()]
    if not values or not np.isfinite(values).all():
        raise ValueError(text)
    return values


def _joined(words: list[str]) -> list[str]:
    """The words of a command line, with values that begin with a minus, which would be taken for options, joined to theirs: --range=-3,3."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] in ("--range", "--stance", "--forward") and word[:1] == "-" and word[:2] != "--":
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def arguments(words: list[str] | None) -> argparse.Namespace:
    """The options of the command."""
    parser = Parser(prog="warpgait robot import", description="From a URDF or MJCF to NAME.toml and NAME.xml.")
    parser.add_argument("file", type=Path, help="a .urdf, or an .xml of MuJoCo")
    parser.add_argument(
        "-o", "--output", type=Path, help="DIR/NAME of the two files (default: the name of FILE, in the working folder)"
    )
    parser.add_argument(
        "--feet", action="append", default=[], metavar="LINK,…", help="links that are feet (default: those that reach the ground)"
    )
    parser.add_argument(
        "--foot-radius", type=float, metavar="M", help="radius of the feet, m (default: that of the file's shapes)"
    )
    parser.add_argument(
        "--stance",
        type=_numbers,
        metavar="Q,…",
        help="joint angles of the stance, rad: those of one leg, for all of them, or those of each, in the file's order",
    )
    parser.add_argument(
        "--speed-limit",
        type=_numbers,
        metavar="V",
        help="of the joints, rad/s: one, or one for each joint of a leg from the base down; replaces the file's",
    )
    parser.add_argument(
        "--torque-limit",
        type=_numbers,
        metavar="T",
        help="of the joints, N m: one, or one for each joint of a leg from the base down; replaces the file's",
    )
    parser.add_argument("--range", type=_numbers, metavar="A,B", help="range of joints without limits, rad")
    parser.add_argument(
        "--forward", choices=FORWARD, default="x", help="the direction in the file's base frame that is ahead (default: x)"
    )
    parser.add_argument(
        "--freeze",
        action="append",
        default=[],
        metavar="JOINT=Q",
        help="hold a joint still at an angle, rad (default: that of the keyframe, or as near to zero as it goes); with * for a part of the name, several",
    )
    parser.add_argument("--without-meshes", action="store_true", help="leave out collision shapes whose meshes are not there")
    parser.add_argument(
        "--mend-inertias", action="store_true", help="put the nearest inertia that a body has in the place of impossible ones"
    )
    parser.add_argument("--source", help="where the file is from and its license, for the two files")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    options = parser.parse_args(_joined(sys.argv[1:] if words is None else words))
    if options.range is not None and len(options.range) != 2:
        parser.error(f"--range: {len(options.range)} numbers; allowed: 2")
    if options.foot_radius is not None and not 1e-3 <= options.foot_radius <= 1:
        parser.error(f"--foot-radius {options.foot_radius:g}: allowed: 0.001 to 1 m")
    if options.range and options.range[0] >= options.range[1]:
        parser.error("--range: the least angle comes first")
    return options


def import_robot(options: argparse.Namespace) -> int:
    """Write the two files, and print what was found."""
    output = options.output or Path(options.file.stem)
    name = output.name
    if not is_name(name) or name.endswith((".toml", ".xml")):
        raise InputError(f"{visible(name)!r} is not the name of a robot; -o takes DIR/NAME, without ending")
    targets = [output.with_name(f"{name}.{ending}") for ending in ("xml", "toml")]
    ensure_outputs(targets, [options.file])
    found = build(options.file, name, options)
    robot, notes = found.robot, found.skeleton.notes
    for target, content in zip(targets, (found.model, to_toml(robot)), strict=True):
        write_text(target, content)
    if options.json:
        emit(json.dumps({"files": [str(t) for t in targets], "mass": robot.body.mass, "feet": robot.feet, "notes": notes}))
    elif not options.quiet:
        emit("\n".join([*_table(found.skeleton, robot, found.source), *(f"wrote {target}" for target in targets)]))
    return 0


def main(words: list[str] | None = None) -> int:
    """Run the command; returns 0, or 2 on bad input."""
    options = arguments(words)
    try:
        check_mujoco()
        return import_robot(options)
    except (InputError, OSError) as error:
        complain(error)
        return ERROR


if __name__ == "__main__":
    raise SystemExit(run(main))
