"""The licenses of what a wheel contains that others wrote: shared libraries of Debian's, and crates that are linked into the compiled part.

wheel_licenses.py WHEEL FOLDER          collects them; the wheel is that of maturin, before auditwheel
wheel_licenses.py --add FOLDER WHEEL    puts them into the wheel, where its metadata are
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from zipfile import ZipFile

# The libraries that every Linux has, and which auditwheel leaves where they are.
SYSTEM = ("linux-vdso", "ld-linux", "libc.", "libm.", "libgcc_s.", "libstdc++.", "libz.")
NAMES = re.compile(r"(LICEN[CS]E|COPYING|COPYRIGHT|NOTICE|UNLICENSE)", re.IGNORECASE)
PACKAGE = "warpgait-python"


def _output(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def _package(library: Path) -> str:
    """The Debian package that a library is from; the folders of its path may be links."""
    for path in (library, Path("/usr") / library.relative_to("/"), library.resolve()):
        found = subprocess.run(["dpkg", "-S", str(path)], capture_output=True, text=True, check=False)
        if found.returncode == 0:
            return found.stdout.split(":")[0]
    raise SystemExit(f"error: {library}: no Debian package has this library, so its license is not known")


def libraries(wheel: Path, folder: Path) -> None:
    """A file for each Debian package with libraries that the compiled part needs."""
    with tempfile.TemporaryDirectory() as place, ZipFile(wheel) as archive:
        compiled = [name for name in archive.namelist() if name.endswith(".so")]
        if len(compiled) != 1:
            raise SystemExit(f"error: {wheel}: expected one compiled file, found {compiled}")
        lines = _output("ldd", archive.extract(compiled[0], place)).splitlines()
    packages: dict[str, list[str]] = {}
    for line in lines:
        name, _, path = line.strip().partition(" => ")
        if not name.startswith(SYSTEM) and not Path(name).name.startswith(SYSTEM):
            packages.setdefault(_package(Path(path.split()[0])), []).append(name)
    for package, names in sorted(packages.items()):
        text = (Path("/usr/share/doc") / package / "copyright").read_text(encoding="utf-8", errors="replace")
        # Debian's copyright files name these texts instead of having them.
        for common in sorted(set(re.findall(r"/usr/share/common-licenses/([A-Za-z0-9.-]*[A-Za-z0-9])", text))):
            text += f"\n\n{'-' * 80}\n{common}\n\n{Path('/usr/share/common-licenses', common).read_text(encoding='utf-8', errors='replace')}"
        version = _output("dpkg-query", "-W", "-f", "${source:Package} ${source:Version}", package)
        head = f"{', '.join(sorted(names))}: from Debian's package {package}, made of the source package {version}\n\n"
        (folder / f"{package}.txt").write_text(head + text, encoding="utf-8")
        print(package, *names)


def crates(folder: Path) -> None:
    """One file with the licenses of every crate that is compiled into the wheel."""
    platform = re.search(r"host: (.*)", _output("rustc", "-vV"))
    assert platform
    found = json.loads(_output("cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", platform[1]))
    packages = {package["id"]: package for package in found["packages"]}
    nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
    waiting = [package["id"] for package in found["packages"] if package["name"] == PACKAGE]
    linked: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in linked:
            linked.add(name)
            waiting += [dep["pkg"] for dep in nodes[name]["deps"] if any(kind["kind"] is None for kind in dep["dep_kinds"])]
    texts: dict[str, list[str]] = {}
    for package in sorted((packages[name] for name in linked), key=lambda each: each["name"]):
        if package["source"] is None:
            continue
        title = f"{package['name']} {package['version']} ({package['license']})"
        files = [
            path for path in sorted(Path(package["manifest_path"]).parent.iterdir()) if path.is_file() and NAMES.match(path.name)
        ]
        if not files:  # its license is one of those of the others
            texts.setdefault("", []).append(title)
        for path in files:
            texts.setdefault(path.read_text(encoding="utf-8", errors="replace").strip(), []).append(title)
    parts = [f"{chr(10).join(titles)}\n\n{text}\n" for text, titles in sorted(texts.items(), key=lambda each: each[1])]
    (folder / "rust-crates.txt").write_text(f"\n{'=' * 80}\n".join(parts), encoding="utf-8")
    print(len(linked), "crates")


def add(folder: Path, wheel: Path) -> None:
    """Put the files of a folder, and this project's licenses, into a wheel."""
    with tempfile.TemporaryDirectory() as place:
        subprocess.run([sys.executable, "-m", "wheel", "unpack", str(wheel), "-d", place], check=True)
        (unpacked,) = Path(place).iterdir()
        (metadata,) = unpacked.glob("*.dist-info")
        target = metadata / "licenses"
        target.mkdir(exist_ok=True)
        for source in [*sorted(folder.iterdir()), *sorted(Path().glob("LICENSE-*"))]:
            shutil.copy(source, target / source.name)
        wheel.unlink()
        subprocess.run([sys.executable, "-m", "wheel", "pack", str(unpacked), "-d", str(wheel.parent)], check=True)
    if not wheel.is_file():
        raise SystemExit(f"error: {wheel}: packing gave it another name")


def main(words: list[str]) -> None:
    """Run the command."""
    if len(words) == 3 and words[0] == "--add":
        add(Path(words[1]), Path(words[2]))
        return
    wheel, folder = map(Path, words)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    libraries(wheel, folder)
    crates(folder)


if __name__ == "__main__":
    main(sys.argv[1:])
