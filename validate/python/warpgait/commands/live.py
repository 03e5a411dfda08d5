"""`warpgait view --live S.toml`: plans a scenario, and shows the iterates in the browser as they come; then the page of the plan.

Ctrl-C writes the motion so far, once there is one, as `warpgait solve` does; a second one ends the command.
"""

from __future__ import annotations

import argparse
import sys
import threading
from pathlib import Path

from ..console import INTERRUPTED, emit
from ..errors import InputError
from ..files import ensure_outputs, stem_of, write_text
from ..plans import Plan, Watch
from ..scenario import Scenario
from ..settings import without_opengl
from ..text import visible
from .overrides import assigned

_AFTER = 0.3  # s after the last page was sent, for other windows that show it
_LAST_WORDS = 0.2  # s for a solve that has not begun


class _Solve:
    """A solve in a thread of its own, so that Ctrl-C need not wait for it."""

    def __init__(self, scenario: Scenario, watch: Watch) -> None:
        self._scenario, self._watch = scenario, watch
        self.plan: Plan | None = None
        self.error: BaseException | None = None
        self.stopped, self._begun, self._done = threading.Event(), threading.Event(), threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    def _progress(self, *_: float) -> None:
        self._begun.set()
        if self.stopped.is_set():
            raise StopIteration

    def _run(self) -> None:
        try:
            self.plan = self._scenario.solve(self._progress, self._watch)
        except BaseException as error:
            self.error = error
        self._done.set()

    def result(self) -> Plan:
        """Wait for the plan; Ctrl-C stops the solve, and the plan is then that of the motion so far, if there is one."""
        try:
            self._done.wait()
        except KeyboardInterrupt:
            self.stopped.set()
            if not self._begun.wait(_LAST_WORDS):
                raise
            self._done.wait()
        if self.error is not None:
            raise self.error
        assert self.plan is not None
        return self.plan


def live(options: argparse.Namespace) -> tuple[int, dict[str, object]]:
    """Run the command; returns the exit code and what `--json` prints. Raises `InputError`."""
    try:
        with without_opengl():
            from ..viewer.iterates import Iterates
            from ..viewer.page import page_of
            from ..viewer.server import Server
    except ImportError as error:
        raise InputError(f"a Python package is missing: {error}. Run: pip install mujoco numpy scipy") from error
    from .view import opened

    scenario = Scenario.read(options.plan).set(assigned(options.set))
    output = options.output or Path(f"{options.plan.stem}.plan.npz")
    target = options.html or output.with_name(f"{stem_of(output)}.view.html")
    ensure_outputs([output, target], [options.plan])
    iterates = Iterates(options.plan.stem)
    with Server(options.port) as server:
        shown = not options.no_browser and opened(server.address)
        if not options.quiet:
            words = "shows the solve" if shown else "shows the solve: open it in a browser"
            print(f"view: {server.address} {words}; Ctrl-C ends it", file=sys.stderr)
        solve = _Solve(scenario, lambda at: server.show(*iterates.shown(at)))
        plan = solve.result()
        plan.save(output)
        page = page_of(output)
        write_text(target, page)
        written = {"plan": str(output), "written": str(target), "solved": plan.solved, "passed": plan.passed, "opened": shown}
        if not options.json and not options.quiet:
            emit(visible(output))
            emit(visible(target))
        server.show(lambda: page, {"scene": 0}, last=True)
        if solve.stopped.is_set():
            print("view: interrupted; the motion so far is written", file=sys.stderr)
            return INTERRUPTED, written
        try:
            server.shown.wait()
            threading.Event().wait(_AFTER)
        except KeyboardInterrupt:
            pass  # everything is written
    return (0 if plan.solved and plan.passed else 1), written
