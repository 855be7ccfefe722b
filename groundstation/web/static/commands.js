// What the operator may do: orders, formations, emergency stop, who is in command.

import { by, make, set, speak } from "./dom.js";
import { holdToConfirm } from "./hold.js";

const ASKED = { at_start: "Do all stand at their starts again:" };
const ORDERS = [["arm", "Arm"], ["start", "Start"], ["stop", "Stop"], ["reset", "Reset"], ["at_start", "At start"]];

export class Commands {
  constructor(connection, operator) {
    this.connection = connection;
    this.operator = operator;
    this.control = null;
    this.rows = [];
    this.robots = [];
    this.live = true;
    this.estopSent = false;
    this.numbers = 0;
    this.orders();
    by("estop").onclick = () => this.estop();
    window.addEventListener("keydown", (event) => this.key(event), true);
    by("operator").onsubmit = (event) => { event.preventDefault(); operator.set(by("operator-name").value, by("token").value); connection().introduce(); };
    by("operator-name").value = operator.name;
  }

  orders() {
    const preflight = make("button", { type: "button", id: "order-preflight", textContent: "Preflight" });
    preflight.onclick = () => { this.checklist(); by("preflight").showModal(); };
    by("orders").append(preflight);
    for (const [name, text] of ORDERS) {
      const button = make("button", { type: "button", id: `order-${name}`, textContent: text });
      if (name === "stop") button.onclick = () => this.give(name);
      else holdToConfirm(button, () => `${ASKED[name] ?? text} ${this.robots.map(({ name: each }) => each).join(", ")}?`, () => this.give(name));
      by("orders").append(button);
    }
    this.take = make("button", { type: "button", id: "take", className: "wide" });
    holdToConfirm(this.take, () => "Take command?", () => this.connection().send({ do: "take_command" }));
    this.giveBack = make("button", { type: "button", id: "give-back", className: "wide", textContent: "Give command back" });
    this.giveBack.onclick = () => this.connection().send({ do: "give_back" });
    by("orders").append(this.take, this.giveBack);
  }

  begin(hello) {
    this.robots = hello.robots;
    this.checks = hello.checks;
    this.live = hello.live;
    by("commands").hidden = !hello.live;
    by("estop").hidden = !hello.live;
    const field = by("formations");
    field.hidden = hello.formations.length < 2;
    field.replaceChildren(field.firstElementChild, ...hello.formations.map((name) => {
      const button = make("button", { type: "button", id: `formation-${name}`, textContent: name });
      holdToConfirm(button, () => `Change to formation ${name}?`, () => this.give("formation", name));
      button.dataset.formation = name;
      return button;
    }));
    this.permit();
  }

  give(name, formation = "") {
    this.numbers += 1;
    set(by("answer"), `${name} ${formation}…`);
    by("answer").dataset.level = "";
    this.connection().send({ do: "order", id: this.numbers, name, formation });
  }

  answered(answer) {
    if (answer.id !== this.numbers) return;
    set(by("answer"), answer.text);
    by("answer").dataset.level = answer.accepted ? "good" : "bad";
  }

