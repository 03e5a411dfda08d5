//! Where on a raster a foot can stand.
//!
//! A cell is steppable if a plane fits the ground under the foot, if that plane is not too steep, and if nothing beside the
//! foot rises so far above it that the foot would touch it on its way down. Nor does a foot stand where a scan has no data, unless the
//! hole is narrower than the foot.

use super::morphology::{Bordered, Offset, closed, disc, opened, widened};
use super::patch::Patch;
use crate::heightfield::Grid;

/// Headings that are tried for the rectangle of a patch, over a quarter turn.
const HEADINGS: usize = 6;
/// What may rise beside a foot, as a multiple of the roughness allowed under it.
const RISE_BESIDE: f64 = 2.0;
/// The ground of a patch may be rougher than under the foot in its middle by this fraction of what is allowed.
const EVENNESS: f64 = 0.25;
/// A patch reaches beyond its outermost cells by this fraction of a cell, so that one of a single cell has an inside.
const CELL_FRACTION: f64 = 0.1;

/// A place this close to a line of cells, in cells, is on it.
const ON_LINE: f64 = 1e-6;

/// What a foot needs in order to stand, lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootNeeds {
    /// Ground without data is a hole if a disc of this radius fits into it.
    pub hole: f64,
    /// The ground must be even within this distance of the contact point …
    pub even: f64,
    /// … up to this difference from a plane.
    pub roughness: f64,
    /// Nothing may rise beside the foot within this distance.
    pub beside: f64,
    /// The ground is not lower than around it by more than this …
    pub depth: f64,
    /// … where what is lower is narrower than this: the trunk stays above such a gap, and the foot does not reach down.
    pub gap: f64,
    /// The plane's largest slope.
    pub slope: f64,
    /// A patch extends from its center by at most this much along each side.
    pub patch: f64,
}

/// Heights, the plane at each cell, and the cells on which a foot can stand.
#[derive(Clone, Debug)]
pub struct ContactGround {
    grid: Grid,
    needs: FootNeeds,
    heights: Vec<f64>,
    /// Height, and slope along x and y, of the plane that fits best around each cell.
    planes: Vec<[f64; 3]>,
    steppable: Vec<bool>,
    /// From a cell to those that the ground under a foot on it depends on.
    under_foot: Vec<Offset>,
    /// Some cells are not steppable because nothing was measured there.
    has_holes: bool,
}

impl ContactGround {
    /// Fits a plane around each cell and judges it. `unknown` tells where nothing was measured, if feet must not stand there.
    pub fn new(grid: &Grid, heights: &[f64], unknown: Option<&[bool]>, needs: FootNeeds) -> Self {
        let planes = planes(grid, heights, needs.even);
        let mut steppable: Vec<bool> = planes.iter().map(|p| p[1].hypot(p[2]) <= needs.slope).collect();
        let under_foot = under_foot(grid, needs.even);
        let mut rule_out = |around: &[Offset], fits: fn(&FootNeeds, f64) -> bool| {
            let bordered = Bordered::new(grid, heights, around);
            let rows = steppable.chunks_exact_mut(grid.columns).zip(planes.chunks_exact(grid.columns));
            for (row, (steppable, planes)) in rows.enumerate() {
                for offset in around {
                    let (u, v) = (offset.0 as f64, offset.1 as f64);
                    let neighbors = planes.iter().zip(bordered.neighbors(row, offset));
                    for (steppable, (plane, height)) in steppable.iter_mut().zip(neighbors) {
                        let [h, x, y] = *plane;
                        let plane = h + x * u * grid.spacing[0] + y * v * grid.spacing[1];
                        *steppable &= fits(&needs, height - plane);
                    }
                }
            }
        };
        rule_out(&under_foot, |needs, above| above.abs() <= needs.roughness);
        rule_out(&disc(grid, needs.beside), |needs, above| above <= RISE_BESIDE * needs.roughness);
        for ((steppable, height), filled) in
            steppable.iter_mut().zip(heights).zip(closed(grid, heights, needs.gap))
        {
            *steppable &= filled - height <= needs.depth;
        }
        let holes = unknown.map(|unknown| opened(grid, unknown, needs.hole));
        if let Some(holes) = &holes {
            for (steppable, near) in steppable.iter_mut().zip(widened(grid, holes, needs.even)) {
                *steppable &= !near;
            }
        }
        // What lies beyond the border is not known.
        let border = grid.spacing.map(|s| (needs.beside / s).ceil() as usize);
        for (cell, steppable) in steppable.iter_mut().enumerate() {
            let (column, row) = (cell % grid.columns, cell / grid.columns);
            let inside = |at: usize, count: usize, border: usize| at >= border && at + border < count;
            *steppable &= inside(column, grid.columns, border[0]) && inside(row, grid.rows, border[1]);
        }
        let has_holes = holes.is_some_and(|holes| holes.contains(&true));
        Self { grid: *grid, needs, heights: heights.to_vec(), planes, steppable, under_foot, has_holes }
    }

