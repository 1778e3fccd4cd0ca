// All texts of the page, by language. No other module holds words that people read.

import { TEXTS as de } from "./texts/de.js";
import { TEXTS as en } from "./texts/en.js";
import { TEXTS as nl } from "./texts/nl.js";

const TEXTS = { en, nl, de };
const KEY = "nena-language";

/** The languages, each by its own name. */
export const LANGUAGES = { en: "English", nl: "Nederlands", de: "Deutsch" };

const wished = [localStorage.getItem(KEY), ...navigator.languages].filter(Boolean);
const language = wished.map((tag) => tag.slice(0, 2)).find((tag) => tag in TEXTS) ?? "en";
const regional = navigator.languages.find((tag) => tag.startsWith(language)) ?? language;

/** Give the language in use. */
export function chosenLanguage() {
  return language;
}

/** Keep another language, and show the page in it. */
export function chooseLanguage(tag) {
  localStorage.setItem(KEY, tag);
  location.reload();
}

/** Give the BCP 47 tag by which numbers and dates are written. */
export function locale() {
  return regional;
}

/** Tell whether there is a text. */
export function has(key) {
  return key in TEXTS[language];
}

/** Give a text with its `{values}` filled in; a missing key shows itself, so that it is found. */
export function t(key, values = {}) {
  const text = TEXTS[language][key] ?? key;
  return text.replace(/\{(\w+)\}/g, (_, name) => values[name] ?? "");
}

/** Give a text in the form that goes with `count`, which is one of its values. */
export function plural(key, count, values = {}) {
  const form = new Intl.PluralRules(language).select(count);
  return t(`${key}.${form}`, { count, ...values });
}
