// Buttons that must be held: with a pointer or the Enter key. A click by assistive technology,
// which cannot hold, asks for confirmation instead.

import { by, set } from "./dom.js";

export const HOLD_MS = 800;

export function holdToConfirm(button, question, act) {
  let timer = 0;
  const begin = () => {
    if (button.disabled || timer) return;
    button.classList.add("holding");
    timer = setTimeout(() => { end(); act(); }, HOLD_MS);
  };
  const end = () => {
    clearTimeout(timer);
    timer = 0;
    button.classList.remove("holding");
  };
  button.classList.add("hold");
  button.style.setProperty("--hold", `${HOLD_MS}ms`);
  button.addEventListener("pointerdown", (event) => { if (event.button === 0) begin(); });
  for (const name of ["pointerup", "pointerleave", "pointercancel", "blur"]) button.addEventListener(name, end);
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  button.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    event.preventDefault();
    if (!event.repeat) begin();
  });
  button.addEventListener("keyup", (event) => { if (event.key === "Enter") end(); });
  button.addEventListener("click", (event) => {
    if (event.detail === 0) ask(question(), act);
  });
}

function ask(question, act) {
  const dialog = by("confirm");
  set(by("confirm-text"), question);
  dialog.onclose = () => { if (dialog.returnValue === "yes") act(); };
  dialog.returnValue = "no";
  dialog.showModal();
}