  key(event) {
    const typing = event.target.matches?.("input:not([type=range]), textarea, select");
    const stops = event.key === "Escape" || (event.key === " " && !typing);
    if (!stops || !this.live) return;
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) this.estop();
  }

  // Sent at once, again while the server has not confirmed it, and after every reconnection.
  estop() {
    this.estopSent = true;
    for (const dialog of document.querySelectorAll("dialog[open]")) dialog.close();
    this.connection().sendSurely({ do: "estop" });
    this.banner();
  }

  controlled(control) {
    this.control = control;
    if (control.estop) this.estopSent = false;
    this.permit();
    this.banner();
  }

  connected(open) {
    if (open && this.estopSent) this.connection().sendSurely({ do: "estop" });
    this.permit();
    this.banner();
  }

  permit() {
    const control = this.control, open = this.connection()?.open ?? false;
    const allowed = open && control?.enabled && control.authorised;
    const commander = control?.commander, mine = !commander || commander.you;
    for (const button of document.querySelectorAll("#orders button, #formations button")) {
      const free = button.id === "order-preflight" || button.id === "order-stop" || button === this.take;
      button.disabled = button.id !== "order-preflight" && !(allowed && (mine || free));
    }
    this.take.hidden = !allowed || mine;
    this.giveBack.hidden = !allowed || !commander?.you;
    set(this.take, commander ? `Take command from ${commander.name}` : "");
    document.body.classList.toggle("locked", Boolean(control && !control.authorised));
    set(by("can-command"), !control ? "" : !control.authorised ? "view only: token needed" : mine ? "hold to confirm" : "view only");
    set(by("commander"), !control?.enabled ? "" : !commander ? "nobody in command"
      : commander.you ? "you are in command" : `${commander.name} is in command`);
    by("commander").dataset.level = commander?.you ? "good" : commander ? "warn" : "";
  }

  banner() {
    const found = [], stop = this.control?.estop, open = this.connection()?.open ?? false;
    if (!open) found.push(["bad", "No connection to the ground station: what you see is old. ",
      this.live ? "An emergency stop from here does not reach the robots now: use echelon estop or the contactor." : ""]);
    if (this.estopSent) found.push(["bad", "EMERGENCY STOP pressed. ", open ? "Waiting for the ground station." : "It will be sent as soon as there is a connection."]);
    if (stop) found.push(["bad", `EMERGENCY STOP by ${stop.by}. `, confirmations(stop)]);
    const spoken = found.map(([, head, text]) => head + text).join(" ");
    if (spoken !== this.spoken) {
      this.spoken = spoken;
      by("banners").replaceChildren(...found.map(([rank, head, text]) => {
        const banner = make("div", { className: "banner" }, make("strong", { textContent: head }), make("span", { textContent: text }));
        banner.dataset.level = rank;
        return banner;
      }));
      if (stop?.repeating) by("banners").lastChild.append(this.withdrawal());
    }
    document.body.classList.toggle("offline", !open);
  }

  withdrawal() {
    const button = make("button", { type: "button", id: "withdraw", textContent: "Stop repeating" });
    button.disabled = !this.control.authorised;
    holdToConfirm(button, () => "Stop repeating the emergency stop?", () => this.connection().send({ do: "withdraw" }));
    return button;
  }

  show(rows) {
    this.rows = rows;
    const unready = rows.map((row, index) => [this.robots[index].name, row]).filter(([, row]) => !row.ready);
    const silent = rows.filter((row) => !row.state).length;
    const active = rows.some((row) => row.state && row.state !== "STANDBY");
    const text = silent ? `${rows.length - silent} of ${rows.length} robots heard`
      : active ? summary(rows)
      : unready.length ? `Not ready: ${unready.map(([name]) => name).join(", ")}` : `All ${rows.length} robots ready`;
    set(by("readiness"), text);
    by("readiness").dataset.level = silent || (!active && unready.length) ? "warn" : rows.some(({ state }) => state === "FAULT" || state === "ESTOP") ? "bad" : "good";
    for (const button of by("formations").querySelectorAll("button")) {
      button.setAttribute("aria-pressed", rows.length > 0 && rows.every((row) => row.formation === button.dataset.formation));
    }
    const states = rows.map((row, index) => `${this.robots[index].name} ${row.state || "silent"}`).join(", ");
    if (states !== this.states) speak(this.states = states);
    if (by("preflight").open) this.checklist();
  }

  checklist() {
    const failing = this.rows.map((row) => new Set((row.not_ready ?? []).map(checkOf)));
    const head = make("tr", {}, make("th", { scope: "col", textContent: "Check" }),
      ...this.robots.map(({ name }) => make("th", { scope: "col", textContent: name })));
    const lines = this.checks.map((check) => make("tr", {},
      make("th", { scope: "row", textContent: check.replaceAll("_", " ") }),
      ...this.robots.map((_, index) => cell(this.rows[index], failing[index]?.has(check)))));
    by("checks").replaceChildren(make("thead", {}, head), make("tbody", {}, ...lines));
    by("findings").replaceChildren(...this.rows.flatMap((row, index) =>
      (row.not_ready ?? []).map((text) => make("li", {}, make("b", { textContent: this.robots[index].name }), ` ${text}`))));
  }
}

function cell(row, fails) {
  const [text, name, rank] = !row?.state ? ["–", "not heard", ""] : fails ? ["✗", "fails", "bad"] : ["✓", "passes", "good"];
  const made = make("td", {}, make("span", { textContent: text, ariaHidden: "true" }), make("span", { className: "hidden-visually", textContent: name }));
  made.dataset.level = rank;
  return made;
}

const checkOf = (text) => /\[check (\w+)\]$/.exec(text)?.[1] ?? "estimate";

function summary(rows) {
  const counts = new Map();
  for (const { state } of rows) counts.set(state || "silent", (counts.get(state || "silent") ?? 0) + 1);
  return [...counts].map(([state, count]) => `${count} ${state.toLowerCase()}`).join(", ");
}

function confirmations({ confirmed, missing }) {
  if (!missing.length) return `Confirmed by all robots: ${confirmed.join(", ")}. They stay stopped until they are reset.`;
  return `NOT confirmed by ${missing.join(", ")}: repeating, stop by hand.` + (confirmed.length ? ` Confirmed by ${confirmed.join(", ")}.` : "");
}
