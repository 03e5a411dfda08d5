//! Vertical rays from above onto triangles: the highest surface, and whether it hides ground.
//!
//! A ray may pass several faces. What is below the highest is hidden ground where a robot could stand if it is a face that looks up
//! and there is room above it: an open space between the underside of one body and the top of another, or a sheet below a sheet. The
//! bottom of a closed body, and ground on which a body stands, are not.

/// Rays at the nodes of a grid.
pub struct Rays {
    /// x, y of the first ray, m.
    pub corner: [f64; 2],
    /// Distance between neighboring rays, m.
    pub spacing: f64,
    /// Rays along x.
    pub columns: usize,
    /// Rays along y.
    pub rows: usize,
}

/// What the rays met.
pub struct Seen {
    /// (rows, columns) heights of the highest faces, m; NaN where a ray met none.
    pub heights: Vec<f64>,
    /// Holes, hidden ground, and meshes that are inside out.
    pub notes: Vec<String>,
}

/// A face that a ray met.
#[derive(Clone, Copy)]
struct Hit {
    column: usize,
    z: f64,
    /// Whether the face looks up.
    up: bool,
}

/// Rays this much beside a face still meet it, in cells: rounding to floats of 4 bytes must not open the seams between faces.
pub const SEAM: f64 = 1e-3;
/// Less room than this above a hidden face does not count, m.
const ROOM: f64 = 0.01;
/// Faces at the same place, m.
const SAME: f64 = 1e-6;
/// Hidden ground is looked for at the middle of cells, a little off, where no edges of a regular mesh are; in cells.
const MIDDLE: [f64; 2] = [0.4863, 0.4717];

