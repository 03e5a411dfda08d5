// Shapes, lines and the ground on a canvas, with WebGL 2.

const VERTEX = `#version 300 es
in vec3 place; in vec3 normal; in float mark;
uniform mat4 camera, model;
out vec3 world, facing; out float marked;
void main() {
  vec4 p = model * vec4(place, 1.0);
  world = p.xyz; facing = mat3(model) * normal; marked = mark;
  gl_Position = camera * p;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 world, facing; in float marked;
uniform vec4 color; uniform int kind; uniform vec2 range; uniform vec3 eye;
out vec4 painted;
// 1 on lines that are a cell apart, one pixel wide.
float lines(vec2 p, float cell) {
  vec2 q = p / cell, width = fwidth(q) * 1.2, away = abs(fract(q - 0.5) - 0.5) / max(width, 1e-6);
  return (1.0 - min(min(away.x, away.y), 1.0)) * clamp(0.25 / max(max(width.x, width.y), 1e-6) - 0.3, 0.0, 1.0);
}
void main() {
  if (kind == 0) { painted = color; return; }
  vec3 n = normalize(facing);
  if (dot(n, eye - world) < 0.0) n = -n;
  float light = 0.42 + 0.5 * max(dot(n, normalize(vec3(0.35, 0.25, 0.9))), 0.0) + 0.12 * n.x;
  vec3 c = color.rgb;
  if (kind == 2) {
    float h = clamp((world.z - range.x) / max(range.y - range.x, 0.02), 0.0, 1.0);
    c = mix(vec3(0.42, 0.44, 0.47), vec3(0.80, 0.74, 0.62), h);
    if (marked > 0.5) c = mix(c, vec3(0.55, 0.35, 0.6), 0.6);
    c = mix(c, vec3(0.12), 0.28 * lines(world.xy, 0.1) + 0.4 * lines(world.xy, 1.0));
  }
  painted = vec4(c * light, color.a);
}`;
const FLAT = 0, LIT = 1, GROUND = 2;

// Triangles of a grid of points given by a function of row and column; normals by the same.
function surface(rows, columns, point) {
  const places = [], normals = [], indices = [];
  for (let i = 0; i < rows; i++) {
    for (let j = 0; j < columns; j++) {
      const [place, normal] = point(i, j);
      places.push(...place);
      normals.push(...normal);
      if (i && j) {
        const here = i * columns + j;
        indices.push(here - columns - 1, here - columns, here, here - columns - 1, here, here - 1);
      }
    }
  }
  return { places, normals, indices };
}

function joined(parts) {
  const all = { places: [], normals: [], indices: [] };
  for (const part of parts) {
    const first = all.places.length / 3;
    all.places.push(...part.places);
    all.normals.push(...part.normals);
    all.indices.push(...part.indices.map((index) => index + first));
  }
  return all;
}

const around = (j, count) => [Math.cos((2 * Math.PI * j) / count), Math.sin((2 * Math.PI * j) / count)];
const lid = (z, radius) => surface(2, 25, (i, j) => [[...around(j, 24).map((v) => v * radius * i), z], [0, 0, Math.sign(z) || 1]]);
const tube = (low, high, from, to) => surface(2, 25, (i, j) => {
  const [x, y] = around(j, 24), r = i ? to : from;
  return [[x * r, y * r, i ? high : low], normalized([x, y, (from - to) / (high - low)])];
});

// Of unit size; `placed` gives them theirs.
const SHAPES = {
  box: () => joined([0, 1, 2].flatMap((axis) => [-1, 1].map((side) => surface(2, 2, (i, j) => {
    const p = [0, 0, 0], n = [0, 0, 0];
    p[axis] = n[axis] = side;
    p[(axis + 1) % 3] = 2 * i - 1;
    p[(axis + 2) % 3] = 2 * j - 1;
    return [p, n];
  })))),
  sphere: () => surface(13, 25, (i, j) => {
    const [x, y] = around(j, 24), polar = (Math.PI * i) / 12, p = [x * Math.sin(polar), y * Math.sin(polar), Math.cos(polar)];
    return [p, p];
  }),
  cylinder: () => joined([tube(-1, 1, 1, 1), lid(-1, 1), lid(1, 1)]),
  cone: () => tube(0, 1, 0, 1), // its tip is the origin
  shaft: () => tube(0, 1, 1, 1),
  tip: () => joined([tube(0, 1, 1, 0), lid(0, 1)]),
  disc: () => lid(0, 1),
};

