"""The ground, made for a scenario or taken from a plan."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from .ground import write_terrain
from .text import escape
from .toml import table_text

_LOOKS = 101  # places along each axis at which a notebook's table looks


@dataclass(frozen=True)
class Terrain:
    """The ground: what a scenario has as its terrain, or what a plan was made for.

    It can be evaluated: a C² spline through the heights, as plans are made on it, extended beyond their rectangle.
    """

    values: Mapping[str, Any]  # of the table [terrain]
    _kept: object = field(default=None, repr=False, compare=False)  # a folder that exists as long as this
    _known: _native.Terrain | None = field(default=None, repr=False, compare=False)  # of a plan

    @classmethod
    def file(cls, path: str | Path, **values: Any) -> Terrain:
        """A heightmap: an image, an array, a grid or a mesh (docs/inputs.md). `values` are keys of [terrain], such as `spacing` in m."""
        return cls({"kind": "heightmap", "file": str(Path(path).resolve()), **values})

    @classmethod
    def array(
        cls,
        heights: npt.ArrayLike,
        *,
        spacing: float,
        layout: str = "picture",
        origin: tuple[float, float] = (0.0, 0.0),
        height_scale: float | None = None,
        path: str | Path | None = None,
        **values: Any,
    ) -> Terrain:
        """Heights (R, C) in m, NaN where there is no data, `spacing` m apart; see `write_terrain` for `layout` and `origin`.

        They are written to `path`, by default to a temporary file that is removed with this object.
        """
        kept = None if path is not None else tempfile.TemporaryDirectory(prefix="warpgait-")
        target = Path(path) if path is not None else Path(kept.name) / "ground.npz"  # type: ignore[union-attr]
        write_terrain(target, heights, spacing=spacing, layout=layout, origin=origin, height_scale=height_scale)
        return cls({**cls.file(target).values, **values}, kept)

    @classmethod
    def formula(cls, expression: str, *, extent: Sequence[float], spacing: float | None = None) -> Terrain:
        """h(x, y) in m as text, such as `0.1*sin(2*x)*cos(y)`, over `extent` = x_min, x_max, y_min, y_max in m."""
        return cls({"kind": "formula", "expression": expression, "extent": list(extent), "spacing": spacing})

    @classmethod
    def shape(cls, kind: str, **values: Any) -> Terrain:
        """One of the built-in shapes: flat, rippled, conic, hilly or pit, with keys of [terrain] such as `level`."""
        return cls({"kind": kind, **values})

    @cached_property
    def _surface(self) -> _native.Terrain:
        if self._known is not None:
            return self._known
        x_min, x_max, y_min, y_max = self.values.get("extent") or (0.0, 0.0, 0.0, 0.0)
        middle = {"position": [0.5 * (x_min + x_max), 0.5 * (y_min + y_max)]}
        return _native.terrain(table_text({"terrain": dict(self.values), "start": middle, "goal": middle}))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x_min, x_max, y_min, y_max, m."""
        return self._surface.extent

    def height(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """h, m, (…), at points (…, 2), x and y in m."""
        return self._surface.height(points)

    def gradient(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """∂h/∂x and ∂h/∂y, (…, 2), at points (…, 2)."""
        return self._surface.gradient(points)

    def normal(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """The upward unit normal, (…, 3), at points (…, 2)."""
        return self._surface.normal(points)

    def grid(self, count: int = _LOOKS) -> npt.NDArray[np.float64]:
        """(count, count, 2) places all over the extent, x along the second axis, m."""
        x_min, x_max, y_min, y_max = self.extent
        return np.stack(np.meshgrid(np.linspace(x_min, x_max, count), np.linspace(y_min, y_max, count)), axis=-1)

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        places = self.grid()
        heights, slopes = self.height(places), np.linalg.norm(self.gradient(places), axis=-1)
        x_min, x_max, y_min, y_max = self.extent
        rows = {
            "kind": self.values.get("kind"),
            "from": self.values.get("file") or self.values.get("expression"),
            "extent": f"x {x_min:g} to {x_max:g} m, y {y_min:g} to {y_max:g} m",
            "heights": f"{heights.min():.3g} to {heights.max():.3g} m",
            "steepest": f"{np.degrees(np.arctan(slopes.max())):.0f}°",
        }
        shown = "".join(f"<tr><th>{key}</th><td>{escape(value)}</td></tr>" for key, value in rows.items() if value is not None)
        return f"<table><caption>Terrain</caption>{shown}</table>"
