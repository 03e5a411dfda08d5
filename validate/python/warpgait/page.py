"""`P.report.html`: the report for people, one self-contained file."""

from __future__ import annotations

import base64
import math
import re
from pathlib import Path

import numpy as np

from . import criteria
from .criteria import Criterion, Metric, Verdict
from .files import write_text
from .metrics import FORCE_WINDOW, filtered_forces
from .model import Indices
from .svg import Line, chart, contact_bars
from .text import escape
from .validation import Trial, Validation

_STYLE = """
:root{color-scheme:light dark;--ink:#1c2330;--paper:#fff;--soft:#667;--line:#d8dce4;--plan:#2f6fde;--real:#d9641e;--pass:#1a7f4b;--marginal:#a66a00;--fail:#c0262d;--foot0:#2f6fde;--foot1:#d9641e;--foot2:#1a8a5f;--foot3:#9b3fc4}
@media(prefers-color-scheme:dark){:root{--ink:#e6e9f0;--paper:#14171d;--soft:#9aa3b2;--line:#2c323d;--plan:#6ea0ff;--real:#ff9a57;--pass:#4cc98a;--marginal:#e0a83a;--fail:#ff6b6f;--foot0:#6ea0ff;--foot1:#ff9a57;--foot2:#4cc98a;--foot3:#cf8bf0}}
body{font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:60rem;margin:2rem auto;padding:0 1rem}
h1{font-size:1.5rem;margin:0}h2{font-size:1.1rem;margin:2rem 0 .5rem}.soft,.unit{color:var(--soft)}
.verdict{font-size:1.25rem;font-weight:600}.pass{color:var(--pass)}.marginal{color:var(--marginal)}.fail{color:var(--fail)}
.scroll{overflow-x:auto}table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{text-align:left;padding:.2rem .6rem .2rem 0;border-bottom:1px solid var(--line);white-space:nowrap}td.n{text-align:right}
figure{margin:1rem 0}figcaption{font-weight:600}svg{width:100%;height:auto}svg text{font-size:11px;fill:var(--soft)}
.grid{stroke:var(--line)}.limit{stroke:var(--fail);stroke-dasharray:4 3}polyline{fill:none;stroke-width:1.4;stroke:var(--real)}
polyline.planned{stroke:var(--plan)}rect.planned{fill:var(--plan)}rect.actual{fill:var(--real)}.key{font-weight:400;margin-left:.8rem}
.key.planned{color:var(--plan)}.key.actual{color:var(--real)}.faint{opacity:.4}
polyline.foot0{stroke:var(--foot0)}polyline.foot1{stroke:var(--foot1)}polyline.foot2{stroke:var(--foot2)}polyline.foot3{stroke:var(--foot3)}
.key.foot0{color:var(--foot0)}.key.foot1{color:var(--foot1)}.key.foot2{color:var(--foot2)}.key.foot3{color:var(--foot3)}
.film{display:grid;grid-template-columns:repeat(auto-fill,minmax(16rem,1fr));gap:.5rem}.film img{width:100%;border-radius:4px}
"""


_COLORS = 4  # of feet in the style sheet

_SENTENCES = {
    "pass": "The robot tracks this plan.",
    "marginal": "The robot tracks this plan, barely.",
    "fail": "The robot does not track this plan.",
}


def _title(name: str) -> str:
    """A name with a capital letter, as HTML."""
    return escape(name[0].upper() + name[1:])


def _table(metrics: list[Metric]) -> str:
    rows = []
    for m in metrics:
        c, word = m.criterion, m.verdict.word
        rows.append(
            f'<tr><td>{escape(c.name)}</td><td class="n">{m.value:.4g}</td><td class="unit">{escape(c.unit)}</td>'
            f'<td class="n">{c.sign} {c.passes:g}</td><td class="n">{c.sign} {c.marginal:g}</td><td class="{word}">{word}</td></tr>'
        )
    head = '<tr><th></th><th class="n">value</th><th></th><th class="n">pass</th><th class="n">marginal</th><th></th></tr>'
    return f'<div class="scroll"><table>{head}{"".join(rows)}</table></div>'


