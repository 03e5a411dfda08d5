// What the page has of a plan, and how it looks at a time.

// Arrays come as base64 of little-endian numbers.
function decoded(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  return new { f4: Float32Array, u2: Uint16Array, u1: Uint8Array }[packed.type](bytes.buffer);
}

// One of equally long rows of an array, and rows between.
const row = (array, width, k, at = 0) => Array.from(array.subarray(k * width + at, k * width + at + 3));
const turn = (array, width, k, at) => Array.from(array.subarray(k * width + at, k * width + at + 4));

// A motion at times in s; frames are at a fixed rate.
class Motion {
  constructor(data, rate, feet) {
    Object.assign(this, data);
    for (const [name, packed] of Object.entries(data)) if (packed && packed.type) this[name] = decoded(packed);
    this.rate = rate;
    this.feet = feet;
    this.frames = this.center.length / 3;
  }

  at(time) {
    const place = Math.min(Math.max(time * this.rate, 0), this.frames - 1);
    this.k = Math.min(Math.floor(place), Math.max(this.frames - 2, 0));
    this.next = Math.min(this.k + 1, this.frames - 1);
    this.part = place - this.k;
    return this;
  }

  get nearest() {
    return this.part < 0.5 ? this.k : this.next;
  }

  vector(array, width, at = 0) {
    return mixed(row(array, width, this.k, at), row(array, width, this.next, at), this.part);
  }

  body(b) {
    const width = this.bodies.length / this.frames;
    return [this.vector(this.bodies, width, 7 * b), mixedTurn(turn(this.bodies, width, this.k, 7 * b + 3), turn(this.bodies, width, this.next, 7 * b + 3), this.part)];
  }

  ofFoot(array, e) {
    return this.vector(array, 3 * this.feet, 3 * e);
  }

  // The way of a foot.
  path(e) {
    this.ways ??= Array.from({ length: this.feet }, (_, foot) => {
      const way = new Float32Array(3 * this.frames);
      for (let k = 0; k < this.frames; k++) way.set(row(this.touch, 3 * this.feet, k, 3 * foot), 3 * k);
      return way;
    });
    return this.ways[e];
  }

  touches(e) {
    return this.contact[this.nearest * this.feet + e] > 0;
  }
}

// The ground as a mesh, from heights between low and high.
function groundMesh(ground, heights, drawing) {
  const { rows, columns, origin, spacing, low, high } = ground, z = decoded(heights), size = (high - low) / 65535;
  const h = (i, j) => low + size * z[Math.min(Math.max(i, 0), rows - 1) * columns + Math.min(Math.max(j, 0), columns - 1)];
  const places = new Float32Array(3 * rows * columns), normals = new Float32Array(3 * rows * columns), indices = new Uint32Array(6 * (rows - 1) * (columns - 1));
  let at = 0;
  for (let i = 0; i < rows; i++) {
    for (let j = 0; j < columns; j++) {
      const here = i * columns + j;
      places.set([origin[0] + j * spacing[0], origin[1] + i * spacing[1], h(i, j)], 3 * here);
      normals.set(normalized([(h(i, j - 1) - h(i, j + 1)) / (2 * spacing[0]), (h(i - 1, j) - h(i + 1, j)) / (2 * spacing[1]), 1]), 3 * here);
      if (i && j) {
        indices.set([here - columns - 1, here - columns, here, here - columns - 1, here, here - 1], at);
        at += 6;
      }
    }
  }
  const marks = ground.unknown ? Float32Array.from(decoded(ground.unknown)) : new Float32Array(rows * columns);
  return drawing.mesh({ places, normals, indices, marks });
}

const color = (hex, alpha = 1) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255).concat(alpha);
const NO_TURN = [1, 0, 0, 0], FORCE_LENGTH = 0.6; // m for m g
const PAPER = { light: [0.93, 0.945, 0.965], dark: [0.09, 0.105, 0.13] };

// The real world.
class Ambient {
  constructor(canvas, data) {
    this.drawing = new Drawing(canvas);
    this.data = data;
    this.ground = groundMesh(data.ground, data.ground.heights, this.drawing);
    this.raw = data.ground.raw ? groundMesh(data.ground, data.ground.raw, this.drawing) : this.ground;
    this.grid = data.map ? data.map.lines.map(decoded) : [];
    this.range = [data.ground.low, data.ground.high];
  }

  paint(view, plan, replay, options) {
    const d = this.drawing, data = this.data;
    d.begin(view.eye, view.target, view.paper);
    d.draw(options.raw ? this.raw : this.ground, placed([0, 0, 0], NO_TURN, [1, 1, 1]), [1, 1, 1, 1], GROUND, this.range);
    if (options.footholds) this.footholds(d, plan);
    if (options.paths) this.paths(d, plan, replay, options);
    this.robot(d, plan, 1);
    if (options.forces) this.forces(d, plan, 1);
    if (replay && options.replay) {
      this.robot(d, replay, 0.35);
      if (options.forces) this.forces(d, replay, 0.5);
    }
    if (options.grid) for (const line of this.grid) d.lines(line, [0.15, 0.4, 0.8, 0.3]);
    if (options.cones) this.cones(d, plan);
  }

