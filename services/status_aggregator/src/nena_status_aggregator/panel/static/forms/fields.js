// Parts that forms are made of: each control stands in its label.

import { element } from "../dom.js";

/** Make a control with its label over it. */
export function field(label, control) {
  return element("label", { class: "field" }, element("span", {}, label), control);
}

/** Make a field for a number; `step` "any" takes every one. */
export function numberInput(attributes = {}) {
  return element("input", { type: "number", step: "any", inputmode: "decimal", ...attributes });
}

/** Make a list to choose from; `options` are `[value, text, verbatim]`, or `{group, options}`. */
export function select(options, attributes = {}) {
  return element("select", attributes, ...options.map(optionOrGroup));
}

function optionOrGroup(each) {
  if (Array.isArray(each)) return element("option", { value: each[0], translate: each[2] ? "no" : null }, each[1]);
  return element("optgroup", { label: each.group }, ...each.options.map(optionOrGroup));
}

/** Put other options into a list; what was chosen stays chosen if it is still there. */
export function refillSelect(control, options) {
  const chosen = control.value;
  control.replaceChildren(...options.map(optionOrGroup));
  if ([...control.options].some((option) => option.value === chosen)) control.value = chosen;
}

/** Give a field's number; null: nothing is in it. */
export function numberOf(control) {
  return control.value.trim() === "" ? null : Number(control.value);
}
