"""Command lines whose errors are one line that says what is allowed."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

from .console import ERROR, complain


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'given "{text}", allowed: a whole number') from None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'given "{text}", allowed: a number') from None


class Parser(argparse.ArgumentParser):
    """Options of the types `int` and `float` are whole and other numbers. An error is one line, without the usage."""

    def __init__(self, **options: Any) -> None:
        """As for `argparse`."""
        super().__init__(**options)
        self.register("type", int, _whole)
        self.register("type", float, _number)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and end the program."""
        if message.startswith("argument "):
            complain(message.removeprefix("argument "))
        else:
            complain(f"{message}; {self.prog} -- --help lists all options")
        raise SystemExit(ERROR)
