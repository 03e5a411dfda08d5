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
