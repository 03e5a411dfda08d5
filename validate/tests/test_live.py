"""`warpgait view --live`: iterates as they come, and the server that shows them."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import WALK
from test_view import CHROMIUM, command, data_of, unpacked

import warpgait
from warpgait.commands.view import main
from warpgait.viewer.iterates import Iterates
from warpgait.viewer.server import Server


@pytest.fixture(scope="module", params=["direct", "warped"])
def watched(request: pytest.FixtureRequest) -> tuple[list[warpgait.Iterate], warpgait.Plan]:
    seen: list[warpgait.Iterate] = []
    return seen, warpgait.solve(WALK, overrides={"formulation": request.param}, watch=seen.append)


def test_iterates_are_the_motion_so_far(watched: tuple[list[warpgait.Iterate], warpgait.Plan]) -> None:
    seen, plan = watched
    first, last = seen[0], seen[-1]
    assert first.iteration == 0 and [at.iteration for at in seen] == sorted({at.iteration for at in seen})
    N, E = len(first.t), len(plan.foot_names)
    assert 25 * plan.duration + 1 == N and first.t[-1] == plan.duration and first.foot_names == plan.foot_names
    assert first.base_position.shape == (N, 3) and first.foot_position.shape == first.foot_force.shape == (N, E, 3)
    np.testing.assert_allclose(np.linalg.norm(last.base_quaternion_wxyz, axis=1), 1, atol=1e-9)
    np.testing.assert_allclose(last.base_position[0], plan.base(0.0).position, atol=1e-6)
    # The guess stands on the ground, and carries the robot.
    standing = first.foot_position[first.foot_contact]
    np.testing.assert_allclose(standing[:, 2], first.terrain.height(standing[:, :2]), atol=1e-6)
    robot = json.loads(first.robot)
    weight = -robot["mass"] * robot["gravity"][2]
    assert first.foot_force[0, :, 2].sum() == pytest.approx(weight, rel=0.05)
    if plan.meta["formulation"] == "direct":
        assert last.warped_foot_position is None and last.warped_box is None
        assert last.ambient([0.1, 0.2, 0.3]).tolist() == [0.1, 0.2, 0.3]
    else:
        assert last.warped_base is not None and last.warped_foot_position is not None
        np.testing.assert_allclose(last.ambient(last.warped_foot_position), last.foot_position, atol=1e-12)
        np.testing.assert_allclose(last.ambient(last.warped_base[:, :3]), last.base_position, atol=1e-12)
    with pytest.raises(warpgait.InputError, match=r"expected \(…, 3\)"):
        first.ambient([1.0, 2.0])


def test_the_page_of_an_iterate_shows_it(watched: tuple[list[warpgait.Iterate], warpgait.Plan]) -> None:
    seen, plan = watched
    iterates = Iterates("walk")
    iterates.shown(seen[0])
    page, news = iterates.shown(seen[-1])
    data = data_of(page())
    assert data["plan"] == news["plan"] and data["scene"] == news["scene"] and data["live"]
    np.testing.assert_allclose(
        unpacked(data["plan"]["touch"]).reshape(seen[-1].foot_position.shape), seen[-1].foot_position, atol=1e-6
    )
    ground = data["ground"]
    heights = ground["low"] + (ground["high"] - ground["low"]) / 65535 * unpacked(ground["heights"])
    x = ground["origin"][0] + ground["spacing"][0] * np.arange(ground["columns"])
    y = ground["origin"][1] + ground["spacing"][1] * np.arange(ground["rows"])
    exact = plan.terrain.height(np.stack(np.meshgrid(x, y), -1))
    np.testing.assert_allclose(heights.reshape(exact.shape), exact, atol=1e-4)
    assert (data["map"] is None) == (plan.meta["formulation"] == "direct")
    assert [row["name"] for row in data["tables"][0][1]] == [f"{at.stage}, {at.iteration}" for at in (seen[-1], seen[0])]


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as made:
        yield made


def get(server: str, path: str = "/", host: str | None = None) -> tuple[int, str]:
    where = server.removeprefix("http://").removesuffix("/")
    connection = http.client.HTTPConnection(where, timeout=10)
    connection.request("GET", path, headers={} if host is None else {"Host": host})
    answer = connection.getresponse()
    return answer.status, answer.read().decode()


def events(server: str) -> Iterator[dict[str, Any]]:
    connection = http.client.HTTPConnection(server.removeprefix("http://").removesuffix("/"), timeout=30)
    connection.request("GET", "/events")
    answer = connection.getresponse()
    for line in answer:
        if line.startswith(b"data: "):
            yield json.loads(line[6:])


def test_the_server_tells_what_is_new_to_this_machine_only(server: Server) -> None:
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", server.address)
    assert "the motion follows" in get(server.address)[1] and not server.shown.is_set()
    server.show(lambda: "one", {"scene": 1})
    told = events(server.address)
    assert next(told) == {"scene": 1}
    server.show(lambda: "two", {"scene": 2})
    assert next(told) == {"scene": 2} and get(server.address) == (200, "two") and not server.shown.is_set()
    server.show(lambda: "three", {"scene": 0}, last=True)
    assert get(server.address) == (200, "three") and server.shown.is_set()
    assert get(server.address, "/etc/passwd")[0] == 404
    assert get(server.address, host="evil.example:80")[0] == 403


def test_a_port_in_use_is_refused(server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = tmp_path / "walk.toml"
    scenario.write_text(WALK)
    for wrong in ("abc", "1.5"):
        with pytest.raises(SystemExit) as ended:
            main(["--live", str(scenario), "--port", wrong])
        assert ended.value.code == 2
        assert capsys.readouterr().err == f'error: --port: given "{wrong}", allowed: a whole number\n'
    assert main(["--live", str(tmp_path / "none.toml"), "--no-browser"]) == 2
    assert capsys.readouterr().err == f"error: {tmp_path / 'none.toml'}: there is no such file\n"
    for port, why in ((server.address.split(":")[2][:-1], "in use"), ("70000", "not a number from 0 to 65535")):
        assert main(["--live", str(scenario), "--port", port, "-o", str(tmp_path / "a.plan.npz"), "--no-browser"]) == 2
        said = capsys.readouterr().err
        assert f"--port {port}: " in said and why in said and said.count("\n") == 1
    assert main([str(scenario), "--port", "1"]) == 2 and "are for --live" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [scenario]


def started(scenario: Path, *more: str) -> tuple[subprocess.Popen[str], str]:
    """The command at work, and its address."""
    words = [sys.executable, "-m", "warpgait.commands.view", "--live", str(scenario), "--no-browser", *more]
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=scenario.parent, env=dict(os.environ)
    )
    assert process.stderr is not None
    line = process.stderr.readline()
    found = re.search(r"http://127\.0\.0\.1:\d+/", line)
    assert found, line + process.stderr.read()
    return process, found[0]


def test_a_solve_is_shown_and_then_its_plan(tmp_path: Path) -> None:
    scenario = tmp_path / "walk.toml"
    scenario.write_text(WALK)
    process, address = started(scenario, "--json")
    told = []
    for news in events(address):
        told.append(news)
        if news["scene"] == 0:
            break
    assert told[0]["scene"] == 1 and told[0]["summary"][0]["text"].startswith("Iteration ")
    status, page = get(address)
    output, _ = process.communicate(timeout=30)
    assert status == 200 and process.returncode == 0
    assert json.loads(output) == {
        "plan": "walk.plan.npz",
        "written": "walk.view.html",
        "solved": True,
        "passed": True,
        "opened": False,
    }
    assert (tmp_path / "walk.view.html").read_text() == page and "Every law of the check holds." in page
    assert warpgait.load(tmp_path / "walk.plan.npz").solved


def test_ctrl_c_ends_the_solve(tmp_path: Path) -> None:
    scenario = tmp_path / "walk.toml"
    scenario.write_text(WALK)
    slow = ["--set", "horizon=30.0", "--set", "formulation=warped"]
    process, address = started(scenario, *slow)
    next(events(address))
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 130
    assert process.stderr is not None and "interrupted; the motion so far is written" in process.stderr.read()
    plan = warpgait.load(tmp_path / "walk.plan.npz")
    assert not plan.solved and "interrupted" in plan.meta["solver"]["status"] and not plan.passed
    assert {file.name for file in tmp_path.iterdir()} == {"walk.toml", "walk.plan.npz", "walk.view.html"}


# Starts the command as the program does, and waits for it.
PARENT = """
import os, subprocess, sys
process = subprocess.Popen(sys.argv[1:], env=dict(os.environ, WARPGAIT_PARENT=str(os.getpid())))
print(process.pid, flush=True)
process.wait()
"""


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_the_command_ends_with_the_program_that_started_it(tmp_path: Path, how: signal.Signals) -> None:
    scenario = tmp_path / "walk.toml"
    scenario.write_text(WALK)
    slow = ["--set", "horizon=60.0", "--set", "formulation=warped"]
    words = [sys.executable, "-m", "warpgait.commands.view", "--live", str(scenario), "--no-browser", *slow]
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    assert parent.stdout is not None and parent.stderr is not None
    child = int(parent.stdout.readline())
    assert "shows the solve" in parent.stderr.readline()
    parent.send_signal(how)
    assert parent.wait(10) == -how
    # The pipes end when nobody holds them any more.
    reader = threading.Thread(target=parent.stderr.read)
    reader.start()
    reader.join(10)
    alive = reader.is_alive()
    if alive:
        os.kill(child, signal.SIGKILL)
    assert not alive, "the command goes on"
    assert list(tmp_path.iterdir()) == [scenario]


# Runs a program with two of the open files as its third and fourth.
AS_3_AND_4 = """
import fcntl, os, sys
first, second = (fcntl.fcntl(int(number), fcntl.F_DUPFD, 10) for number in sys.argv[1:3])
os.dup2(first, 3)
os.dup2(second, 4)
os.execv(sys.argv[3], sys.argv[3:])
"""


class Browser:
    """Chromium, told through pipes what to do."""

    def __init__(self, folder: Path, address: str) -> None:
        commands, self._commands = os.pipe()
        self._answers, answers = os.pipe()
        words = [sys.executable, "-c", AS_3_AND_4, str(commands), str(answers), *command(folder), "--remote-debugging-pipe"]
        self._process = subprocess.Popen([*words, "about:blank"], pass_fds=(commands, answers), stderr=subprocess.DEVNULL)
        os.close(commands)
        os.close(answers)
        self._end = threading.Timer(60, self._process.kill)  # then the pipe ends, and with it every wait
        self._end.start()
        self._id, self._rest = 0, b""
        self.errors: list[Any] = []
        target = self.ask("Target.createTarget", url=address)["targetId"]
        self._session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.ask("Runtime.enable")

    def ask(self, method: str, **parameters: Any) -> Any:
        self._id += 1
        session = {"sessionId": self._session} if hasattr(self, "_session") else {}
        os.write(self._commands, json.dumps({"id": self._id, "method": method, "params": parameters} | session).encode() + b"\0")
        while True:
            while b"\0" not in self._rest:
                more = os.read(self._answers, 1 << 16)
                assert more, "Chromium has ended"
                self._rest += more
            message, _, self._rest = self._rest.partition(b"\0")
            answer = json.loads(message)
            if answer.get("method") == "Runtime.exceptionThrown":
                self.errors.append(answer)
            if answer.get("id") == self._id:
                return answer.get("result", {})

    def wait_for(self, expression: str, words: str) -> None:
        """Until the value of an expression, which a page that is just being loaded does not have, contains the words."""
        value = ""
        for _ in range(200):
            value = str(self.ask("Runtime.evaluate", expression=expression).get("result", {}).get("value"))
            if words in value:
                return
            time.sleep(0.1)
        raise AssertionError(f"{words!r} does not come; the last was {value!r}")

    def close(self) -> None:
        self._end.cancel()
        self._process.kill()
        self._process.wait()
        os.close(self._commands)
        os.close(self._answers)


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_a_browser_follows_the_iterates(
    watched: tuple[list[warpgait.Iterate], warpgait.Plan], server: Server, tmp_path: Path
) -> None:
    seen, _ = watched
    iterates = Iterates("walk")
    browser = Browser(tmp_path, server.address)
    try:
        browser.wait_for("document.body.innerText", "the motion follows")
        for at in seen:
            server.show(*iterates.shown(at))
            browser.wait_for("document.getElementById('facts')?.innerText", f"Iteration {at.iteration}: {at.stage}")
            browser.wait_for("document.getElementById('problem').hidden", "True")
        server.show(lambda: "<p>the plan", {"scene": 0}, last=True)
        browser.wait_for("document.body.innerText", "the plan")
        assert browser.errors == []
    finally:
        browser.close()
