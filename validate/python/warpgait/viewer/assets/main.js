// The page: time, camera, switches, and what is under the pointer.

const SLOW = 40, COARSEST = 0.4; // ms a frame, and the least quality

const by = (id) => document.getElementById(id);

function element(kind, text, parent, name) {
  const made = document.createElement(kind);
  if (text !== undefined) made.textContent = text;
  if (name) made.className = name;
  parent.append(made);
  return made;
}

function start() {
  const data = JSON.parse(by("data").textContent);
  let plan, flat;
  const replay = data.replay ? new Motion(data.replay, data.rate, data.feet.length) : null;
  const take = () => {
    plan = new Motion(data.plan, data.rate, data.feet.length);
    data.plan.contact = plan.contact;
    flat = data.map ? new Motion(data.warped, data.rate, data.feet.length) : null;
  };
  take();
  if (replay) data.replay.contact = replay.contact;
  const ambient = new Ambient(by("ambient"), data);
  const warped = data.map ? new Warped(by("warped"), data) : null;
  const options = {};
  const linked = Number(location.hash.slice(1)); // page.html#2.5 opens at 2.5 s
  const state = { time: linked >= 0 ? Math.min(linked, data.duration) : 0, playing: false, speed: 1, yaw: -0.9, pitch: 0.42, distance: 3.2, shift: [0, 0, 0], stale: true };
  window.warpgait = { state, frames: 0, iterates: 0 };

  const tip = by("tip");
  function say(lines, event) {
    tip.hidden = !lines;
    if (!lines) return;
    tip.textContent = lines.join("\n");
    tip.style.left = `${Math.min(event.clientX + 14, window.innerWidth - tip.offsetWidth - 6)}px`;
    tip.style.top = `${Math.min(event.clientY + 12, window.innerHeight - tip.offsetHeight - 6)}px`;
  }
  function go(time) {
    state.time = Math.min(Math.max(time, 0), data.duration);
    state.stale = true;
  }
  const timeline = new Timeline(by("timeline"), data, go, say);
  facts(data, go);
  switches(data, options, state);
  play(data, state, go);
  for (const canvas of warped ? [by("ambient"), by("warped")] : [by("ambient")]) camera(canvas, state);
  by("ambient").addEventListener("pointermove", (event) => say(under(event), event));
  by("ambient").addEventListener("pointerleave", () => say(null));
  window.addEventListener("resize", () => (state.stale = true));

  if (data.live) listen(data, () => {
    take();
    by("facts").replaceChildren();
    facts(data, go);
    timeline.key = null;
    state.stale = true;
    window.warpgait.iterates += 1;
  });

  // What is near the pointer, in words.
  function under(event) {
    const box = by("ambient").getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    const found = [];
    const near = (place, lines) => {
      const p = ambient.drawing.seen(place);
      if (p) found.push([Math.hypot(p[0] - x, p[1] - y), lines]);
    };
    const xyz = (p) => p.map((v) => v.toFixed(3)).join(", ");
    for (const [motion, name] of [[plan, "plan"], [options.replay ? replay : null, "replay"]]) {
      if (!motion) continue;
      data.feet.forEach((foot, e) => {
        const touch = motion.ofFoot(motion.touch, e), force = motion.ofFoot(motion.force, e), normal = motion.ofFoot(motion.normal, e);
        const push = dot(force, normal), shear = length(sub(force, scaled(normal, push))), lines = [`${foot.name}, ${name}: ${motion.touches(e) ? "standing" : "in the air"}`, `${xyz(touch)} m`];
        if (push > 1) lines.push(`${push.toFixed(0)} N along the normal, ${shear.toFixed(0)} N across`, `${((100 * shear) / (data.friction * push)).toFixed(0)} % of the friction`);
        near(touch, lines);
      });
      near(motion.vector(motion.center, 3), [`center of mass, ${name}`, `${xyz(motion.vector(motion.center, 3))} m`]);
    }
    if (options.footholds) for (const hold of data.footholds) near(hold.place, [`${data.feet[hold.foot].name} stands here`, `${hold.start.toFixed(2)} to ${hold.end.toFixed(2)} s`, `${xyz(hold.place)} m`]);
    found.sort((a, b) => a[0] - b[0]);
    return found.length && found[0][0] < 16 ? found[0][1] : null;
  }

  const darkness = matchMedia("(prefers-color-scheme:dark)");
  const colors = () => {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(["ink", "soft", "line", "plan", "real", "fail"].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  };
  let ink = colors();
  darkness.addEventListener("change", () => {
    ink = colors();
    state.stale = true;
  });
  let before = performance.now(), slow = 0;
  // Coarser pictures while they move too slowly, fine ones when they stand.
  function adapt(milliseconds) {
    slow = state.playing ? 0.8 * slow + 0.2 * Math.min(milliseconds, 500) : 0;
    if (slow > SLOW && Drawing.quality > COARSEST) {
      Drawing.quality *= 0.8;
      slow = 0;
    } else if (!state.playing && Drawing.quality < 1) {
      Drawing.quality = 1;
      state.stale = true;
    }
  }
  function frame(now) {
    const passed = Math.min((now - before) / 1000, 0.1);
    adapt(now - before);
    before = now;
    if (state.playing) {
      state.time += passed * state.speed;
      if (state.time > data.duration) state.time = 0;
      state.stale = true;
    }
    if (state.stale) paint();
    requestAnimationFrame(frame);
  }
  function paint() {
    state.stale = false;
    plan.at(state.time);
    if (replay) replay.at(state.time);
    const dark = darkness.matches, paper = dark ? PAPER.dark : PAPER.light;
    const look = (center) => {
      const target = add(options.follow ? center : data.center, state.shift), cos = Math.cos(state.pitch);
      return { target, eye: add(target, scaled([cos * Math.cos(state.yaw), cos * Math.sin(state.yaw), Math.sin(state.pitch)], state.distance)), paper };
    };
    ambient.paint(look(plan.vector(plan.center, 3)), plan, replay, options);
    if (warped) warped.paint(look(flat.at(state.time).vector(flat.center, 3)), flat, options);
    timeline.paint(state.time, ink);
    by("time").textContent = `${state.time.toFixed(2)} / ${data.duration.toFixed(2)} s`;
    window.warpgait.frames += 1;
  }
  requestAnimationFrame(frame);
}

// A solve that is watched: each iterate as it comes, and the page anew when it shows something else.
function listen(data, changed) {
  const source = new EventSource("/events"), problem = by("problem");
  source.onmessage = (event) => {
    const news = JSON.parse(event.data);
    if (news.scene !== data.scene) return location.reload();
    problem.hidden = true;
    Object.assign(data, news);
    changed();
  };
  source.onerror = () => {
    problem.textContent = "The program no longer answers. This is the last that it showed.";
    problem.hidden = false;
  };
}

// Drag turns, with Shift or the other button it moves; the wheel or two fingers change the distance.
function camera(canvas, state) {
  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const here = [event.clientX, event.clientY], [dx, dy] = [here[0] - last[0], here[1] - last[1]];
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1], gap = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      state.distance *= gap(last) / Math.max(gap(here), 1);
    } else if (event.shiftKey || event.buttons & 6) {
      const reach = state.distance / 900, right = [-Math.sin(state.yaw), Math.cos(state.yaw), 0];
      state.shift = add(state.shift, add(scaled(right, -dx * reach), [0, 0, dy * reach]));
    } else {
      state.yaw -= dx * 0.006;
      state.pitch = Math.min(Math.max(state.pitch + dy * 0.006, -0.3), 1.5);
    }
    state.distance = Math.min(Math.max(state.distance, 0.4), 40);
    fingers.set(event.pointerId, here);
    state.stale = true;
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    state.distance = Math.min(Math.max(state.distance * Math.exp(event.deltaY * 0.001), 0.4), 40);
    state.stale = true;
  }, { passive: false });
}

