"""The command: files, exit codes, messages."""

import importlib.metadata
import json
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import crawl
from warpgait import film
from warpgait.commands.validate import main
from warpgait.settings import MUJOCO_VERSION


def test_a_good_plan_gives_three_files_and_exit_code_0(
    walk_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(walk_plan), "-o", str(tmp_path), "--no-pictures", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    report = json.loads((tmp_path / "walk.report.json").read_text())
    assert printed == report
    assert report["verdict"] == "pass" and report["first_failure"] is None
    assert [t["name"] for t in report["replays"]] == ["closed loop", "closed loop, steps of 1 ms"]
    assert len(report["check"]["metrics"]) > 40 and report["settings"]["quick"] is False
    worlds = report["robust"]["worlds"]
    assert len(worlds) == 12 and all(world["tracked"] for world in worlds), worlds
    assert report["robust"]["metrics"][0]["value"] == 100
    page = (tmp_path / "walk.report.html").read_text()
    assert "The robot tracks this plan." in page and "sensor noise" in page and "http" not in page.replace("http-equiv", "")
    with np.load(tmp_path / "walk.replay.npz") as replay:
        K = len(replay["t"])
        assert replay["q"].shape == replay["qd"].shape == replay["tau"].shape == (K, 12)
        assert replay["joint_names"][2] == "LF_KFE"
        assert np.abs(replay["qd"]).max() < 7.5


def test_a_bad_plan_gives_exit_code_1_and_the_reason(walk_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = crawl.altered(walk_plan, tmp_path / "weak.plan.npz", lambda a: a.update(foot_force=0.5 * a["foot_force"]))
    assert main([str(bad), "--no-pictures", "--quick"]) == 1
    said = capsys.readouterr().out
    assert "check: newton_rms" in said and "unexplained force" in said and "left out" in said
    report = json.loads((tmp_path / "weak.report.json").read_text())
    assert report["robust"] is None
    assert report["trackable"] is False and [t["name"] for t in report["replays"]] == ["closed loop"]
    # The first metric that decides, in the order of the report.
    assert report["first_failure"]["what"].startswith("check: spline_forces")


def test_errors_give_exit_code_2_and_write_nothing(walk_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.plan.npz"), "--json"]) == 2
    said = capsys.readouterr()
    assert "no such file" in said.err and "no such file" in json.loads(said.out)["error"]

    def rename(a: dict[str, Any]) -> None:
        meta = json.loads(str(a["meta"]))
        meta["robot"]["name"] = "anymal_towr"
        a["meta"] = np.array(json.dumps(meta))

    other = crawl.altered(walk_plan, tmp_path / "towr.plan.npz", rename)
    assert main([str(other)]) == 2
    assert "no full model" in capsys.readouterr().err
    assert main([str(walk_plan), "-o", str(other)]) == 2  # a file, not a folder
    assert "cannot make this folder for the reports" in capsys.readouterr().err
    assert main([str(other), "-o", str(tmp_path / "new" / "folder")]) == 2
    assert sorted(tmp_path.iterdir()) == [other]
    capsys.readouterr()
    assert main([str(other), "--model", "anymal_c", "--no-pictures", "--quick"]) == 1
    assert "meta.robot.name" in capsys.readouterr().out
    before = sorted(walk_plan.parent.iterdir())
    for wrong in (
        ["--friction", "-1"],
        ["--rate", "333"],
        ["--rate", "0"],
        ["--push", "0,nan,0,0,0"],
        ["--push", "0,-1,0,0,0"],
        ["--seed", "-1"],
    ):
        assert main([str(walk_plan), *wrong]) == 2
        assert wrong[0] in capsys.readouterr().err
    for words, said_of_it in (
        (["--repeat", "1.5"], '--repeat: given "1.5", allowed: a whole number'),
        (["--rate", "fast"], '--rate: given "fast", allowed: a number'),
        (["--quik"], "unrecognized arguments: --quik; warpgait validate -- --help lists all options"),
    ):
        with pytest.raises(SystemExit) as ended:
            main([str(walk_plan), *words])
        assert ended.value.code == 2 and capsys.readouterr().err == f"error: {said_of_it}\n"
    assert sorted(walk_plan.parent.iterdir()) == before  # a report of an earlier run stays


def test_a_bug_is_not_a_verdict(
    walk_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("warpgait.validation.analyze", lambda *_: 1 / 0)
    assert main([str(walk_plan), "-o", str(tmp_path)]) == 2
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_a_closed_standard_output_does_not_change_the_verdict(walk_plan: Path, tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "warpgait.commands.validate",
        str(walk_plan),
        "-o",
        str(tmp_path),
        "--no-pictures",
        "--quick",
    ]
    run = subprocess.Popen([*command], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.stdout is not None and run.stderr is not None
    run.stdout.close()
    assert run.wait() == 0, run.stderr.read()
    run.stderr.close()
    assert json.loads((tmp_path / "walk.report.json").read_text())["verdict"] == "pass"


def test_without_a_display_or_opengl_the_report_says_what_to_install(
    walk_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "no-such-backend")
    assert main([str(walk_plan), "-o", str(tmp_path), "--quick"]) == 0
    assert "libegl1" in capsys.readouterr().err
    assert "libegl1" in (tmp_path / "walk.report.html").read_text()


def test_a_missing_opengl_loses_only_the_pictures(walk_plan: Path, tmp_path: Path) -> None:
    """With this setting, MuJoCo itself cannot be imported."""
    command = [sys.executable, "-m", "warpgait.commands.validate", str(walk_plan), "-o", str(tmp_path), "--quick"]
    environment = dict(os.environ, MUJOCO_GL="osmesa", PYOPENGL_PLATFORM="no-such-platform")
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "No pictures" in done.stderr and "libosmesa6" in done.stderr


def test_without_ffmpeg_there_is_a_message_and_no_film(
    walk_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(film, "ffmpeg", lambda: None)
    assert main([str(walk_plan), "-o", str(tmp_path), "--no-pictures", "--quick", "--video"]) == 0
    assert "ffmpeg" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.mp4"))


def test_a_still_shows_the_whole_walk(walk_plan: Path, tmp_path: Path) -> None:
    assert main([str(walk_plan), "-o", str(tmp_path), "--no-pictures", "--quick", "--still"]) == 0
    picture = (tmp_path / "walk.png").read_bytes()
    columns, rows = struct.unpack(">II", picture[16:24])
    assert (columns, rows) == film.STILL_SIZE
    start = picture.index(b"IDAT") + 4
    lines = np.frombuffer(zlib.decompressobj().decompress(picture[start:]), np.uint8).reshape(rows, 1 + 3 * columns)
    red, green, blue = lines[:, 1:].reshape(rows, columns, 3).astype(int).transpose(2, 0, 1)
    robot = (red > 2 * green) & (red > 2 * blue)
    assert robot.mean() > 0.02


def test_the_package_requires_the_version_of_mujoco_that_it_was_calibrated_with() -> None:
    assert f"mujoco=={MUJOCO_VERSION}" in (importlib.metadata.requires("warpgait") or [])


def test_a_missing_mujoco_is_a_message(walk_plan: Path, tmp_path: Path) -> None:
    (tmp_path / "mujoco.py").write_text("raise ImportError('No module named mujoco')")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from warpgait.commands.validate import main; sys.exit(main([{str(walk_plan)!r}, '-o', {str(tmp_path)!r}]))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "pip install" in done.stderr and "Traceback" not in done.stderr


def a_number(key: str) -> Any:
    def change(a: dict[str, Any]) -> None:
        meta = json.loads(str(a["meta"]))
        meta[key] = 5
        a["meta"] = np.array(json.dumps(meta))

    return change


def unsolved(a: dict[str, Any]) -> None:
    meta = json.loads(str(a["meta"]))
    meta["solver"]["success"] = False
    a["meta"] = np.array(json.dumps(meta))


def pulling(a: dict[str, Any]) -> None:
    """One foot pulls by 10 % of m g, the one beside it bears that."""
    force = a["foot_force"].copy()
    weight = force[:, :, 2].sum(1).mean()
    force[:10, 0, 2] -= force[:10, 0, 2] + 0.1 * weight
    a["foot_force"] = force


def cut(a: dict[str, Any]) -> None:
    """The motion ends in mid-step."""
    samples = len(a["t"])
    keep = int(np.argmin(a["foot_contact"].all(1))) + 20
    for member, values in a.items():
        if values.shape[:1] == (samples,):
            a[member] = values[:keep]


@pytest.mark.parametrize(
    ("change", "law"),
    [(unsolved, "solved"), (pulling, "pull"), (cut, "horizon")],
)
def test_what_fails_the_check_fails_here(
    walk_plan: Path, tmp_path: Path, change: Any, law: str, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = crawl.altered(walk_plan, tmp_path / "bad.plan.npz", change)
    assert main([str(bad), "--no-files", "--quick", "--json", "--quiet"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["verdict"] == "fail"
    assert law in [m["name"] for m in report["check"]["metrics"] if m["verdict"] == "fail"]


def times_millionth(a: dict[str, Any]) -> None:
    a["t"] = 1e-6 * a["t"]


def huge_cells(a: dict[str, Any]) -> None:
    a["heightfield_spacing"] = 1e7 * a["heightfield_spacing"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (a_number("scenario"), "meta"),
        (times_millionth, "member t"),
        (huge_cells, "member heightfield_spacing"),
        (lambda a: a.update(t=np.zeros(0)), "member"),
    ],
)
def test_a_plan_that_cannot_be_replayed_is_one_clear_line(
    walk_plan: Path, tmp_path: Path, change: Any, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = crawl.altered(walk_plan, tmp_path / "bad.plan.npz", change)
    assert main([str(bad), "--no-files", "--quiet"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "bad.plan.npz" in said and words in said, said
