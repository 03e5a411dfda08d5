"""The results of a sweep as CSV, as Parquet where pyarrow is there, and as a page."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..files import write_bytes, write_text
from ..text import escape
from .pool import result_of
from .spec import Case

COLUMNS = (
    "status",
    "reason",
    "solved",
    "broken_laws",
    "binding_law",
    "binding_fraction",
    "iterations",
    "violation",
    "solver_seconds",
    "wall_seconds",
    "memory_mb",
    "verdict",
    "first_failure",
    "plan",
    "motion",
)
FILES = ("results.csv", "index.html")  # and results.parquet
Row = dict[str, Any]
_COLORS = {"solved": "#1a7f4b", "failed": "#a66a00"}
_BAD = "#c0262d"
_MOST_PICTURES = 2000  # rows that have a picture of their way
_STYLE = (
    ":root{color-scheme:light dark}body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:80rem;padding:0 1rem}"
    "table{border-collapse:collapse;font-variant-numeric:tabular-nums}th,td{text-align:left;padding:.15rem .7rem .15rem 0;border-bottom:1px solid #8884}"
    ".scroll{overflow-x:auto}.bar{display:inline-block;height:.7em;background:#1a7f4b}"
)


def rows_of(folder: Path, cases: list[Case]) -> list[Row]:
    """The cases that have a result, in order: number, name, values, and what was found."""
    rows = []
    for case in cases:
        found = result_of(folder, case)
        if found is not None:
            rows.append({"number": case.number, "case": case.name, **case.values, **{name: found.get(name) for name in COLUMNS}})
    return rows


def ways_of(folder: Path, cases: list[Case]) -> dict[str, list[list[float]]]:
    """The ways of the bases, (K, 2) in m, by the names of the cases that have one."""
    found = {case.name: (result_of(folder, case) or {}).get("path") for case in cases}
    return {name: path for name, path in found.items() if isinstance(path, list) and len(path) > 1}


def counts(rows: list[Row]) -> Counter[str]:
    """How the cases ended."""
    return Counter(row["status"] for row in rows)


def _cell(value: Any) -> Any:
    return str(value) if isinstance(value, list | dict) else value


def csv_text(rows: list[Row], columns: Iterable[str] = ("number", "case", *COLUMNS)) -> str:
    """Rows as CSV; `columns` are those of a table without rows."""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0] if rows else columns), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: _cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()


def parquet(rows: list[Row]) -> bytes | None:
    """Rows as Parquet; none without pyarrow."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        return None
    content = io.BytesIO()
    table = {key: [_cell(row[key]) for row in rows] for key in rows[0]}
    for key, column in table.items():  # a column of numbers and texts is one of texts
        if len({type(value) for value in column if value is not None} - {int, float}) and any(isinstance(v, str) for v in column):
            table[key] = [None if value is None else str(value) for value in column]
    pyarrow.parquet.write_table(pyarrow.table(table), content, compression="zstd")
    return content.getvalue()


def _fractions(rows: list[Row], key: str) -> str:
    """How many cases are solved, for each value of a key."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        value = row[key]
        groups.setdefault(f"{value:.4g}" if isinstance(value, float) else str(value), []).append(row)
    if len(groups) > 40:
        return ""
    lines = []
    for value, group in groups.items():
        good = sum(row["status"] == "solved" for row in group)
        lines.append(
            f"<tr><td>{escape(value)}</td><td>{good} of {len(group)}</td><td><span class='bar' style='width:{8 * good / len(group):.2f}rem'></span></td></tr>"
        )
    return f"<h2>{escape(key)}</h2><table>{''.join(lines)}</table>"


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "" if value is None else str(value)


def _thumbnail(path: list[list[float]]) -> str:
    """The base's way from above, start to goal, in a picture of its own size."""
    (x_min, x_max), (y_min, y_max) = ((min(axis), max(axis)) for axis in zip(*path, strict=True))
    size = max(x_max - x_min, y_max - y_min, 1e-3)
    points = [(32 + 48 * (x - 0.5 * (x_min + x_max)) / size, 20 - 32 * (y - 0.5 * (y_min + y_max)) / size) for x, y in path]
    line = " ".join(f"{x:.0f},{y:.0f}" for x, y in points)
    (x, y) = points[-1]
    return (
        f"<svg width='64' height='40' role='img' aria-label='way from above'><polyline points='{line}' fill='none' stroke='currentColor'/>"
        f"<circle cx='{x:.0f}' cy='{y:.0f}' r='2.5' fill='#1a7f4b'/></svg>"
    )