function play(data, state, go) {
  const button = by("play");
  const toggle = () => {
    state.playing = !state.playing;
    button.textContent = state.playing ? "Pause" : "Play";
  };
  button.addEventListener("click", toggle);
  by("speed").addEventListener("change", (event) => (state.speed = Number(event.target.value)));
  window.addEventListener("keydown", (event) => {
    if (["SELECT", "INPUT", "SUMMARY", "BUTTON"].includes(event.target.tagName)) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === " ") toggle();
    else if (step) go(state.time + (step * (event.shiftKey ? 10 : 1)) / data.rate);
    else return;
    event.preventDefault();
  });
}

function switches(data, options, state) {
  const all = [["forces", "forces", true], ["cones", "friction cones", true], ["footholds", data.patches.length ? "footholds and patches" : "footholds", true], ["paths", "paths", true]];
  if (data.replay) all.push(["replay", "replay", true]);
  if (data.ground.raw) all.push(["raw", data.ground.raw_label, data.ground.raw_first]);
  if (data.map) all.push(["grid", "grid of the warped space", true]);
  all.push(["follow", "follow", true]);
  for (const [name, words, on] of all) {
    const label = element("label", undefined, by("switches")), box = element("input", undefined, label);
    box.type = "checkbox";
    box.checked = options[name] = on;
    label.append(` ${words}`);
    box.addEventListener("change", () => {
      options[name] = box.checked;
      state.stale = true;
    });
  }
}

// Verdicts, margins, and the laws, each with the moment at which it is worst.
function facts(data, go) {
  const side = by("facts");
  for (const line of data.summary) element("p", line.text, side, line.kind);
  for (const [title, rows, open] of data.tables) {
    const details = element("details", undefined, side);
    details.open = open;
    element("summary", title, details);
    const table = element("table", undefined, element("div", undefined, details, "scroll"));
    for (const each of rows) {
      const line = element("tr", undefined, table);
      const name = element("td", undefined, line);
      if (each.time === null) element("span", each.name, name, each.good ? "" : "fail");
      else {
        element("button", each.name, name, each.good ? "jump" : "jump fail").addEventListener("click", () => go(each.time));
        element("span", ` ${each.time.toFixed(2)} s${each.foot ? ` ${each.foot}` : ""}`, name, "soft");
      }
      element("td", each.value, line, "n");
    }
  }
}

try {
  start();
} catch (error) {
  by("problem").textContent = `This page cannot be shown: ${error.message}.`;
  by("problem").hidden = false;
  throw error;
}
