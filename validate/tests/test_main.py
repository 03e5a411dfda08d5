"""`python -m warpgait`: the whole command line, in the process of the Python that has the package."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import WALK

COMMAND = [sys.executable, "-P", "-m", "warpgait"]
BARE = {key: value for key, value in os.environ.items() if key != "WARPGAIT_PYTHON"} | {"PATH": "/nowhere"}


def run(folder: Path, *words: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *words], cwd=folder, env=BARE, capture_output=True, text=True, check=False, timeout=120)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "walk.toml").write_text(WALK)
    return tmp_path


def test_it_plans_checks_and_runs_the_commands_of_this_python(folder: Path) -> None:
    assert run(folder, "--version").stdout.startswith("warpgait ")
    solved = run(folder, "solve", "walk.toml")
    assert solved.returncode == 0 and "Written: walk.plan.npz" in solved.stdout and "solve" in solved.stderr
    assert (folder / "walk.svg").read_text().endswith("</svg>\n")
    assert "checks hold" in run(folder, "check", "walk.plan.npz").stdout
    exported = run(folder, "export", "walk.plan.npz", "--to", "csv")
    assert exported.returncode == 0, exported.stderr
    assert (folder / "walk.csv").is_file()


def test_exit_codes_are_those_of_the_program(folder: Path) -> None:
    for words in (["solve", "none.toml"], ["export", "none.plan.npz", "--to", "csv"], ["nonsense"], ["check", "walk.toml"]):
        done = run(folder, *words)
        assert done.returncode == 2 and "error: " in done.stderr and "Traceback" not in done.stderr, words
    assert run(folder, "solve", "walk.toml", "--set", "solver.max_iterations=1", "--no-plot").returncode == 1
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*COMMAND, "schema"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2 and "standard output" in done.stderr


def test_ctrl_c_ends_a_solve_within_a_second_with_a_plan(folder: Path) -> None:
    words = ["solve", "walk.toml", "--no-plot", "--set", "horizon=15.0", "--set", "solver.tolerance=1e-11"]
    process = subprocess.Popen([*COMMAND, *words], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    for line in process.stderr:
        if "iteration" in line:
            break
    started = time.monotonic()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130 and time.monotonic() - started < 5.0  # 1 s on an idle machine
    assert (folder / "walk.plan.npz").is_file()


@pytest.mark.parametrize("send", [os.kill, os.killpg])
def test_ctrl_c_interrupts_a_command_of_python_once(walk_plan: Path, tmp_path: Path, send: Callable[[int, int], None]) -> None:
    """Whether the terminal sends it to both processes, or a program to the one that it started."""
    words = ["validate", str(walk_plan), "-o", "reports"]
    process = subprocess.Popen([*COMMAND, *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stderr is not None
    for line in process.stderr:
        if "closed loop" in line:
            break
    send(process.pid, signal.SIGINT)
    assert process.stderr.read().splitlines()[-1:] == ["validate: interrupted"]
    assert process.wait() == 130 and not list(tmp_path.iterdir())


def test_it_starts_without_numpy() -> None:
    code = "import sys, warpgait.__main__; print(*sorted(m for m in ('numpy', 'scipy', 'mujoco') if m in sys.modules))"
    assert subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True).stdout.strip() == ""
