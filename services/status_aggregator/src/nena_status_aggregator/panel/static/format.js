// Numbers and times as people read them.

import { locale, t } from "./catalogue.js";

/** Write a number with a fixed count of decimals. */
export function number(value, decimals = 0) {
  return value.toLocaleString(locale(), {
    minimumFractionDigits: decimals,
    maximumFractionDigits: decimals,
  });
}

/** Write a time of day; `moment` is ISO 8601 or milliseconds. */
export function timeOfDay(moment) {
  return new Date(moment).toLocaleTimeString(locale(), { hour12: false });
}

/** Write a date with its time; `moment` is ISO 8601 or milliseconds. */
export function dateAndTime(moment) {
  return new Date(moment).toLocaleString(locale(), { dateStyle: "medium", timeStyle: "medium" });
}

/** Write a heading, given in rad, in degrees. */
export function degrees(theta) {
  return t("unit.degrees", { value: number((theta * 180) / Math.PI, 0) });
}

const UNITS = [
  [60, 1, "age.seconds"],
  [3600, 60, "age.minutes"],
  [86400, 3600, "age.hours"],
  [Infinity, 86400, "age.days"],
];

/** Write a duration in seconds in its greatest unit. */
export function age(seconds) {
  const [, unit, key] = UNITS.find(([limit]) => seconds < limit);
  return t(key, { count: number(Math.floor(Math.max(0, seconds) / unit)) });
}

const order = new Intl.Collator(undefined, { numeric: true });

/** Compare two names as people sort them: r2 before r10. */
export function byName(a, b) {
  return order.compare(a, b);
}
