"""`warpgait validate P.plan.npz`: will the robot walk it?

Writes P.report.json, P.report.html and P.replay.npz beside the plan, or into --output. Exit code 0: trackable (pass or marginal); 1: not
trackable; 2: bad input, something needed is missing, or standard output cannot be written. Reports of an earlier run are replaced by the error
when there is no verdict.
"""

from __future__ import annotations

import argparse
import json
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import Parser
from ..console import ERROR, INTERRUPTED, OutputError, complain, emit, run
from ..errors import InputError, error_page, error_report
from ..files import ensure_outputs, stem_of, write_text
from ..settings import MUJOCO_VERSION, Disturbance, Settings, without_opengl
from ..text import visible

if TYPE_CHECKING:
    from ..validation import Validation

# MuJoCo and daqp are imported late, so that a missing package gives a message instead of a traceback.

REPORTS = ".report.json", ".report.html"  # endings
TRACKABLE, NOT_TRACKABLE = 0, 1  # exit codes, besides those of `console`
UNFINISHED = "the replay has not finished"


def _numbers(count: int, what: str) -> type[argparse.Action]:
    """An option of `count` comma-separated numbers."""

    class Numbers(argparse.Action):
        def __call__(self, parser, namespace, values, option_string=None):  # type: ignore[no-untyped-def]
            try:
                numbers = tuple(float(v) for v in str(values).split(","))
            except ValueError:
                numbers = ()
            if len(numbers) != count:
                parser.error(f"{option_string} {values}: expected {what}")
            setattr(namespace, self.dest, numbers)

    return Numbers


