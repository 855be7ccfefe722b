// The event log, newest first.

import { by, make } from "./dom.js";

const LINES = 300;

export class EventLog {
  begin(hello) {
    by("log").replaceChildren();
    this.add(hello.log);
  }

  add(lines) {
    const list = by("log");
    for (const line of lines) {
      const at = new Date(1000 * line.t_s);
      const entry = make("li", {},
        make("time", { dateTime: at.toISOString(), textContent: at.toLocaleTimeString([], { hour12: false }) }),
        make("b", { textContent: line.source }), make("span", { textContent: line.text }));
      entry.dataset.level = line.severity;
      if (line.severity !== "info") entry.firstChild.after(make("em", { textContent: line.severity }));
      list.prepend(entry);
    }
    while (list.childElementCount > LINES) list.lastChild.remove();
  }
}
