// The map: estimates filled, wanted places dashed, truth hollow. World x right, y up, in metres.

import { by, color, make, robotColor } from "./dom.js";

const TRAIL_POINTS = 600, LEAST_SPAN_M = 4, MARGIN = 1.35, LEAST_BODY_PX = 20, RAY_M = 3;
const LAYERS = [
  ["follow", "Follow", true], ["trails", "Trails", true], ["rays", "Bearings", true],
  ["ellipses", "95 %", true], ["places", "Wanted", true], ["truth", "Truth", false],
];

export class FleetMap {
  constructor() {
    this.canvas = by("map");
    this.context = this.canvas.getContext("2d");
    this.robots = [];
    this.frames = [];
    this.details = [];
    this.places = [];
    this.trails = [];
    this.trueTrails = [];
    this.particles = [];
    this.landmarks = [];
    this.fresh = true;
    this.shownMs = performance.now();
    this.view = { x: 0, y: 0, scale: 40 };
    this.layers = Object.fromEntries(LAYERS.map(([key, , on]) => [key, on]));
    this.changed = () => {};
    this.buttons();
    this.gestures();
    this.theme();
    new ResizeObserver(() => this.resize()).observe(this.canvas);
  }

  buttons() {
    for (const [key, text] of LAYERS) {
      const button = make("button", { type: "button", textContent: text, id: `layer-${key}` });
      const show = () => button.setAttribute("aria-pressed", this.layers[key]);
      button.onclick = () => { this.layers[key] = !this.layers[key]; show(); this.legend(); this.draw(); this.changed(key); };
      show();
      by("layers").append(button);
      if (key === "follow") this.showFollow = show;
      if (key === "truth") button.title = "Where simulated robots really are; no robot knows it";
    }
    this.legend();
  }

  legend() {
    const entries = [["estimate", "Estimate"]];
    if (this.layers.places) entries.push(["wanted", "Wanted place"]);
    if (this.layers.truth) entries.push(["true", "Truth (simulation)"]);
    by("legend").replaceChildren(...entries.map(([kind, text]) =>
      make("span", { className: `key ${kind}` }, make("i"), text)));
  }

  theme() {
    this.ink = color("--text");
    this.muted = color("--muted");
    this.faint = color("--grid");
    this.paper = color("--map");
    this.truthInk = color("--truth");
    this.landmarkInk = color("--landmark");
    this.colors = this.robots.map((_, index) => robotColor(index));
    this.draw();
  }

  begin(hello) {
    this.robots = hello.robots;
    this.landmarks = hello.landmarks;
    this.fixed = new Map(hello.landmarks.map(([id, x, y]) => [id, [x, y]]));
    this.markers = new Map();
    hello.robots.forEach((robot, index) => {
      for (const [id, x, y] of robot.markers) this.markers.set(id, [index, x, y]);
    });
    const known = (points) => points.filter(([x]) => x !== null);
    this.trails = hello.past.map((past) => known(past.trail));
    this.trueTrails = hello.past.map((past) => known(past.true_trail));
    this.frames = [];
    this.details = [];
    this.places = [];
    this.indices = new Map(hello.robots.map(({ name }, index) => [name, index]));
    this.fresh = true;
    this.theme();
  }

  take(frames) {
    this.frames = frames;
    this.places = this.layers.places ? this.robots.map((robot, index) => this.wanted(robot, index)) : [];
  }

  // The wanted place beside the leader, where the leader believes to be.
  wanted(robot, index) {
    const leader = this.frames[this.indices.get(robot.leader)]?.pose, offset = this.details[index]?.offset;
    if (!leader || !offset) return null;
    return [...fromBody(leader, ...offset), leader[2]];
  }

  // Lets the trails grow.
  extend() {
    this.frames.forEach((frame, index) => {
      extend(this.trails[index], frame.pose);
      extend(this.trueTrails[index], frame.truth);
    });
  }

  show() {
    // Towards the robots with a time constant of a third of a second, however many frames come.
    const nowMs = performance.now(), share = 1 - Math.exp(-(nowMs - this.shownMs) / 330);
    this.shownMs = nowMs;
    if (this.layers.follow) this.fit(share);
    this.draw();
  }

  fit(share) {
    const points = [];
    for (const frame of this.frames) points.push(frame.pose, this.layers.truth ? frame.truth : null);
    points.push(...this.places);
    const known = points.filter((at) => at);
    if (!known.length) return;
    const xs = known.map((at) => at[0]), ys = known.map((at) => at[1]);
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const scale = Math.min(width / Math.max(LEAST_SPAN_M, MARGIN * (right - left)),
      height / Math.max(LEAST_SPAN_M, MARGIN * (high - low)));
    const wanted = { x: (left + right) / 2, y: (low + high) / 2, scale };
    const step = this.fresh ? 1 : share;
    this.fresh = false;
    for (const key of ["x", "y", "scale"]) this.view[key] += step * (wanted[key] - this.view[key]);
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    this.draw();
  }