def _limits(criterion: Criterion) -> tuple[float, float]:
    return criterion.passes, criterion.marginal


def _plots(v: Validation, trial: Trial) -> list[str]:
    """Charts of a trial over time."""
    r, ref, t, end = trial.replay, trial.reference, trial.replay.t, v.plan.duration
    K, feet = len(t), list(enumerate(v.index.feet))
    if K < 2:
        return ["<p>The replay ended before there was anything to plot.</p>"]
    com = [Line(t, np.linalg.norm(1e3 * (r.com - ref.com[:K]), axis=1), "actual")]
    turn = [Line(t, np.degrees(np.linalg.norm(r.rotation_error, axis=1)), "actual")]
    apart = 1e3 * np.linalg.norm(r.foot - ref.foot[:K], axis=2)
    distances = [Line(t, apart[:, e], f"foot{e % _COLORS}", foot) for e, foot in feet]
    parts = [
        contact_bars(v.index.feet, t, ref.contact[:K], r.contact, end),
        chart("Center of mass: distance from plan", "mm", com, _limits(criteria.COM_MAX.for_size(v.index.size)), end),
        chart("Trunk orientation: angle from plan", "°", turn, _limits(criteria.ROTATION_MAX), end),
        chart("Feet: distance from plan", "mm", distances, (), end),
    ]
    forces = filtered_forces(r, ref)
    planned, simulated = forces.planned[..., 2], forces.simulated[..., 2]
    total = [Line(t, planned.sum(1), "planned", "planned"), Line(t, simulated.sum(1), "actual", "replayed")]
    parts.append(chart(f"Vertical force, all feet, {1e3 * FORCE_WINDOW:g} ms mean", "N", total, (), end))
    for e, foot in feet:
        lines = [Line(t, planned[:, e], "planned", "planned"), Line(t, simulated[:, e], "actual", "replayed")]
        parts.append(chart(f"Vertical force, {foot}", "N", lines, (), end))
    known = slice(2, -2)  # the open loop has no accelerations at the ends
    for j in range(v.index.torque_limit.shape[1]):
        joint = joint_title(v.index, j)
        limit = float(v.index.torque_limit[:, j].max())
        lines = [Line(v.plan.t[known], v.analysis.torque[known, e, j], f"foot{e % _COLORS} faint") for e, _ in feet]
        lines += [Line(t, r.torque[:, e, j], f"foot{e % _COLORS}", foot) for e, foot in feet]
        parts.append(chart(f"Torque {joint} (faint: open loop)", "N m", lines, (-limit, limit), end))
    return parts


def joint_title(index: Indices, j: int) -> str:
    """What the names of the joints number `j` of all legs have in common, such as HFE; or its number."""
    names = [joints[j] for joints in index.joints_of]
    words = [set(re.split(r"[_\-\s]+", name)) for name in names]
    common = [word for word in re.split(r"[_\-\s]+", names[0]) if all(word in other for other in words) and word != "joint"]
    return " ".join(common) if len(names) > 1 and common else f"of joint {j + 1}"


def _head(v: Validation) -> list[str]:
    """Title, verdict, first failure and notes."""
    word, name = v.verdict.word, escape(v.plan.path.name)
    parts = [
        f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{name}: {word}</title><style>{_STYLE}</style>",
        f'<h1>{name}</h1><p class="verdict {word}">{word}. {_SENTENCES[word]}</p>',
        f'<p class="soft">{escape(v.model_path.stem)}, {v.plan.duration:g} s, friction {v.plan.robot.friction:g}, '
        f"whole-body controller at {v.settings.rate:g} Hz; computed in {v.seconds:.1f} s.</p>",
    ]
    if v.first_failure:
        word = "Fails" if v.verdict is Verdict.FAIL else "Marginal"
        parts.append(f"<p><strong>{word}:</strong> {escape(str(v.first_failure))}.</p>")
    return parts + [f"<p>{escape(note)}</p>" for note in v.notes]


