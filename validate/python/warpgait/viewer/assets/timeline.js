// Contacts, residuals and tracking over time; drag to go there.

const ROW = 15, CURVE = 46, LEFT = 8, RIGHT = 8, TOP = 4;

class Timeline {
  constructor(canvas, data, go, say) {
    Object.assign(this, { canvas, data, go, say });
    this.curves = data.curves.map((curve) => ({ ...curve, values: decoded(curve.values) }));
    canvas.style.height = `${TOP + ROW * data.feet.length + (CURVE + 6) * this.curves.length + 20}px`;
    const time = (event) => {
      const box = canvas.getBoundingClientRect();
      return Math.min(Math.max((event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT), 0), 1) * data.duration;
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      go(time(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) go(time(event));
      say(this.told(time(event)), event);
    });
    canvas.addEventListener("pointerleave", () => say(null));
  }

  told(time) {
    const k = Math.min(Math.round(time * this.data.rate), this.data.frames - 1);
    const standing = this.data.feet.filter((_, e) => this.data.plan.contact[k * this.data.feet.length + e]).map((foot) => foot.name);
    const values = this.curves.map((curve) => `${curve.name}: ${curve.values[k] === undefined ? "none" : `${curve.values[k].toPrecision(3)} ${curve.unit}`}`);
    return [`${time.toFixed(2)} s`, `standing: ${standing.join(" ") || "none"}`, ...values];
  }

  // All but the moment that is shown; it changes only with the size of the window and its colors.
  background(width, height, dense, ink) {
    const { data } = this, canvas = document.createElement("canvas");
    canvas.width = Math.round(width * dense);
    canvas.height = Math.round(height * dense);
    const c = canvas.getContext("2d"), across = width - LEFT - RIGHT, at = (t) => LEFT + (across * t) / data.duration;
    c.scale(dense, dense);
    c.font = "11px system-ui, sans-serif";
    data.feet.forEach((foot, e) => {
      const top = TOP + ROW * e;
      for (const [motion, from, size, alpha] of [[data.plan, 1, 8, 1], [data.replay, 10, 3, 0.6]]) {
        if (!motion) continue;
        c.fillStyle = foot.color;
        c.globalAlpha = alpha;
        const count = motion.contact.length / data.feet.length;
        for (let k = 0, first = -1; k <= count; k++) {
          const touching = k < count && motion.contact[k * data.feet.length + e];
          if (touching && first < 0) first = k;
          if (touching || first < 0) continue;
          c.fillRect(at(first / data.rate), top + from, at(k / data.rate) - at(first / data.rate), size);
          first = -1;
        }
      }
      c.globalAlpha = 1;
      c.fillStyle = "#fff";
      c.fillText(foot.name, LEFT + 2, top + 9);
    });
    this.curves.forEach((curve, n) => {
      const top = TOP + ROW * data.feet.length + 6 + (CURVE + 6) * n, most = Math.max(curve.values.reduce((a, b) => Math.max(a, b), 0), curve.limit || 0, 1e-9);
      const y = (value) => top + CURVE - ((CURVE - 12) * Math.min(value, most)) / most;
      c.strokeStyle = ink.line;
      c.strokeRect(LEFT, top, across, CURVE);
      if (curve.limit) {
        c.strokeStyle = ink.fail;
        c.setLineDash([4, 3]);
        c.beginPath();
        c.moveTo(LEFT, y(curve.limit));
        c.lineTo(LEFT + across, y(curve.limit));
        c.stroke();
        c.setLineDash([]);
      }
      c.strokeStyle = curve.replay ? ink.real : ink.plan;
      c.beginPath();
      curve.values.forEach((value, k) => c[k ? "lineTo" : "moveTo"](at(k / data.rate), y(value)));
      c.stroke();
      c.fillStyle = ink.soft;
      c.fillText(`${curve.name}, ${curve.unit}; ${most.toPrecision(2)} at the top`, LEFT + 3, top + 10);
    });
    for (const moment of data.moments) {
      c.fillStyle = moment.good ? ink.soft : ink.fail;
      const x = at(moment.time), base = height - 12;
      c.beginPath();
      c.moveTo(x, base - (moment.good ? 4 : 8));
      c.lineTo(x - (moment.good ? 2 : 5), base);
      c.lineTo(x + (moment.good ? 2 : 5), base);
      c.fill();
    }
    c.fillStyle = ink.soft;
    const step = [0.5, 1, 2, 5, 10, 20, 50, 100].find((s) => data.duration / s <= 12) || 200;
    for (let t = 0; t <= data.duration + 1e-9; t += step) c.fillText(`${t}`, Math.min(at(t), width - 16), height - 2);
    return canvas;
  }

  paint(time, ink) {
    const { canvas, data } = this, dense = Math.min(window.devicePixelRatio || 1, 2), width = canvas.clientWidth, height = canvas.clientHeight;
    const key = [width, height, dense, ink.ink].join();
    if (this.key !== key) {
      this.key = key;
      this.still = this.background(width, height, dense, ink);
      canvas.width = this.still.width;
      canvas.height = this.still.height;
    }
    const c = canvas.getContext("2d");
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, canvas.width, canvas.height);
    c.drawImage(this.still, 0, 0);
    c.scale(dense, dense);
    c.fillStyle = ink.ink;
    c.fillRect(LEFT + ((width - LEFT - RIGHT) * time) / data.duration - 0.75, 0, 1.5, height - 12);
  }
}
