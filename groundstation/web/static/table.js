// One row per robot: built once, then only cells that have changed are touched.

import { by, level, make, number, robotColor, set } from "./dom.js";

const warn = (value, limit, bad = Infinity) =>
  value === null || value === undefined ? "" : value >= bad ? "bad" : value >= limit ? "warn" : "";
const STATES = {
  RUNNING: "good", ARMED: "ready", ARMING: "warn", STOPPING: "warn", STANDBY: "idle", FAULT: "bad", ESTOP: "bad",
};

const COLUMNS = [
  ["State", (row) => [row.state || (row.alive === false ? "gone" : "silent"), STATES[row.state] ?? "silent"], "state"],
  ["Reason", (row) => [reasonOf(row), reasonLevel(row)], "reason"],
  ["Formation error", (row, truth) => [errorOf(row, truth), warn(row.formation_error_m, 0.1, 0.25)], "num"],
  ["Age", (row) => [ageOf(row.age_s), warn(row.age_s, 0.3, 0.6)], "num"],
  ["Loop p50 / p99", (row) => [pair(row.loop_p50_ms, row.loop_p99_ms, 1, " ms"), warn(row.loop_p99_ms, 8, 10)], "num"],
  ["Overruns", (row) => [number(row.overruns, 0), warn(row.overruns, 1)], "num"],
  ["Bus load", (row) => [busOf(row), busLevel(row)], "num"],
  ["Steering / drive", (row) => [drivesOf(row), drivesLevel(row)], ""],
  ["Temperature", (row) => [temperaturesOf(row), warn(hottest(row), 60, 70)], "num"],
  ["Battery", (row) => [number(row.battery_v, 1, " V"), ""], "num"],
  ["Clock", (row) => [number(row.clock_offset_ms, 1, " ms"), warn(Math.abs(row.clock_offset_ms ?? 0), 20, 50)], "num"],
  ["Observability", (row) => [observabilityOf(row), observabilityLevel(row)], "wide"],
];

export class RobotTable {
  begin(hello) {
    const head = make("thead", {}, make("tr", {}, th("Robot"), ...COLUMNS.map(([title, , kind]) => th(title, kind))));
    this.robots = hello.robots;
    this.lines = hello.robots.map((robot, index) => this.line(robot, index));
    by("robots").replaceChildren(
      make("caption", { className: "hidden-visually", textContent: "State and health of every robot" }),
      head, make("tbody", {}, ...this.lines.map(({ line }) => line)));
    this.theme();
  }

  line(robot, index) {
    const name = make("th", { scope: "row" }, make("span", { className: "robot-key", textContent: robot.name }),
      make("small", { textContent: robot.leader ? `follows ${robot.leader}` : "leads" }));
    const cells = COLUMNS.map(([title, , kind]) => {
      const value = make("span");
      const cell = make("td", { className: kind }, value);
      cell.dataset.label = title;
      return { cell, value };
    });
    const line = make("tr", { id: `robot-${robot.name}` }, name, ...cells.map(({ cell }) => cell));
    return { line, name, cells };
  }

  theme() {
    this.lines?.forEach(({ name }, index) => name.firstChild.style.setProperty("--ink", robotColor(index)));
  }

  show(rows, truth) {
    rows.forEach((row, index) => {
      COLUMNS.forEach(([, look], column) => {
        const [text, rank] = look(row, truth), { cell, value } = this.lines[index].cells[column];
        set(value, text);
        level(cell, rank);
      });
    });
  }
}

const th = (text, kind = "") => make("th", { scope: "col", textContent: text, className: kind });
const pair = (one, other, digits, unit) =>
  one === null || one === undefined ? "–" : `${one.toFixed(digits)} / ${other.toFixed(digits)}${unit}`;
const ageOf = (age) => age === null || age === undefined ? "–"
  : age < 0 ? "0 ms" : age < 10 ? `${Math.round(1000 * age)} ms` : `${age.toFixed(0)} s`;

function reasonOf(row) {
  if (row.state === "STANDBY" && row.not_ready?.length) return row.not_ready.join("; ");
  return row.reason || (row.state ? "" : "nothing heard from it");
}

function reasonLevel(row) {
  if (row.state === "FAULT" || row.state === "ESTOP") return "bad";
  return row.state === "STANDBY" && row.not_ready?.length ? "warn" : "";
}

function errorOf(row, truth) {
  const believed = number(row.formation_error_m, 3, " m");
  return truth && row.true_error_m !== undefined ? `${believed} (true ${number(row.true_error_m, 3)})` : believed;
}

function busOf(row) {
  if (row.bus_load === null || row.bus_load === undefined) return "–";
  const wrong = row.bus_state && row.bus_state.toLowerCase() !== "active" && row.bus_state.toLowerCase() !== "ok";
  return wrong ? row.bus_state : `${(100 * row.bus_load).toFixed(0)} %`;
}

function busLevel(row) {
  return busOf(row).endsWith("%") || busOf(row) === "–" ? warn(row.bus_load, 0.5, 0.7) : "bad";
}

const drivesOf = (row) => row.steering ? `${told(row.steering)} / ${told(row.drive)}` : "–";
const told = (drive) => drive.faults.length ? drive.faults.join(" ") : drive.state.toLowerCase();

function drivesLevel(row) {
  const drives = [row.steering, row.drive].filter(Boolean);
  return drives.some((drive) => drive.faults.length || drive.state === "FAULT" || drive.state === "OFFLINE") ? "bad" : "";
}

function temperaturesOf(row) {
  const known = [row.steering, row.drive].filter(Boolean).map((drive) => drive.temperature_degc);
  return known.length ? known.map((value) => number(value, 0)).join(" / ") + " °C" : "–";
}

const hottest = (row) => Math.max(...[row.steering, row.drive].filter(Boolean).map((drive) => drive.temperature_degc ?? 0), 0);

function observabilityOf(row) {
  if (row.nis_state === "high" || row.nis_state === "low") return `filter NIS ${row.nis_state}`;
  if (!(row.pose_trusted ?? true)) return "pose not trusted";
  const told = row.observability;
  if (!told) return "–";
  const spread = told.std_m === null ? "unbounded" : `${told.std_m.toPrecision(2)} m`;
  return told.weak ? `weak: ${told.direction}` : `good, ${spread}`;
}

function observabilityLevel(row) {
  const text = observabilityOf(row);
  return text.startsWith("good") || text === "–" ? "" : "warn";
}