  at(x, y) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [width / 2 + (x - this.view.x) * this.view.scale, height / 2 - (y - this.view.y) * this.view.scale];
  }

  draw() {
    const c = this.context, ratio = window.devicePixelRatio || 1;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = this.paper;
    c.fillRect(0, 0, this.canvas.clientWidth, this.canvas.clientHeight);
    this.grid(c);
    for (const [id, x, y] of this.landmarks) this.landmark(c, id, x, y);
    const each = (paint) => this.frames.forEach((frame, index) => paint(frame, index, this.colors[index]));
    if (this.layers.trails) {
      if (this.layers.truth) this.trueTrails.forEach((trail) => this.line(c, trail, this.truthInk, 1, 0.5));
      this.trails.forEach((trail, index) => this.line(c, trail, this.colors[index], 1.75, 0.55));
    }
    each((frame, index, ink) => this.cloud(c, this.particles[index], ink));
    if (this.layers.rays) each((frame, index, ink) => this.rays(c, frame, this.details[index]?.looks, ink));
    if (this.layers.ellipses) each((frame, index, ink) => this.ellipse(c, frame, this.details[index]?.ellipse, ink));
    this.places.forEach((at, index) => at && this.body(c, at, index, { dashed: this.colors[index] }));
    if (this.layers.truth) each((frame, index) => frame.truth && this.body(c, frame.truth, index, { hollow: this.truthInk }));
    each((frame, index, ink) => frame.pose && this.body(c, frame.pose, index, { filled: ink, faded: !frame.fresh }));
    each((frame, index, ink) => frame.pose && this.name(c, frame.pose, this.robots[index].name, ink));
  }

  grid(c) {
    const step = niceStep(70 / this.view.scale);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const halfX = width / 2 / this.view.scale, halfY = height / 2 / this.view.scale;
    c.strokeStyle = this.faint;
    c.fillStyle = this.muted;
    c.lineWidth = 1;
    c.font = "11px system-ui, sans-serif";
    c.beginPath();
    for (let x = Math.ceil((this.view.x - halfX) / step) * step; x < this.view.x + halfX; x += step) {
      const px = Math.round(this.at(x, 0)[0]) + 0.5;
      c.moveTo(px, 0);
      c.lineTo(px, height);
    }
    for (let y = Math.ceil((this.view.y - halfY) / step) * step; y < this.view.y + halfY; y += step) {
      const py = Math.round(this.at(0, y)[1]) + 0.5;
      c.moveTo(0, py);
      c.lineTo(width, py);
    }
    c.stroke();
    this.scaleBar(c, step, width, height);
  }

  scaleBar(c, step, width, height) {
    const length = step * this.view.scale, x = width - 16 - length, y = height - 16;
    c.strokeStyle = this.muted;
    c.lineWidth = 1.5;
    c.beginPath();
    c.moveTo(x, y - 4); c.lineTo(x, y); c.lineTo(x + length, y); c.lineTo(x + length, y - 4);
    c.stroke();
    c.textAlign = "center";
    c.fillText(`${step} m`, x + length / 2, y - 6);
  }

  landmark(c, id, x, y) {
    const [px, py] = this.at(x, y);
    c.fillStyle = this.landmarkInk;
    c.beginPath();
    c.moveTo(px, py - 7); c.lineTo(px + 6, py + 4); c.lineTo(px - 6, py + 4);
    c.closePath();
    c.fill();
    c.textAlign = "left";
    c.fillText(id, px + 9, py + 4);
  }

  line(c, points, ink, width, alpha) {
    if (points.length < 2) return;
    c.globalAlpha = alpha;
    c.strokeStyle = ink;
    c.lineWidth = width;
    c.lineJoin = "round";
    c.beginPath();
    for (const [x, y] of points) c.lineTo(...this.at(x, y));
    c.stroke();
    c.globalAlpha = 1;
  }

  cloud(c, points, ink) {
    if (!points?.length) return;
    c.fillStyle = ink;
    c.globalAlpha = 0.45;
    for (const [x, y] of points) {
      const [px, py] = this.at(x, y);
      c.fillRect(px - 1, py - 1, 2, 2);
    }
    c.globalAlpha = 1;
  }

  rays(c, frame, looks, ink) {
    if (!frame.pose || !looks) return;
    const [x, y, heading] = frame.pose;
    c.strokeStyle = ink;
    c.lineWidth = 1;
    c.globalAlpha = 0.4;
    c.beginPath();
    for (const [marker, bearing] of looks) {
      const target = this.target(marker);
      const length = target ? Math.hypot(target[0] - x, target[1] - y) : RAY_M;
      c.moveTo(...this.at(x, y));
      c.lineTo(...this.at(x + length * Math.cos(heading + bearing), y + length * Math.sin(heading + bearing)));
    }
    c.stroke();
    c.globalAlpha = 1;
  }

  target(marker) {
    if (this.fixed.has(marker)) return this.fixed.get(marker);
    if (!this.markers.has(marker)) return null;
    const [index, forward, left] = this.markers.get(marker);
    const pose = this.frames[index]?.pose;
    return pose ? fromBody(pose, forward, left) : null;
  }

  ellipse(c, frame, ellipse, ink) {
    if (!ellipse || !frame.pose) return;
    const [major, minor, direction] = ellipse;
    const [px, py] = this.at(frame.pose[0], frame.pose[1]);
    c.beginPath();
    c.ellipse(px, py, major * this.view.scale, minor * this.view.scale, -direction, 0, 2 * Math.PI);
    c.fillStyle = c.strokeStyle = ink;
    c.globalAlpha = 0.12;
    c.fill();
    c.globalAlpha = 0.8;
    c.lineWidth = 1;
    c.stroke();
    c.globalAlpha = 1;
  }

  // A car seen from above; its pose is that of the front wheel, the body lies behind.
  body(c, [x, y, heading, steering], index, { filled, dashed, hollow, faded }) {
    const base = this.robots[index].wheelbase_m;
    const scale = Math.max(this.view.scale, LEAST_BODY_PX / (1.5 * base));
    const length = base * scale, half = 0.36 * length, nose = 0.28 * length, tail = 0.22 * length;
    c.save();
    c.translate(...this.at(x, y));
    c.rotate(-heading);
    c.globalAlpha = faded ? 0.35 : 1;
    c.beginPath();
    c.moveTo(nose, 0);
    c.lineTo(0, -half); c.lineTo(-length - tail, -half); c.lineTo(-length - tail, half); c.lineTo(0, half);
    c.closePath();
    if (filled) { c.fillStyle = filled; c.fill(); c.strokeStyle = this.paper; c.lineWidth = 1.5; c.stroke(); }
    if (dashed) { c.setLineDash([4, 3]); c.strokeStyle = dashed; c.lineWidth = 1.5; c.stroke(); c.setLineDash([]); }
    if (hollow) { c.strokeStyle = hollow; c.lineWidth = 1.75; c.stroke(); }
    if (!dashed && steering !== null && steering !== undefined) {
      c.rotate(-steering);
      c.strokeStyle = hollow ?? this.ink;
      c.lineWidth = Math.max(2.5, 0.12 * length);
      c.beginPath();
      c.moveTo(-0.26 * length, 0); c.lineTo(0.26 * length, 0);
      c.stroke();
    }
    c.restore();
  }

  name(c, [x, y], text, ink) {
    const [px, py] = this.at(x, y);
    c.font = "600 12px system-ui, sans-serif";
    c.textAlign = "left";
    c.lineWidth = 3;
    c.strokeStyle = this.paper;
    c.strokeText(text, px + 12, py - 10);
    c.fillStyle = ink;
    c.fillText(text, px + 12, py - 10);
  }

  free() {
    if (!this.layers.follow) return;
    this.layers.follow = false;
    this.showFollow();
  }

  zoom(factor, px, py) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const dx = (px - width / 2) / this.view.scale, dy = (height / 2 - py) / this.view.scale;
    this.view.scale = Math.min(2000, Math.max(2, this.view.scale * factor));
    this.view.x += dx - (px - width / 2) / this.view.scale;
    this.view.y += dy - (height / 2 - py) / this.view.scale;
  }

  gestures() {
    const pointers = new Map(), canvas = this.canvas;
    const place = (event) => [event.offsetX, event.offsetY];
    const apart = () => {
      const [[ax, ay], [bx, by_]] = [...pointers.values()];
      return Math.hypot(ax - bx, ay - by_);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, place(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      const from = pointers.get(event.pointerId);
      if (!from) return;
      this.free();
      const before = pointers.size === 2 ? apart() : 0, to = place(event);
      pointers.set(event.pointerId, to);
      if (pointers.size === 1) {
        this.view.x -= (to[0] - from[0]) / this.view.scale;
        this.view.y += (to[1] - from[1]) / this.view.scale;
      } else if (pointers.size === 2 && before > 0) {
        this.zoom(apart() / before, ...to);
      }
      this.draw();
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.free();
      this.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
      this.draw();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const step = 40 / this.view.scale, { clientWidth: width, clientHeight: height } = this.canvas;
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (moves[event.key]) {
      this.view.x += moves[event.key][0];
      this.view.y += moves[event.key][1];
    } else if (event.key === "+" || event.key === "-") {
      this.zoom(event.key === "+" ? 1.25 : 0.8, width / 2, height / 2);
    } else return;
    event.preventDefault();
    this.free();
    this.draw();
  }
}

// A point given in a robot's body axes.
function fromBody([x, y, heading], forward, left) {
  const cos = Math.cos(heading), sin = Math.sin(heading);
  return [x + cos * forward - sin * left, y + sin * forward + cos * left];
}

function extend(trail, at) {
  if (!at || !trail) return;
  const last = trail.at(-1);
  if (last && Math.hypot(at[0] - last[0], at[1] - last[1]) < 0.005) return;
  trail.push([at[0], at[1]]);
  if (trail.length > TRAIL_POINTS) trail.shift();
}

function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least);
}
