//! Faces with more than three corners, split into triangles.

use super::triangles::Triangles;
use crate::error::{Error, Result};

/// Tests of a corner in a triangle in all faces of a mesh; more would take seconds.
const MOST_TESTS: usize = 200_000_000;
/// Areas below this do not count, in squares of a face's size.
const FLAT: f64 = 1e-12;

/// Splits faces, and counts the work.
#[derive(Default)]
pub struct Splitter {
    faces: usize,
    tests: usize,
}

impl Splitter {
    /// Adds the triangles of the next face: a fan if it is convex, else one ear after the other, seen along its normal.
    ///
    /// # Errors
    /// For a face that crosses itself, and too much work.
    pub fn split(&mut self, corners: &[[f64; 3]], triangles: &mut Triangles) -> Result<()> {
        self.faces += 1;
        if corners.len() < 3 {
            return Ok(());
        }
        let fan = || (1..corners.len() - 1).map(|k| [0, k, k + 1]);
        let flat = flattened(corners);
        let n = flat.len();
        let convex = n == 3
            || fan().all(|[a, b, c]| twice_area(flat[a], flat[b], flat[c]) >= -FLAT)
                && (0..n).all(|k| twice_area(flat[k], flat[(k + 1) % n], flat[(k + 2) % n]) >= -FLAT);
        if convex {
            triangles.extend(fan().map(|face| face.map(|k| corners[k])));
            return Ok(());
        }
        let mut left: Vec<usize> = (0..n).collect();
        while left.len() > 3 {
            let ear = self.ear(&flat, &left, FLAT)?.or(self.ear(&flat, &left, -FLAT)?);
            let Some(k) = ear else {
                let what = format!("face {} crosses itself; split it into triangles", self.faces);
                return Err(Error::input(what));
            };
            triangles.push(around(&left, k).map(|k| corners[k]));
            left.remove(k);
        }
        triangles.push([left[0], left[1], left[2]].map(|k| corners[k]));
        Ok(())
    }

    /// The place in `left` of a corner whose triangle with its neighbors has more than an area, and no other corner inside.
    fn ear(&mut self, flat: &[[f64; 2]], left: &[usize], area: f64) -> Result<Option<usize>> {
        for k in 0..left.len() {
            let [a, b, c] = around(left, k).map(|k| flat[k]);
            if twice_area(a, b, c) <= area {
                continue;
            }
            self.tests += left.len();
            if self.tests > MOST_TESTS {
                let what = format!("face {} and those before have too many corners; split them", self.faces);
                return Err(Error::input(what));
            }
            let inside = |p: [f64; 2]| {
                ![a, b, c].contains(&p)
                    && twice_area(a, b, p) >= 0.0
                    && twice_area(b, c, p) >= 0.0
                    && twice_area(c, a, p) >= 0.0
            };
            if !left.iter().any(|&other| inside(flat[other])) {
                return Ok(Some(k));
            }
        }
        Ok(None)
    }
}

/// A corner between its neighbors.
fn around(left: &[usize], k: usize) -> [usize; 3] {
    let n = left.len();
    [left[(k + n - 1) % n], left[k], left[(k + 1) % n]]
}

/// The corners in the plane of the two axes that the face's normal is farthest from, counterclockwise, brought to a size of 1.
fn flattened(corners: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let first = corners[0];
    let size = corners.iter().flat_map(|p| [0, 1, 2].map(|k| (p[k] - first[k]).abs())).fold(0.0, f64::max);
    let size = if size > 0.0 { size } else { 1.0 };
    let local: Vec<[f64; 3]> = corners.iter().map(|p| [0, 1, 2].map(|k| (p[k] - first[k]) / size)).collect();
    let mut normal = [0.0; 3];
    for (p, q) in local.iter().zip(local.iter().cycle().skip(1)) {
        for (k, sum) in normal.iter_mut().enumerate() {
            let (u, v) = ((k + 1) % 3, (k + 2) % 3);
            *sum += p[u] * q[v] - p[v] * q[u];
        }
    }
    let along = (0..3).fold(0, |best, k| if normal[k].abs() > normal[best].abs() { k } else { best });
    let (u, v) = ((along + 1) % 3, (along + 2) % 3);
    let (u, v) = if normal[along] < 0.0 { (v, u) } else { (u, v) };
    local.iter().map(|p| [p[u], p[v]]).collect()
}

fn twice_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
