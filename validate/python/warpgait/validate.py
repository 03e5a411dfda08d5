"""`python -m warpgait.validate P.plan.npz`: will the robot walk it?

Writes P.report.json, P.report.html and P.replay.npz beside the plan (or into --output). Exit code 0: trackable (pass or marginal);
1: not trackable; 2: bad input, or something needed is missing.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import InputError

if TYPE_CHECKING:
    from .validation import Validation

# MuJoCo and daqp are imported late, so that a missing one is a message instead of a traceback.


def _stem(plan: Path) -> str:
    return plan.name.removesuffix(".npz").removesuffix(".plan")


def _numbers(count: int, what: str) -> type[argparse.Action]:
    """An option of `count` comma-separated numbers."""

    class Numbers(argparse.Action):
        def __call__(self, parser, namespace, values, option_string=None):  # type: ignore[no-untyped-def]
            try:
                numbers = tuple(float(v) for v in str(values).split(","))
            except ValueError:
                parser.error(f"{option_string} {values}: expected {what}")
            if len(numbers) != count:
                parser.error(f"{option_string} {values}: expected {what}")
            setattr(namespace, self.dest, numbers)

    return Numbers


def arguments() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="warpgait validate", description="Replays a plan on the full robot in MuJoCo and judges it."
    )
    parser.add_argument("plan", type=Path, help="NAME.plan.npz")
    parser.add_argument("-o", "--output", type=Path, help="folder for the reports (default: the plan's)")
    parser.add_argument("--model", help="replay on this robot (a name in robots/, or an .xml file) instead of the plan's")
    parser.add_argument("--rate", type=float, default=250.0, metavar="HZ", help="control rate (default 250)")
    parser.add_argument("--no-second-opinion", action="store_true", help="skip the joint PD replay")
    parser.add_argument("--no-raw", action="store_true", help="skip the replay on the raw heightfield")
    parser.add_argument("--no-pictures", action="store_true", help="no pictures in the report")
    parser.add_argument("--video", action="store_true", help="write NAME.mp4 as well")
    parser.add_argument("--json", action="store_true", help="print the report as JSON and nothing else")
    parser.add_argument("--no-files", action="store_true", help="write nothing, only print the verdict")
    parser.add_argument("--quiet", action="store_true", help="no progress on standard error")
    wrong = parser.add_argument_group("a world that differs from the plan's")
    wrong.add_argument("--friction", type=float, help="of the ground (default: the plan's)")
    wrong.add_argument("--mass-factor", type=float, default=1.0, help="on the base body's mass (default 1)")
    wrong.add_argument(
        "--push", action=_numbers(5, "START,DURATION,FX,FY,FZ in s and N"), metavar="T,DT,FX,FY,FZ", help="push the base"
    )
    wrong.add_argument(
        "--terrain-shift",
        action=_numbers(3, "DX,DY,DZ in m"),
        default=(0.0, 0.0, 0.0),
        metavar="DX,DY,DZ",
        help="move the ground",
    )
    wrong.add_argument("--noise", type=float, default=0.0, help="sensor noise; 1 is 1 mm, 0.1°, 2 cm/s, 1°/s")
    wrong.add_argument("--delay", type=float, default=0.0, metavar="S", help="between measurement and control")
    wrong.add_argument("--seed", type=int, default=0, help="of the noise (default 0)")
    return parser


def _refuse_nonsense(options: argparse.Namespace) -> None:
    for name, value in vars(options).items():
        numbers = value if isinstance(value, tuple) else (value,)
        if any(isinstance(v, float) and not math.isfinite(v) for v in numbers):
            raise InputError(f"--{name.replace('_', '-')}: every number must be finite")
    if options.friction is not None and not 0 < options.friction <= 10:
        raise InputError(f"--friction {options.friction:g}: must be in (0, 10]")
    if not 0.1 <= options.mass_factor <= 10:
        raise InputError(f"--mass-factor {options.mass_factor:g}: must be in [0.1, 10]")
    if not 0 <= options.noise <= 100:
        raise InputError(f"--noise {options.noise:g}: must be in [0, 100]")
    if not 0 <= options.delay <= 0.2:
        raise InputError(f"--delay {options.delay:g}: must be in [0, 0.2] s")
    if options.seed < 0:
        raise InputError(f"--seed {options.seed}: must not be negative")
    if options.push is not None and not options.push[1] > 0:
        raise InputError(f"--push: the duration, {options.push[1]:g} s, must be positive")
    if not 50 <= options.rate <= 500 or 500 % options.rate:
        raise InputError(f"--rate {options.rate:g}: must be 500 Hz divided by a whole number, and at least 50")


@contextmanager
def _without_opengl() -> Iterator[None]:
    """MuJoCo loads the OpenGL that $MUJOCO_GL names as it is imported, and fails where there is none; only the rendering process needs it."""
    wished = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        yield
    finally:
        os.environ.pop("MUJOCO_GL")
        if wished is not None:
            os.environ["MUJOCO_GL"] = wished


def _run(options: argparse.Namespace, folder: Path) -> int:
    try:
        with _without_opengl():
            from . import plan, report, scene, validation
    except ImportError as error:
        raise InputError(f"a Python package is missing: {error}. Run: pip install mujoco==3.17.0 daqp numpy scipy") from error

    def say(text: str) -> None:
        if not (options.quiet or options.json):
            print(f"validate: {text}", file=sys.stderr)

    loaded = plan.load(options.plan)
    if not options.no_files:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: no folder for the reports ({error.strerror}); name another one with --output") from error
    disturbance = scene.Disturbance(
        friction=options.friction,
        mass_factor=options.mass_factor,
        terrain_shift=options.terrain_shift,
        push=options.push,
        noise=options.noise,
        delay=options.delay,
        seed=options.seed,
    )
    settings = validation.Settings(options.model, options.rate, not options.no_second_opinion, not options.no_raw, disturbance)
    found = validation.validate(loaded, settings, say)

    if not options.no_files:
        _write(options, folder, found, say)
    try:
        if options.json:
            print(json.dumps(report.as_dict(found), allow_nan=False))
        else:
            _summary(found)
            if not options.no_files:
                print(f"{folder / _stem(options.plan)}.report.html")
        sys.stdout.flush()
    except BrokenPipeError:  # whoever read our output has enough of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0 if report.trackable(found) else 1


def _write(options: argparse.Namespace, folder: Path, found: Validation, say: Callable[[str], None]) -> None:
    """The report, the replay, and pictures and film as asked for."""
    from . import film, page, report

    stem = _stem(options.plan)
    pictures: list[tuple[float, bytes]] = []
    note = None
    try:
        if not options.no_pictures:
            say("pictures")
            pictures = film.strip(found)
        if options.video:
            say("film")
            film.video(found, folder / f"{stem}.mp4")
    except film.FilmError as error:
        note = str(error)
        print(f"validate: {note}", file=sys.stderr)
    report.write_json(found, folder / f"{stem}.report.json")
    page.write_html(found, folder / f"{stem}.report.html", pictures, note)
    report.write_replay(found, folder / f"{stem}.replay.npz")


def _summary(found: Validation) -> None:
    print(f"{found.plan.path.name}: {found.verdict.word} ({found.model_path.stem}, {found.seconds:.1f} s)")
    for line in found.notes:
        print(f"  note: {line}")
    for metric in [*found.metrics, *(m for t in found.trials if t.counts for m in t.metrics)]:
        if metric.verdict.value:
            sign = "≥" if metric.at_least else "≤"
            print(
                f"  {metric.verdict.word}: {metric.layer}: {metric.name} {metric.value:.3g} {metric.unit} (pass {sign} {metric.passes:g})"
            )
    first = found.first_failure
    if first:
        print(f"  first failure at {first.time:.2f} s{f', {first.foot}' if first.foot else ''}: {first.what}")
    for trial in found.trials:
        if not trial.counts:
            print(f"  {trial.name}: {trial.verdict.word}")


def main(words: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = arguments().parse_args(words)
    folder = options.output or options.plan.parent
    try:
        _refuse_nonsense(options)
    except InputError as error:
        _say_error(options, str(error))
        return 2
    try:
        return _run(options, folder)
    except (InputError, OSError) as error:
        _say_error(options, str(error))
        if not options.no_files and options.plan.is_file() and folder.is_dir():
            _report_error(folder / f"{_stem(options.plan)}.report.json", options.plan.name, str(error))
        return 2
    except KeyboardInterrupt:
        print("validate: interrupted", file=sys.stderr)
        return 130
    except Exception:  # exit code 1 means "not trackable", which an error in this program must not say
        traceback.print_exc()
        _say_error(options, "the replay itself failed; please report it with the plan")
        return 2


def _say_error(options: argparse.Namespace, message: str) -> None:
    print(f"error: {message}", file=sys.stderr)
    if options.json:
        print(json.dumps({"plan": options.plan.name, "verdict": "error", "trackable": False, "error": message}))


def _report_error(target: Path, plan: str, message: str) -> None:
    """A report that says why there is none, if it can be written at all."""
    try:
        from .report import write_error

        write_error(target, plan, message)
    except (ImportError, OSError):
        return


if __name__ == "__main__":
    raise SystemExit(main())
