"""Small line charts and contact bars as SVG text, light and dark by the page's style sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from .plan import Array, Bools

FAR = 4.0  # a limit so many times larger than all values would flatten them
WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 720, 190, 52, 24, 10


@dataclass(frozen=True)
class Line:
    """One curve; `style` is a class of the style sheet."""

    x: Array
    y: Array
    style: str
    label: str = ""


def _ticks(low: float, high: float, count: int = 4) -> list[float]:
    """Round numbers that span [low, high]."""
    raw = (high - low) / count
    step = 10.0 ** np.floor(np.log10(raw))
    step *= next(f for f in (1, 2, 5, 10) if f * step >= raw * 0.999)
    return [float(v) + 0.0 for v in np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step]


def _path(line: Line, sx: tuple[float, float], sy: tuple[float, float], points: int = 600) -> str:
    """The curve; where there are more samples than pixels, the least and greatest of each bin, so that no peak is lost."""
    x, y = line.x, line.y
    if len(x) > 2 * points:
        bins = np.array_split(np.arange(len(x)), points)
        keep = np.unique(np.concatenate([[b[y[b].argmin()], b[y[b].argmax()]] for b in bins]))
        x, y = x[keep], y[keep]
    ok = np.isfinite(y)
    pairs = " ".join(f"{sx[0] + sx[1] * a:.1f},{sy[0] + sy[1] * b:.1f}" for a, b in zip(x[ok], y[ok], strict=True))
    return f'<polyline class="{line.style}" points="{pairs}"/>'


def chart(title: str, unit: str, lines: Sequence[Line], limits: Sequence[float] = (), end: float | None = None) -> str:
    """A line chart over time with dashed lines at `limits`, those that are far off only in words."""
    largest = max((float(np.abs(line.y[np.isfinite(line.y)]).max(initial=0.0)) for line in lines), default=0.0)
    drawn = [v for v in limits if abs(v) <= FAR * largest]
    values = np.concatenate([line.y[np.isfinite(line.y)] for line in lines] + [np.asarray(drawn, float), [0.0]])
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-9:
        high = low + 1.0
    pad = 0.05 * (high - low)
    low, high = low - pad, high + pad
    t1 = end or max(float(line.x[-1]) for line in lines)
    width, height = WIDTH - LEFT - 8, HEIGHT - BOTTOM - TOP
    sx, sy = (LEFT, width / t1), (TOP + height * high / (high - low), -height / (high - low))
    off = ", ".join(f"{v:g}" for v in limits if v not in drawn)
    unit += f"; limits far above: {off}" if off else ""
    parts = [f'<figure><figcaption>{escape(title)} <span class="unit">{escape(unit)}</span>']
    parts += [f' <span class="key {line.style}">{escape(line.label)}</span>' for line in lines if line.label]
    parts.append(f'</figcaption><svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title)}">')
    for v in _ticks(low, high):
        y = sy[0] + sy[1] * v
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - 8}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{v:g}</text>')
    for v in _ticks(0.0, t1, 8):
        x = sx[0] + sx[1] * v
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - 6}" text-anchor="middle">{v:g}</text>')
    parts += [
        f'<line class="limit" x1="{LEFT}" x2="{WIDTH - 8}" y1="{sy[0] + sy[1] * v:.1f}" y2="{sy[0] + sy[1] * v:.1f}"/>'
        for v in drawn
    ]
    parts += [_path(line, sx, sy) for line in lines]
    return "".join(parts) + "</svg></figure>"


def _runs(flags: Bools) -> list[tuple[int, int]]:
    """First and one-past-last index of every run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def contact_bars(feet: Sequence[str], t: Array, planned: Bools, actual: Bools, end: float) -> str:
    """For every foot, planned stance above actual contact."""
    row, width = 26, WIDTH - LEFT - 8
    height = row * len(feet) + BOTTOM
    scale = width / end
    parts = [
        '<figure><figcaption>Contact <span class="key planned">planned</span> <span class="key actual">replayed</span></figcaption>',
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="Contact">',
    ]
    step = float(t[1] - t[0]) if len(t) > 1 else 0.0
    for i, foot in enumerate(feet):
        parts.append(f'<text x="{LEFT - 6}" y="{row * i + 16}" text-anchor="end">{escape(foot)}</text>')
        for flags, style, offset in ((planned[:, i], "planned", 3), (actual[:, i], "actual", 12)):
            for a, b in _runs(flags):
                x, w = LEFT + scale * t[a], scale * (t[b - 1] - t[a] + step)
                parts.append(f'<rect class="{style}" x="{x:.1f}" y="{row * i + offset}" width="{w:.1f}" height="8"/>')
    for v in _ticks(0.0, end, 8):
        parts.append(f'<text x="{LEFT + scale * v:.1f}" y="{height - 6}" text-anchor="middle">{v:g}</text>')
    return "".join(parts) + "</svg></figure>"
