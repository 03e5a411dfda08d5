"""The page of a plan: one self-contained HTML file."""

from __future__ import annotations

import json
import re
from importlib import resources
from pathlib import Path
from typing import Any

from ..text import escape
from .scene import scene_of

_SCRIPTS = ("math.js", "draw.js", "world.js", "timeline.js", "main.js")
_WARPED = '<figure><canvas id="warped" aria-label="The robot in the warped space"></canvas><figcaption>Warped space: the ground is a plane</figcaption></figure>'


def _asset(name: str) -> str:
    return (resources.files(__package__) / "assets" / name).read_text(encoding="utf-8")


def _subtitle(scene: dict[str, Any]) -> str:
    plan = scene["facts"]["certificate"]["plan"]
    return f"{scene['facts']['robot']}, {scene['duration']:g} s, {plan['formulation'] or 'unknown'} formulation, {plan['file']}, SHA-256 {plan['sha256'][:12]}"


def page_of(path: Path) -> str:
    """The page of a plan as text; raises `InputError` for a plan that cannot be read."""
    scene = scene_of(path)
    return page_of_scene(scene, f"{scene['name']}: a walk by warpgait", _subtitle(scene))


def page_of_scene(scene: dict[str, Any], title: str, subtitle: str, sources: str = "") -> str:
    """The page that shows a scene. `sources` is what it may load from, in the words of its content security policy."""
    # No text of the plan can end the element that holds it.
    data = json.dumps(scene, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts = {
        "title": escape(title),
        "subtitle": escape(subtitle),
        "sources": sources,
        "style": _asset("style.css"),
        "warped": _WARPED if scene["map"] else "",
        "script": "\n".join(_asset(name) for name in _SCRIPTS),
        "data": data,
    }
    return re.sub(r"\{(title|subtitle|sources|style|warped|script|data)\}", lambda found: parts[found[1]], _asset("page.html"))