def _film(pictures: list[tuple[float, bytes]]) -> str:
    """The pictures, inside the page."""
    images = "".join(
        f'<figure><img alt="at {t:.1f} s" src="data:image/png;base64,{base64.b64encode(png).decode()}"><figcaption class="unit">{t:.1f} s</figcaption></figure>'
        for t, png in pictures
    )
    return f'<div class="film">{images}</div>'


def _trial(trial: Trial) -> list[str]:
    """Verdict, metrics and incidents of a trial."""
    title, word = _title(trial.name), trial.verdict.word
    parts = [f'<h2>{title}: <span class="{word}">{word}</span></h2>{_table(trial.metrics)}']
    if trial.incidents:
        items = "".join(f"<li>{escape(str(i))}</li>" for i in sorted(trial.incidents, key=lambda i: i.time or 0.0))
        parts.append(f"<ul>{items}</ul>")
    return parts


def _figures(v: Validation) -> list[str]:
    """Figures by which walks are compared."""
    rows = [
        f'<tr><td>{escape(f.name)}</td><td class="n">{f.value:.3g}</td><td class="unit">{escape(f.unit)}</td></tr>'
        for f in v.figures
        if math.isfinite(f.value)
    ]
    table = f'<div class="scroll"><table>{"".join(rows)}</table></div>'
    return [f"<h2>Figures of the replay</h2>{table}"] if rows else []


def _worlds(v: Validation) -> list[str]:
    """The worlds that differ from the plan's: which are tracked, and the metric that comes closest to its wider limit."""
    if not v.attempts:
        return []
    word = max(m.verdict for m in v.robust_metrics).word
    rows = []
    for a in v.attempts:
        c, tracked = a.worst.criterion, ("pass", "yes") if a.tracked else ("fail", "no")
        rows.append(
            f'<tr><td>{escape(a.world)}</td><td class="{tracked[0]}">{tracked[1]}</td><td>{escape(c.name)}</td>'
            f'<td class="n">{a.worst.value:.4g}</td><td class="unit">{escape(c.unit)}</td><td class="n">{c.sign} {c.marginal:g}</td></tr>'
        )
    head = (
        '<tr><th></th><th>tracked</th><th>closest to its limit</th><th class="n">value</th><th></th><th class="n">limit</th></tr>'
    )
    table = f'<div class="scroll"><table>{head}{"".join(rows)}</table></div>'
    return [f'<h2>Worlds that differ from the plan\'s: <span class="{word}">{word}</span></h2>{_table(v.robust_metrics)}{table}']


def as_html(v: Validation, pictures: list[tuple[float, bytes]], picture_note: str | None) -> str:
    """The page; `pictures` are (time s, PNG bytes)."""
    parts = _head(v)
    if pictures:
        parts.append(_film(pictures))
    if picture_note:
        parts.append(f'<p class="soft">{escape(picture_note)}</p>')
    if v.laws.metrics:
        broken = [m for m in v.laws.metrics if m.verdict.value]
        what = _table(broken) if broken else f"<p>All {len(v.laws.metrics)} laws of <code>warpgait check</code> hold.</p>"
        parts.append(f"<h2>Check</h2>{what}")
    parts.append(f"<h2>Open loop: postures, torques, the plan's own laws</h2>{_table(v.metrics)}")
    for trial in v.trials:
        parts += _trial(trial)
    parts += _worlds(v)
    parts += _figures(v)
    parts.append(f"<h2>{_title(v.shown.name)}, over time in s</h2>")
    parts += _plots(v, v.shown)
    return "\n".join(parts) + "</html>\n"


def write_html(v: Validation, target: Path, pictures: list[tuple[float, bytes]], picture_note: str | None) -> None:
    """Write the page."""
    write_text(target, as_html(v, pictures, picture_note))
