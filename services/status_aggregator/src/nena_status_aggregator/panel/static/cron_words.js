// When a schedule runs, in words and in fields instead of a cron expression.

import { element, field, select } from "./dom.js";
import { locale, number, t } from "./i18n.js";

const DAYS = ["SUN", "MON", "TUE", "WED", "THU", "FRI", "SAT"];
const WEEK = [1, 2, 3, 4, 5, 6, 0]; // as shown
const SUNDAY = Date.UTC(2023, 0, 1);
const DAY = 86_400_000; // ms
const MINUTES = [5, 10, 15, 20, 30, 60];

/**
 * Read a cron expression: `{kind: "template"}` for null, `{kind: "days", time, days}` (days of the week, 0 is Sunday),
 * `{kind: "minutes", minutes}`, or `{kind: "cron"}` for all others.
 */
export function readCron(cron) {
  if (!cron) return { kind: "template" };
  const [minute, hour, dayOfMonth, month, dayOfWeek, ...more] = cron.trim().split(/\s+/);
  const days = dayOfMonth === "*" && month === "*" && !more.length && readDays(dayOfWeek ?? "");
  if (!days) return { kind: "cron" };
  if (/^\d+$/.test(minute) && /^\d+$/.test(hour)) return { kind: "days", time: `${hour.padStart(2, "0")}:${minute.padStart(2, "0")}`, days };
  const minutes = minute === "0" ? 60 : Number(/^\*\/(\d+)$/.exec(minute)?.[1]);
  if (hour === "*" && days.length === 7 && MINUTES.includes(minutes)) return { kind: "minutes", minutes };
  return { kind: "cron" };
}

// The days of a list such as MON-FRI,0; null if it means something else.
function readDays(text) {
  if (text === "*") return WEEK;
  const found = new Set();
  for (const part of text.toUpperCase().split(",")) {
    const [first, last, ...more] = part.split("-").map((name) => (DAYS.includes(name) ? DAYS.indexOf(name) : /^[0-7]$/.test(name) ? Number(name) : NaN));
    const end = last ?? first;
    if (more.length || !(first <= end)) return null; // also NaN
    for (let day = first; day <= end; day += 1) found.add(day % 7);
  }
  return WEEK.filter((day) => found.has(day));
}

/** Say in words when a schedule runs; `timeZone` is left out if it is that of the browser. */
export function whenInWords({ cron, timeZone }) {
  const when = readCron(cron);
  if (when.kind === "template") return t("when.template");
  const zone = timeZone === browserZone() ? "" : ` (${timeZone})`;
  if (when.kind === "minutes") return t("when.minutesOne", { count: number(when.minutes) });
  if (when.kind === "cron") return t("when.cronOne", { cron }) + zone;
  const days = when.days.length === 7 ? t("when.daily") : when.days.map((day) => nameOf(day, "long")).join(", ");
  return t("when.daysOne", { days, time: when.time }) + zone;
}

/** Return the time zone of the browser, such as Europe/Berlin. */
export function browserZone() {
  return Intl.DateTimeFormat().resolvedOptions().timeZone;
}

function nameOf(day, weekday) {
  return new Date(SUNDAY + day * DAY).toLocaleDateString(locale(), { weekday, timeZone: "UTC" });
}

/** Fields for when a schedule runs. `cron`, `timeZone`: what they show at first. */
export class WhenFields {
  constructor({ cron, timeZone }) {
    const when = cron === undefined ? { kind: "days", time: "06:00", days: WEEK } : readCron(cron);
    const kinds = ["days", "minutes", "template", "cron"].map((kind) => [kind, t(`when.${kind}`)]);
    this.kind = select(kinds, { name: "when" });
    this.kind.value = when.kind;
    this.time = element("input", { type: "time", name: "time", required: true, value: when.time ?? "06:00" });
    this.days = WEEK.map((day) => element("input", { type: "checkbox", value: day, checked: (when.days ?? WEEK).includes(day) ? "" : null }));
    this.minutes = select(MINUTES.map((each) => [each, number(each)]), { name: "minutes" });
    this.minutes.value = when.minutes ?? 15;
    this.cron = element("input", { type: "text", name: "cron", required: true, value: cron ?? "", spellcheck: "false" });
    this.zone = element("input", { type: "text", name: "timeZone", required: true, value: timeZone ?? browserZone(), spellcheck: "false" });
    this.chosen = element("div", { class: "fields" });
    this.kind.addEventListener("change", () => this.#show());
    for (const box of this.days) box.addEventListener("change", () => this.#checkDays());
    this.element = element("div", {}, field(t("when.title"), this.kind), this.chosen);
    this.#show();
  }

  #show() {
    const zone = field(t("when.zone"), this.zone);
    const days = this.days.map((box) => element("label", {}, box, " ", nameOf(Number(box.value), "short")));
    const shown = {
      days: [field(t("when.time"), this.time), element("fieldset", { class: "days" }, element("legend", {}, t("when.onDays")), ...days), zone],
      minutes: [field(t("when.everyMinutes"), this.minutes)],
      template: [],
      cron: [field(t("when.cron"), this.cron), zone],
    };
    this.chosen.replaceChildren(...shown[this.kind.value]);
  }

  #checkDays() {
    this.days[0].setCustomValidity(this.days.some((box) => box.checked) ? "" : t("when.noDay"));
  }

  /** Return `cron` and `timeZone` as in the order service's API. */
  get definition() {
    return { cron: this.#cron(), timeZone: this.zone.value.trim() };
  }

  #cron() {
    if (this.kind.value === "template") return null;
    if (this.kind.value === "cron") return this.cron.value.trim();
    if (this.kind.value === "minutes") return this.minutes.value === "60" ? "0 * * * *" : `*/${this.minutes.value} * * * *`;
    const [hour, minute] = this.time.value.split(":").map(Number);
    const days = this.days.filter((box) => box.checked).map((box) => DAYS[Number(box.value)]);
    return `${minute} ${hour} * * ${days.length === 7 ? "*" : days.join(",")}`;
  }
}
