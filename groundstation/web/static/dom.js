// Small helpers for the document. Text is only ever set as text, never as markup.

export const by = (id) => document.getElementById(id);

export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

export function set(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function level(element, name) {
  if (element.dataset.level !== name) element.dataset.level = name;
}

export function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export const COLORS = 10;
export const robotColor = (index) => color(`--robot-${index % COLORS}`);

export const number = (value, digits, unit = "") =>
  value === null || value === undefined ? "–" : `${value.toFixed(digits)}${unit}`;

export function speak(text) {
  set(by("spoken"), text);
}
