"""The tables and keys of scenarios as types. Made by scripts/scenario_types.py from the schema; what `warpgait schema` prints has the ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from .scenario import Robot
    from .surface import Terrain

Numbers: TypeAlias = Sequence[float] | npt.NDArray[np.floating[Any] | np.integer[Any]]
"""Several numbers, such as a position."""

Formulation: TypeAlias = "Literal['warped', 'direct', 'hybrid']"
"""The space in which the variables live."""

Level: TypeAlias = "Literal['easy', 'medium', 'hard']"
"""How steep a terrain of the paper is. Parameters given by name override it."""

Layout: TypeAlias = "Literal['picture', 'y-up', 'x-y', 'grid-map']"
"""Which way the indices of a heightmap a[i, j] run, i the first (the row in a file), j the second (the column)."""

GaitKind: TypeAlias = "Literal['walk', 'wave', 'trot', 'flying-trot', 'tripod', 'pace', 'bound', 'hop', 'pronk', 'stand', 'custom']"
"""`gait.kind`."""

Cone: TypeAlias = "Literal['exact', 'conformal']"
"""The form of the friction cone."""

Footholds: TypeAlias = "Literal['patches', 'anywhere']"
"""Where feet may stand."""

Law: TypeAlias = "Literal['pcdm', 'pcdm-backward', 'newton-euler']"
"""The form of the laws of motion."""

Legs: TypeAlias = "Literal['massive', 'massless']"
"""What the legs weigh in the plan."""

MapMethod: TypeAlias = "Literal['mips', 'acap-local-global', 'acap-newton', 'dirichlet', 'arap', 'shear', 'auto']"
"""The method that computes the map."""

MapScale: TypeAlias = "Literal['trace', 'determinant']"
"""The scale of the scaled rotation that J is compared with in the `acap` methods."""

Continuation: TypeAlias = "ContinuationMode | int"
"""`continuation`."""

ContinuationMode: TypeAlias = "Literal['auto', 'off']"
"""`'auto'` or `'off'`."""

Hessian: TypeAlias = "Literal['limited-memory', 'exact']"
"""Which Hessian Ipopt gets."""

LinearSolver: TypeAlias = "Literal['auto', 'faer', 'mumps']"
"""The linear solver inside Ipopt."""

Effort: TypeAlias = "Literal['feasible', 'smooth', 'optimal']"
"""When to stop."""


class RobotSpec(TypedDict, total=False):
    """`[robot]` of a scenario."""

    name: str
    """Name of a shipped robot."""
    file: str
    """A robot file instead, relative to the scenario."""
    adhesive_feet: Sequence[str]
    """Names of the feet that may pull on the ground."""


class TerrainFlatSpec(TypedDict, total=False):
    """h = 0."""

    kind: Literal["flat"]
    """As its name says."""
    extent: Numbers
    """x_min, x_max, y_min, y_max, m."""
    spacing: float
    """Spacing of the grid on which h is sampled, m."""


class TerrainRippledSpec(TypedDict, total=False):
    """h = A sin(kx) sin(ky), k = 2π/wavelength."""

    kind: Literal["rippled"]
    """As its name says."""
    level: Level
    """How steep; parameters given by name override it."""
    amplitude: float
    """A, m; default by level."""
    wavelength: float
    """2π/k, m; default by level."""
    extent: Numbers
    """x_min, x_max, y_min, y_max, m."""
    spacing: float
    """Spacing of the grid on which h is sampled, m."""


class TerrainConicSpec(TypedDict, total=False):
    """A smooth cone, h = s β softplus((ρ₀ − √(ρ² + ε²))/β), with ρ² = x² + y²."""

    kind: Literal["conic"]
    """As its name says."""
    level: Level
    """How steep; parameters given by name override it."""
    slope: float
    """s; default by level."""
    radius: float
    """ρ₀, m; default by level."""
    tip: float
    """ε, m; default by level."""
    foot: float
    """β, m; default by level."""
    extent: Numbers
    """x_min, x_max, y_min, y_max, m."""
    spacing: float
    """Spacing of the grid on which h is sampled, m."""


class TerrainHillySpec(TypedDict, total=False):
    """A Gaussian hill, h = H exp(−ρ²/(2w²))."""

    kind: Literal["hilly"]
    """As its name says."""
    level: Level
    """How steep; parameters given by name override it."""
    height: float
    """H, m; default by level."""
    width: float
    """w, m; default by level."""
    extent: Numbers
    """x_min, x_max, y_min, y_max, m."""
    spacing: float
    """Spacing of the grid on which h is sampled, m."""


class TerrainPitSpec(TypedDict, total=False):
    """A round pit with a smooth edge, h = −D/2 (1 − tanh((ρ² − ρ₀²)/(2ρ₀δ)))."""

    kind: Literal["pit"]
    """As its name says."""
    level: Level
    """How steep; parameters given by name override it."""
    depth: float
    """D, m; default by level."""
    radius: float
    """ρ₀, m; default by level."""
    edge: float
    """δ, m; default by level."""
    extent: Numbers
    """x_min, x_max, y_min, y_max, m."""
    spacing: float
    """Spacing of the grid on which h is sampled, m."""


class TerrainFormulaSpec(TypedDict, total=False):
    """An expression in x and y."""

    kind: Literal["formula"]
    """As its name says."""
    expression: str
    """h(x, y), m."""
    extent: Numbers
    """x_min, x_max, y_min, y_max, m."""
    spacing: float
    """Spacing of the grid on which h is sampled, m."""


class TerrainHeightmapSpec(TypedDict, total=False):
    """Heights in a file: an image, an array, a grid, a mesh."""

    kind: Literal["heightmap"]
    """As its name says."""
    file: str
    """The file, relative to the scenario; `docs/inputs.md` lists the formats."""
    member: str
    """What to take from a file with several members: an array of an `.npz`, an `<hfield>` of an MJCF file. Default: the only one."""
    layout: Layout
    """Which way the indices run. Default: what the file tells; `picture` for images, `.npy` and text."""
    spacing: float
    """Distance between neighboring cells, m; default: that of the file. Required if the file tells none."""
    height_scale: float
    """Image: height from black to white, m; required. Integers: height of one unit, m; required. Floats: factor that converts to m;
    default 1."""
    no_data: float | Numbers
    """Values, as stored in the file, that stand for no data; in addition to NaN and to what the file tells."""
    smoothing: float
    """Standard deviation of the smoothing, m; at most 50 cells. Default with `contact.footholds = 'patches'`: 0; else 1.5 cells, but at
    least 0.03 and at most 0.06 m."""
    origin: Numbers
    """x, y of the center of the file, m; default: what the file tells, else 0, 0."""
    extent: Numbers
    """x_min, x_max, y_min, y_max of the part to use, m; default: all of the file."""

TerrainSpec: TypeAlias = "TerrainFlatSpec | TerrainRippledSpec | TerrainConicSpec | TerrainHillySpec | TerrainPitSpec | TerrainFormulaSpec | TerrainHeightmapSpec"
"""`[terrain]`: the ground, by `kind`."""


class StartSpec(TypedDict, total=False):
    """`[start]`."""

    position: Numbers
    """x, y of the base, m."""
    yaw: float
    """Heading, rad; default: toward the goal."""
    plan: str
    """A plan to go on from, relative to the scenario: sets `position`, `yaw` and `state`."""
    time: float
    """When that plan is left, s; default: at its end."""
    state: StartState
    """What else is given of the start; default: a standing pose at rest."""


class StartState(TypedDict, total=False):
    """`[start.state]`: all in the world frame."""

    height: float
    """Height of the center of mass, z, m."""
    tilt: Numbers
    """Roll and pitch, rad."""
    velocity: Numbers
    """Of the center of mass, m/s."""
    angular_velocity: Numbers
    """rad/s."""
    acceleration: Numbers
    """Of the center of mass, m/s²."""
    angular_acceleration: Numbers
    """rad/s²."""
    feet: Sequence[Numbers]
    """Where each foot is, in the robot's order, m."""
    swings: Sequence[Numbers]
    """By foot, for how long it has been in the air and when it lands, s; 0 and 0 for one that stands. Default: all stand, unless
    `gait.phases` begin with a swing."""
    feet_velocity: Sequence[Numbers]
    """Velocity of each foot, m/s, which counts for those in the air; default: free."""
    forces: Sequence[Numbers]
    """The force of the ground on each foot, in the robot's order, N."""


