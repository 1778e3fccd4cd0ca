// The order service's reasons in the panel's language.

import { element, foreign } from "./dom.js";
import { dateAndTime, fillable, has, number, t, timeOfDay } from "./i18n.js";

// What is between the causes; others: a semicolon.
const JOINED = {
  did_you_mean: () => t("because.or"),
  findings: () => " ",
  no_route: () => "",
  no_route_anywhere: () => "",
  waits_for_any_vehicle: () => t("because.or"),
};
const HOLDERS = { "failure policy": "holder.policy", "failure of a dependency": "holder.dependency", somebody: "holder.somebody" };

// How values are shown, by name; others are names, the same in all languages.
const SHOWN = {
  by: nameOfHolder,
  level: (level) => (has(`integration.${level}`) ? t(`integration.${level}`) : shown(level)),
  measure: (measure) => t(`measure.${measure}`),
  mode: (mode) => t(`mode.${mode}`),
  reported: (state) => t(`peripheral.${state}`),
  since: dateAndTime,
  state: (state) => t(`state.${state}`),
  time: timeOfDay,
};

/**
 * Return a reason as `{text, foreign}`: `text` in the panel's language, or `foreign`, the English text, if a code has no
 * words here (a newer order service) or there is none (an older one).
 */
export function worded({ reason, codedReason }) {
  const text = codedReason ? inWords(codedReason) : null;
  return text === null ? { text: "", foreign: reason ?? "" } : { text, foreign: "" };
}

/** Return the name of the holder of an order: a person, a host or the order service. */
export function nameOfHolder(name) {
  return name in HOLDERS ? t(HOLDERS[name]) : name;
}

/** Create an element with a reason. */
export function reasonElement(name, explained, attributes = {}) {
  const { text, foreign: words } = worded(explained);
  return words ? foreign(name, words, attributes) : element(name, attributes, text);
}

function inWords({ code, values, causes }) {
  const parts = causes.map(inWords);
  const between = JOINED[code]?.() ?? "; ";
  const filled = { causes: parts.join(between), first: parts[0] ?? "", rest: parts.slice(1).join(between) };
  for (const [name, value] of Object.entries(values)) filled[name] = (SHOWN[name] ?? shown)(value);
  const known = fillable(`because.${code}`, filled) && !parts.includes(null);
  return known ? t(`because.${code}`, filled) : null;
}

function shown(value) {
  return typeof value === "number" ? number(value, Number.isInteger(value) ? 0 : 1) : value;
}
