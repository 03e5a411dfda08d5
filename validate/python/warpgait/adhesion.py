"""How strongly the adhesive feet stick at every moment: as much as the plan needs, and a little more for the controller."""

from __future__ import annotations

import numpy as np

from .arrays import Array, Bools, runs
from .reference import Reference

RESERVE = 0.1  # of m g, for the controller; at most the largest pull that the plan may use
BUILD_UP = 0.05  # s in which adhesion grows from nothing to its greatest strength, and in which it ends


def adhesion(reference: Reference, adhesive: Bools, friction: float, pull_limit: float, weight: float) -> Array:
    """Adhesion (K, E) N of each foot: zero in the air, and on feet that are not in `adhesive` (E,).

    It adds to the force with which a foot is pressed onto the ground. A foot whose planned force is f needs as much as keeps f inside the
    cone of the `friction` that the controller uses: |f − n (n·f)| ≤ friction (n·f + adhesion). `pull_limit` N is the largest pull of the
    plan; it bounds what is given. Adhesion is built up after touch-down and released before lift-off.
    """
    along = (reference.force * reference.normal).sum(-1)
    across = np.linalg.norm(reference.force - along[..., None] * reference.normal, axis=-1)
    most = greatest(pull_limit, weight)
    given = np.maximum(across / friction - along, 0.0) + most - pull_limit
    return np.where(adhesive, np.minimum(given, most * _envelope(reference)), 0.0)


def greatest(pull_limit: float, weight: float) -> float:
    """The greatest adhesion of a foot, N, with the reserve."""
    return pull_limit + min(RESERVE * weight, pull_limit)


def _envelope(reference: Reference) -> Array:
    """From 0 to 1 (K, E) within `BUILD_UP` after each touch-down, and back before each lift-off; zero in the air."""
    contact = reference.contact
    steps, K = BUILD_UP / float(reference.t[1]), len(contact)
    envelope = np.zeros(contact.shape)
    for e in range(contact.shape[1]):
        for first, end in runs(contact[:, e]):
            k = np.arange(first, end)
            since = (k - first + 1) / steps if first > 0 else np.ones(len(k))
            left = (end - k) / steps if end < K else np.ones(len(k))
            envelope[first:end, e] = np.minimum(np.minimum(since, left), 1.0)
    return envelope
