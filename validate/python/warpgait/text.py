"""Text from files and arguments, made safe to show: on a terminal, and in pages."""

from __future__ import annotations

import html
import unicodedata

_LONGEST = 2000  # characters; longer texts are cut
_LONGEST_NAME = 100  # characters, of a robot
_ACTIVE = {"Cc", "Cf", "Cs", "Zl", "Zp"}  # categories: control and format characters, surrogates, ends of lines and paragraphs


def visible(text: object) -> str:
    """A text on one line: what a terminal would obey is shown as an escape such as `\\x1b`, and a very long text is cut."""
    plain = str(text)
    cut = plain[:_LONGEST] + ("…" if len(plain) > _LONGEST else "")
    return "".join(c.encode("unicode_escape").decode() if unicodedata.category(c) in _ACTIVE else c for c in cut)


def escape(text: object) -> str:
    """A text for HTML and SVG."""
    return html.escape(visible(text))


def is_name(text: str) -> bool:
    """Whether a text can be the name of a robot. Names become names of files, and must not lead to others."""
    plain = visible(text) == text and not any(c in text for c in "/\\:")
    return plain and text != "" and not text.startswith(".") and len(text) <= _LONGEST_NAME
