"""`warpgait export P.plan.npz --to FORMAT`: the motion of a plan, or of its replay, for trainers, robots and viewers.

Exit code 0: written; 2: bad input, something needed is missing, or a file or standard output cannot be written.
"""

from __future__ import annotations

import argparse
import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import Parser
from ..console import answer, emit, run
from ..errors import InputError
from ..files import ensure_outputs, stem_of
from ..settings import without_opengl
from ..text import visible

if TYPE_CHECKING:
    from ..motions import Format, Motion

_GROUND = ".ground.npz"


def _parser() -> Parser:
    parser = Parser(
        prog="warpgait export", description="Writes the motion of a plan in the format of a trainer, a robot or a viewer."
    )
    parser.add_argument("plan", type=Path, nargs="?", help="NAME.plan.npz")
    parser.add_argument("--to", metavar="FORMAT", help="the format; --list shows all")
    parser.add_argument(
        "-o", "--output", type=Path, help="file or folder to write (default: NAME with the format's ending, beside the plan)"
    )
    parser.add_argument(
        "--rate", type=float, metavar="HZ", help="frames per second (default: the format's, or that of the plan or replay)"
    )
    parser.add_argument(
        "--from",
        dest="source",
        choices=("plan", "replay"),
        default="plan",
        help="the planned motion, or the simulated one in NAME.replay.npz (default %(default)s)",
    )
    parser.add_argument("--repeat", type=int, default=1, metavar="N", help="a cyclic plan N times in a row (default %(default)s)")
    parser.add_argument("--list", action="store_true", help="show the formats")
    parser.add_argument("--json", action="store_true", help="print what was written, with the certificate, as JSON")
    parser.add_argument("-q", "--quiet", action="store_true", help="print errors only")
    return parser


def formats() -> dict[str, Format]:
    """The registry; a missing MuJoCo is an `InputError`."""
    try:
        with without_opengl():
            from ..motions import FORMATS
    except ImportError as error:
        raise InputError(f"a Python package is missing: {error}. Run: pip install mujoco numpy scipy") from error
    return FORMATS


def chosen(name: str | None) -> Format:
    """A format by its name; raises `InputError` with those that there are."""
    known = formats()
    if name not in known:
        what = "--to is missing" if name is None else f"--to {name}: there is no such format"
        raise InputError(f"{what}; the formats are {', '.join(known)} (--list says what each is for)")
    return known[name]


def motion_for(plan: Path, target: Format, source: str, rate: float | None, repeat: int = 1) -> Motion:
    """The motion that a format is to have; raises `InputError`, also if the robot has no joints and the format needs them."""
    from ..cycles import repeated
    from ..model import available_models
    from ..motions import motion_of_plan, motion_of_replay
    from ..plan import read_plan

    loaded = repeated(read_plan(plan), repeat)
    if target.joints and loaded.robot.name not in available_models():
        with_joints = ", ".join(name for name, each in formats().items() if not each.joints)
        raise InputError(
            f"{plan}: --to {target.name} needs joint angles; {loaded.robot.name} is planned as one rigid body with feet and has no full model. "
            f"Plan for one of {', '.join(available_models())}, or export to {with_joints}"
        )
    read = motion_of_plan if source == "plan" else motion_of_replay
    return read(loaded, target.rate if rate is None else rate)


def export(
    plan: Path, target: Format, output: Path | None = None, source: str = "plan", rate: float | None = None, repeat: int = 1
) -> tuple[list[Path], Motion]:
    """Write a motion; returns the files, and the motion."""
    from ..ground import write_heightfield

    output = output or plan.parent / f"{stem_of(plan)}{target.ending}"
    motion = motion_for(plan, target, source, rate, repeat)
    ground = output.with_name(f"{stem_of(plan)}{_GROUND}")
    outputs = [*target.outputs(output), *([] if target.ground else [ground])]
    folders = {path.parent for path in target.outputs(output) if target.files}
    new = [folder for folder in folders if not folder.exists()]
    for folder in folders:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot make this folder ({error.strerror}); name another with --output") from error
    ensure_outputs(outputs, [plan])
    try:
        target.write(motion, output)
    except InputError:
        for folder in new:
            with suppress(OSError):
                folder.rmdir()  # it is empty
        raise
    if not target.ground:
        write_heightfield(ground, motion.ground)
    return outputs, motion


def _list() -> str:
    known = formats().values()
    width = max(len(each.name) for each in known)
    return "\n".join(f"{each.name:{width}}  {each.purpose}" for each in known)


def _told(outputs: list[Path], motion: Motion) -> str:
    """What was written, for people."""
    certificate = motion.certificate
    verdict = certificate["replay"]["verdict"] or f"no verdict ({certificate['replay']['note']})"
    laws = "every law of the check holds" if certificate["all_laws_hold"] else "the plan breaks laws of the check"
    joints = f"{len(motion.joint_names)} joints" if motion.joint_names else "no joints"
    lines = [
        f"{motion.name}: {len(motion.t)} frames at {motion.rate:g} Hz from the {motion.source} ({motion.robot}, {joints}); {laws}; replay: {verdict}"
    ]
    return "\n".join(visible(line) for line in [*lines, *map(str, outputs)])


def _main(options: argparse.Namespace) -> int:
    if options.list:
        emit(_list())
        return 0
    if options.plan is None:
        raise InputError("the plan is missing: warpgait export NAME.plan.npz --to FORMAT")
    outputs, motion = export(options.plan, chosen(options.to), options.output, options.source, options.rate, options.repeat)
    if options.json:
        emit(json.dumps({"written": [str(path) for path in outputs], **motion.facts}, allow_nan=False))
    elif not options.quiet:
        emit(_told(outputs, motion))
    return 0


def main(words: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(words)
    return answer("export", options.json, lambda: _main(options))


if __name__ == "__main__":
    raise SystemExit(run(main))
