"""The site: Sphinx, with formulas as MathML, so that a page needs no network."""

from __future__ import annotations

import re
from typing import Any

import latex2mathml.converter
from docutils import nodes

project = "warpgait"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = "warpgait"
html_show_copyright = False
html_show_sphinx = False
exclude_patterns: list[str] = []
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 4
autodoc_member_order = "bysource"
autodoc_typehints = "description"
nitpicky = False
# Lists of files and examples of output, which have no language.
suppress_warnings = ["misc.highlighting_failure"]


def _mathml(latex: str, display: str) -> str:
    # \tfrac and \underline are not known there.
    plain = latex.replace(r"\tfrac", r"\frac")
    plain = re.sub(r"\\frac(\d)(\d)", r"\\frac{\1}{\2}", plain)
    return latex2mathml.converter.convert(plain, display=display)


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(_mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="math">{_mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))


html_math_renderer = "mathml"
