// Range error, bearing error, NIS and speed of every robot over the last minute.

import { by, color, make, robotColor } from "./dom.js";

const LENGTH = 600, SPAN_S = 60, REDRAW_MS = 250;
const DEGREES = 180 / Math.PI;
const QUANTITIES = [
  ["Range error", "m", 1, 0.05], ["Bearing error", "°", DEGREES, 3],
  ["NIS, mean of the last bearings", "", 1, 1], ["Speed", "m/s", 1, 0.5],
];

export class Plots {
  constructor() {
    this.times = [];
    this.values = [];
    this.robots = [];
    this.drawnMs = 0;
    this.plots = [];
    new ResizeObserver(() => this.resize()).observe(by("plots"));
  }

  begin(hello) {
    this.robots = hello.robots;
    this.times = hello.past[0].t_s.slice();
    this.values = hello.past.map((past) => QUANTITIES.map((_, which) => past.values.map((row) => row[which])));
    this.theme();
  }

  theme() {
    by("keys").replaceChildren(...this.robots.map((robot, index) => {
      const key = make("span", { className: "robot-key", textContent: robot.name });
      key.style.setProperty("--ink", robotColor(index));
      return key;
    }));
    for (const plot of this.plots) plot.destroy();
    by("plots").replaceChildren();
    this.plots = QUANTITIES.map((quantity) => this.make(...quantity));
    this.redraw();
  }

  make(title, unit, factor, leastSpan) {
    const box = make("figure", {}, make("figcaption", { textContent: unit ? `${title} [${unit}]` : title }));
    by("plots").append(box);
    const ink = color("--muted"), grid = { stroke: color("--grid"), width: 1 }, font = "11px system-ui, sans-serif";
    const axis = { stroke: ink, grid, ticks: { show: false }, font };
    const plot = new uPlot({
      ...this.size(),
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, points: { size: 5 } },
      padding: [8, 8, 0, 0],
      scales: {
        x: { time: false, range: [-SPAN_S, 0] },
        y: { range: (_, low, high) => range(low, high, leastSpan) },
      },
      axes: [
        { ...axis, size: 26, values: (_, ticks) => ticks.map((tick) => `${tick} s`) },
        { ...axis, size: 48 },
      ],
      series: [{}, ...this.robots.map((robot, index) => ({
        label: robot.name, stroke: robotColor(index), width: 1.5, points: { show: false },
      }))],
    }, [[], ...this.robots.map(() => [])], box);
    const canvas = box.querySelector("canvas");
    canvas.setAttribute("role", "img");
    canvas.ariaLabel = `${title} of every robot over the last minute`;
    return plot;
  }

  size() {
    const width = by("plots").clientWidth, columns = width > 1100 ? 4 : width > 560 ? 2 : 1;
    return { width: Math.max(200, Math.floor((width - 12 * (columns - 1)) / columns)), height: 150 };
  }

  resize() {
    for (const plot of this.plots) plot.setSize(this.size());
  }

  add(t, details) {
    this.times.push(t);
    details.forEach(({ values }, index) => {
      QUANTITIES.forEach((_, which) => this.values[index][which].push(values ? values[which] : null));
    });
    if (this.times.length > LENGTH) {
      this.times.shift();
      for (const robot of this.values) for (const row of robot) row.shift();
    }
    if (performance.now() - this.drawnMs > REDRAW_MS && !document.hidden) this.redraw();
  }

  redraw() {
    this.drawnMs = performance.now();
    const now = this.times.at(-1) ?? 0, times = this.times.map((t) => t - now);
    this.plots.forEach((plot, which) => {
      const factor = QUANTITIES[which][2];
      const rows = this.values.map((robot) =>
        factor === 1 ? robot[which] : robot[which].map((value) => value === null ? null : factor * value));
      plot.setData([times, ...rows]);
    });
  }
}

function range(low, high, leastSpan) {
  if (low === null || high === null) return [0, leastSpan];
  const middle = (low + high) / 2, half = Math.max(high - low, leastSpan) * 0.55;
  return [middle - half, middle + half];
}