impl Rays {
    /// About how many hits there will be, and how many rows are looked at.
    pub fn work(&self, triangles: &[[[f64; 3]; 3]]) -> f64 {
        let work = |t: &[[f64; 3]; 3]| {
            let rows = t.iter().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max)
                - t.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
            (0.5 * twice_area(t).abs() / self.spacing + rows) / self.spacing + 1.0
        };
        2.0 * triangles.iter().map(work).sum::<f64>()
    }

    /// Casts the rays.
    pub fn cast(&self, triangles: &[[[f64; 3]; 3]]) -> Seen {
        let mut heights = vec![f64::NAN; self.columns * self.rows];
        let (mut up, mut down) = (0_usize, 0_usize);
        self.each_row(triangles, |row, hits| {
            for column in hits.chunk_by(|a, b| a.column == b.column) {
                let top = column[0];
                heights[row * self.columns + top.column] = top.z;
                *(if top.up { &mut up } else { &mut down }) += 1;
            }
        });
        let mut notes = Vec::new();
        let inside_out = down > up;
        if inside_out {
            notes.push(
                "most faces that are seen from above look down; the mesh was turned inside out".to_owned(),
            );
        }
        notes.extend(self.hidden(triangles, inside_out));
        notes.extend(self.holes(&heights));
        Seen { heights, notes }
    }

    /// A note on ground below the highest surface.
    fn hidden(&self, triangles: &[[[f64; 3]; 3]], inside_out: bool) -> Option<String> {
        let middles = Rays {
            corner: [0, 1].map(|axis| self.corner[axis] + MIDDLE[axis] * self.spacing),
            columns: self.columns - 1,
            rows: self.rows - 1,
            ..*self
        };
        // Room, place and height of the deepest.
        let (mut count, mut deepest): (usize, Option<(f64, [f64; 2], f64)>) = (0, None);
        middles.each_row(triangles, |row, hits| {
            for column in hits.chunk_by(|a, b| a.column == b.column) {
                if let Some(z) = hidden_below(column, inside_out) {
                    count += 1;
                    let depth = column[0].z - z;
                    if deepest.is_none_or(|(most, ..)| depth > most) {
                        let place = [column[0].column, row];
                        let at = [0, 1].map(|k| middles.corner[k] + middles.spacing * place[k] as f64);
                        deepest = Some((depth, at, column[0].z));
                    }
                }
            }
        });
        let (depth, [x, y], z) = deepest?;
        let part = 100.0 * count as f64 / (middles.columns * middles.rows) as f64;
        Some(format!(
            "overhangs hide ground below the highest surface, which is used, in {count} cells ({part:.1} %); at x = {x:.3}, y = {y:.3} \
             m the surface at {z:.3} m hides ground {depth:.3} m below it"
        ))
    }

    /// A note on rays that met nothing.
    fn holes(&self, heights: &[f64]) -> Option<String> {
        let first = heights.iter().position(|h| h.is_nan())?;
        let count = heights.iter().filter(|h| h.is_nan()).count();
        let [x, y] = [first % self.columns, first / self.columns].map(|i| i as f64 * self.spacing);
        Some(format!(
            "{count} of {} rays from above meet no face, the first of them at x = {:.3}, y = {:.3} m",
            heights.len(),
            self.corner[0] + x,
            self.corner[1] + y
        ))
    }

    /// Calls `see` for each row with its hits, by column and from above.
    fn each_row(&self, triangles: &[[[f64; 3]; 3]], mut see: impl FnMut(usize, &[Hit])) {
        let rows = |t: &[[f64; 3]; 3]| {
            let y = t.map(|p| (p[1] - self.corner[1]) / self.spacing);
            let first = (y.iter().copied().fold(f64::INFINITY, f64::min) - SEAM).ceil().max(0.0);
            let last = (y.iter().copied().fold(f64::NEG_INFINITY, f64::max) + SEAM).floor();
            // A last row below 0 is none.
            (first as usize, (last + 1.0).max(0.0) as usize)
        };
        // Vertical faces add nothing: those beside them meet the same rays.
        let mut waiting: Vec<(usize, usize, usize)> = (0..triangles.len())
            .filter(|&i| twice_area(&triangles[i]).abs() > 0.0)
            .map(|i| (rows(&triangles[i]), i))
            .map(|((first, end), i)| (first, end.min(self.rows), i))
            .filter(|(first, end, _)| first < end)
            .collect();
        waiting.sort_unstable();
        let (mut next, mut active, mut hits) = (0, Vec::new(), Vec::new());
        for row in 0..self.rows {
            while next < waiting.len() && waiting[next].0 <= row {
                active.push((waiting[next].1, waiting[next].2));
                next += 1;
            }
            active.retain(|(end, _)| *end > row);
            hits.clear();
            for &(_, i) in &active {
                self.meet(row, &triangles[i], &mut hits);
            }
            hits.sort_unstable_by(|a, b| a.column.cmp(&b.column).then(b.z.total_cmp(&a.z)));
            see(row, &hits);
        }
    }

    /// Adds the rays of a row that meet a triangle.
    fn meet(&self, row: usize, triangle: &[[f64; 3]; 3], hits: &mut Vec<Hit>) {
        // In cells, with the row at y = 0.
        let corners = triangle.map(|[x, y, z]| {
            [(x - self.corner[0]) / self.spacing, (y - self.corner[1]) / self.spacing - row as f64, z]
        });
        // The ends of the triangle's cut with the row: x and z.
        let (mut left, mut right): (Option<[f64; 2]>, Option<[f64; 2]>) = (None, None);
        let mut add = |point: [f64; 2]| {
            left = Some(left.filter(|l| l[0] <= point[0]).unwrap_or(point));
            right = Some(right.filter(|r| r[0] >= point[0]).unwrap_or(point));
        };
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if a[1].abs() <= SEAM {
                add([a[0], a[2]]);
            }
            if (a[1] < 0.0) != (b[1] < 0.0) {
                let t = a[1] / (a[1] - b[1]);
                add([a[0] + t * (b[0] - a[0]), a[2] + t * (b[2] - a[2])]);
            }
        }
        let (Some(left), Some(right)) = (left, right) else { return };
        let up = twice_area(triangle) > 0.0;
        let first = (left[0] - SEAM).ceil().max(0.0) as usize;
        let end = ((right[0] + SEAM).floor() + 1.0).max(0.0).min(self.columns as f64) as usize;
        for column in first..end {
            let length = right[0] - left[0];
            let t = if length > SEAM { ((column as f64 - left[0]) / length).clamp(0.0, 1.0) } else { 0.5 };
            hits.push(Hit { column, z: left[1] + t * (right[1] - left[1]), up });
        }
    }
}

/// Twice the area of a triangle seen from above, positive if it looks up.
fn twice_area([a, b, c]: &[[f64; 3]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The height of the lowest ground that is hidden, of the hits of one ray from above.
fn hidden_below(hits: &[Hit], inside_out: bool) -> Option<f64> {
    let top = hits[0].z;
    // In how many bodies a point of the ray is, going down; sheets count as bodies without end.
    let (mut depth, mut found, mut lowest_up) = (0, None, top);
    let mut last: Option<Hit> = None;
    let mut open_at = top;
    for &hit in hits {
        if last.is_some_and(|last| last.up == hit.up && last.z - hit.z <= SAME) {
            // The same face, or its neighbor.
            continue;
        }
        last = Some(hit);
        if hit.up != inside_out {
            if depth == 0 && open_at - hit.z > ROOM {
                found = Some(hit.z);
            }
            depth += 1;
            lowest_up = hit.z;
        } else {
            depth -= i32::from(depth > 0);
            if depth == 0 {
                open_at = hit.z;
            }
        }
    }
    // Two sheets or more.
    if depth >= 2 && top - lowest_up > ROOM { Some(lowest_up) } else { found }
}