  robot(d, motion, alpha) {
    this.data.bodies.forEach((body, b) => {
      const [p, q] = motion.body(b);
      for (const shape of body.shapes) {
        const place = add(p, turned(q, shape.place)), facing = product(q, shape.turn), tint = [...shape.color.slice(0, 3), alpha];
        d.draw(d.shapes[shape.kind], placed(place, facing, shape.size), tint);
      }
    });
    if (this.data.legs) {
      const [p, q] = motion.body(0);
      this.data.legs.forEach((hip, e) => d.lines([...add(p, turned(q, hip)), ...motion.ofFoot(motion.touch, e)], [0.2, 0.2, 0.22, alpha], true));
    }
    this.data.feet.forEach((foot, e) => d.draw(d.shapes.sphere, placed(motion.ofFoot(motion.touch, e), NO_TURN, [0.022, 0.022, 0.022]), color(foot.color, alpha)));
    d.draw(d.shapes.sphere, placed(motion.vector(motion.center, 3), NO_TURN, [0.03, 0.03, 0.03]), [0.95, 0.75, 0.1, alpha]);
  }

  forces(d, motion, alpha) {
    this.data.feet.forEach((foot, e) => {
      const force = scaled(motion.ofFoot(motion.force, e), FORCE_LENGTH / this.data.weight);
      d.arrow(motion.ofFoot(motion.touch, e), force, 0.012, color(foot.color, alpha));
    });
  }

  cones(d, plan) {
    this.data.feet.forEach((foot, e) => {
      if (!plan.touches(e)) return;
      const height = 0.22, wide = height * this.data.friction, normal = plan.ofFoot(plan.normal, e);
      d.draw(d.shapes.cone, placed(plan.ofFoot(plan.touch, e), turnTo(normal), [wide, wide, height]), color(foot.color, 0.18));
    });
  }

  footholds(d, plan) {
    const now = plan.k / plan.rate;
    for (const hold of this.data.footholds) {
      const tint = color(this.data.feet[hold.foot].color, hold.start <= now && now <= hold.end ? 0.95 : 0.45);
      d.draw(d.shapes.disc, placed(add(hold.place, scaled(hold.normal, 0.004)), turnTo(hold.normal), [0.035, 0.035, 1]), tint);
    }
    for (const patch of this.data.patches) {
      const lifted = [...patch.corners, patch.corners[0]].flatMap((c) => add(c, [0, 0, 0.006]));
      d.lines(lifted, color(this.data.feet[patch.foot].color, 0.9));
    }
  }

  paths(d, plan, replay, options) {
    d.lines(plan.center, [0.95, 0.65, 0.1, 1]);
    this.data.feet.forEach((foot, e) => d.lines(plan.path(e), color(foot.color, 0.8)));
    if (replay && options.replay) d.lines(replay.center, [0.85, 0.39, 0.12, 0.7]);
  }
}

// The warped space, where the ground is a plane.
class Warped {
  constructor(canvas, data) {
    this.drawing = new Drawing(canvas);
    this.data = data;
    this.grid = data.map.straight.map(decoded);
    const [x0, x1, y0, y1] = data.map.extent;
    this.plane = this.drawing.mesh(surface(2, 2, (i, j) => [[i ? x1 : x0, j ? y1 : y0, 0], [0, 0, 1]]));
  }

  paint(view, motion, options) {
    const d = this.drawing, data = this.data;
    d.begin(view.eye, view.target, view.paper);
    d.draw(this.plane, placed([0, 0, 0], NO_TURN, [1, 1, 1]), [1, 1, 1, 1], GROUND, [-1, 1]);
    if (options.grid) for (const line of this.grid) d.lines(line, [0.15, 0.4, 0.8, 0.3]);
    if (options.paths) d.lines(motion.center, [0.95, 0.65, 0.1, 1]);
    const [p, q] = motion.body(0), box = data.torso;
    d.draw(d.shapes.box, placed(add(p, turned(q, box.center)), q, box.half), [0.75, 0.14, 0.12, data.map.has_base ? 1 : 0.25]);
    data.feet.forEach((foot, e) => {
      const touch = motion.ofFoot(motion.touch, e);
      d.lines([...p, ...touch], [0.1, 0.1, 0.12, 0.9], true);
      d.draw(d.shapes.sphere, placed(touch, NO_TURN, [0.022, 0.022, 0.022]), color(foot.color));
      if (options.forces) d.arrow(touch, scaled(motion.ofFoot(motion.force, e), FORCE_LENGTH / data.weight), 0.012, color(foot.color));
    });
  }
}
