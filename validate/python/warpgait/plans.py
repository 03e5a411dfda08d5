"""Plans in Python: exact at any time, with samples, joint angles and torques, the check, the replay, exports and pages."""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._native import BaseMotion, FeetMotion, Iterate
from .errors import InputError
from .files import ensure_outputs
from .scenario import Scenario
from .surface import Terrain
from .text import escape

if TYPE_CHECKING:
    from .criteria import Metric
    from .motions import Motion
    from .plan import Plan as Samples
    from .settings import Settings
    from .sweeps.run import SweepResult
    from .validation import Validation

Progress = Callable[[int, float, float], object]
Watch = Callable[[Iterate], object]


class Plan:
    """A plan as optimized: splines, evaluated exactly at any time, and what can be done with it. E feet. SI units, world frame."""

    def __init__(self, trajectory: _native.Trajectory, path: Path | None = None) -> None:
        """Made by `solve` and `load`."""
        self._trajectory, self._path = trajectory, path
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    @property
    def duration(self) -> float:
        """The horizon, s."""
        return self._trajectory.duration

    @property
    def t(self) -> npt.NDArray[np.float64]:
        """(N,) times of the plan's own samples, s."""
        return self._trajectory.t

    @property
    def foot_names(self) -> tuple[str, ...]:
        """The E feet in order."""
        return self._trajectory.foot_names

    @property
    def terrain(self) -> Terrain:
        """The ground that the plan was made for."""
        values = tomllib.loads(str(self.meta.get("scenario", ""))).get("terrain", {})
        return Terrain(values, _known=self._trajectory.terrain)

    @property
    def solved(self) -> bool:
        """Every constraint of the nonlinear program holds."""
        return self._trajectory.solved

    @property
    def passed(self) -> bool:
        """Every check that was made after the solve holds; `check` makes them again."""
        return self._trajectory.passed

    @property
    def meta(self) -> dict[str, Any]:
        """The plan's member `meta`: scenario, robot, limits, solver, checks, inputs."""
        return self._trajectory.meta

    @property
    def robot(self) -> str:
        """The name of the robot."""
        return str(self.meta["robot"]["name"])

    def base(self, t: npt.ArrayLike) -> BaseMotion:
        """The base at times t in s, of any shape (…); a time outside 0…`duration` is refused."""
        return self._trajectory.base(t)

    def feet(self, t: npt.ArrayLike) -> FeetMotion:
        """The feet and their forces at times t in s, of any shape (…)."""
        return self._trajectory.feet(t)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the plan file, `NAME.plan.npz`."""
        self._trajectory.save(path)
        self._path = Path(path)

    @property
    def path(self) -> Path:
        """The plan's file; of a plan that was not saved, a temporary one that is removed with this object."""
        if self._path is not None:
            return self._path
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="warpgait-")
            self._trajectory.save(Path(self._folder.name) / "plan.plan.npz")
        return Path(self._folder.name) / "plan.plan.npz"

    @property
    def samples(self) -> Samples:
        """The arrays of the file, (N, …); `warpgait.plan.Plan` has their shapes and units."""
        from .plan import read_plan

        return read_plan(self.path)

    def motion(self, rate: float | None = None, source: str = "plan") -> Motion:
        """Joint angles, speeds and torques, and the poses of all links, at `rate` Hz; `warpgait.motions.Motion` has the shapes.

        By default at the rate of the samples. `source` = "replay" is what `validate` wrote beside the plan, at the rate of its controller.
        """
        from .motions import motion_of_plan, motion_of_replay

        if source not in ("plan", "replay"):
            raise InputError(f'source "{source}": expected plan or replay')
        return (motion_of_plan if source == "plan" else motion_of_replay)(self.samples, rate)

    def to(self, form: str, path: str | Path, rate: float | None = None, source: str = "plan") -> list[Path]:
        """Write the motion in a format of `warpgait export`; returns the files. `to_csv` and so on are short for it."""
        from .commands.export import chosen, export

        return export(self.path, chosen(form), Path(path), source, rate)[0]

    def __getattr__(self, name: str) -> Any:
        """`to_FORMAT(path, rate=None, source="plan")` for every format."""
        if name.startswith("to_"):
            from .commands.export import formats

            form = name.removeprefix("to_")
            if form in formats():
                return lambda path, rate=None, source="plan": self.to(form, path, rate, source)
        raise AttributeError(f"{type(self).__name__} has no attribute {name}")

    def check(self) -> Check:
        """Every law again, from the file."""
        return check(self)

    def validate(
        self, settings: Settings | None = None, folder: str | Path | None = None, progress: Callable[[str], None] | None = None
    ) -> Report:
        """Replay the plan on the full robot in MuJoCo, and judge it, as `warpgait validate` does.

        `settings` are a `warpgait.settings.Settings`: model, rate, a world that differs. With `folder`, the report and the replay are written
        there, called after the plan. `progress` is told what is being done.
        """
        from . import report, validation
        from .files import stem_of

        found = validation.validate(self.samples, settings, progress or (lambda _: None))
        if folder is not None:
            stem = Path(folder) / stem_of(self.path)
            targets = [stem.with_name(f"{stem.name}{end}") for end in (".report.json", ".replay.npz")]
            ensure_outputs(targets, [self.path])
            report.write_json(found, targets[0])
            report.write_replay(found, targets[1])
        return Report(found)

    def view(self, path: str | Path | None = None) -> Page:
        """The page of `warpgait view`; a notebook shows it. With `path`, it is written there as well."""
        from .commands.view import page_text, write_page

        if path is not None:
            write_page(self.path, Path(path))
        return Page(page_text(self.path))

    def __repr__(self) -> str:
        """Robot, duration, and whether it is good."""
        state = "solved" if self.solved else "not solved"
        checks = "every check holds" if self.passed else "checks fail"
        return f"<warpgait.Plan: {self.robot}, {self.duration:g} s, {self.meta.get('formulation')}, {state}, {checks}>"

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        failed = [row["name"] for row in self.meta.get("checks", []) if not row["passed"]]
        start, goal = self.base([0.0, self.duration]).position
        rows = [
            ("robot", self.robot),
            ("duration", f"{self.duration:g} s"),
            ("way", f"from ({start[0]:.2f}, {start[1]:.2f}) to ({goal[0]:.2f}, {goal[1]:.2f}) m"),
            ("formulation", self.meta.get("formulation")),
            ("solver", f"{self.meta['solver'].get('status')}, {self.meta['solver'].get('iterations')} iterations"),
            ("checks", "every check holds" if self.passed else f"fail: {', '.join(failed)}"),
        ]
        return _html_table("Plan", rows)


