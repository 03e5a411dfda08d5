"""Where on a ground a robot can start, in which direction, and with which gait: a sweep over places, headings and gaits, and its map."""

from __future__ import annotations

import base64
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..files import write_bytes, write_text
from ..scenario import Scenario
from ..surface import Terrain
from ..text import escape
from . import results
from .run import Progress, SweepResult
from .run import run as run_sweep
from .spec import Sweep
from .worker import FAILED, KILLED, REFUSED, SOLVED, TIMED_OUT

_MOST_CASES = 200_000
_LEAST_STEP = 0.02  # m
_PIXELS = 640  # of the longer side of a map
_MARGIN = 8  # pixels around it
_SHADES = 240  # heights along the longer side of the shaded ground
_VERDICTS = {SOLVED: "#1a9850", FAILED: "#f08c00", REFUSED: "#8a8f98", TIMED_OUT: "#7b3fa0", KILLED: "#111111"}
_LAWS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2", "#bcbd22", "#7f7f7f")
COLUMNS = ("x", "y", "heading", "gait", *(name for name in results.COLUMNS if name != "plan"))


@dataclass(frozen=True)
class Atlas:
    """What was found: a row for each place, heading and gait."""

    terrain: Terrain
    sweep: SweepResult
    rows: list[dict[str, Any]]  # x, y m; heading rad; gait; and the columns of a sweep
    step: float  # m between places
    written: list[Path]

    def fraction(self) -> float:
        """The fraction of the cases that are solved."""
        return self.sweep.counts.get(SOLVED, 0) / max(len(self.rows), 1)

    def __repr__(self) -> str:
        """How many cases ended in which way."""
        return (
            f"<warpgait.Atlas: {self.sweep.total} cases: {', '.join(f'{n} {status}' for status, n in self.sweep.counts.items())}>"
        )

    def _repr_html_(self) -> str:
        """The maps for notebooks."""
        return "".join(maps(self))


def places(terrain: Terrain, step: float) -> list[tuple[float, float]]:
    """The middles of squares of `step` m that cover the ground."""
    x_min, x_max, y_min, y_max = terrain.extent
    counts = [max(int((high - low) / step + 1e-9), 1) for low, high in ((x_min, x_max), (y_min, y_max))]
    middle = 0.5 * (x_min + x_max), 0.5 * (y_min + y_max)
    along = [[m + step * (k - 0.5 * (n - 1)) for k in range(n)] for m, n in zip(middle, counts, strict=True)]
    return [(x, y) for y in along[1] for x in along[0]]


def listed(
    starts: Sequence[tuple[float, float]], headings: int, gaits: Sequence[str], distance: float
) -> Iterator[dict[str, Any]]:
    """The values of every case: from a place straight ahead."""
    for x, y in starts:
        for k in range(headings):
            yaw = math.remainder(2 * math.pi * k / headings, 2 * math.pi)
            goal = [round(x + distance * math.cos(yaw), 6), round(y + distance * math.sin(yaw), 6)]
            for gait in gaits:
                yield {
                    "start.position": [round(x, 6), round(y, 6)],
                    "start.yaw": round(yaw, 6),
                    "goal.position": goal,
                    "gait.kind": gait,
                }


