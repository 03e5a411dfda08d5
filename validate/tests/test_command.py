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
from warpgait.settings import MUJOCO_VERSION
from warpgait.validate import main


def test_a_good_plan_gives_three_files_and_exit_code_0(
    standing_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(standing_plan), "-o", str(tmp_path), "--no-pictures", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    report = json.loads((tmp_path / "stand.report.json").read_text())
    assert printed == report
    assert report["verdict"] == "pass" and report["first_failure"] is None
    assert {t["name"] for t in report["replays"]} == {"closed loop", "second opinion: joint PD"}
    page = (tmp_path / "stand.report.html").read_text()
    assert "The robot tracks this plan." in page and "http" not in page.replace("http-equiv", "")
    with np.load(tmp_path / "stand.replay.npz") as replay:
        K = len(replay["t"])
        assert replay["q"].shape == replay["qd"].shape == replay["tau"].shape == (K, 12)
        assert replay["joint_names"][2] == "LF_KFE"
        assert np.abs(replay["qd"]).max() < 1.0


def test_a_bad_plan_gives_exit_code_1_and_the_reason(
    standing_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = crawl.altered(standing_plan, tmp_path / "weak.plan.npz", lambda a: a.update(foot_force=0.5 * a["foot_force"]))
    assert main([str(bad), "--no-pictures", "--no-second-opinion"]) == 1
    assert "unexplained force" in capsys.readouterr().out
    assert json.loads((tmp_path / "weak.report.json").read_text())["trackable"] is False


def test_errors_give_exit_code_2_and_a_report_that_says_so(
    standing_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(tmp_path / "none.plan.npz"), "--json"]) == 2
    said = capsys.readouterr()
    assert "no such file" in said.err and "no such file" in json.loads(said.out)["error"]

    def rename(a: dict[str, Any]) -> None:
        meta = json.loads(str(a["meta"]))
        meta["robot"]["name"] = "anymal_towr"
        a["meta"] = np.array(json.dumps(meta))

    other = crawl.altered(standing_plan, tmp_path / "towr.plan.npz", rename)
    assert main([str(other)]) == 2
    assert "no full model" in capsys.readouterr().err
    assert main([str(standing_plan), "-o", str(other)]) == 2  # a file, not a folder
    assert "cannot make this folder for the reports" in capsys.readouterr().err
    assert json.loads((tmp_path / "towr.report.json").read_text())["verdict"] == "error"
    assert main([str(other), "--model", "anymal_b", "--no-pictures", "--no-second-opinion"]) == 0
    before = sorted(standing_plan.parent.iterdir())
    for wrong in (
        ["--friction", "-1"],
        ["--rate", "333"],
        ["--rate", "0"],
        ["--push", "0,nan,0,0,0"],
        ["--push", "0,-1,0,0,0"],
        ["--seed", "-1"],
    ):
        assert main([str(standing_plan), *wrong]) == 2
        assert wrong[0] in capsys.readouterr().err
    assert sorted(standing_plan.parent.iterdir()) == before  # a report of an earlier run stays


def test_a_bug_is_not_a_verdict(
    standing_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("warpgait.validation.analyze", lambda *_: 1 / 0)
    assert main([str(standing_plan), "-o", str(tmp_path)]) == 2
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_a_closed_standard_output_does_not_change_the_verdict(standing_plan: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "warpgait.validate", str(standing_plan), "-o", str(tmp_path), "--no-pictures"]
    run = subprocess.Popen([*command, "--no-second-opinion"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert run.stdout is not None and run.stderr is not None
    run.stdout.close()
    assert run.wait() == 0, run.stderr.read()
    run.stderr.close()
    assert json.loads((tmp_path / "stand.report.json").read_text())["verdict"] == "pass"


def test_without_a_display_or_opengl_the_report_says_what_to_install(
    standing_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "no-such-backend")
    assert main([str(standing_plan), "-o", str(tmp_path), "--no-second-opinion"]) == 0
    assert "libegl1" in capsys.readouterr().err
    assert "libegl1" in (tmp_path / "stand.report.html").read_text()


def test_a_missing_opengl_loses_only_the_pictures(standing_plan: Path, tmp_path: Path) -> None:
    """With this setting, MuJoCo itself cannot be imported."""
    command = [sys.executable, "-m", "warpgait.validate", str(standing_plan), "-o", str(tmp_path), "--no-second-opinion"]
    environment = dict(os.environ, MUJOCO_GL="osmesa", PYOPENGL_PLATFORM="no-such-platform")
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "No pictures" in done.stderr and "libosmesa6" in done.stderr


def test_without_ffmpeg_there_is_a_message_and_no_film(
    standing_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(film, "ffmpeg", lambda: None)
    assert main([str(standing_plan), "-o", str(tmp_path), "--no-second-opinion", "--no-pictures", "--video"]) == 0
    assert "ffmpeg" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.mp4"))


def test_a_still_shows_the_whole_walk(ripple_plan: Path, tmp_path: Path) -> None:
    assert main([str(ripple_plan), "-o", str(tmp_path), "--no-second-opinion", "--no-pictures", "--still"]) == 0
    picture = (tmp_path / "ripple.png").read_bytes()
    columns, rows = struct.unpack(">II", picture[16:24])
    assert (columns, rows) == film.STILL_SIZE
    start = picture.index(b"IDAT") + 4
    lines = np.frombuffer(zlib.decompressobj().decompress(picture[start:]), np.uint8).reshape(rows, 1 + 3 * columns)
    red, green, blue = lines[:, 1:].reshape(rows, columns, 3).astype(int).transpose(2, 0, 1)
    robot = (red > 2 * green) & (red > 2 * blue)
    assert robot.mean() > 0.02


def test_the_package_requires_the_version_of_mujoco_that_it_was_calibrated_with() -> None:
    assert f"mujoco=={MUJOCO_VERSION}" in (importlib.metadata.requires("warpgait") or [])


def test_a_missing_mujoco_is_a_message(standing_plan: Path, tmp_path: Path) -> None:
    (tmp_path / "mujoco.py").write_text("raise ImportError('No module named mujoco')")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from warpgait.validate import main; sys.exit(main([{str(standing_plan)!r}, '-o', {str(tmp_path)!r}]))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "pip install" in done.stderr and "Traceback" not in done.stderr
