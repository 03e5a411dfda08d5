//! Vectors, rotations and quaternions as arrays: the check shares no code with the planner.

pub(super) fn norm(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scale(a: f64, v: [f64; 3]) -> [f64; 3] {
    [a * v[0], a * v[1], a * v[2]]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// v rotated by a unit quaternion (w, x, y, z).
pub(super) fn rotate(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let u = [q[1], q[2], q[3]];
    let t = scale(2.0, cross(u, v));
    add(add(v, scale(q[0], t)), cross(u, t))
}

/// v rotated by its inverse.
pub(super) fn rotate_back(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    rotate([q[0], -q[1], -q[2], -q[3]], v)
}

/// The rotation vector (world) that turns orientation a into b.
pub(super) fn rotation_between(a: [f64; 4], b: [f64; 4]) -> [f64; 3] {
    // b a⁻¹
    let (ua, ub) = ([a[1], a[2], a[3]], [b[1], b[2], b[3]]);
    let w = b[0] * a[0] + dot(ub, ua);
    let v = sub(sub(scale(a[0], ub), scale(b[0], ua)), cross(ub, ua));
    let sine = norm(v);
    // The factor angle/sin(angle/2) tends to 2.
    let factor = if sine < 1e-9 { 2.0 } else { 2.0 * sine.atan2(w.abs()) / sine };
    scale(if w < 0.0 { -factor } else { factor }, v)
}

/// A 3 × 3 matrix, rows first.
pub(super) type Turn = [[f64; 3]; 3];

pub(super) fn apply(a: &Turn, v: [f64; 3]) -> [f64; 3] {
    a.map(|row| dot(row, v))
}

pub(super) fn transposed(a: &Turn) -> Turn {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

pub(super) fn product(a: &Turn, b: &Turn) -> Turn {
    a.map(|row| std::array::from_fn(|j| (0..3).map(|k| row[k] * b[k][j]).sum()))
}

/// Solves `rows · x = right` by Gauss's elimination with pivots, in place: x is left in `right`. Not finite for a singular matrix.
pub(super) fn solve(rows: &mut [Vec<f64>], right: &mut [f64]) {
    let n = right.len();
    for column in 0..n {
        let largest = (column..n).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()));
        let pivot = largest.unwrap_or(column);
        rows.swap(column, pivot);
        right.swap(column, pivot);
        for row in column + 1..n {
            let factor = rows[row][column] / rows[column][column];
            for c in column..n {
                rows[row][c] -= factor * rows[column][c];
            }
            right[row] -= factor * right[column];
        }
    }
    for row in (0..n).rev() {
        let known: f64 = (row + 1..n).map(|c| rows[row][c] * right[c]).sum();
        right[row] = (right[row] - known) / rows[row][row];
    }
}

/// The rotation by a rotation vector.
pub(super) fn rotation(vector: [f64; 3]) -> Turn {
    let angle = norm(vector);
    let axis = if angle > 0.0 { scale(1.0 / angle, vector) } else { [1.0, 0.0, 0.0] };
    let (sin, cos) = angle.sin_cos();
    let [x, y, z] = axis;
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let unit = if i == j { cos } else { 0.0 };
            unit + (1.0 - cos) * axis[i] * axis[j] + sin * skew[i][j]
        })
    })
}

/// The rotation vector (world) that turns orientation a into b, by less than half a turn.
pub(super) fn turn_between(a: &Turn, b: &Turn) -> [f64; 3] {
    let r = product(b, &transposed(a));
    let skew = scale(0.5, [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]]);
    let sine = norm(skew);
    let cosine = 0.5 * (r[0][0] + r[1][1] + r[2][2] - 1.0);
    if sine == 0.0 { skew } else { scale(sine.atan2(cosine) / sine, skew) }
}
