"""The command next to files of others: nothing there is run or believed, nothing in them acts, and output that cannot be written is an error."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import WALK

import crawl
from warpgait.commands.validate import main
from warpgait.errors import InputError
from warpgait.film import ffmpeg
from warpgait.model import find_model, model_file, robots_directories
from warpgait.plan import read_plan

QUICK = ["--no-pictures", "--quick"]


def _with_meta(source: Path, target: Path, **robot: Any) -> Path:
    def change(a: dict[str, Any]) -> None:
        meta = json.loads(str(a["meta"]))
        meta["robot"].update(robot)
        a["meta"] = np.array(json.dumps(meta))

    return crawl.altered(source, target, change)


def _run(words: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "warpgait.commands.validate", *words]
    return subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False, **options)


def test_a_plan_never_names_a_path_of_a_model(walk_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "own.xml"
    model.write_bytes(find_model("anymal_c").read_bytes())
    for name in (str(model), "../own", "own.xml/../own", "./own", ".."):
        plan = _with_meta(walk_plan, tmp_path / "path.plan.npz", name=name)
        with pytest.raises(InputError, match="not a path"):
            read_plan(plan)
        with pytest.raises(InputError, match="only --model"):
            find_model(name)
    assert model_file(str(model)) == model
    assert main([str(walk_plan), "-o", str(tmp_path), "--model", str(model), *QUICK]) == 0
    assert "own" in capsys.readouterr().out


def test_models_and_programs_of_the_working_folder_are_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "own.xml").write_text("<mujoco/>")
    (tmp_path / "ffmpeg").write_text("#!/bin/sh\n")
    (tmp_path / "ffmpeg").chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", "." + os.pathsep + os.environ["PATH"])
    assert all(tmp_path not in folder.parents for folder in robots_directories())
    with pytest.raises(InputError, match="no full model"):
        find_model("own")
    found = ffmpeg()
    assert found is None or os.path.isabs(found)


def test_modules_of_the_working_folder_are_not_imported(walk_plan: Path, tmp_path: Path) -> None:
    (tmp_path / "warpgait").mkdir()
    for module in ("numpy.py", "mujoco.py", "json.py", "warpgait/__init__.py", "warpgait/render.py"):
        (tmp_path / module).write_text("open('ran', 'a').write(__file__ + '\\n')\n")
    # With pictures: their process is one of its own.
    done = _run([str(walk_plan), "-o", "out", "--quick"], cwd=tmp_path, stdout=subprocess.PIPE)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("words", "written"),
    [
        (["export", "walk.plan.npz", "--to", "csv"], "walk.csv"),
        (["view", "walk.plan.npz", "--html", "walk.html"], "walk.html"),
        (["sweep", "s.toml"], "s.sweep/results.csv"),
    ],
)
def test_other_commands_import_nothing_from_the_working_folder(
    walk_plan: Path, tmp_path: Path, words: list[str], written: str
) -> None:
    (tmp_path / "warpgait").mkdir()
    for module in ("numpy.py", "mujoco.py", "json.py", "warpgait/__init__.py", "warpgait/sweeps.py"):
        (tmp_path / module).write_text("open('ran', 'a').write(__file__ + '\\n')\n")
    (tmp_path / "walk.plan.npz").write_bytes(walk_plan.read_bytes())
    (tmp_path / "walk.toml").write_text(WALK)
    (tmp_path / "s.toml").write_text('scenario = "walk.toml"\n[values]\nsolver.max_iterations = [1]\n')
    command = [sys.executable, "-P", "-m", f"warpgait.commands.{words[0]}", *words[1:]]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and (tmp_path / written).is_file(), done.stderr
    assert not (tmp_path / "ran").exists()


def test_without_a_verdict_no_old_one_stays(
    walk_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = tmp_path / "walk.plan.npz"
    plan.write_bytes(walk_plan.read_bytes())
    reports = [tmp_path / "walk.report.json", tmp_path / "walk.report.html"]

    def judged(exit_code: int, verdict: str) -> None:
        data, page = (report.read_text() for report in reports)
        assert json.loads(data)["verdict"] == verdict
        assert ("The robot tracks this plan." in page) == (verdict == "pass")
        assert (exit_code == 0) == (verdict == "pass")

    def good() -> None:
        plan.write_bytes(walk_plan.read_bytes())
        judged(main([str(plan), *QUICK]), "pass")

    good()
    plan.write_bytes(walk_plan.read_bytes()[:5000])  # a bad plan
    judged(main([str(plan), *QUICK]), "error")
    good()
    plan.unlink()  # a missing plan
    judged(main([str(plan), *QUICK]), "error")
    good()
    judged(main([str(plan), "--model", "none.xml", *QUICK]), "error")  # a missing model
    good()
    with monkeypatch.context() as patched:
        patched.setattr("warpgait.validation.analyze", lambda *_: 1 / 0)  # a crash
        judged(main([str(plan), *QUICK]), "error")
    good()
    with monkeypatch.context() as patched:
        patched.setattr("warpgait.validation.analyze", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        judged(main([str(plan), *QUICK]), "error")
    good()
    with monkeypatch.context() as patched:
        patched.setattr("warpgait.validation.analyze", lambda *_: os._exit(9))  # killed
        if os.fork() == 0:
            main([str(plan), *QUICK])
        os.wait()
    judged(9, "error")
    capsys.readouterr()


def test_a_report_never_replaces_the_plan(walk_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "walk.plan.npz"
    plan.write_bytes(walk_plan.read_bytes())
    (tmp_path / "walk.replay.npz").symlink_to("walk.plan.npz")
    assert main([str(plan), *QUICK]) == 2
    assert "which this command reads" in capsys.readouterr().err
    assert plan.read_bytes() == walk_plan.read_bytes()


def test_names_act_neither_on_the_terminal_nor_in_the_page(
    walk_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = "<b>\x1b[2J\n.plan.npz"
    (tmp_path / name).write_bytes(walk_plan.read_bytes())
    assert main([str(tmp_path / name), *QUICK]) == 0
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err and "\\x1b[2J\\n" in said.out
    page = next(tmp_path.glob("*.html")).read_text()
    assert "\x1b" not in page and "<b>" not in page and "&lt;b&gt;\\x1b[2J\\n" in page


def test_a_full_standard_output_is_an_error_and_a_closed_one_is_not(walk_plan: Path, tmp_path: Path) -> None:
    words = [str(walk_plan), "-o", str(tmp_path), *QUICK]
    for more in (words, [*words, "--json"], ["none.plan.npz", "--json"]):
        with open("/dev/full", "w") as full:
            done = _run(more, stdout=full)
        assert done.returncode == 2, done.stderr
        assert "error: standard output: No space left on device" in done.stderr and "Traceback" not in done.stderr
    # The verdict is written all the same, and stays.
    assert json.loads((tmp_path / "walk.report.json").read_text())["verdict"] == "pass"
    shell = f"'{sys.executable}' -P -m warpgait.commands.validate \"$@\" >&-"
    done = subprocess.run(["sh", "-c", shell, "sh", *words], stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
