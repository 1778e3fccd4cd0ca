// The order service's reasons in the panel's language.

import { element, foreign } from "./dom.js";
import { addTexts, chosenLanguage, dateAndTime, fillable, has, number, t, timeOfDay } from "./i18n.js";

// The order service makes its sentences from the same tables.
addTexts("because", await (await fetch(`./reasons/${chosenLanguage()}.json`)).json());

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
  level: (level) => String(known(`integration.${level}`, level)).split(":")[0],
  link: (link) => known(`connection.${link}`, link),
  measure: (measure) => known(`measure.${measure}`, measure),
  cost: (cost) => number(cost, 0),
  known: String,
  limit: (limit) => number(limit, Number.isInteger(limit) ? 0 : 2),
  mode: (mode) => known(`mode.${mode}`, mode),
  reported: (state) => known(`peripheral.${state}`, state),
  since: dateAndTime,
  state: (state) => known(`state.${state === "WITHDRAWN" ? "WAS_WITHDRAWN" : state}`, state), // always of an order that has ended
  time: timeOfDay,
  update: String,
};

// The words of an enumeration's value; of a newer order service's one, the value.
function known(key, value) {
  return has(key) ? t(key) : shown(value);
}

// A name may be that of an inherited property, such as "constructor".
const own = (object, name) => (Object.hasOwn(object, name) ? object[name] : undefined);

/**
 * Return a reason as `{text, foreign}`: `text` in the panel's language, or `foreign`, the English text, if a code has no words here (a newer order service) or there is none (an older one).
 */
export function worded({ reason, codedReason }) {
  const text = codedReason ? inWords(codedReason) : null;
  return text === null ? { text: "", foreign: reason ?? "" } : { text, foreign: "" };
}

/** Return the name of the holder of an order: a person, a host or the order service. */
export function nameOfHolder(name) {
  const key = own(HOLDERS, name);
  return key ? t(key) : name;
}

/** Create an element with a reason. */
export function reasonElement(name, explained, attributes = {}) {
  const { text, foreign: words } = worded(explained);
  return words ? foreign(name, words, attributes) : element(name, attributes, text);
}

function inWords({ code, values = {}, causes = [] }) {
  const parts = causes.map(inWords);
  const between = own(JOINED, code)?.() ?? "; ";
  const filled = { causes: parts.join(between), first: parts[0] ?? "", rest: parts.slice(1).join(between) };
  for (const [name, value] of Object.entries(values)) filled[name] = (own(SHOWN, name) ?? shown)(value);
  const possible = fillable(`because.${code}`, filled) && !parts.includes(null);
  return possible ? t(`because.${code}`, filled) : null;
}

function shown(value) {
  return typeof value === "number" ? number(value, Number.isInteger(value) ? 0 : 1) : value;
}
