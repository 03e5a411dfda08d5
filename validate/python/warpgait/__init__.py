"""Reads, checks and replays the gait plans of warpgait on full robot models in MuJoCo."""

from .errors import InputError

__all__ = ["InputError"]
