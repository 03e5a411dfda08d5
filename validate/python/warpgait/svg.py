"""Small line charts and contact bars as SVG text. The page's style sheet has the colors, light and dark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools, runs
from .text import escape

FAR = 4.0  # a limit above all values by more than this factor would flatten them; the title names it instead
POINTS = 600  # bins of a curve, about as many as the chart has pixels
VALUE_TICKS, TIME_TICKS = 4, 8  # about so many

# Pixels.
WIDTH, HEIGHT = 720, 190
LEFT, RIGHT, TOP, BOTTOM = 52, 8, 10, 24  # margins around a chart
PLOT_WIDTH = WIDTH - LEFT - RIGHT
BAR_ROW, BAR_HEIGHT = 26, 8  # a foot's row in the contact chart, and one bar in it
PLANNED_BAR, ACTUAL_BAR = 3, 12  # from the top of the row


@dataclass(frozen=True)
class Line:
    """One curve; `style` is a class of the style sheet."""

    x: Array
    y: Array
    style: str
    label: str = ""


@dataclass(frozen=True)
class _Axis:
    """From values to pixels."""

    low: float
    high: float
    start: float  # pixel of `low`
    length: float  # pixels from `low` to `high`; negative upward

    def at(self, value: float) -> float:
        """The pixel of a value."""
        return self.start + self.length * (value - self.low) / (self.high - self.low)

    def ticks(self, count: int) -> list[float]:
        """Round numbers in the range, about `count`."""
        raw = (self.high - self.low) / count
        step = 10.0 ** np.floor(np.log10(raw))
        step *= next(f for f in (1, 2, 5, 10) if f * step >= raw * 0.999)
        first, last = np.ceil(self.low / step - 1e-9), np.floor(self.high / step + 1e-9)
        return [float(v) + 0.0 for v in np.arange(first, last + 1) * step]  # + 0.0: no negative zero


def _polyline(line: Line, x_axis: _Axis, y_axis: _Axis) -> str:
    """The curve. Where there are more samples than pixels, the least and the greatest of each bin, so that no peak is lost."""
    x, y = line.x, line.y
    if len(x) > 2 * POINTS:
        bins = np.array_split(np.arange(len(x)), POINTS)
        keep = np.unique(np.concatenate([[b[y[b].argmin()], b[y[b].argmax()]] for b in bins]))
        x, y = x[keep], y[keep]
    ok = np.isfinite(y)
    pairs = " ".join(f"{x_axis.at(a):.1f},{y_axis.at(b):.1f}" for a, b in zip(x[ok], y[ok], strict=True))
    return f'<polyline class="{line.style}" points="{pairs}"/>'


def _level(style: str, y: float) -> str:
    """A horizontal line across the chart."""
    return f'<line class="{style}" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'


def _row_label(y: float, text: str) -> str:
    """A label to the left of the chart."""
    return f'<text x="{LEFT - 6}" y="{y:g}" text-anchor="end">{escape(text)}</text>'


def _time_labels(axis: _Axis, height: int) -> list[str]:
    """Labels below a chart of `height` pixels."""
    labels = ((axis.at(v), f"{v:g}") for v in axis.ticks(TIME_TICKS))
    return [f'<text x="{x:.1f}" y="{height - 6}" text-anchor="middle">{text}</text>' for x, text in labels]


def _figure(title: str, unit: str, keys: Sequence[tuple[str, str]], height: int, parts: Sequence[str]) -> str:
    """A captioned figure; `keys` are (style, label) of its legend."""
    words = escape(title) + (f' <span class="unit">{escape(unit)}</span>' if unit else "")
    legend = "".join(f' <span class="key {style}">{escape(label)}</span>' for style, label in keys if label)
    svg = f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(title)}">{"".join(parts)}</svg>'
    return f"<figure><figcaption>{words}{legend}</figcaption>{svg}</figure>"


def chart(title: str, unit: str, lines: Sequence[Line], limits: Sequence[float], end: float) -> str:
    """A line chart over time, 0 to `end` s, with dashed lines at `limits`. The title names those that are far above the values."""
    finite = [line.y[np.isfinite(line.y)] for line in lines]
    largest = max((float(np.abs(y).max(initial=0.0)) for y in finite), default=0.0)
    drawn = [v for v in limits if abs(v) <= FAR * largest]
    values = np.concatenate([*finite, np.asarray(drawn, float), [0.0]])
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-9:  # a constant
        high = low + 1.0
    pad = 0.05 * (high - low)
    x_axis = _Axis(0.0, end, LEFT, PLOT_WIDTH)
    plot_height = HEIGHT - BOTTOM - TOP
    y_axis = _Axis(low - pad, high + pad, TOP + plot_height, -plot_height)
    far = ", ".join(f"{v:g}" for v in limits if v not in drawn)
    parts = []
    for v in y_axis.ticks(VALUE_TICKS):
        y = y_axis.at(v)
        parts += [_level("grid", y), _row_label(round(y + 4, 1), f"{v:g}")]
    parts += _time_labels(x_axis, HEIGHT)
    parts += [_level("limit", y_axis.at(v)) for v in drawn]
    parts += [_polyline(line, x_axis, y_axis) for line in lines]
    keys = [(line.style, line.label) for line in lines]
    return _figure(title, unit + (f"; limits far above: {far}" if far else ""), keys, HEIGHT, parts)


def contact_bars(feet: Sequence[str], t: Array, planned: Bools, actual: Bools, end: float) -> str:
    """For every foot, planned stance above actual contact, (K, E), at times `t` (K,) of 0 to `end` s."""
    height = BAR_ROW * len(feet) + BOTTOM
    axis = _Axis(0.0, end, LEFT, PLOT_WIDTH)
    step = float(t[1] - t[0]) if len(t) > 1 else 0.0
    parts = []
    for e, foot in enumerate(feet):
        top = BAR_ROW * e
        parts.append(_row_label(top + 16, foot))
        for flags, style, offset in ((planned[:, e], "planned", PLANNED_BAR), (actual[:, e], "actual", ACTUAL_BAR)):
            for first, last in runs(flags):
                x, width = axis.at(t[first]), axis.at(t[last - 1] + step) - axis.at(t[first])
                parts.append(f'<rect class="{style}" x="{x:.1f}" y="{top + offset}" width="{width:.1f}" height="{BAR_HEIGHT}"/>')
    parts += _time_labels(axis, height)
    return _figure("Contact", "", [("planned", "planned"), ("actual", "replayed")], height, parts)
