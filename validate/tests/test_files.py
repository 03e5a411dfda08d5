"""Outputs: never over an input, a device or each other, whole or not at all; and what is left behind is cleared."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from warpgait.errors import InputError
from warpgait.files import ensure_outputs, replacing, write_text
from warpgait.text import escape, is_name, visible


def test_a_file_keeps_its_mode_and_a_link_stays_a_link(tmp_path: Path) -> None:
    private, link = tmp_path / "private", tmp_path / "link"
    private.write_text("old")
    private.chmod(0o600)
    link.symlink_to("private")
    write_text(link, "new")
    assert private.read_text() == "new" and link.is_symlink() and stat.S_IMODE(private.stat().st_mode) == 0o600
    (tmp_path / "dangling").symlink_to("made")
    write_text(tmp_path / "dangling", "made")
    assert (tmp_path / "made").read_text() == "made"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dangling", "link", "made", "private"]


def test_what_is_no_writable_file_is_refused(tmp_path: Path) -> None:
    fixed, pipe, null = tmp_path / "fixed", tmp_path / "pipe", tmp_path / "null"
    fixed.write_text("old")
    fixed.chmod(0o444)
    os.mkfifo(pipe)
    null.symlink_to("/dev/null")
    (tmp_path / "circle").symlink_to("circle")
    for path, what in (
        (fixed, "read-only"),
        (pipe, "a pipe"),
        (null, "a device"),
        (tmp_path, "a folder"),
        (tmp_path / "none" / "file", "there is no folder"),
        (tmp_path / "circle", "ymbolic links"),
        (tmp_path / ("n" * 300), "too long"),
    ):
        with pytest.raises(InputError, match=what):
            write_text(path, "new")
        with pytest.raises(InputError, match=what):
            ensure_outputs([path], [])
    assert fixed.read_text() == "old"


def test_outputs_replace_neither_inputs_nor_each_other(tmp_path: Path) -> None:
    read, link, hard = tmp_path / "read", tmp_path / "link", tmp_path / "hard"
    read.write_text("kept")
    link.symlink_to("read")
    hard.hardlink_to(read)
    (tmp_path / "sub").mkdir()
    for path in (read, link, hard, tmp_path / "sub" / ".." / "read"):
        with pytest.raises(InputError, match="which this command reads"):
            ensure_outputs([path], [read])
    with pytest.raises(InputError, match="as well"):
        ensure_outputs([tmp_path / "a", tmp_path / "sub" / ".." / "a"], [read])
    ensure_outputs([tmp_path / "a", tmp_path / "b"], [read, tmp_path / "none"])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["hard", "link", "read", "sub"]


def test_what_a_killed_run_left_is_cleared_and_nothing_else(tmp_path: Path) -> None:
    left, other = tmp_path / ".warpgait-0123456789abcdef.part", tmp_path / ".warpgait-0123.part"
    left.write_text("left")
    other.write_text("another's")
    with replacing(tmp_path / "slow") as temporary:
        temporary.write_text("slow")
        # Also another process sees that this one is still at work.
        code = f"from pathlib import Path; from warpgait.files import write_text; write_text(Path({str(tmp_path / 'quick')!r}), 'quick')"
        subprocess.run([sys.executable, "-c", code], check=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == [other.name, "quick", "slow"]
    with pytest.raises(RuntimeError), replacing(tmp_path / "slow") as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert (tmp_path / "slow").read_text() == "slow"


def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    code = (
        "import resource, signal; from pathlib import Path; from warpgait.files import write_text\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        f"write_text(Path({str(tmp_path / 'file')!r}), 'x' * 2000)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "file: cannot be written: File too large; nothing was replaced" in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["file"] and (tmp_path / "file").read_text() == "old"


def test_texts_of_others_do_not_act() -> None:
    assert visible("fuß\x1b[2J\n\u202e") == "fuß\\x1b[2J\\n\\u202e"
    assert escape("<b>\x07") == "&lt;b&gt;\\x07"
    assert is_name("anymal_c") and is_name("My robot 2")
    for name in ("", ".", "..", "../anymal_c", "/tmp/x", "a/b", "a\\b", "C:x", "a\nb", "n" * 101):
        assert not is_name(name)
