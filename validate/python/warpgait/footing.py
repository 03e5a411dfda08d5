"""Feet that meet the ground elsewhere, earlier or later than planned."""

from __future__ import annotations

import numpy as np

from .arrays import Array, Bools, runs
from .geometry import smootherstep
from .reference import Reference

# Fractions of a swing between which a contact is an edge. Before, it may be the stance, of which the controller hears late; after, the touch-down.
EDGE_WINDOW = (0.12, 0.5)
EARLY = 0.6  # fraction of a swing after which a contact is the touch-down: the foot stands


def swing_progress(reference: Reference) -> Array:
    """Fraction (K, E) of the current swing that is over; zero in stance."""
    progress: Array = np.zeros(reference.contact.shape)
    for e in range(progress.shape[1]):
        for first, end in runs(~reference.contact[:, e]):
            progress[first:end, e] = np.arange(end - first) / (end - first)
    return progress


class StepOver:
    """Lifts a foot that touches something in the first half of its swing: an edge that the plan does not know, which would hold it back.

    Where the ground is as planned, no foot touches it then, and nothing changes.
    """

    def __init__(self, reference: Reference, speed: float, limit: float) -> None:
        """`speed` m/s and `limit` m of the rise."""
        self._contact, self._progress = reference.contact, swing_progress(reference)
        self._step, self._speed, self._limit = speed * float(reference.t[1]), speed, limit
        self._met = np.zeros(reference.contact.shape[1], bool)
        self._risen = np.zeros(reference.contact.shape[1])

    def update(self, k: int, touching: Bools) -> tuple[Array, Array]:
        """Rise (E,) m of the feet's targets along the normal, and its speed (E,) m/s. It is zero again at touch-down. Call once a step."""
        s, stance = self._progress[k], self._contact[k]
        self._met = ~stance & (self._met | (touching & (s > EDGE_WINDOW[0]) & (s < EDGE_WINDOW[1])))
        rising = self._met & (self._risen < self._limit)
        self._risen = np.where(stance, 0.0, self._risen + rising * self._step)
        return (1 - smootherstep(s)) * self._risen, np.where(rising, self._speed, 0.0)


class TouchDown:
    """Feet that meet the ground earlier or later than planned, because it is higher or lower than in the plan."""

    def __init__(self, progress: Array, step: float, speed: float, limit: float) -> None:
        """`progress` (K, E): fraction of the current swing that is over; `speed` m/s and `limit` m of the search downward."""
        self._progress, self._step, self._speed, self._limit = progress, step, speed, limit
        self.early = np.zeros(progress.shape[1], bool)  # stands before the plan has it stand
        self.sought = np.zeros(progress.shape[1])  # m below the plan's foothold

    def update(self, k: int, contact: Bools, touching: Bools) -> None:
        """`contact` (E,): which feet the plan has standing at control step k. Call once a step."""
        self.early = ~contact & (self.early | (touching & (self._progress[k] > EARLY)))
        seeking = contact & ~touching
        further = np.minimum(self.sought + self._speed * self._step, self._limit)
        self.sought = np.where(seeking, further, np.where(contact, self.sought, 0.0))