def atlas(
    terrain: Terrain | Scenario | str | Path,
    robot: str | None = None,
    *,
    folder: str | Path,
    step: float = 0.5,
    headings: int = 8,
    gaits: Sequence[str] = ("walk",),
    distance: float = 0.6,
    horizon: float | None = None,
    time_limit: float = 60.0,
    memory_limit: float = 2.0,
    keep_plans: bool = False,
    workers: int | None = None,
    scheduler: Any = None,
    again: bool = False,
    begin: Callable[[int, int], object] | None = None,
    progress: Progress | None = None,
) -> Atlas:
    """Plan from places `step` m apart all over a ground, `distance` m straight ahead in `headings` directions, with each of the gaits.

    `terrain` is a `Terrain`, the file of a heightmap that needs nothing more, or a `Scenario`, whose other values are kept. The horizon is
    the scenario's, or 4 s for 0.6 m and in proportion. Results are in `folder`: atlas.svg, atlas.csv, atlas.parquet and index.html; what is
    there is not planned again. Raises `InputError`.
    """
    if not (isinstance(step, int | float) and math.isfinite(step) and step >= _LEAST_STEP):
        raise InputError(f"--step {step}: expected at least {_LEAST_STEP:g}, m")
    if not 1 <= headings <= 360:
        raise InputError(f"--headings {headings}: expected from 1 to 360")
    if not (math.isfinite(distance) and 0.05 <= distance <= 100.0):
        raise InputError(f"--distance {distance}: expected from 0.05 to 100, m")
    if not gaits:
        raise InputError("--gaits: expected at least one")
    if isinstance(terrain, Scenario):
        base = terrain
    else:
        ground = terrain if isinstance(terrain, Terrain) else Terrain.file(terrain)
        base = Scenario(terrain=ground, start=(0.0, 0.0), goal=(0.0, 0.0))
    if robot is not None:
        base = base.set("robot.name", robot)
    if horizon is not None or "horizon" not in base.to_dict():
        base = base.set("horizon", horizon if horizon is not None else round(4.0 * max(distance / 0.6, 0.5), 2))
    surface = ground if not isinstance(terrain, Scenario) else base.terrain
    starts = places(surface, step)
    if len(starts) * headings * len(gaits) > _MOST_CASES:
        raise InputError(
            f"--step {step:g}: {len(starts)} places, {headings} headings and {len(gaits)} gaits are more than {_MOST_CASES} cases"
        )
    sweep = Sweep(
        scenario=base,
        inputs=(),
        kind="listed",
        listed=tuple(listed(starts, headings, gaits, distance)),
        time_limit=time_limit,
        memory_limit=memory_limit,
        keep_plans=keep_plans,
    )
    found = run_sweep(
        sweep,
        Path(folder),
        title="An atlas",
        workers=workers,
        scheduler=scheduler,
        again=again,
        one_first=True,
        begin=begin,
        progress=progress,
    )
    return _write(surface, found, step)


def _row(row: dict[str, Any]) -> dict[str, Any]:
    x, y = row["start.position"]
    named = {"x": x, "y": y, "heading": row["start.yaw"], "gait": row["gait.kind"]}
    return named | {name: row[name] for name in COLUMNS[4:]}


def _write(terrain: Terrain, found: SweepResult, step: float) -> Atlas:
    rows = [_row(row) for row in found.rows]
    folder = found.folder
    made = Atlas(terrain, found, rows, step, written=[folder / "atlas.svg", folder / "atlas.csv"])
    write_text(made.written[0], _stacked(maps(made)))
    write_text(made.written[1], results.csv_text(rows, COLUMNS))
    if rows and (content := results.parquet(rows)) is not None:
        made.written.append(folder / "atlas.parquet")
        write_bytes(made.written[-1], content)
    page = folder / "index.html"
    text = page.read_text(encoding="utf-8")
    write_text(page, text.replace("<h2>", f"<h2>Map</h2><div class='scroll'>{''.join(maps(made))}</div><h2>", 1))
    made.written.append(page)
    return made


# ---- The maps -------------------------------------------------------------------------------------------------------


def _shaded(terrain: Terrain) -> str:
    """The ground from above, lit from the upper left, as a PNG for an SVG."""
    from ..render import png

    x_min, x_max, y_min, y_max = terrain.extent
    scale = _SHADES / max(x_max - x_min, y_max - y_min)
    columns, rows = (max(round(scale * (high - low)), 2) for low, high in ((x_min, x_max), (y_min, y_max)))
    places = np.stack(np.meshgrid(np.linspace(x_min, x_max, columns), np.linspace(y_max, y_min, rows)), axis=-1)
    light = terrain.normal(places) @ (np.array([-1.0, 1.0, 2.0]) / math.sqrt(6.0))
    heights = terrain.height(places)
    relative = (heights - heights.min()) / max(float(np.ptp(heights)), 1e-9)
    grey = np.clip(255 * (0.45 + 0.35 * light + 0.2 * relative), 0, 255).astype(np.uint8)
    return base64.b64encode(png(np.repeat(grey[..., None], 3, axis=-1))).decode()