def _scatter(rows: list[Row], x: str, y: str) -> str:
    """The cases over two keys that are numbers."""
    width, height, left, bottom = 420, 300, 60, 30
    across, along = ([float(row[key]) for row in rows] for key in (x, y))
    points = list(zip(across, along, rows, strict=True))
    (x_min, x_max), (y_min, y_max) = ((min(values), max(values)) for values in (across, along))
    marks = "".join(
        f"<circle cx='{left + (width - left - 8) * (a - x_min) / (x_max - x_min or 1):.1f}' "
        f"cy='{height - bottom - (height - bottom - 8) * (b - y_min) / (y_max - y_min or 1):.1f}' r='4' fill='{_COLORS.get(row['status'], _BAD)}' "
        f"fill-opacity='.75'><title>{escape(row['status'])}: {a:.4g}, {b:.4g}</title></circle>"
        for a, b, row in points
    )
    labels = (
        f"<text x='{left}' y='{height - 12}'>{x_min:.4g}</text><text x='{width - 8}' y='{height - 12}' text-anchor='end'>{x_max:.4g}</text>"
        f"<text x='{(left + width) / 2:.0f}' y='{height - 2}' text-anchor='middle'>{escape(x)}</text><text x='2' y='14'>{y_max:.4g}</text>"
        f"<text x='2' y='{height - bottom}'>{y_min:.4g}</text><text x='2' y='{(height - bottom) / 2:.0f}'>{escape(y)}</text>"
    )
    return f"<svg width='{width}' height='{height}' font-size='11' fill='currentColor' role='img' aria-label='outcomes'>{marks}{labels}</svg>"


def _pictures(rows: list[Row], keys: list[str]) -> str:
    """Outcomes over the first pairs of keys that are numbers."""

    def varies(key: str) -> bool:
        values = {row[key] for row in rows if not isinstance(row[key], list)}
        return len(values) > 2 and all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)

    numbers = [key for key in keys if varies(key)][:3]
    drawn = [_scatter(rows, a, b) for k, a in enumerate(numbers) for b in numbers[k + 1 :]]
    return f"<h2>Outcomes</h2><p>{''.join(drawn)}</p>" if drawn else ""


def page(title: str, rows: list[Row], total: int, keys: list[str], ways: Mapping[str, list[list[float]]]) -> str:
    """The page: how the cases ended, by each value, and all of them, with the ways of the bases by case."""
    told = ", ".join(f"{count} {status}" for status, count in counts(rows).most_common()) or "no case yet"
    binding = Counter(row["binding_law"] for row in rows if row["status"] == "solved" and row["binding_law"])
    binds = ", ".join(f"{escape(law)} ({count})" for law, count in binding.most_common(8))
    verdicts = Counter(row["verdict"] for row in rows if row["verdict"])
    replayed = (
        f"<p>Replays: {', '.join(f'{count} {escape(word)}' for word, count in verdicts.most_common())}.</p>" if verdicts else ""
    )
    columns = ["status", "reason", "binding_law", "binding_fraction", "iterations", "wall_seconds", "memory_mb"]
    shown = ["number", *keys, *columns, *(["verdict"] if verdicts else [])]
    body = []
    for row in rows:
        cells = "".join(f"<td{_style(name, row)}>{escape(_shown(row[name]))}</td>" for name in shown)
        links = [("plan", row["plan"]), ("motion", row["motion"]), ("laws", f"cases/{row['case']}.json")]
        linked = " ".join(f"<a href='{escape(target)}'>{name}</a>" for name, target in links if target)
        way = _thumbnail(ways[row["case"]]) if row["case"] in ways and len(rows) <= _MOST_PICTURES else ""
        body.append(f"<tr>{cells}<td>{linked}</td><td>{way}</td></tr>")
    head = "".join(f"<th>{escape(name.replace('_', ' '))}</th>" for name in shown)
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style><h1>{escape(title)}</h1><p>{len(rows)} of {total} cases: {escape(told)}.</p>"
        f"<p>Laws that solved plans come nearest to: {binds or 'none yet'}.</p>{replayed}{_pictures(rows, keys)}{''.join(_fractions(rows, key) for key in keys)}"
        f"<h2>All cases</h2><div class='scroll'><table><tr>{head}<th></th><th></th></tr>{''.join(body)}</table></div></html>\n"
    )


def _style(name: str, row: Mapping[str, Any]) -> str:
    return f" style='color:{_COLORS.get(row['status'], _BAD)}'" if name == "status" else ""


def write(folder: Path, title: str, cases: list[Case], keys: list[str]) -> list[Path]:
    """Write the tables and the page of the cases that have a result; returns the files."""
    rows = rows_of(folder, cases)
    written = [folder / name for name in FILES]
    write_text(written[0], csv_text(rows))
    write_text(written[1], page(title, rows, len(cases), keys, ways_of(folder, cases)))
    if rows and (content := parquet(rows)) is not None:
        written.append(folder / "results.parquet")
        write_bytes(written[-1], content)
    return written