@dataclass(frozen=True)
class Check:
    """What `check` found: every law, with its value and limit."""

    laws: tuple[Metric, ...]
    remarks: tuple[str, ...]  # where the plan states something else than its scenario asks for

    @property
    def passed(self) -> bool:
        """Whether every law holds."""
        return not self.broken

    @property
    def broken(self) -> list[str]:
        """Names of the laws that do not hold."""
        return [law.name for law in self.laws if law.verdict.value]

    def __getitem__(self, name: str) -> Metric:
        """A law by its name."""
        for law in self.laws:
            if law.name == name:
                return law
        raise KeyError(name)

    def __repr__(self) -> str:
        """How many laws hold, and which do not."""
        return f"<warpgait.Check: {len(self.laws)} laws, {'all hold' if self.passed else 'broken: ' + ', '.join(self.broken)}>"

    def _repr_html_(self) -> str:
        """A table for notebooks, what is broken first."""
        return _metrics_table(repr(self)[1:-1], sorted(self.laws, key=lambda law: -law.verdict.value))


@dataclass(frozen=True)
class Report:
    """What a replay found."""

    validation: Validation

    @property
    def verdict(self) -> str:
        """pass, marginal or fail."""
        return self.validation.verdict.word

    @property
    def trackable(self) -> bool:
        """Whether the robot walks the plan: pass or marginal."""
        return self.validation.trackable

    @property
    def first_failure(self) -> str | None:
        """What decided a verdict other than pass."""
        first = self.validation.first_failure
        return None if first is None else str(first)

    @property
    def metrics(self) -> list[Metric]:
        """Laws, open loop, and all replays, in the order of the report."""
        return self.validation.all_metrics

    def to_dict(self) -> dict[str, Any]:
        """The report as `NAME.report.json` has it."""
        from .report import as_dict

        return as_dict(self.validation)

    def __repr__(self) -> str:
        """The verdict and its reason."""
        return f"<warpgait.Report: {self.verdict}{f', {self.first_failure}' if self.first_failure else ''}>"

    def _repr_html_(self) -> str:
        """A table for notebooks, the worst first."""
        return _metrics_table(f"Replay: {self.verdict}", sorted(self.metrics, key=lambda m: -m.verdict.value))


@dataclass(frozen=True)
class Page:
    """A page of HTML that a notebook shows in a frame."""

    text: str

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{_quoted(self.text)}" width="100%" height="720" style="border:0"></iframe>'


def _quoted(page: str) -> str:
    """A page as the value of an attribute."""
    return page.replace("&", "&amp;").replace('"', "&quot;")


def _html_table(title: str, rows: list[tuple[str, object]]) -> str:
    body = "".join(
        f"<tr><th style='text-align:left'>{escape(key)}</th><td style='text-align:left'>{escape(value)}</td></tr>"
        for key, value in rows
    )
    return f"<table><caption>{escape(title)}</caption>{body}</table>"


