// Texts of the panel by language, and numbers, times and names in that language's format.

import { TEXTS as de } from "./texts/de.js";
import { TEXTS as en } from "./texts/en.js";
import { TEXTS as nl } from "./texts/nl.js";

const TEXTS = { en, nl, de };
const KEY = "nena-language";

/** Languages by tag, each in its own name. */
export const LANGUAGES = { en: "English", nl: "Nederlands", de: "Deutsch" };

const preferred = [localStorage.getItem(KEY), ...navigator.languages].filter(Boolean);
const language = preferred.map((tag) => tag.slice(0, 2)).find((tag) => tag in TEXTS) ?? "en";
const regional = navigator.languages.find((tag) => tag.startsWith(language)) ?? language;

/** Return the language in use. */
export function chosenLanguage() {
  return language;
}

/** Store another language and reload the page. */
export function chooseLanguage(tag) {
  localStorage.setItem(KEY, tag);
  location.reload();
}

/** Return the BCP 47 tag for numbers and dates. */
export function locale() {
  return regional;
}

/** Add texts of the chosen language, with keys behind a prefix. */
export function addTexts(prefix, texts) {
  for (const [key, text] of Object.entries(texts)) TEXTS[language][`${prefix}.${key}`] = text;
}

/** Return whether a text exists. */
export function has(key) {
  return key in TEXTS[language];
}

/** Return whether a text exists and `values` has all of its values. */
export function fillable(key, values) {
  return has(key) && [...TEXTS[language][key].matchAll(/\{(\w+)\}/g)].every(([, name]) => name in values);
}

/** Return a text with its `{values}` filled in; a missing text is shown as its key. */
export function t(key, values = {}) {
  const text = TEXTS[language][key] ?? key;
  return text.replace(/\{(\w+)\}/g, (_, name) => values[name] ?? "");
}

const plurals = new Intl.PluralRules(language);

/** Return a text in the plural form for `count`, which is also one of its values. */
export function plural(key, count, values = {}) {
  const form = plurals.select(count);
  return t(`${key}.${form}`, { ...values, count });
}

const numbers = new Map(); // formats by count of decimals: making one takes longer than a hundred uses of it

/** Format a number with a fixed count of decimals. */
export function number(value, decimals = 0) {
  if (!numbers.has(decimals)) {
    numbers.set(decimals, new Intl.NumberFormat(locale(), { minimumFractionDigits: decimals, maximumFractionDigits: decimals }));
  }
  return numbers.get(decimals).format(value);
}

/** Format a time of day; `moment` is ISO 8601 or milliseconds. */
export function timeOfDay(moment) {
  return new Date(moment).toLocaleTimeString(locale(), { hour12: false });
}

/** Format date and time; `moment` is ISO 8601 or milliseconds. */
export function dateAndTime(moment) {
  return new Date(moment).toLocaleString(locale(), { dateStyle: "medium", timeStyle: "medium" });
}

/** Return a time (ms) as the value of a field for a local time, to the minute. */
export function fieldTime(time) {
  return new Date(time - new Date(time).getTimezoneOffset() * 60_000).toISOString().slice(0, 16);
}

/** Format a date with its day of the week; `moment` is ISO 8601 or milliseconds. */
export function dateOf(moment) {
  return new Date(moment).toLocaleDateString(locale(), { weekday: "short", day: "numeric", month: "short" });
}

/** Format a heading (rad) in degrees. */
export function degrees(theta) {
  return t("unit.degrees", { value: number((theta * 180) / Math.PI, 0) });
}

const UNITS = [
  [60, 1, "age.seconds"],
  [3600, 60, "age.minutes"],
  [86400, 3600, "age.hours"],
  [Infinity, 86400, "age.days"],
];

/** Format a duration (s) in its largest unit. */
export function age(seconds) {
  const [, unit, key] = UNITS.find(([limit]) => seconds < limit);
  return t(key, { count: number(Math.floor(Math.max(0, seconds) / unit)) });
}

/** Format a duration (s) in hours and minutes, minutes and seconds, or seconds. */
export function duration(seconds) {
  const whole = Math.round(seconds);
  if (whole < 60) return t("age.seconds", { count: number(whole) });
  if (whole < 3600 && whole % 60 === 0) return t("age.minutes", { count: number(whole / 60) });
  if (whole < 3600) return t("duration.minutes", { minutes: number(Math.floor(whole / 60)), seconds: number(whole % 60) });
  const minutes = Math.round(whole / 60);
  return t("duration.hours", { hours: number(Math.floor(minutes / 60)), minutes: number(minutes % 60) });
}

const order = new Intl.Collator(undefined, { numeric: true });

/** Compare two names in natural order: r2 before r10. */
export function byName(a, b) {
  return order.compare(a, b);
}
