"""The results of a sweep as CSV, as Parquet where pyarrow is there, and as a page."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping
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
    "plan",
)
FILES = ("results.csv", "index.html")  # and results.parquet
Row = dict[str, Any]
_COLORS = {"solved": "#1a7f4b", "failed": "#a66a00"}
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


def counts(rows: list[Row]) -> Counter[str]:
    """How the cases ended."""
    return Counter(row["status"] for row in rows)


def _cell(value: Any) -> Any:
    return str(value) if isinstance(value, list | dict) else value


def _csv(rows: list[Row]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]) if rows else ["number", "case", *COLUMNS], lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: _cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()


def _parquet(rows: list[Row]) -> bytes | None:
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


def page(title: str, rows: list[Row], total: int, keys: list[str]) -> str:
    """The page: how the cases ended, by each value, and all of them."""
    told = ", ".join(f"{count} {status}" for status, count in counts(rows).most_common()) or "no case yet"
    binding = Counter(row["binding_law"] for row in rows if row["status"] == "solved" and row["binding_law"])
    binds = ", ".join(f"{escape(law)} ({count})" for law, count in binding.most_common(8))
    shown = ["number", *keys, "status", "reason", "binding_law", "binding_fraction", "iterations", "wall_seconds", "memory_mb"]
    body = []
    for row in rows:
        cells = "".join(f"<td{_style(name, row)}>{escape(_shown(row[name]))}</td>" for name in shown)
        link = f"<a href='{escape(row['plan'])}'>plan</a>" if row["plan"] else ""
        body.append(f"<tr>{cells}<td>{link}</td></tr>")
    head = "".join(f"<th>{escape(name.replace('_', ' '))}</th>" for name in shown)
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style><h1>{escape(title)}</h1><p>{len(rows)} of {total} cases: {escape(told)}.</p>"
        f"<p>Laws that solved plans come nearest to: {binds or 'none yet'}.</p>{''.join(_fractions(rows, key) for key in keys)}"
        f"<h2>All cases</h2><div class='scroll'><table><tr>{head}<th></th></tr>{''.join(body)}</table></div></html>\n"
    )


def _style(name: str, row: Mapping[str, Any]) -> str:
    return f" style='color:{_COLORS.get(row['status'], '#c0262d')}'" if name == "status" else ""


def write(folder: Path, title: str, cases: list[Case], keys: list[str]) -> list[Path]:
    """Write the tables and the page of the cases that have a result; returns the files."""
    rows = rows_of(folder, cases)
    written = [folder / name for name in FILES]
    write_text(written[0], _csv(rows))
    write_text(written[1], page(title, rows, len(cases), keys))
    if rows and (content := _parquet(rows)) is not None:
        written.append(folder / "results.parquet")
        write_bytes(written[-1], content)
    return written
