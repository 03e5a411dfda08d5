"""`P.report.html`: the report for people, one file without outside references."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path

import numpy as np

from .metrics import Metric, filtered_forces
from .report import write_safely
from .svg import Line, chart, contact_bars
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


def _table(metrics: list[Metric]) -> str:
    rows = []
    for m in metrics:
        sign = "≥" if m.at_least else "≤"
        rows.append(
            f'<tr><td>{escape(m.name)}</td><td class="n">{m.value:.4g}</td><td class="unit">{escape(m.unit)}</td>'
            f'<td class="n">{sign} {m.passes:g}</td><td class="n">{sign} {m.marginal:g}</td><td class="{m.verdict.word}">{m.verdict.word}</td></tr>'
        )
    head = '<tr><th></th><th class="n">value</th><th></th><th class="n">pass</th><th class="n">marginal</th><th></th></tr>'
    return f'<div class="scroll"><table>{head}{"".join(rows)}</table></div>'


def _plots(v: Validation, trial: Trial) -> list[str]:
    r, ref = trial.replay, trial.reference
    K, t, end = len(trial.replay.t), trial.replay.t, v.plan.duration
    if K < 2:
        return ["<p>The replay ended before there was anything to plot.</p>"]
    contact = np.linalg.norm(r.force, axis=2) > 3.0
    forces = filtered_forces(r, ref)
    error = 1e3 * (r.com - ref.com[:K])
    parts = [contact_bars(v.index.feet, t, ref.contact[:K], contact, end)]
    limits = {m.name: (m.passes, m.marginal) for m in trial.metrics}

    def distance(title: str, unit: str, lines: list[Line], metric: str) -> str:
        return chart(title, unit, lines, limits.get(metric, ()), end)

    off = [Line(t, np.linalg.norm(error, axis=1), "actual")]
    parts.append(distance("Centre of mass: distance from plan", "mm", off, "centre of mass, max"))
    turn = [Line(t, np.degrees(np.linalg.norm(r.rotation_error, axis=1)), "actual")]
    parts.append(distance("Trunk orientation: angle from plan", "°", turn, "rotation, max"))
    apart = 1e3 * np.linalg.norm(r.foot - ref.foot[:K], axis=2)
    feet = [Line(t, apart[:, e], f"foot{e % 4}", foot) for e, foot in enumerate(v.index.feet)]
    parts.append(chart("Feet: distance from plan", "mm", feet, (), end))
    total = [
        Line(t, forces.planned[..., 2].sum(1), "planned", "planned"),
        Line(t, forces.simulated[..., 2].sum(1), "actual", "replayed"),
    ]
    parts.append(chart("Vertical force, all feet, 20 ms mean", "N", total, (), end))
    for e, foot in enumerate(v.index.feet):
        lines = [Line(t, forces.planned[:, e, 2], "planned", "planned"), Line(t, forces.simulated[:, e, 2], "actual", "replayed")]
        parts.append(chart(f"Vertical force, {foot}", "N", lines, (), end))
    for j, joint in enumerate(("HAA", "HFE", "KFE")):
        limit = float(v.index.torque_limit[:, j].max())
        lines = [Line(v.plan.t[2:-2], v.analysis.torque[2:-2, e, j], f"foot{e % 4} faint") for e in range(len(v.index.feet))]
        lines += [Line(t, r.torque[:, e, j], f"foot{e % 4}", foot) for e, foot in enumerate(v.index.feet)]
        parts.append(chart(f"Torque {joint} (faint: open loop)", "N m", lines, (-limit, limit), end))
    return parts


def render(v: Validation, pictures: list[tuple[float, bytes]], picture_note: str | None) -> str:
    """The page; `pictures` are (time s, PNG bytes)."""
    word = v.verdict.word
    sentence = {
        "pass": "The robot tracks this plan.",
        "marginal": "The robot tracks this plan, barely.",
        "fail": "The robot does not track this plan.",
    }[word]
    parts = [
        f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{escape(v.plan.path.name)}: {word}</title><style>{_STYLE}</style>",
        f'<h1>{escape(v.plan.path.name)}</h1><p class="verdict {word}">{word}. {sentence}</p>',
        f'<p class="soft">{escape(v.model_path.stem)}, {v.plan.duration:g} s, friction {v.plan.robot.friction:g}, '
        f"whole-body controller at {v.settings.rate:g} Hz; computed in {v.seconds:.1f} s.</p>",
    ]
    first = v.first_failure
    if first:
        foot = f", {first.foot}" if first.foot else ""
        parts.append(f"<p><strong>First failure</strong> at {first.time:.2f} s{escape(foot)}: {escape(first.what)}.</p>")
    parts += [f"<p>{escape(note)}</p>" for note in v.notes]
    if pictures:
        images = "".join(
            f'<figure><img alt="at {t:.1f} s" src="data:image/png;base64,{base64.b64encode(png).decode()}"><figcaption class="unit">{t:.1f} s</figcaption></figure>'
            for t, png in pictures
        )
        parts.append(f'<div class="film">{images}</div>')
    if picture_note:
        parts.append(f'<p class="soft">{escape(picture_note)}</p>')
    parts.append(f"<h2>Open loop: postures, torques, the plan's own laws</h2>{_table(v.metrics)}")
    for trial in v.trials:
        title = trial.name[0].upper() + trial.name[1:] + ("" if trial.counts else " (does not count towards the verdict)")
        parts.append(
            f'<h2>{escape(title)}: <span class="{trial.verdict.word}">{trial.verdict.word}</span></h2>{_table(trial.metrics)}'
        )
        if trial.incidents:
            items = "".join(
                f"<li>{i.time:.2f} s{', ' + escape(i.foot) if i.foot else ''}: {escape(i.what)}</li>"
                for i in sorted(trial.incidents, key=lambda i: i.time)
            )
            parts.append(f"<ul>{items}</ul>")
    name = v.shown.name[0].upper() + v.shown.name[1:]
    parts.append(f"<h2>{escape(name)}, over time in s</h2>")
    parts += _plots(v, v.shown)
    return "\n".join(parts) + "</html>\n"


def write_html(v: Validation, target: Path, pictures: list[tuple[float, bytes]], picture_note: str | None) -> None:
    """Write the page."""
    text = render(v, pictures, picture_note)
    write_safely(target, lambda file: file.write(text.encode()))
