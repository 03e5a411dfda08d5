"""What a replay is judged by: every criterion with its limits. `README.md` has the figures from which the limits were chosen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum


class Verdict(IntEnum):
    """In order, so that the worst is the largest."""

    PASS = 0
    MARGINAL = 1
    FAIL = 2

    @property
    def word(self) -> str:
        """pass, marginal or fail."""
        return self.name.lower()


@dataclass(frozen=True)
class Criterion:
    """A metric passes up to `passes`, is marginal up to `marginal`, and fails beyond it."""

    name: str
    unit: str
    passes: float
    marginal: float
    at_least: bool = False  # the limits are lower bounds

    @property
    def sign(self) -> str:
        """≤, or ≥ where the limits are lower bounds."""
        return "≥" if self.at_least else "≤"

    def for_size(self, size: float) -> Criterion:
        """The same for a robot of a size in ANYmals: distances are proportional to it."""
        return replace(self, passes=size * self.passes, marginal=size * self.marginal) if self.unit == "mm" else self

    def judge(self, value: float) -> Verdict:
        """NaN fails."""
        sign = -1 if self.at_least else 1
        if sign * value <= sign * self.passes:
            return Verdict.PASS
        return Verdict.MARGINAL if sign * value <= sign * self.marginal else Verdict.FAIL


@dataclass(frozen=True)
class Metric:
    """One line of the report."""

    layer: str  # check, open loop, or the name of a replay
    criterion: Criterion
    value: float
    time: float | None = None  # s, when it was worst, or first beyond all limits
    foot: str | None = None  # which one, if it is about one
    what: str = ""  # what happened, where the name of the metric does not say enough

    @property
    def name(self) -> str:
        """The criterion's name."""
        return self.criterion.name

    @property
    def verdict(self) -> Verdict:
        """The criterion's verdict on the value."""
        return self.criterion.judge(self.value)

    @property
    def reason(self) -> str:
        """What is wrong, for people, without verdict, time and foot."""
        c = self.criterion
        words = f"{self.layer}: {self.what}" if self.what else f"{self.layer}: {c.name}"
        unit = f" {c.unit}" if c.unit else ""
        return f"{words}: {self.value:.3g}{unit}, passes {c.sign} {c.passes:g}"

    def __str__(self) -> str:
        """Verdict, name, value and limit, for people."""
        c = self.criterion
        return f"{self.verdict.word}: {self.layer}: {c.name} {self.value:.3g} {c.unit} (pass {c.sign} {c.passes:g})"


LEVER = 0.3
"""m. Torques are judged as fractions of m g times this length."""

# Open loop.
UNREACHABLE = Criterion("postures out of reach", "", 0, 0)
BEYOND_LIMITS = Criterion("postures past a joint limit", "", 0, 0)
IN_GROUND = Criterion("postures with other parts in the ground", "", 0, 0)
COLLISIONS = Criterion("legs that hit each other or the trunk", "postures", 0, 0)
PLAN_FORCE = Criterion("plan: unexplained force, rms", "% m g", 0.5, 5)
PLAN_FORCE_MAX = Criterion("plan: unexplained force, max", "% m g", 3, 10)
PLAN_TORQUE = Criterion("plan: unexplained torque, rms", f"% m g·{LEVER:g} m", 0.5, 5)
PLAN_TORQUE_MAX = Criterion("plan: unexplained torque, max", f"% m g·{LEVER:g} m", 3, 10)
BODY_FORCE = Criterion("full body: unexplained force, rms", "m g", 0.05, 0.20)
BODY_FORCE_MAX = Criterion("full body: unexplained force, max", "m g", 0.10, 0.40)
BODY_TORQUE = Criterion("full body: unexplained torque, rms", f"m g·{LEVER:g} m", 0.10, 0.20)
BODY_TORQUE_MAX = Criterion("full body: unexplained torque, max", f"m g·{LEVER:g} m", 0.6, 1.0)
PEAK_TORQUE = Criterion("peak joint torque", "of limit", 0.9, 1.0)
PEAK_SPEED = Criterion("peak joint speed", "of limit", 0.9, 1.0)
PEAK_POWER = Criterion("peak joint power", "of limit", 0.9, 1.0)

# Closed loop.
FALL = Criterion("fall", "", 0, 0)
STRAY_CONTACTS = Criterion("contacts other than feet", "samples", 0, 0)
NO_SOLUTION = Criterion("controller without solution", "% of steps", 0, 1)
COM_RMS = Criterion("center of mass, rms", "mm", 7, 40)
COM_MAX = Criterion("center of mass, max", "mm", 20, 100)
ROTATION_RMS = Criterion("rotation, rms", "°", 1, 3)
ROTATION_MAX = Criterion("rotation, max", "°", 3, 8)
FEET_RMS = Criterion("feet, rms", "mm", 5, 25)
FEET_WORST = Criterion("worst step of a foot, rms", "mm", 20, 60)
SLIP = Criterion("slip per step", "mm", 3, 10)
SLIP_WORST = Criterion("slip in the worst stance", "mm", 10, 30)
CONTACT_MISMATCH = Criterion("contact mismatch", "% of samples", 1.0, 4)
CONTACT_WORST = Criterion("contact mismatch, worst step", "ms", 60, 150)
REPLAY_SPEED = Criterion("peak joint speed, replayed", "of limit", 1.0, 1.1)
REPLAY_POWER = Criterion("peak joint power, replayed", "of limit", 1.0, 1.1)
SATURATION = Criterion("torque at its limit", "% of samples", 0.5, 6)
FOOT_FORCES = Criterion("foot forces, rms", "m g", 0.08, 0.15)
NET_FORCE = Criterion("net force, rms", "m g", 0.07, 0.15)
FORCE_CORRELATION = Criterion("vertical force, correlation", "", 0.98, 0.95, at_least=True)

# In worlds that differ from the plan's. One is tracked if no metric of its replay is beyond the limit for marginal.
WORLDS = Criterion("worlds that are tracked", "%", 90, 75, at_least=True)