// Whether the browser draws without a graphics card; smooth edges then cost more than they are worth.
function drawsInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2"), named = gl && gl.getExtension("WEBGL_debug_renderer_info");
  const name = named ? gl.getParameter(named.UNMASKED_RENDERER_WEBGL) : "";
  if (gl) gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

class Drawing {
  static quality = 1; // pixels drawn for one shown, along each axis; less while frames take long

  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: !(Drawing.software ??= drawsInSoftware()), alpha: false });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    this.program = this.compiled();
    this.place = Object.fromEntries(["camera", "model", "color", "kind", "range", "eye"].map((name) => [name, gl.getUniformLocation(this.program, name)]));
    this.shapes = Object.fromEntries(Object.entries(SHAPES).map(([name, make]) => [name, this.mesh(make())]));
    this.stroke = this.mesh({ places: [], normals: [], indices: [] });
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  compiled() {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    ["place", "normal", "mark"].forEach((name, at) => gl.bindAttribLocation(program, at, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  mesh({ places, normals, indices, marks }) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const buffers = [[places, 3], [normals, 3], [marks, 1]].map(([values, size], at) => {
      if (!values) return null;
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, gl.FLOAT, false, 0, 0);
      return buffer;
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(indices), gl.STATIC_DRAW);
    return { array, buffers, count: indices.length };
  }

  // Clear, and look from `eye` at `target`.
  begin(eye, target, paper) {
    const gl = this.gl, canvas = this.canvas, dense = Math.min(window.devicePixelRatio || 1, 2) * Drawing.quality;
    const width = Math.max(1, Math.round(canvas.clientWidth * dense)), height = Math.max(1, Math.round(canvas.clientHeight * dense));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(...paper, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.program);
    this.camera = times(perspective(0.75, width / height, 0.05, 200), lookingAt(eye, target));
    gl.uniformMatrix4fv(this.place.camera, false, this.camera);
    gl.uniform3fv(this.place.eye, eye);
  }

  draw(mesh, model, color, kind = LIT, range = [0, 1]) {
    const gl = this.gl, clear = color[3] < 1;
    gl.uniformMatrix4fv(this.place.model, false, model);
    gl.uniform4fv(this.place.color, color);
    gl.uniform1i(this.place.kind, kind);
    gl.uniform2fv(this.place.range, range);
    gl.depthMask(!clear);
    gl.bindVertexArray(mesh.array);
    gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
    gl.depthMask(true);
  }

  // A curve through points, three numbers each; or separate lines.
  lines(points, color, separate = false) {
    const gl = this.gl;
    gl.uniformMatrix4fv(this.place.model, false, placed([0, 0, 0], [1, 0, 0, 0], [1, 1, 1]));
    gl.uniform4fv(this.place.color, color);
    gl.uniform1i(this.place.kind, FLAT);
    gl.bindVertexArray(this.stroke.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.stroke.buffers[0]);
    gl.bufferData(gl.ARRAY_BUFFER, points instanceof Float32Array ? points : new Float32Array(points), gl.STREAM_DRAW);
    gl.disableVertexAttribArray(1);
    gl.drawArrays(separate ? gl.LINES : gl.LINE_STRIP, 0, points.length / 3);
  }

  arrow(from, vector, width, color) {
    const size = length(vector);
    if (size < 1e-4) return;
    const q = turnTo(vector), head = Math.min(4 * width, 0.5 * size), end = add(from, scaled(vector, 1 - head / size));
    this.draw(this.shapes.shaft, placed(from, q, [width, width, size - head]), color);
    this.draw(this.shapes.tip, placed(end, q, [2.4 * width, 2.4 * width, head]), color);
  }

  // Where a point is on the canvas, in CSS pixels, or null behind the camera.
  seen(p) {
    const m = this.camera, w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
    if (w <= 0) return null;
    const x = (m[0] * p[0] + m[4] * p[1] + m[8] * p[2] + m[12]) / w, y = (m[1] * p[0] + m[5] * p[1] + m[9] * p[2] + m[13]) / w;
    return [((x + 1) / 2) * this.canvas.clientWidth, ((1 - y) / 2) * this.canvas.clientHeight];
  }
}
