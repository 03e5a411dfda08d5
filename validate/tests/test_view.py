"""`warpgait view`: the page, and what it shows."""

from __future__ import annotations

import base64
import html
import json
import re
import shutil
import subprocess
import webbrowser
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import WALK

import crawl
import warpgait
from warpgait.archive import Archive
from warpgait.commands import view
from warpgait.commands.validate import main as validate
from warpgait.commands.view import main
from warpgait.motions import motion_of_plan
from warpgait.plan import read_plan
from warpgait.viewer.warping import warping_of

TYPES = {"f4": "<f4", "u2": "<u2", "u1": "|u1"}


@pytest.fixture(scope="module")
def warped_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The walk, planned in the warped space, with its replay beside it."""
    path = tmp_path_factory.mktemp("warped") / "walk.plan.npz"
    warpgait.solve(WALK, overrides={"formulation": "warped"}).save(path)
    assert validate([str(path), "--quick", "--no-pictures", "--quiet"]) in (0, 1)
    return path


@pytest.fixture(scope="module")
def page(warped_plan: Path) -> str:
    target = warped_plan.with_name("walk.html")
    assert main([str(warped_plan), "--html", str(target), "--quiet"]) == 0
    return target.read_text()


def data_of(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def unpacked(packed: dict[str, str]) -> npt.NDArray[Any]:
    return np.frombuffer(base64.b64decode(packed["data"]), TYPES[packed["type"]])


def test_the_page_needs_nothing_else(page: str) -> None:
    assert len(page) < 5e6
    code = page.replace(re.search(r'id="data">(.*?)</script>', page, re.DOTALL)[1], "")  # type: ignore[index]
    assert "http" not in code.replace('http-equiv="Content-Security-Policy"', "") and "src=" not in code and "import " not in code
    assert "default-src 'none'" in code


def test_the_page_shows_the_motion_of_plan_and_replay(page: str, warped_plan: Path) -> None:
    data, plan = data_of(page), read_plan(warped_plan)
    motion = motion_of_plan(plan, 50.0)
    bodies = unpacked(data["plan"]["bodies"]).reshape(len(motion.t), -1, 7)
    np.testing.assert_allclose(bodies[..., :3], motion.body_position, atol=1e-6)
    np.testing.assert_allclose(bodies[..., 3:], motion.body_quaternion_wxyz, atol=1e-6)
    assert [body["name"] for body in data["bodies"]] == list(motion.body_names)
    np.testing.assert_allclose(
        unpacked(data["plan"]["force"]).reshape(-1, 4, 3), plan.foot_force[::4] * plan.foot_contact[::4, :, None], atol=1e-4
    )
    with np.load(warped_plan.with_name("walk.replay.npz")) as replay:
        center = unpacked(data["replay"]["center"]).reshape(-1, 3)
        np.testing.assert_allclose(center, replay["center_of_mass"][::5], atol=1e-6)
    ground = data["ground"]
    heights = ground["low"] + (ground["high"] - ground["low"]) / 65535 * unpacked(ground["heights"]).reshape(
        ground["rows"], ground["columns"]
    )
    exact = warpgait.load(warped_plan).terrain
    j, i = 11, 17
    at = [ground["origin"][0] + j * ground["spacing"][0], ground["origin"][1] + i * ground["spacing"][1]]
    assert heights[i, j] == pytest.approx(float(exact.height(at)), abs=1e-4)
    stances = sum(len([s for s in data["footholds"] if s["foot"] == e]) for e in range(4))
    assert stances == len(data["footholds"]) >= 8


def test_the_warped_space_is_that_of_the_plan(page: str, warped_plan: Path) -> None:
    data = data_of(page)
    archive, plan = Archive(warped_plan), read_plan(warped_plan)
    warping = warping_of(archive, plan)
    assert warping is not None
    np.testing.assert_allclose(warping(archive["warped_base_position"]), plan.base_position, atol=1e-9)
    np.testing.assert_allclose(
        warping(archive["warped_foot_position"]), plan.foot_position, atol=1e-6
    )  # below the plane by less, it is clipped
    straight, curved = (unpacked(data["map"][key][3]).reshape(-1, 3) for key in ("straight", "lines"))
    np.testing.assert_allclose(warping(straight.astype(float)), curved, atol=1e-6)
    # On the plane of the warped space, the grid is on the ground.
    np.testing.assert_allclose(warpgait.load(warped_plan).terrain.height(curved[:, :2].astype(float)), curved[:, 2], atol=1e-3)
    touch = unpacked(data["warped"]["touch"]).reshape(-1, 4, 3)
    assert np.abs(touch[unpacked(data["warped"]["contact"]).reshape(-1, 4) > 0][:, 2]).max() < 1e-3


def test_moments_at_which_laws_fail_come_first(walk_plan: Path, tmp_path: Path) -> None:
    def shaken(a: dict[str, Any]) -> None:
        force = a["foot_force"].copy()
        force[150] *= 1.5
        a["foot_force"] = force

    bad = crawl.altered(walk_plan, tmp_path / "bad.plan.npz", shaken)
    assert main([str(bad), "--html", str(tmp_path / "bad.html"), "-q"]) == 0
    data = data_of((tmp_path / "bad.html").read_text())
    rows = data["tables"][0][1]
    good = [row["good"] for row in rows]
    assert good == sorted(good) and not good[0]
    assert any(abs(row["time"] - 0.75) < 0.02 for row in rows if not row["good"] and row["time"] is not None)
    assert data["map"] is None and data["replay"] is None and data["summary"][0]["kind"] == "fail"
    curve = unpacked(data["curves"][0]["values"])
    assert np.argmax(curve) in (36, 37, 38) and curve.max() > 3 > np.median(curve)


def test_metrics_of_the_replay_have_their_moments(page: str, warped_plan: Path) -> None:
    title, rows, _ = data_of(page)["tables"][1]
    report = json.loads(warped_plan.with_name("walk.report.json").read_text())
    metrics = [*report["open_loop"]["metrics"], *(m for trial in report["replays"] for m in trial["metrics"])]
    assert title.startswith("Metrics of the replay") and len(rows) == len(metrics)
    slip = next(row for row in rows if row["name"] == "closed loop: slip in the worst stance")
    found = next(m for m in report["replays"][0]["metrics"] if m["name"] == "slip in the worst stance")
    assert slip["time"] == found["time"] and slip["foot"] == found["foot"] and slip["good"] == (found["verdict"] == "pass")


def test_unknown_ground_and_patches_are_shown(walk_plan: Path, tmp_path: Path) -> None:
    corners = np.full((4, 2, 4, 3), np.nan)
    corners[:, 0] = np.array([[0.1, 0.1, 0.0], [0.2, 0.1, 0.0], [0.2, 0.2, 0.0], [0.1, 0.2, 0.0]]) + np.arange(4)[:, None, None]

    def change(a: dict[str, Any]) -> None:
        unknown = np.zeros(a["heightfield"].shape, bool)
        unknown[60:70, 80:95] = True
        a.update(heightfield_unknown=unknown, patch_corners=corners, heightfield_raw=a["heightfield"] + 0.01)

    plan = crawl.altered(walk_plan, tmp_path / "edges.plan.npz", change)
    assert main([str(plan), "--html", str(tmp_path / "a.html"), "-q"]) == 0
    data = data_of((tmp_path / "a.html").read_text())
    ground = data["ground"]
    unknown = unpacked(ground["unknown"]).reshape(ground["rows"], ground["columns"])
    i, j = np.argwhere(unknown).mean(0)
    x, y = (ground["origin"][axis] + at * ground["spacing"][axis] for axis, at in ((0, j), (1, i)))
    assert (x, y) == (pytest.approx(-1.5 + 0.02 * 87, abs=0.02), pytest.approx(-1.5 + 0.02 * 64.5, abs=0.02))
    assert [patch["foot"] for patch in data["patches"]] == [0, 1, 2, 3]
    np.testing.assert_allclose(data["patches"][3]["corners"], corners[3, 0])
    # Planned for the raw ground, the other surface is the smoothed one.
    assert ground["raw_label"] == "smoothed ground"
    between = (ground["high"] - ground["low"]) / 65535 * (unpacked(ground["heights"]).astype(float) - unpacked(ground["raw"]))
    np.testing.assert_allclose(between, 0.01, atol=1e-4)


def test_a_robot_without_joints_is_a_box_with_lines(tmp_path: Path) -> None:
    plan = tmp_path / "towr.plan.npz"
    warpgait.solve(WALK, overrides={"robot.name": "anymal_towr"}).save(plan)
    assert main([str(plan), "--html", str(tmp_path / "a.html"), "-q"]) == 0
    data = data_of((tmp_path / "a.html").read_text())
    assert [shape["kind"] for shape in data["bodies"][0]["shapes"]] == ["box"] and np.shape(data["legs"]) == (4, 3)


def test_names_in_a_plan_are_only_shown(walk_plan: Path, tmp_path: Path) -> None:
    evil = "<img src=x onerror=alert(1)>{data}"
    plan = tmp_path / f"{evil}.plan.npz"
    plan.write_bytes(walk_plan.read_bytes())
    target = tmp_path / "a.html"
    assert main([str(plan), "--html", str(target), "-q"]) == 0
    page = target.read_text()
    assert "<img" not in page and html.escape(evil) in page and data_of(page)["name"] == evil


def test_the_page_is_opened_or_its_path_is_printed(
    walk_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = tmp_path / "walk.plan.npz"
    plan.write_bytes(walk_plan.read_bytes())
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    seen: list[str] = []

    def remember(url: str) -> bool:
        seen.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", remember)
    assert main([str(plan)]) == 0
    said = capsys.readouterr()
    assert said.out.strip() == str(tmp_path / "walk.view.html") and "no browser" in said.err and not seen
    monkeypatch.setenv("DISPLAY", ":0")
    assert main([str(plan), "--html", str(tmp_path / "b.html"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"written": str(tmp_path / "b.html"), "opened": False} and not seen
    assert main([str(plan)]) == 0
    assert seen == [(tmp_path / "walk.view.html").as_uri()] and capsys.readouterr().err == ""

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(view, "write_page", interrupted)
    assert main([str(plan)]) == 130


def test_bad_input_is_one_line(walk_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "walk.plan.npz"
    plan.write_bytes(walk_plan.read_bytes()[:4000])
    torn = plan, tmp_path / "a.html", "damaged"
    itself = walk_plan, walk_plan, "this command reads"
    nowhere = walk_plan, tmp_path / "none" / "a.html", "there is no folder"
    for source, target, words in (torn, itself, nowhere):
        assert main([str(source), "--html", str(target)]) == 2
        said = capsys.readouterr()
        assert words in said.err and said.err.count("\n") == 1 and said.out == ""
    assert list(tmp_path.iterdir()) == [plan]


def test_a_damaged_map_is_refused(warped_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for change in (
        lambda a: a.update(map_knots_x=a["map_knots_x"][:-1]),
        lambda a: a.update(map_control_points=np.full_like(a["map_control_points"], np.inf)),
        lambda a: a.update(map_knots_z=a["map_knots_z"][::-1].copy()),
    ):
        bad = crawl.altered(warped_plan, tmp_path / "bad.plan.npz", change)
        assert main([str(bad), "--html", str(tmp_path / "a.html")]) == 2
        assert "map_" in capsys.readouterr().err


CHROMIUM = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None)


def command(folder: Path) -> list[str]:
    """Chromium without a window, which draws in software; its console goes to standard error."""
    options = ["--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    return [str(CHROMIUM), *options, f"--user-data-dir={folder / 'profile'}", "--enable-logging=stderr"]


def chromium(folder: Path, address: str, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*command(folder), *options, address], capture_output=True, text=True, timeout=120, check=True)


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
@pytest.mark.parametrize("size", ["1200,800", "390,844"])
def test_chromium_shows_the_page_without_an_error(page: str, warped_plan: Path, tmp_path: Path, size: str) -> None:
    picture = tmp_path / "page.png"
    options = [f"--window-size={size}", "--virtual-time-budget=3000"]
    address = f"{warped_plan.with_name('walk.html').as_uri()}#1.5"
    shown = chromium(tmp_path, address, *options, f"--screenshot={picture}")
    assert "CONSOLE" not in shown.stderr, shown.stderr
    assert picture.stat().st_size > 60_000  # an empty page takes 10 kB
    dumped = chromium(tmp_path, address, *options, "--dump-dom").stdout
    assert "1.50 / 3.00 s" in dumped and "Every law of the check holds." in dumped and 'id="problem" hidden' in dumped