    /// Rules out the cells whose place is not allowed.
    pub fn keep_out(&mut self, allows: impl Fn([f64; 2]) -> bool) {
        let grid = self.grid;
        for (cell, steppable) in self.steppable.iter_mut().enumerate() {
            *steppable &= allows([grid.x(cell % grid.columns), grid.y(cell / grid.columns)]);
        }
    }

    /// Whether feet keep away from places because nothing was measured there.
    pub fn has_holes(&self) -> bool {
        self.has_holes
    }

    /// The raster.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// By cell, (rows, columns).
    pub fn steppable(&self) -> &[bool] {
        &self.steppable
    }

    /// x, y of a cell, and the height of its plane there, m.
    pub fn point(&self, cell: usize) -> [f64; 3] {
        let (column, row) = (cell % self.grid.columns, cell / self.grid.columns);
        [self.grid.x(column), self.grid.y(row), self.planes[cell][0]]
    }

    /// The cell nearest to a place, if a foot can stand there.
    pub fn steppable_cell(&self, place: [f64; 2]) -> Option<usize> {
        self.grid.nearest(place).filter(|&cell| self.steppable[cell])
    }

    /// Whether a foot can stand at the cell nearest to a place.
    pub fn is_steppable(&self, place: [f64; 2]) -> bool {
        self.steppable_cell(place).is_some()
    }

    /// In how many of four directions the ground next to a foot on this cell cannot be stood on.
    pub fn closed_directions(&self, cell: usize) -> u8 {
        let [x, y, _] = self.point(cell);
        let away = self.needs.even;
        let around = [[away, 0.0], [-away, 0.0], [0.0, away], [0.0, -away]];
        around.iter().map(|[u, v]| u8::from(!self.is_steppable([x + u, y + v]))).sum()
    }

