"""`warpgait dataset`: motions over random ground, and the card."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import warpgait
from warpgait import Terrain
from warpgait.commands.dataset import main
from warpgait.sweeps.dataset import attempts, ground

SHORT = ["--horizon", "3.0", "--distance", "0.2", "0.3", "--roughness", "0", "0.02", "--workers", "2"]
DIRECT = ["--set", "formulation=direct", "--set", "physics.legs=massless"]


def test_random_grounds_have_their_roughness_and_attempts_stay_the_same() -> None:
    random = np.random.default_rng(3)
    for roughness in (0.01, 0.05):
        terrain = Terrain.formula(ground(random, roughness), extent=(-6.0, 6.0, -6.0, 6.0), spacing=0.05)
        assert np.std(terrain.height(terrain.grid(301))) == pytest.approx(roughness, rel=0.25)
    few, more = (attempts(count, 1, ("walk", "trot"), (0.4, 1.0), (0.0, 0.04)) for count in (5, 9))
    assert more[:5] == few and len({str(case) for case in more}) == 9
    assert attempts(5, 2, ("walk", "trot"), (0.4, 1.0), (0.0, 0.04)) != few


def test_motions_are_kept_that_are_tracked_and_the_card_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "walks"
    words = ["-o", str(folder), "--count", "2", *SHORT, *DIRECT, "-q", "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["motions"] == 2 and told["attempts"] >= 2
    card = json.loads((folder / "card.json").read_text())
    assert card["motions"] == card["wanted"] == 2 and card["rate_hz"] == 50.0 and card["export"] == "isaaclab"
    assert card["attempts"] == 2 + card["spare"] + sum(card["failed"].values())
    frames = 0
    for entry in card["files"]:
        motion = np.load(folder / entry["motion"])
        facts = json.loads(str(motion["warpgait"]))
        assert facts["certificate"]["all_laws_hold"] and facts["certificate"]["replay"]["verdict"] == entry["verdict"]
        assert facts["certificate"]["plan"]["sha256"] == entry["plan_sha256"]
        assert warpgait.load(folder / entry["plan"]).passed
        frames += len(motion["dof_positions"])
    assert frames == card["frames"]
    text = (folder / "README.md").read_text()
    assert text.startswith("# 2 motions of anymal_c") and "## What was left out" in text and "joint_torque" in text
    # What is there is not made again, and a larger set has the same motions.
    before = {path: path.stat().st_mtime_ns for path in (folder / "cases").iterdir()}
    assert main(words) == 0
    assert {path: path.stat().st_mtime_ns for path in (folder / "cases").iterdir()} == before


def test_attempts_that_fail_are_told_in_the_card(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "few"
    few = ["--count", "1", "--attempts", "2", "--set", "solver.max_iterations=1", "--no-replay"]
    assert main(["-o", str(folder), *few, *SHORT, "--set", "formulation=direct"]) == 1
    said = capsys.readouterr()
    assert "0 of 1 motions, 2 attempts" in said.out and "attempt 2 of 2: failed" in said.err
    card = json.loads((folder / "card.json").read_text())
    assert card["motions"] == 0 and sum(card["failed"].values()) == 2 and all("failed: " in why for why in card["failed"])
    assert "| failed: " in (folder / "README.md").read_text()


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--count", "0"], "--count 0: expected from 1"),
        (["--to", "bvh"], "--to bvh: there is no such format"),
        (["--distance", "2", "1"], "--distance: expected two numbers"),
        (["--roughness", "0", "nan"], "--roughness: expected two numbers"),
        (["--robot", "cow"], "robot.name"),
        (["--robot", "anymal_towr"], "--robot anymal_towr: --to isaaclab needs joint angles; plan for one of "),
        (["--robot", "anymal_towr", "--to", "csv"], "--robot anymal_towr: a replay needs a full model"),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, words: list[str], what: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-o", str(tmp_path / "a"), *words]) == 2
    said = capsys.readouterr()
    assert what in said.err and said.err.count("\n") == 1 and said.out == ""