class GoalSpec(TypedDict, total=False):
    """`[goal]`."""

    position: Numbers
    """x, y of the base at the end, m; a hard constraint."""
    yaw: float
    """Heading at the end, rad; if given, a hard constraint."""
    height: float
    """Height of the center of mass above the mean of the feet at the end, m; if given, a hard constraint."""
    turns: int
    """Whole turns to the left (negative: to the right), in addition to the shortest turn to `yaw`, or to the heading at the start."""
    velocity: Numbers
    """Velocity of the base at the end along x and y, m/s; default: at rest."""
    speed: float
    """Mean speed along the way, m/s, from which the horizon follows where that is not given."""
    circle: CircleSpec
    """The way is an arc."""
    detours: bool
    """Whether the way may lead around what cannot be walked, where that blocks the straight one."""
    waypoints: Sequence[WaypointSpec]
    """Where the way leads, in order."""
    waypoint_distance: float
    """How near the base passes a way-point without a time, m."""


class CircleSpec(TypedDict, total=False):
    """`goal.circle`: the way is an arc around a center, from the start to the goal."""

    center: Numbers
    """x, y, m."""
    turns: float
    """How often the base goes around the center, to the left (negative: to the right); default: the shorter arc to the goal, or once."""


class WaypointSpec(TypedDict, total=False):
    """`[[goal.waypoints]]`."""

    position: Numbers
    """x, y of the base, m. Without a time it is passed within `goal.waypoint_distance`, in order."""
    yaw: float
    """Heading there, rad; with a time a hard constraint, else the way turns to it."""
    height: float
    """Height of the center of mass above the mean of the feet, m; only with a time."""
    time: float
    """When the base is there, s; a hard constraint."""