def _parser() -> Parser:
    """The command line. Defaults are those of `Settings` and `Disturbance`."""
    settings, disturbance = Settings(), Disturbance()
    parser = Parser(prog="warpgait validate", description="Replays a plan on the full robot in MuJoCo and judges it.")
    parser.add_argument("plan", type=Path, help="NAME.plan.npz")
    parser.add_argument("-o", "--output", type=Path, help="folder for the reports (default: the plan's folder)")
    parser.add_argument("--model", help="replay on this robot (a name in robots/, or an .xml file) instead of the plan's robot")
    parser.add_argument("--rate", type=float, default=settings.rate, metavar="HZ", help="control rate (default %(default)g)")
    parser.add_argument(
        "--repeat", type=int, default=1, metavar="N", help="replay a cyclic plan N times in a row (default %(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="skip the replays with finer time steps and in other worlds")
    parser.add_argument("--no-robust", action="store_true", help="skip the replays in worlds that differ from the plan's")
    parser.add_argument("--no-raw", action="store_true", help="skip the replay on the raw heightfield")
    parser.add_argument("--no-pictures", action="store_true", help="no pictures in the report")
    parser.add_argument("--video", action="store_true", help="write NAME.mp4 as well")
    parser.add_argument("--still", action="store_true", help="write NAME.png as well: the whole walk in one picture")
    parser.add_argument("--json", action="store_true", help="print the report as JSON and nothing else")
    parser.add_argument("--no-files", action="store_true", help="write no files, only print the verdict")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress on standard error")
    world = parser.add_argument_group("a world that differs from the plan's; the controller does not know it")
    world.add_argument("--friction", type=float, help="friction coefficient of the ground (default: the plan's)")
    world.add_argument(
        "--mass-factor",
        type=float,
        default=disturbance.mass_factor,
        metavar="FACTOR",
        help="multiplies the mass of the base body (default %(default)g)",
    )
    world.add_argument(
        "--body-factor",
        type=float,
        default=disturbance.body_factor,
        metavar="FACTOR",
        help="multiplies every mass and inertia of the robot (default %(default)g)",
    )
    world.add_argument(
        "--com-shift",
        action=_numbers(3, "DX,DY,DZ in m"),
        default=disturbance.com_shift,
        metavar="DX,DY,DZ",
        help="move the robot's center of mass, m, frame of the base",
    )
    world.add_argument(
        "--payload",
        action=_numbers(4, "KG,X,Y,Z in kg and m"),
        metavar="KG,X,Y,Z",
        help="a load on the base, and where: m from its origin, frame of the base",
    )
    world.add_argument(
        "--drives",
        action=_numbers(2, "INERTIA,FRICTION in kg m² and N m"),
        default=disturbance.drives,
        metavar="INERTIA,FRICTION",
        help="rotor inertia (kg m²) and friction (N m) that every joint has in addition",
    )
    world.add_argument(
        "--push",
        action=_numbers(5, "START,DURATION,FX,FY,FZ in s and N"),
        metavar="T,DT,FX,FY,FZ",
        help="push the base from time T s for DT s with a force in N",
    )
    world.add_argument(
        "--terrain-shift",
        action=_numbers(3, "DX,DY,DZ in m"),
        default=disturbance.terrain_shift,
        metavar="DX,DY,DZ",
        help="move the ground, m",
    )
    world.add_argument(
        "--terrain-tilt",
        action=_numbers(2, "ABOUT_X,ABOUT_Y in degrees"),
        default=disturbance.terrain_tilt,
        metavar="AX,AY",
        help="tilt the ground about the middle of the first footholds, degrees",
    )
    world.add_argument(
        "--noise",
        type=float,
        default=disturbance.noise,
        metavar="LEVEL",
        help="sensor noise; level 1 has standard deviations of 1 mm, 0.1°, 2 cm/s and 1°/s (default %(default)g)",
    )
    world.add_argument(
        "--delay",
        type=float,
        default=disturbance.delay,
        metavar="S",
        help="time between measurement and control, beside one control step (default %(default)g)",
    )
    world.add_argument("--seed", type=int, default=disturbance.seed, help="seed of the noise (default %(default)s)")
    return parser


def _settings(options: argparse.Namespace) -> Settings:
    """The settings that the options ask for; raises `InputError` for a value that is out of range."""
    disturbance = Disturbance(
        friction=options.friction,
        mass_factor=options.mass_factor,
        body_factor=options.body_factor,
        com_shift=options.com_shift,
        payload=options.payload,
        drives=options.drives,
        terrain_shift=options.terrain_shift,
        terrain_tilt=options.terrain_tilt,
        push=options.push,
        noise=options.noise,
        delay=options.delay,
        seed=options.seed,
    )
    return Settings(
        options.model,
        options.rate,
        quick=options.quick,
        robust=not options.no_robust,
        raw=not options.no_raw,
        disturbance=disturbance,
    )


def _run(options: argparse.Namespace, settings: Settings, folder: Path) -> int:
    """Read the plan, replay it, write the files, and print the verdict; returns the exit code."""
    try:
        with without_opengl():
            from .. import cycles, plan, validation
    except ImportError as error:
        packages = f"mujoco=={MUJOCO_VERSION} daqp numpy scipy"
        raise InputError(f"a Python package is missing: {error}. Run: pip install {packages}") from error

    def say(text: str) -> None:
        if not (options.quiet or options.json):
            print(f"validate: {visible(text)}", file=sys.stderr)

    loaded = cycles.repeated(plan.read_plan(options.plan), options.repeat)
    if not options.no_files:
        ensure_outputs(_outputs(options, folder), _inputs(options))
        _replace_reports(options, folder, UNFINISHED)
    found = validation.validate(loaded, settings, say)
    if not options.no_files:
        _write(options, folder, found, say)
    _print(options, folder, found)
    return TRACKABLE if found.trackable else NOT_TRACKABLE


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """With this folder for the reports. If nothing is written into a new one, it goes away again."""
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot make this folder for the reports ({error.strerror}); name another with --output"
        ) from error
    try:
        yield
    except BaseException:
        with suppress(OSError):
            for path in new:
                path.rmdir()
        raise


