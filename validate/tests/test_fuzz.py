"""Mutated plans: each is read or refused with an `InputError`, within 5 s and 500 MB.

By default a few hundred, the same every time. A long run: `WARPGAIT_FUZZ=100000 pytest tests/test_fuzz.py`. `tests/fuzz` does the same for the
readers in Rust. Plans that fail are kept in the folder that the message names.
"""

import os
import random
import re
import resource
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

from conftest import WALK

import warpgait
from warpgait.errors import InputError
from warpgait.plan import read_plan
from warpgait.viewer.page import page_of

COUNT = int(os.environ.get("WARPGAIT_FUZZ", "400"))
MOST_SECONDS, MOST_MEMORY = 5.0, 500_000_000
WORDS = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-308",
    "NaN",
    "Infinity",
    "99999999999999999999",
    "4294967296",
    "null",
    "true",
    "[]",
    "{}",
    "[",
    "{",
    "(",
    ")",
    "}",
    "]",
    ",",
    ":",
    "'",
    '"',
    "\\",
    "é",
    "\x1b[2J",
]
NUMBER = re.compile(rb"-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?")


def _change(rng: random.Random, content: bytes, others: list[bytes]) -> bytes:
    """One change: of a bit, a byte, a number in text, or a piece."""
    at = rng.randrange(len(content) + 1)
    end = min(len(content), at + rng.randrange(1 << rng.randrange(1, 12)))
    word = rng.choice(WORDS).encode() * rng.choice([1, 1, 1, 1, 100, 3000])
    match rng.randrange(9):
        case 0 if at < len(content):
            return content[:at] + bytes([content[at] ^ 1 << rng.randrange(8)]) + content[at + 1 :]
        case 1:
            return content[:at]
        case 2:
            return content[:at] + content[end:]
        case 3:
            return content[:at] + content[at : at + 64] * rng.choice([2, 100, 3000]) + content[at:]
        case 4:
            other = rng.choice(others)
            start = rng.randrange(len(other) + 1)
            return content[:at] + other[start : start + rng.randrange(256)] + content[end:]
        case 5:
            return content[:at] + rng.randbytes(8) + content[at + 8 :]
        case 6:
            return content[:at] + word + content[at:]
        case _:
            found = NUMBER.search(content, at) or NUMBER.search(content)
            return content if found is None else content[: found.start()] + word + content[found.end() :]


def _mutated(rng: random.Random, members: dict[str, bytes]) -> dict[str, bytes]:
    """One to three changes of members: of their bytes, or another's bytes, another name, or none."""
    members, everything = dict(members), list(members.values())
    for _ in range(rng.randrange(1, 4)):
        name = rng.choice(list(members) or ["t.npy"])
        match rng.randrange(10):
            case 0:
                members.pop(name, None)
            case 1:
                members[name] = rng.choice(everything)
            case 2:
                members[rng.choice(list(members) or ["t.npy"]) + "x"] = members.pop(name, b"")
            # The text of meta has the most places for mistakes.
            case 3 | 4 | 5 if "meta.npy" in members:
                old = members["meta.npy"][128:].decode("utf-32-le", "ignore").encode()
                text = _change(rng, old, [old]).decode("utf-8", "ignore")
                members["meta.npy"] = _text(text.replace("\0", "") or "0")
            case _:
                members[name] = _change(rng, members.get(name, b"0"), everything)
    return members


def _text(text: str) -> bytes:
    """A `.npy` file with one string."""
    head = f"{{'descr': '<U{len(text)}', 'fortran_order': False, 'shape': (), }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + text.encode("utf-32-le", "surrogatepass")


def _fuzz(source: Path, folder: Path, count: int, read: Callable[[Path], object], most_seconds: float = MOST_SECONDS) -> None:
    """Give `read` mutations of a plan: it reads them, or refuses them with an error that names the file."""
    with zipfile.ZipFile(source) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    whole, failures, accepted, slowest = source.read_bytes(), [], 0, 0.0
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in range(count):
        rng = random.Random(number)
        path = folder / "mutated.plan.npz"
        if rng.randrange(4) == 0:
            path.write_bytes(_change(rng, whole, [whole]))
        else:
            with zipfile.ZipFile(path, "w") as archive:
                for name, content in _mutated(rng, members).items():
                    archive.writestr(name, content)
        start = time.perf_counter()
        why = ""
        try:
            read(path)
            accepted += 1
        except InputError as error:
            assert str(path) in str(error)
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
        seconds = time.perf_counter() - start
        slowest = max(slowest, seconds)
        memory = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
        before += memory // 1024
        if why or seconds > most_seconds or memory > MOST_MEMORY:
            kept = path.rename(folder / f"{number}.plan.npz")
            failures.append(f"{kept}: {why or f'{seconds:.1f} s, {memory / 1e6:.0f} MB'}")
    print(f"plans: {count} inputs, {accepted} accepted, {len(failures)} failures, slowest {slowest:.2f} s")
    assert not failures, "\n".join(failures[:20])
    assert accepted < count


def test_mutated_plans_are_read_or_refused(standing_plan: Path, tmp_path: Path) -> None:
    _fuzz(standing_plan, tmp_path, COUNT, read_plan)


def test_mutated_plans_are_shown_or_refused(tmp_path: Path) -> None:
    """With joint angles, the map, and everything else that a page shows."""
    plan = tmp_path / "walk.plan.npz"
    warpgait.solve(WALK, overrides={"formulation": "warped", "horizon": 2.0}).save(plan)
    _fuzz(plan, tmp_path, COUNT // 2, page_of, most_seconds=30.0)
