"""Errors that a user can act on."""


class InputError(ValueError):
    """Something given to warpgait cannot be used; the message says what, where, and what to do."""
