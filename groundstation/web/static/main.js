// Wiring: messages from the server to the parts of the page.

import { Commands } from "./commands.js";
import { Connection } from "./connection.js";
import { by, set } from "./dom.js";
import { EventLog } from "./log.js";
import { FleetMap } from "./map.js";
import { Player } from "./player.js";
import { Plots } from "./plots.js";
import { RobotTable } from "./table.js";

const SAMPLE_S = 0.1;

// Name and token of whoever sits here. The token comes with the address and is then hidden.
const operator = {
  name: localStorage.getItem("echelon.operator") ?? `operator ${Math.random().toString(36).slice(2, 5)}`,
  token: new URLSearchParams(location.hash.slice(1)).get("token") ?? sessionStorage.getItem("echelon.token") ?? "",
  set(name, token) {
    this.name = name.trim() || this.name;
    localStorage.setItem("echelon.operator", this.name);
    if (token) this.token = token;
    sessionStorage.setItem("echelon.token", this.token);
  },
};
operator.set(operator.name, operator.token);
if (location.hash) history.replaceState(null, "", location.pathname);

let connection = null;
const reach = () => connection;
const map = new FleetMap(), plots = new Plots(), table = new RobotTable(), log = new EventLog();
const commands = new Commands(reach, operator), player = new Player(reach);
let begun = false, live = true, missionS = 0, sampledS = -Infinity, painting = false;

// What tests and the curious look at.
const seen = (window.echelon = { frames: 0, drawn: 0, connected: false, hello: 0 });

const handlers = {
  hello(hello) {
    begun = true;
    live = hello.live;
    missionS = hello.mission_s;
    sampledS = -Infinity;
    seen.hello += 1;
    document.title = `${hello.fleet} – Echelon`;
    set(by("fleet-name"), hello.fleet);
    by("fleet-name").title = `version ${hello.version}`;
    for (const part of [map, plots, table, log, commands, player]) part.begin(hello);
    connection.changed(connection.open);
    showTruth();
  },
  frame(frame) {
    if (!begun) return;
    map.take(frame.robots);
    if (!painting) {
      painting = true;
      requestAnimationFrame(() => { painting = false; map.show(); seen.drawn += 1; });
    }
    player.show(frame.playback);
    seen.frames += 1;
  },
  details({ t_s: t, robots }) {
    if (!begun) return;
    map.details = robots;
    if (t - sampledS < SAMPLE_S - 0.005) return;
    sampledS = t;
    map.extend();
    plots.add(t, robots);
  },
  rows({ robots, particles }) {
    if (!begun) return;
    table.show(robots, map.layers.truth);
    commands.show(robots);
    map.particles = particles;
    const times = robots.map((row) => row.mission_time_s).filter((t) => t !== undefined && t !== null);
    set(by("mission"), times.length ? `${Math.max(...times).toFixed(1)} of ${missionS.toFixed(0)} s` : "");
  },
  log({ lines }) { if (begun) log.add(lines); },
  control(control) { commands.controlled(control); },
  answer(answer) { commands.answered(answer); },
};

connection = new Connection(
  () => ({ name: operator.name, token: operator.token }), handlers,
  (open) => {
    seen.connected = open;
    set(by("connection"), !open ? "no connection" : live ? "live" : "replay");
    by("connection").dataset.level = !open ? "bad" : live ? "good" : "warn";
    commands.connected(open);
  });

function showTruth() {
  connection.send({ do: "show_truth", wanted: map.layers.truth });
}
map.changed = (layer) => { if (layer === "truth") showTruth(); };

function repaint() {
  map.theme();
  plots.theme();
  table.theme();
}
by("theme").onclick = () => {
  const root = document.documentElement, dark = getComputedStyle(root).colorScheme === "dark";
  root.dataset.theme = dark ? "light" : "dark";
  localStorage.setItem("echelon.theme", root.dataset.theme);
  repaint();
};
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