    /// The greatest height between two places, m.
    pub fn highest_between(&self, [from, to]: [[f64; 2]; 2]) -> f64 {
        let spacing = self.grid.spacing[0].min(self.grid.spacing[1]);
        let steps = ((to[0] - from[0]).hypot(to[1] - from[1]) / spacing).ceil().max(1.0) as usize;
        (0..=steps)
            .filter_map(|n| {
                let u = n as f64 / steps as f64;
                self.grid.nearest(std::array::from_fn(|c| from[c] + u * (to[c] - from[c])))
            })
            .map(|cell| self.heights[cell])
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether there is a cell within a distance, m, on which no foot can stand.
    pub fn has_edge_within(&self, place: [f64; 2], distance: f64) -> bool {
        let around = disc(&self.grid, distance);
        around.iter().any(|&(u, v, _)| {
            let offset = [u as f64 * self.grid.spacing[0], v as f64 * self.grid.spacing[1]];
            !self.is_steppable([place[0] + offset[0], place[1] + offset[1]])
        })
    }

    /// The up to four cells of which a place is in the middle; fewer where it is on one of their lines.
    fn cells_around(&self, place: [f64; 2]) -> Option<impl Iterator<Item = usize>> {
        let range = |axis: usize, count: usize| {
            let at = (place[axis] - self.grid.origin[axis]) / self.grid.spacing[axis];
            let [first, last] = [(at + ON_LINE).floor(), (at - ON_LINE).ceil()];
            (first >= 0.0 && last < count as f64).then_some(first as usize..=last as usize)
        };
        let (columns, rows) = (range(0, self.grid.columns)?, range(1, self.grid.rows)?);
        let width = self.grid.columns;
        Some(rows.flat_map(move |row| columns.clone().map(move |column| row * width + column)))
    }

    /// The largest of some rectangles around a steppable cell within which a foot can stand on the same plane.
    pub fn patch(&self, cell: usize) -> Patch {
        let patch = self.plane_at(cell);
        let even = (self.roughness(cell) + EVENNESS * self.needs.roughness).min(self.needs.roughness);
        let area = |p: &Patch| (p.sides[0][1] - p.sides[0][0]) * (p.sides[1][1] - p.sides[1][0]);
        (0..HEADINGS)
            .map(|n| {
                let heading = n as f64 / HEADINGS as f64 * std::f64::consts::FRAC_PI_2;
                self.grown(Patch { heading, ..patch }, even)
            })
            // The first one counts where several are equal.
            .fold(None, |best: Option<Patch>, one| match best {
                Some(best) if area(&best) >= area(&one) => Some(best),
                _ => Some(one),
            })
            .unwrap_or(patch)
    }

    /// Largest difference of the ground under a foot at a cell from the cell's own plane, m.
    pub fn roughness(&self, cell: usize) -> f64 {
        self.difference(cell, &self.plane_at(cell))
    }

    /// Largest difference of the ground under a foot at a cell from a patch's plane, m.
    fn difference(&self, cell: usize, patch: &Patch) -> f64 {
        let (columns, rows) = (self.grid.columns, self.grid.rows);
        let (column, row) = (cell % columns, cell / columns);
        let difference = |&(u, v, _): &Offset| {
            let clamped = |k: usize, by: isize, count: usize| k.saturating_add_signed(by).min(count - 1);
            let (c, r) = (clamped(column, u, columns), clamped(row, v, rows));
            (self.heights[r * columns + c] - patch.jet(self.grid.x(c), self.grid.y(r)).h).abs()
        };
        self.under_foot.iter().map(difference).fold(0.0, f64::max)
    }

    /// The plane at a cell as a patch without sides.
    fn plane_at(&self, cell: usize) -> Patch {
        let [x, y, height] = self.point(cell);
        let [_, slope_x, slope_y] = self.planes[cell];
        Patch { center: [x, y], height, slope: [slope_x, slope_y], heading: 0.0, sides: [[0.0; 2]; 2] }
    }

    /// Moves the sides of a rectangle outward in turn, as long as all that it gains is steppable and even.
    fn grown(&self, patch: Patch, even: f64) -> Patch {
        let step = self.grid.spacing[0].min(self.grid.spacing[1]);
        let most = (self.needs.patch / step) as isize;
        let axes = patch.axes();
        let fits = |u: isize, v: isize| {
            let [x, y] = std::array::from_fn(|c| {
                patch.center[c] + step * (u as f64 * axes[0][c] + v as f64 * axes[1][c])
            });
            self.cells_around([x, y]).is_some_and(|mut cells| {
                cells.all(|cell| self.steppable[cell] && self.difference(cell, &patch) <= even)
            })
        };
        let (mut u, mut v) = ([0_isize; 2], [0_isize; 2]);
        loop {
            let before = (u, v);
            for (side, outward) in [(1, 1), (0, -1)] {
                if (u[side] + outward).abs() <= most && (v[0]..=v[1]).all(|v| fits(u[side] + outward, v)) {
                    u[side] += outward;
                }
                if (v[side] + outward).abs() <= most && (u[0]..=u[1]).all(|u| fits(u, v[side] + outward)) {
                    v[side] += outward;
                }
            }
            if before == (u, v) {
                break;
            }
        }
        let side = |ends: [isize; 2]| {
            [step * (ends[0] as f64 - CELL_FRACTION), step * (ends[1] as f64 + CELL_FRACTION)]
        };
        Patch { sides: [side(u), side(v)], ..patch }
    }
}

/// The offsets of the nodes that the bilinear surface depends on within a distance of a node.
fn under_foot(grid: &Grid, radius: f64) -> Vec<Offset> {
    let [x, y] = grid.spacing;
    let mut offsets = disc(grid, radius + x.hypot(y));
    offsets.retain(|&(u, v, _)| {
        let beside = |k: isize, spacing: f64| ((k.abs() - 1).max(0)) as f64 * spacing;
        beside(u, x).hypot(beside(v, y)) < radius
    });
    offsets
}

/// The least-squares plane around each cell. Over a whole disc the sums of odd order vanish.
fn planes(grid: &Grid, heights: &[f64], radius: f64) -> Vec<[f64; 3]> {
    // At least the eight neighbors.
    let radius = radius.max(1.01 * grid.spacing[0].hypot(grid.spacing[1]));
    let around = disc(grid, radius);
    let place = |(u, v, _): (isize, isize, f64)| (u as f64 * grid.spacing[0], v as f64 * grid.spacing[1]);
    let (xx, yy) = around.iter().fold((0.0, 0.0), |(xx, yy), &o| {
        let (x, y) = place(o);
        (xx + x * x, yy + y * y)
    });
    let bordered = Bordered::new(grid, heights, &around);
    let mut planes = vec![[0.0; 3]; heights.len()];
    for (row, planes) in planes.chunks_exact_mut(grid.columns).enumerate() {
        for &offset in &around {
            let (x, y) = place(offset);
            for (sums, height) in planes.iter_mut().zip(bordered.neighbors(row, &offset)) {
                *sums = [sums[0] + height, sums[1] + x * height, sums[2] + y * height];
            }
        }
        for sums in planes {
            *sums = [sums[0] / around.len() as f64, sums[1] / xx, sums[2] / yy];
        }
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { origin: [-1.0, -1.0], spacing: [0.02, 0.02], columns: 101, rows: 101 };
    const NEEDS: FootNeeds = FootNeeds {
        hole: 0.03,
        even: 0.033,
        roughness: 0.012,
        beside: 0.075,
        depth: 0.15,
        gap: 0.45,
        slope: 0.6,
        patch: 0.16,
    };

    fn ground(h: impl Fn(f64, f64) -> f64) -> ContactGround {
        ContactGround::new(&GRID, &GRID.sample(|x, y| Ok(h(x, y))).expect("heights"), None, NEEDS)
    }

    #[test]
    fn feet_keep_away_from_edges_above_and_below() {
        let ground = ground(|x, _| if x > 0.01 { 0.15 } else { 0.0 });
        // Below the step by the wall's distance, above it by the foot's.
        for (x, expected) in [(-0.08, true), (-0.04, false), (0.0, false), (0.04, false), (0.06, true)] {
            assert_eq!(ground.is_steppable([x, 0.0]), expected, "x = {x}");
        }
        assert!(!ground.is_steppable([-0.96, 0.0]) && !ground.is_steppable([3.0, 0.0]));
    }

    #[test]
    fn steep_and_rough_ground_is_not_steppable() {
        assert!(!ground(|x, _| 0.65 * x).is_steppable([0.0, 0.0]));
        let slope = ground(|x, y| 0.5 * x - 0.2 * y);
        assert!(slope.is_steppable([0.0, 0.0]));
        let plane = slope.planes[slope.grid.nearest([0.2, 0.1]).expect("a cell")];
        assert!((plane[0] - 0.08).abs() < 1e-12 && (plane[1] - 0.5).abs() < 1e-12);
        assert!(!ground(|x, _| 0.02 * (70.0 * x).sin()).is_steppable([0.0, 0.0]));
    }

    #[test]
    fn feet_keep_away_from_ground_that_was_not_measured() {
        let unknown = |width: f64| -> Vec<bool> {
            let inside =
                GRID.sample(|x, _| Ok(if x.abs() < 0.5 * width { 1.0 } else { 0.0 })).expect("heights");
            inside.iter().map(|v| *v > 0.0).collect()
        };
        let flat = vec![0.0; GRID.len()];
        let ground = |width: f64| ContactGround::new(&GRID, &flat, Some(&unknown(width)), NEEDS);
        assert!(ground(0.03).is_steppable([0.0, 0.0]) && !ground(0.03).has_holes());
        let wide = ground(0.3);
        for (x, expected) in [(0.0, false), (0.14, false), (0.16, false), (0.20, true), (-0.20, true)] {
            assert_eq!(wide.is_steppable([x, 0.0]), expected, "x = {x}");
        }
        assert!(wide.has_holes());
    }

    #[test]
    fn a_patch_covers_a_turned_tread_and_nothing_else() {
        // Treads of 0.3 m, turned by 0.5 rad.
        let along = |x: f64, y: f64| 0.5_f64.cos() * x + 0.5_f64.sin() * y;
        let ground = ground(|x, y| 0.15 * (along(x, y) / 0.3).floor());
        let middle = [0.13 * 0.5_f64.cos(), 0.13 * 0.5_f64.sin()];
        let seed = ground.steppable_cell(middle).expect("a steppable cell");
        let patch = ground.patch(seed);
        let [u, v] = patch.sides.map(|s| s[1] - s[0]);
        assert!(u.min(v) > 0.1 && u.max(v) > 0.25, "{patch:?}");
        for [x, y, z] in patch.corners() {
            assert!((z - 0.0).abs() < 1e-9, "{patch:?}");
            // A rectangle reaches a fraction of a cell beyond what is steppable, and the raster has the edge within a cell.
            let tread = along(x, y);
            assert!(tread > 0.03 && tread < 0.3 - 0.065, "{tread} of {patch:?}");
        }
    }
}