def _wedge(x: float, y: float, yaw: float, half: float, radius: float) -> str:
    """A sector around a heading; pixels, y down."""
    if half >= math.pi:
        return f"M{x - radius:.1f} {y:.1f}a{radius:.1f} {radius:.1f} 0 1 0 {2 * radius:.1f} 0a{radius:.1f} {radius:.1f} 0 1 0 {-2 * radius:.1f} 0z"
    ends = [(x + radius * math.cos(yaw + s * half), y - radius * math.sin(yaw + s * half)) for s in (-1, 1)]
    (ax, ay), (bx, by) = ends
    return f"M{x:.1f} {y:.1f}L{ax:.1f} {ay:.1f}A{radius:.1f} {radius:.1f} 0 {int(half > math.pi / 2)} 0 {bx:.1f} {by:.1f}z"


def _status(row: dict[str, Any]) -> str | None:
    return str(row["status"])


def _law(row: dict[str, Any]) -> str | None:
    """The law that a solved motion comes nearest to, or the first that a failed one breaks."""
    if row["status"] == FAILED and row["broken_laws"]:
        return f"{str(row['broken_laws']).split()[0]}, broken"
    return row["binding_law"] if row["status"] == SOLVED else None


def _binding_colors(rows: list[dict[str, Any]]) -> dict[str, str]:
    """Colors of the laws that bind, the most frequent first."""
    counted = Counter(law for row in rows if (law := _law(row)))
    return dict(zip((law for law, _ in counted.most_common()), _LAWS, strict=False))


def maps(found: Atlas) -> list[str]:
    """For each gait a map by verdict and one by the law that binds, as SVG."""
    x_min, x_max, y_min, y_max = found.terrain.extent
    scale = _PIXELS / max(x_max - x_min, y_max - y_min)
    width, height = scale * (x_max - x_min), scale * (y_max - y_min)
    shaded, laws = _shaded(found.terrain), _binding_colors(found.rows)
    drawn = []
    for gait in dict.fromkeys(row["gait"] for row in found.rows):
        rows = [row for row in found.rows if row["gait"] == gait]
        half = math.pi / max(len({row["heading"] for row in rows}), 1)
        for title, colors, of in (("verdict", _VERDICTS, _status), ("law that binds", laws, _law)):
            shapes: dict[str, list[str]] = {}
            for row in rows:
                if (name := of(row)) and (color := colors.get(name)):
                    at = _MARGIN + scale * (row["x"] - x_min), _MARGIN + scale * (y_max - row["y"])
                    shapes.setdefault(color, []).append(_wedge(*at, row["heading"], 0.9 * half, 0.45 * scale * found.step))
            paths = "".join(f'<path d="{"".join(d)}" fill="{color}" fill-opacity="0.85"/>' for color, d in shapes.items())
            used = [(name, color) for name, color in colors.items() if color in shapes]
            legend = "".join(
                f'<rect x="{_MARGIN + 210 * (k % 3)}" y="{height + 38 + 18 * (k // 3):.0f}" width="11" height="11" fill="{color}"/>'
                f'<text x="{_MARGIN + 16 + 210 * (k % 3)}" y="{height + 48 + 18 * (k // 3):.0f}">{escape(name)}</text>'
                for k, (name, color) in enumerate(used)
            )
            full = max(width, 630) + 2 * _MARGIN, height + 62 + 18 * ((len(used) + 2) // 3)
            drawn.append(
                f'<svg xmlns="http://www.w3.org/2000/svg" width="{full[0]:.0f}" height="{full[1]:.0f}" viewBox="0 0 {full[0]:.0f} {full[1]:.0f}" '
                f'font-family="system-ui,sans-serif" font-size="12" fill="#444">'
                f'<image x="{_MARGIN}" y="{_MARGIN}" width="{width:.1f}" height="{height:.1f}" preserveAspectRatio="none" href="data:image/png;base64,{shaded}"/>'
                f'{paths}<text x="{_MARGIN}" y="{height + 28:.0f}" font-size="14">{escape(gait)}: {title}; x {x_min:g} to {x_max:g} m, y {y_min:g} to {y_max:g} m</text>{legend}</svg>'
            )
    return drawn


def _stacked(drawings: list[str]) -> str:
    """Several drawings below one another, as one."""
    placed, top, widest = [], 0.0, 0.0
    for drawing in drawings:
        head = drawing[: drawing.index(">")]
        width, height = (float(head.split(f'{name}="')[1].split('"')[0]) for name in ("width", "height"))
        placed.append(drawing.replace("<svg ", f'<svg y="{top:.0f}" ', 1))
        top, widest = top + height, max(widest, width)
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{widest:.0f}" height="{top:.0f}">{"".join(placed)}</svg>\n'
