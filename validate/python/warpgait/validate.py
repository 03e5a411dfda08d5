"""`python -m warpgait.validate P.plan.npz`: will the robot walk it?

Writes P.report.json, P.report.html and P.replay.npz beside the plan, or into --output. Exit code 0: trackable (pass or marginal); 1: not
trackable; 2: bad input, or something needed is missing.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import InputError, error_report
from .files import write_text
from .settings import MUJOCO_VERSION, Disturbance, Settings

if TYPE_CHECKING:
    from .validation import Validation

# MuJoCo and daqp are imported late, so that a missing package gives a message instead of a traceback.

TRACKABLE, NOT_TRACKABLE, ERROR, INTERRUPTED = 0, 1, 2, 130  # exit codes


def _stem(plan: Path) -> str:
    return plan.name.removesuffix(".npz").removesuffix(".plan")


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


def _parser() -> argparse.ArgumentParser:
    """The command line. Defaults are those of `Settings` and `Disturbance`."""
    settings, disturbance = Settings(), Disturbance()
    parser = argparse.ArgumentParser(
        prog="warpgait validate", description="Replays a plan on the full robot in MuJoCo and judges it."
    )
    parser.add_argument("plan", type=Path, help="NAME.plan.npz")
    parser.add_argument("-o", "--output", type=Path, help="folder for the reports (default: the plan's folder)")
    parser.add_argument("--model", help="replay on this robot (a name in robots/, or an .xml file) instead of the plan's robot")
    parser.add_argument("--rate", type=float, default=settings.rate, metavar="HZ", help="control rate (default %(default)g)")
    parser.add_argument("--no-second-opinion", action="store_true", help="skip the replay with joint PD control")
    parser.add_argument("--no-raw", action="store_true", help="skip the replay on the raw heightfield")
    parser.add_argument("--no-pictures", action="store_true", help="no pictures in the report")
    parser.add_argument("--video", action="store_true", help="write NAME.mp4 as well")
    parser.add_argument("--still", action="store_true", help="write NAME.png as well: the whole walk in one picture")
    parser.add_argument("--json", action="store_true", help="print the report as JSON and nothing else")
    parser.add_argument("--no-files", action="store_true", help="write no files, only print the verdict")
    parser.add_argument("--quiet", action="store_true", help="no progress on standard error")
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
        help="time between measurement and control (default %(default)g)",
    )
    world.add_argument("--seed", type=int, default=disturbance.seed, help="seed of the noise (default %(default)s)")
    return parser


def _settings(options: argparse.Namespace) -> Settings:
    """The settings that the options ask for; raises `InputError` for a value that is out of range."""
    disturbance = Disturbance(
        friction=options.friction,
        mass_factor=options.mass_factor,
        terrain_shift=options.terrain_shift,
        push=options.push,
        noise=options.noise,
        delay=options.delay,
        seed=options.seed,
    )
    return Settings(options.model, options.rate, not options.no_second_opinion, not options.no_raw, disturbance)


@contextmanager
def _without_opengl() -> Iterator[None]:
    """On import, MuJoCo loads the OpenGL that $MUJOCO_GL names, and fails if there is none. Only the rendering process needs it."""
    requested = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        yield
    finally:
        os.environ.pop("MUJOCO_GL")
        if requested is not None:
            os.environ["MUJOCO_GL"] = requested


def _run(options: argparse.Namespace, settings: Settings, folder: Path) -> int:
    """Read the plan, replay it, write the files, and print the verdict; returns the exit code."""
    try:
        with _without_opengl():
            from . import plan, validation
    except ImportError as error:
        packages = f"mujoco=={MUJOCO_VERSION} daqp numpy scipy"
        raise InputError(f"a Python package is missing: {error}. Run: pip install {packages}") from error

    def say(text: str) -> None:
        if not (options.quiet or options.json):
            print(f"validate: {text}", file=sys.stderr)

    loaded = plan.read_plan(options.plan)
    if not options.no_files:
        _make_folder(folder)
    found = validation.validate(loaded, settings, say)
    if not options.no_files:
        _write(options, folder, found, say)
    _print(options, folder, found)
    return TRACKABLE if found.trackable else NOT_TRACKABLE


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot make this folder for the reports ({error.strerror}); name another with --output"
        ) from error


def _print(options: argparse.Namespace, folder: Path, found: Validation) -> None:
    """The verdict on standard output, as JSON or for people."""
    from . import report

    try:
        if options.json:
            print(json.dumps(report.as_dict(found), allow_nan=False))
        else:
            _print_summary(found)
            if not options.no_files:
                print(f"{folder / _stem(options.plan)}.report.html")
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _write(options: argparse.Namespace, folder: Path, found: Validation, say: Callable[[str], None]) -> None:
    """The report, the replay, and pictures and film as asked for."""
    from . import film, page, report

    stem = _stem(options.plan)
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
        print(f"validate: {note}", file=sys.stderr)
    report.write_json(found, folder / f"{stem}.report.json")
    page.write_html(found, folder / f"{stem}.report.html", pictures, note)
    report.write_replay(found, folder / f"{stem}.replay.npz")


def _print_summary(found: Validation) -> None:
    print(f"{found.plan.path.name}: {found.verdict.word} ({found.model_path.stem}, {found.seconds:.1f} s)")
    for note in found.notes:
        print(f"  note: {note}")
    for metric in found.counted_metrics:
        if metric.verdict.value:
            print(f"  {metric}")
    first = found.first_failure
    if first:
        print(f"  first failure at {first}")
    for trial in found.trials:
        if not trial.counts:
            print(f"  {trial.name}: {trial.verdict.word}")


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
        return _run(options, settings, folder)
    except (InputError, OSError) as error:
        _print_error(options, str(error))
        if not options.no_files and options.plan.is_file() and folder.is_dir():
            _write_error(options, folder, str(error))
        return ERROR
    except KeyboardInterrupt:
        print("validate: interrupted", file=sys.stderr)
        return INTERRUPTED
    except Exception:  # Python's own exit code, 1, would mean "not trackable"
        traceback.print_exc()
        _print_error(options, "the replay itself failed; please report this with the plan")
        return ERROR


def _print_error(options: argparse.Namespace, message: str) -> None:
    print(f"error: {message}", file=sys.stderr)
    if options.json:
        print(json.dumps(error_report(options.plan.name, message)))


def _write_error(options: argparse.Namespace, folder: Path, message: str) -> None:
    """A report that says why there is no verdict, if it can be written at all."""
    text = json.dumps(error_report(options.plan.name, message), indent=2, ensure_ascii=False) + "\n"
    with suppress(OSError):
        write_text(folder / f"{_stem(options.plan)}.report.json", text)


if __name__ == "__main__":
    raise SystemExit(main())