class GaitSpec(TypedDict, total=False):
    """`[gait]`."""

    kind: GaitKind
    """The pattern."""
    cycle: float
    """Duration of a cycle, s; default: the robot's (anymal_c 1.2), or 1 if it has none; for a walk over smooth ground 1.25 times that;
    for walk and wave a quarter of it for each foot; with flight from the robot's height."""
    duty: float
    """Fraction of the cycle that a foot stands; default for four feet: walk over smooth ground 5/6, over patches and wave 0.75; trot,
    tripod, pace and bound 0.6, flying-trot 0.4, hop and pronk 0.55 (on one foot 0.65)."""
    periodic: bool
    """Whether the motion is cyclic: its end is its start, shifted to the goal and turned by the goal's yaw, with nothing at rest, so
    that it can be repeated. As many cycles as fill the horizon."""
    optimize_durations: bool
    """Whether the phase durations are variables."""
    duration_bounds: Numbers
    """Shortest and longest phase duration, s."""
    sequence: Sequence[SectionSpec]
    """Gaits one after the other, instead of `kind`, `cycle` and `duty`."""
    phases: Sequence[Numbers]
    """custom: for each foot, alternating stance and swing durations in s, stance first; they sum to the horizon. A first or last stance
    of 0 s is none: the foot begins or ends in the air."""


class SectionSpec(TypedDict, total=False):
    """A section of `[[gait.sequence]]`."""

    kind: GaitKind
    """The pattern; not `custom`."""
    duration: float
    """How long it lasts, s; sections without a duration share what the others leave of the horizon."""
    cycle: float
    """As `gait.cycle`."""
    duty: float
    """As `gait.duty`."""


class MotionSpec(TypedDict, total=False):
    """`[motion]`."""

    swing_clearance: float
    """Lowest allowed apex of a swing above the ground, m."""
    base_clearance: float
    """Smallest allowed distance of the torso's underside from the ground, m."""
    force_limit: float
    """Largest normal force on a foot, in units of m g."""
    pull_limit: float
    """Largest pull of an adhesive foot, in units of m g."""
    smoothness: Numbers
    """Weights of base acceleration and force rate."""


class PostureSpec(TypedDict, total=False):
    """`[posture]`: within which limits the torso stays, as `[least, greatest]`."""

    height: Numbers
    """Height of the center of mass above the mean of the feet, m."""
    roll: Numbers
    """Roll against the horizontal, rad; positive to the right."""
    pitch: Numbers
    """Pitch against the horizontal, rad; positive nose down."""


class PayloadSpec(TypedDict, total=False):
    """`[payload]`: a mass fixed to the trunk."""

    mass: float
    """kg."""
    position: Numbers
    """Its place, base frame, m from the center of mass of the robot without it at the nominal stance."""

ForceSpec = TypedDict("ForceSpec", {"vector": "Numbers", "from": "float", "until": "float", "ramp": "float", "point": "Numbers"}, total=False)
"""`[[force]]`: a force on the trunk for some time."""


class KeepOutSpec(TypedDict, total=False):
    """`[[keep_out]]`."""

    polygon: Sequence[Numbers]
    """Its corners in order around it, x and y, m; it need not be convex."""
    mask: str
    """Instead of a polygon, a raster of what is kept free, relative to the scenario: an image (PNG), whose pixels from half of white on
    count, or an array (`.npy`) of numbers or booleans, whose elements other than zero do. The first row has the largest y."""
    extent: Numbers
    """mask: the ground that it covers, from edge to edge: x_min, x_max, y_min, y_max, m; default: the terrain's extent."""
    outlines: Sequence[Sequence[Numbers]]
    """What a mask becomes: loops around its parts, and around holes in them, x and y, m."""


class FootholdSpec(TypedDict, total=False):
    """`[[foothold]]`: where a foot stands once."""

    foot: str
    """Name of the foot."""
    step: int
    """Which of its steps leads there, from 1; 0 is where it stands at the start."""
    time: float
    """Or a time at which it stands there, s."""
    position: Numbers
    """x, y, m."""