def _outputs(options: argparse.Namespace, folder: Path) -> list[Path]:
    """The files that a run writes."""
    pictures = [".png"] * options.still + [".mp4"] * options.video
    return [folder / f"{stem_of(options.plan)}{end}" for end in (*REPORTS, ".replay.npz", *pictures)]


def _inputs(options: argparse.Namespace) -> list[Path]:
    """The files that a run reads."""
    model = [Path(options.model)] if options.model and options.model.endswith(".xml") else []
    return [options.plan, *model]


def _print(options: argparse.Namespace, folder: Path, found: Validation) -> None:
    """The verdict on standard output, as JSON or for people."""
    from .. import report

    if options.json:
        emit(json.dumps(report.as_dict(found), allow_nan=False))
        return
    lines = _summary(found)
    if not options.no_files:
        lines.append(visible(folder / f"{stem_of(options.plan)}.report.html"))
    emit("\n".join(lines))


def _write(options: argparse.Namespace, folder: Path, found: Validation, say: Callable[[str], None]) -> None:
    """The report, the replay, and pictures and film as asked for."""
    from .. import film, page, report

    stem = stem_of(options.plan)
    pictures: list[tuple[float, bytes]] = []
    note = None
    try:
        if not options.no_pictures:
            say("pictures")
            pictures = film.pictures(found)
        if options.still:
            say("still")
            film.still(found, folder / f"{stem}.png")
        if options.video:
            say("film")
            film.video(found, folder / f"{stem}.mp4")
    except film.FilmError as error:
        note = str(error)
        print(f"validate: {visible(note)}", file=sys.stderr)
    report.write_json(found, folder / f"{stem}.report.json")
    page.write_html(found, folder / f"{stem}.report.html", pictures, note)
    report.write_replay(found, folder / f"{stem}.replay.npz")


def _summary(found: Validation) -> list[str]:
    """The verdict and its reason, then a line for each fact."""
    lines = [f"{found.plan.path.name}: {found.verdict.word} ({found.model_path.stem}, {found.seconds:.1f} s)"]
    first = found.first_failure
    if first:
        lines.append(f"  {found.verdict.word}{' at' if first.time is not None else ':'} {first}")
    lines += [f"  note: {note}" for note in found.notes]
    lines += [f"  {metric}" for metric in found.all_metrics if metric.verdict.value]
    return [visible(line) for line in lines]


def main(words: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(words)
    folder = options.output or options.plan.parent
    try:
        settings = _settings(options)
    except InputError as error:
        _print_error(options, str(error))
        return ERROR
    try:
        with nullcontext() if options.no_files else _made(folder):
            return _run(options, settings, folder)
    except OutputError as error:  # the files are written
        complain(error)
        return ERROR
    except (InputError, OSError) as error:
        message, code = str(error), ERROR
    except KeyboardInterrupt:
        print("validate: interrupted", file=sys.stderr)
        message, code = "the replay was interrupted", INTERRUPTED
    except Exception:  # Python's own exit code, 1, would mean "not trackable"
        traceback.print_exc()
        message, code = "the replay itself failed; please report this with the plan", ERROR
    if not options.no_files and folder.is_dir():
        _replace_reports(options, folder, message)
    if code == ERROR:
        _print_error(options, message)
    return code


def _print_error(options: argparse.Namespace, message: str) -> None:
    complain(message)
    if options.json:
        emit(json.dumps(error_report(options.plan.name, message)))


def _replace_reports(options: argparse.Namespace, folder: Path, message: str) -> None:
    """Reports that say why there is no verdict, in place of those of an earlier run, as far as they can be written at all."""
    name = options.plan.name
    texts = json.dumps(error_report(name, message), indent=2, ensure_ascii=False) + "\n", error_page(name, message)
    for end, text in zip(REPORTS, texts, strict=True):
        report = folder / f"{stem_of(options.plan)}{end}"
        if report.exists():
            with suppress(InputError, OSError):
                ensure_outputs([report], _inputs(options))
                write_text(report, text)


if __name__ == "__main__":
    raise SystemExit(run(main))
