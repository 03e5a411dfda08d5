"""Grounds for scenarios from arrays: the `.npz` files that `terrain.file` names."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .errors import InputError
from .files import write_bytes

if TYPE_CHECKING:
    from .plan import Heightfield

LAYOUTS = ("picture", "y-up", "x-y", "grid-map")
_MOST_CELLS = 4096 * 4096
_SQUARE = 1e-6  # of the spacing, by which a cell may differ from a square


def write_heightfield(path: Path, ground: Heightfield) -> None:
    """Write the ground of a plan as a file that `terrain.file` can name, `layout` y-up. Its cells must be squares; raises `InputError`."""
    if abs(ground.spacing[0] - ground.spacing[1]) > _SQUARE * ground.spacing[0]:
        raise InputError(
            f"{path}: the cells of the ground are {ground.spacing[0]:g} m by {ground.spacing[1]:g} m; a file of heights has squares"
        )
    center = ground.origin + 0.5 * ground.spacing * (np.array(ground.heights.shape)[::-1] - 1)
    place = float(center[0]), float(center[1])
    write_terrain(path, ground.heights, spacing=float(ground.spacing[0]), layout="y-up", origin=place)


def write_terrain(
    path: str | Path,
    heights: npt.ArrayLike,
    *,
    spacing: float,
    height_scale: float | None = None,
    layout: str = "picture",
    origin: tuple[float, float] = (0.0, 0.0),
) -> None:
    """Write a ground that a scenario can name: `kind = "heightmap"`, `file = "NAME.npz"`.

    `heights` is two-dimensional, NaN or masked where there is no data; floats in m, or integers of which one unit is `height_scale` m. `layout` says which way its indices run, as `terrain.layout` does:
    picture (a[0, 0] at the least x and the largest y), y-up (a[y, x]), x-y (a[x, y]) or grid-map. `origin` is x, y of the center, m.
    Raises `InputError`.
    """
    # Masked elements have no data.
    masked = np.ma.getmaskarray(heights) if isinstance(heights, np.ma.MaskedArray) else None
    array = np.asarray(heights)
    if array.ndim != 2 or min(array.shape) < 4 or array.size > _MOST_CELLS:
        raise InputError(
            f"heights of shape {array.shape}: expected two dimensions of at least 4, at most {_MOST_CELLS} cells in all"
        )
    if array.dtype.kind not in "fiu":
        raise InputError(f"heights of type {array.dtype}: expected numbers, in m")
    if array.dtype.kind in "iu" and height_scale is None:
        raise InputError("heights are integers: height_scale is missing, the height of one unit in m (1.0 if they are in m)")
    scale = 1.0 if height_scale is None else float(height_scale)
    if not np.isfinite(scale) or scale == 0.0:
        raise InputError(f"height_scale {height_scale}: expected a number other than 0, m")
    if np.isinf(array if masked is None else array[~masked]).any():
        raise InputError("heights must be finite, or NaN where there is no data")
    if layout not in LAYOUTS:
        raise InputError(f'layout "{layout}": expected one of {", ".join(LAYOUTS)}')
    if not 0.001 <= spacing <= 10.0:
        raise InputError(f"spacing {spacing}: expected a number from 0.001 to 10, m")
    columns, rows = array.shape if layout in ("x-y", "grid-map") else array.shape[::-1]
    center = np.asarray(origin, dtype=float)
    if center.shape != (2,) or not np.isfinite(center).all():
        raise InputError(f"origin {origin}: expected x and y of the center, m")
    corner = center - 0.5 * spacing * (np.array([columns, rows]) - 1)
    measured = array.astype(float) * scale
    if masked is not None:
        measured[masked] = np.nan
    content = io.BytesIO()
    np.savez_compressed(content, heights=measured, spacing=float(spacing), origin=corner, layout=np.array(layout))
    write_bytes(Path(path), content.getvalue())
