// Controls of a recording: play, pause, seek, speed. Space plays and pauses.

import { by, make, set } from "./dom.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

export class Player {
  constructor(connection) {
    this.connection = connection;
    this.playing = false;
    this.seeking = false;
    by("speed").append(...SPEEDS.map((speed) => make("option", { value: speed, textContent: `${speed} ×` })));
    by("play").onclick = () => this.toggle();
    by("speed").onchange = () => this.send("speed", Number(by("speed").value));
    by("seek").oninput = () => { this.seeking = true; };
    by("seek").onchange = () => { this.seeking = false; this.send("seek", Number(by("seek").value)); };
    window.addEventListener("keydown", (event) => {
      if (event.key !== " " || by("player").hidden || event.target.matches("button, select, input:not([type=range])")) return;
      event.preventDefault();
      this.toggle();
    });
  }

  begin(hello) {
    by("player").hidden = hello.live;
  }

  toggle() {
    this.send(this.playing ? "pause" : "play");
  }

  send(action, value = 0) {
    this.connection().send({ do: "play", action, value });
  }

  show(state) {
    if (!state) return;
    this.playing = state.playing;
    set(by("play"), state.playing ? "Pause" : "Play");
    by("seek").max = state.duration_s;
    if (!this.seeking) by("seek").value = state.position_s;
    set(by("position"), `${clock(state.position_s)} / ${clock(state.duration_s)}`);
    if (document.activeElement !== by("speed")) by("speed").value = state.speed;
  }
}

const clock = (seconds) => `${Math.floor(seconds / 60)}:${(seconds % 60).toFixed(1).padStart(4, "0")}`;