def _metrics_table(title: str, metrics: list[Metric]) -> str:
    colors = {"pass": "#1a7f4b", "marginal": "#a66a00", "fail": "#c0262d"}
    body = "".join(
        f"<tr><td style='text-align:left'>{escape(m.layer)}: {escape(m.name)}</td><td>{m.value:.3g}</td><td>{m.criterion.sign} {m.criterion.passes:g}</td>"
        f"<td style='text-align:left'>{escape(m.criterion.unit)}</td><td style='color:{colors[m.verdict.word]}'>{m.verdict.word}</td></tr>"
        for m in metrics
    )
    return f"<table><caption>{escape(title)}</caption>{body}</table>"


def load(path: str | PathLike[str]) -> Plan:
    """Read a plan file. A damaged file, or one without splines, is refused with file, member and reason."""
    return Plan(_native.load(path), Path(path))


def solve(
    scenario: Scenario | str | PathLike[str],
    *,
    overrides: dict[str, Any] | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
    guess: Plan | str | PathLike[str] | None = None,
) -> Plan:
    """Plan the motion of a scenario and check it, as `warpgait solve` does.

    `scenario` is a `Scenario`, a file, or the text of one: a `str` with a line break (its relative paths are relative to the working folder).
    `overrides` sets values by dotted key, `{"gait.kind": "trot"}`. `progress(iteration, violation, objective)` is called at every
    iteration of the nonlinear program, and `watch(iterate)` at most ten times a second with an `Iterate`, the motion so far. An exception that
    they raise ends the solve and is raised here, and so is Ctrl-C; after `StopIteration`, the motion so far is returned, with its check.
    Other threads run meanwhile. One solve runs at a time in a process. A
    solve that does not converge is not an error: see `solved` and `passed`. `guess` is a plan, or the file of a motion, to start from, as
    `guess.file` names it.
    """
    if guess is not None:
        file = guess.path if isinstance(guess, Plan) else Path(guess)
        overrides = {**(overrides or {}), "guess.file": str(file.resolve())}
    if isinstance(scenario, Scenario):
        return (scenario.set(overrides) if overrides else scenario).solve(progress, watch)
    return Plan(_native.solve(scenario, overrides=overrides, progress=progress, watch=watch))


def validate(
    plan: Plan | str | PathLike[str],
    settings: Settings | None = None,
    *,
    folder: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Report:
    """Replay a plan, or a plan file, on the full robot in MuJoCo, and judge it, as `warpgait validate` does; see `Plan.validate`."""
    return (plan if isinstance(plan, Plan) else load(plan)).validate(settings, folder, progress)


def sweep(
    scenario: Scenario | str | PathLike[str],
    values: Mapping[str, Any] | None = None,
    *,
    folder: str | Path | None = None,
    workers: int | None = None,
    scheduler: Any = None,
    again: bool = False,
    progress: Callable[[int, int, dict[str, Any]], object] | None = None,
    **keys: Any,
) -> SweepResult:
    """Plan many scenarios that differ in some values, each in a process of its own, as `warpgait sweep` does.

    `scenario` with `values` by dotted key: lists to choose from, or `{"from": 0.0, "to": 1.0, "count": 5}`; `keys` are the other keys of a
    sweep's file, such as `kind="random", count=100, seed=0, time_limit=60.0`. Without `values`, `scenario` is the file of a sweep.
    Results are written to `folder` (for files, `NAME.sweep` beside them); what has a result there is not planned again, but with `again`
    what timed out or was killed. `scheduler` is a Dask scheduler's address, or a `distributed.Client`. `progress` is told how many cases have
    a result, of how many, and the last result.
    """
    from .sweeps import spec
    from .sweeps.run import run

    file = None if isinstance(scenario, Scenario) else Path(scenario)
    if values is None:
        if file is None:
            raise InputError("values: are missing; a scenario is swept over values of its keys")
        made = spec.read(file)
    else:
        made = spec.of(
            lambda: scenario if isinstance(scenario, Scenario) else Scenario.read(Path(scenario)), {"values": values, **keys}
        )
    if folder is None:
        if file is None:
            raise InputError("folder: is missing; where are the results to be written?")
        folder = file.with_name(f"{file.stem}.sweep")
    told = None if progress is None else lambda finished, count, _, result: progress(finished, count, result)
    found = run(made, Path(folder), workers=workers, scheduler=scheduler, again=again, progress=told)
    if found.interrupted:
        raise KeyboardInterrupt
    return found


def check(plan: Plan | str | PathLike[str]) -> Check:
    """Recompute every law of a plan, or of a plan file, as `warpgait check` does."""
    from . import laws

    found = laws.check(plan.path if isinstance(plan, Plan) else Path(plan))
    return Check(found.metrics, found.remarks)