class GuessSpec(TypedDict, total=False):
    """`[guess]`."""

    file: str
    """A motion of base and feet, relative to the scenario: a CSV with the columns of `warpgait export --to csv`, or a plan. Its gait
    should be that of the scenario."""


class ContactSpec(TypedDict, total=False):
    """`[contact]`."""

    friction: float
    """Coefficient of friction ν."""
    friction_margin: float
    """Fraction of ν that the plan leaves to the controller and to slippery spots: forces stay within (1 − margin) ν."""
    cone: Cone
    """The form of the friction cone."""
    footholds: Footholds
    """Where feet may stand; default: patches on a heightmap, anywhere on a terrain that is a function."""
    on_known_ground: bool
    """Feet stand on measured ground only, not where a scan has no data and the ground is a guess. With `footholds = 'anywhere'` this is
    checked, not planned for."""
    max_slope: float
    """Largest slope |∇h| at a foothold; default: no limit."""
    edge_margin: float
    """With `max_slope`: how far a foothold must stay from steeper ground, m."""


class PhysicsSpec(TypedDict, total=False):
    """`[physics]`."""

    law: Law
    """The form of the laws of motion."""
    legs: Legs
    """What the legs weigh; by default massive where the robot's file has the masses of their links and feet may stand anywhere. With
    flight, by default, massless if no motion is found with massive ones."""


class DiscretizationSpec(TypedDict, total=False):
    """`[discretization]`."""

    base_knots: int
    """Distance between the knots of the base's spline, in time steps. More than 1 leaves fewer unknowns per row of physics."""
    force_knots: int
    """Distance between the nodes of the forces, in time steps."""


class MapSpec(TypedDict, total=False):
    """`[map]`."""

    method: MapMethod
    """The method."""
    scale: MapScale
    """acap-local-global, acap-newton: the scale."""
    cells: Numbers
    """Cells along x, y, z. Default: 48, 48, 16 over a square. Over an oblong, about as many cells, each about square. Twice as many
    along x and y where the curvature of the terrain needs them."""
    thickness: float
    """Height of the box, m."""
    torso_weight: float
    """Weight of the energy well above the ground, where the torso is, relative to its weight at the ground. More makes the map gentler
    there and less conformal at the ground. (dirichlet weights all heights alike; shear has no energy.)"""


class SolverSpec(TypedDict, total=False):
    """`[solver]`."""

    max_iterations: int
    """Limit on the iterations, including those of a continuation."""
    tolerance: float
    """Largest violation, in the units of the NLP."""
    continuation: Continuation
    """Whether to grow the terrain out of the plane if the plain solve fails."""
    hessian: Hessian
    """Which Hessian; default: exact if there is a cost, limited-memory otherwise."""
    hessian_memory: int
    """Number of steps that the limited-memory Hessian remembers."""
    linear_solver: LinearSolver
    """Which linear solver Ipopt uses."""
    effort: Effort
    """When to stop."""
    explain: bool
    """Whether to find out which limits would have to give when no motion is found."""
    threads: int
    """Threads that evaluate the derivatives of the NLP; the linear solver uses one."""


class ScenarioTables(TypedDict, total=False):
    """The keyword arguments of `Scenario`."""

    schema: int
    """Version of this format: 1."""
    formulation: Formulation
    """The space in which the variables live; default: hybrid where feet stand on patches or the motion starts or ends moving, else
    warped."""
    horizon: float
    """Duration of the motion T, s."""
    time_step: float
    """Time between two samples of the constraints Δt, s."""
    robot: RobotSpec | Robot | str
    """The robot."""
    terrain: TerrainSpec | Terrain
    """The ground."""
    start: StartSpec | Numbers
    """Where the motion starts."""
    goal: GoalSpec | Numbers
    """Where the motion ends."""
    gait: GaitSpec | GaitKind
    """Order and timing of the feet."""
    motion: MotionSpec
    """Clearances, limits of force and weights of smoothness."""
    posture: PostureSpec
    """Limits of the torso's height and tilt."""
    payload: PayloadSpec
    """A mass on the trunk."""
    force: Sequence[ForceSpec]
    """Forces on the trunk."""
    keep_out: Sequence[KeepOutSpec]
    """Where no foot may stand."""
    foothold: Sequence[FootholdSpec]
    """Footholds whose place is given."""
    guess: GuessSpec
    """A motion to start the solve from."""
    contact: ContactSpec
    """Friction and footholds."""
    physics: PhysicsSpec
    """The form of the laws of motion."""
    discretization: DiscretizationSpec
    """How finely the motion is discretized."""
    map: MapSpec
    """How the map φ is computed."""
    solver: SolverSpec
    """How the NLP is solved."""
