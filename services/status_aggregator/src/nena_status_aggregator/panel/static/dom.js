// Helpers that create and update elements, icons and form controls. The page is only modified where something changed.

import { number, t } from "./i18n.js";

/** Create an element with attributes and children (elements or texts). */
export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) setAttribute(made, key, value);
  made.append(...children);
  return made;
}

export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Set an attribute; null, undefined and false remove it. */
export function setAttribute(node, name, value) {
  if (value === null || value === undefined || value === false) node.removeAttribute(name);
  else if (node.getAttribute(name) !== String(value)) node.setAttribute(name, value);
}

/** Refill an element if `content` (any JSON value) has changed since the last call. */
export function refill(node, content, make) {
  const key = JSON.stringify(content) ?? "";
  if (node.shown === key) return;
  node.shown = key;
  node.replaceChildren(...make(content));
}

/** Replace the children of an element; a control that has the focus passes it to the one in its place. */
export function renew(node, children) {
  const controls = () => [...node.querySelectorAll("input, textarea, select, button")];
  const focused = controls().indexOf(document.activeElement);
  node.replaceChildren(...children);
  if (focused >= 0) controls()[focused]?.focus({ preventScroll: true });
}

/** Create an element with a text of another program, which is always English. */
export function foreign(name, text, attributes = {}) {
  return element(name, { lang: "en", translate: "no", ...attributes }, text ?? "");
}

/** Create an element with names or values that are not translated. */
export function verbatim(name, text, attributes = {}) {
  return element(name, { translate: "no", ...attributes }, text ?? "");
}

/** Create a section with a heading, the text of `key`. */
export function section(key, ...content) {
  return element("section", {}, element("h3", {}, t(key)), ...content);
}

/** Create a button. */
export function button(text, action, attributes = {}) {
  const made = element("button", { type: "button", ...attributes }, text);
  made.addEventListener("click", action);
  return made;
}

/** Create a progress bar (0 to 100) with its value as text. */
export function progressBar() {
  const bar = element("progress", { max: 100, value: 0 });
  const value = element("span", { class: "number" });
  return { bar, value, box: element("span", { class: "progress" }, bar, value) };
}

/** Show the progress of an order in a progress bar; hide it if there is none. */
export function showProgress({ box, bar, value }, order) {
  const progress = order?.progress ?? null;
  box.hidden = progress === null;
  if (box.hidden) return;
  bar.value = progress;
  setAttribute(bar, "aria-label", t("progress.label", { name: order.name }));
  setText(value, t("progress.value", { percent: number(progress) }));
}

/** Create the placeholder for an empty view: what is missing, and what to do. */
export function emptyBox(title, text) {
  return element("div", { class: "empty" }, element("strong", {}, title), element("p", {}, text));
}

const SVG = "http://www.w3.org/2000/svg";

const PATHS = {
  plus: "M8 3v10M3 8h10",
  minus: "M3 8h10",
  fit: "M3 6V3h3M10 3h3v3M13 10v3h-3M6 13H3v-3",
  follow: "M8 1v3M8 12v3M1 8h3M12 8h3M8 4.5a3.5 3.5 0 1 0 .01 0",
  layers: "M8 2 2 5.5 8 9l6-3.5zM2 8.5 8 12l6-3.5M2 11.5 8 15l6-3.5",
  screen: "M9.5 6.5l4-4M10 2.5h3.5V6M6.5 9.5l-4 4M2.5 10v3.5H6",
  columns: "M2.5 3h11v10h-11zM6.2 3v10M9.8 3v10",
  auto: "M8 2.5a5.5 5.5 0 1 0 0 11zM8 2.5a5.5 5.5 0 0 1 0 11M7 4v8M6 5v6M5 6v4",
  light: "M8 5.2a2.8 2.8 0 1 0 .01 0M8 1v1.6M8 13.4V15M1 8h1.6M13.4 8H15M3 3l1.2 1.2M11.8 11.8 13 13M13 3l-1.2 1.2M4.2 11.8 3 13",
  dark: "M13 9.6A5.5 5.5 0 0 1 6.4 3 5.5 5.5 0 1 0 13 9.6z",
};

/** Create an icon; its button carries the label. */
export function icon(name) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("aria-hidden", "true");
  svg.classList.add("icon", `icon-${name}`);
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("d", PATHS[name]);
  svg.append(path);
  return svg;
}

/** Create a labelled control. */
export function field(label, control) {
  return element("label", { class: "field" }, element("span", {}, label), control);
}

/** Create a number input. */
export function numberInput(attributes = {}) {
  return element("input", { type: "number", step: "any", inputmode: "decimal", ...attributes });
}

/** Create a select; `options` are `[value, text, verbatim]` or `{group, options}`. */
export function select(options, attributes = {}) {
  return element("select", attributes, ...options.map(optionOrGroup));
}

function optionOrGroup(each) {
  if (Array.isArray(each)) return element("option", { value: each[0], translate: each[2] ? "no" : null }, each[1]);
  return element("optgroup", { label: each.group }, ...each.options.map(optionOrGroup));
}

/** Replace the options of a select if they have changed; keeps the selection if it still exists. */
export function refillSelect(control, options) {
  const chosen = control.value;
  refill(control, options, () => options.map(optionOrGroup));
  if ([...control.options].some((option) => option.value === chosen)) control.value = chosen;
}

/** Return the number in a field, or null if it is empty. */
export function numberOf(control) {
  return control.value.trim() === "" ? null : Number(control.value);
}
