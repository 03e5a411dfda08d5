// Vectors are arrays of 3, quaternions of 4 (w, x, y, z), matrices of 16 in WebGL's order, column by column.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(a[0], a[1], a[2]);
const normalized = (a) => scaled(a, 1 / (length(a) || 1));
const mixed = (a, b, part) => a.map((value, i) => value + part * (b[i] - value));

// Between two rotations that are close to each other.
function mixedTurn(a, b, part) {
  const sign = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0 ? -1 : 1;
  const q = a.map((value, i) => value + part * (sign * b[i] - value));
  const size = Math.hypot(...q);
  return q.map((value) => value / size);
}

function product(a, b) {
  const [w, x, y, z] = a, [v, i, j, k] = b;
  return [w * v - x * i - y * j - z * k, w * i + x * v + y * k - z * j, w * j - x * k + y * v + z * i, w * k + x * j - y * i + z * v];
}

function turned(q, vector) {
  const axis = [q[1], q[2], q[3]], twice = scaled(cross(axis, vector), 2);
  return add(add(vector, scaled(twice, q[0])), cross(axis, twice));
}

// The turn that takes z to a direction.
function turnTo(direction) {
  const d = normalized(direction);
  if (d[2] < -0.999999) return [0, 1, 0, 0];
  const q = [1 + d[2], -d[1], d[0], 0], size = Math.hypot(...q);
  return q.map((value) => value / size);
}

// Position, turn, and a size along each axis.
function placed(p, q, size) {
  const [w, x, y, z] = q, [a, b, c] = size;
  return new Float32Array([
    (1 - 2 * (y * y + z * z)) * a, 2 * (x * y + w * z) * a, 2 * (x * z - w * y) * a, 0,
    2 * (x * y - w * z) * b, (1 - 2 * (x * x + z * z)) * b, 2 * (y * z + w * x) * b, 0,
    2 * (x * z + w * y) * c, 2 * (y * z - w * x) * c, (1 - 2 * (x * x + y * y)) * c, 0,
    p[0], p[1], p[2], 1,
  ]);
}

function times(a, b) {
  const result = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
      result[4 * column + row] = sum;
    }
  }
  return result;
}

function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2), range = 1 / (near - far);
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) * range, -1, 0, 0, 2 * near * far * range, 0]);
}

function lookingAt(eye, target) {
  const back = normalized(sub(eye, target)), right = normalized(cross([0, 0, 1], back)), up = cross(back, right);
  return new Float32Array([
    right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    -dot(right, eye), -dot(up, eye), -dot(back, eye), 1,
  ]);
}
