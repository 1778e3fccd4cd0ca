// Reports: figures of robots and orders over a time range, which the server computes from the history.

import { button, element, field, foreign, progressBar, section, select, setText, verbatim } from "./dom.js";
import { errorText } from "./explanations.js";
import { byName, dateAndTime, dateOf, duration, fieldTime, has, number, plural, t, timeOfDay } from "./i18n.js";
import { address, backLink, parameters, setParameters } from "./router.js";

const LONGEST_DAYS = 31;
const DAY = 86_400_000; // ms
const SHOWN_BY_HOUR = 50; // longer ranges are shown by day
const INTERRUPTED = 60; // s without data that are worth a note
const NO_HISTORY = 404;
const SHOWN_PLACES = 20;
const STOPPED = ["ERROR", "BLOCKED", "BROKEN", "SILENT", "MANUAL"];

// Local midnight, `days` after that of `now`; days have 23 to 25 hours.
function midnight(now, days) {
  const date = new Date(now);
  return new Date(date.getFullYear(), date.getMonth(), date.getDate() + days).getTime();
}

const RANGES = {
  today: (now) => ({ since: midnight(now, 0), until: now }),
  yesterday: (now) => ({ since: midnight(now, -1), until: midnight(now, 0) }),
  days7: (now) => ({ since: midnight(now, -6), until: now }),
  days30: (now) => ({ since: midnight(now, -29), until: now }),
};

class ReportsPage extends HTMLElement {
  #loading = new AbortController(); // of the last report
  #report = null;
  #robots = 0; // robots that were known when the report was shown

  /** Attach to `fleet`: {store}. */
  show(fleet) {
    this.store = fleet.store;
    // The names and links of robots may become known after their report.
    this.store.addEventListener("change", () => this.#report && this.#robots !== this.store.robots.size && this.#showReport());
  }

  /** Show the page; null hides it. */
  open(view) {
    this.#loading.abort();
    this.#report = null;
    if (view === null) return this.replaceChildren();
    const presets = [...Object.keys(RANGES).map((name) => [name, t(`reports.${name}`)]), ["given", t("period.given")]];
    this.preset = select(presets, { name: "range" });
    this.from = element("input", { type: "datetime-local" });
    this.to = element("input", { type: "datetime-local" });
    this.note = element("p", { class: "hint", role: "status" });
    this.files = element("p", { class: "files" });
    this.results = element("div");
    this.preset.addEventListener("change", () => this.#choose(this.preset.value));
    for (const input of [this.from, this.to]) input.addEventListener("change", () => this.#choose("given"));
    const heading = element("h2", { tabindex: -1 }, t("reports.title"));
    const controls = [["range", this.preset], ["from", this.from], ["to", this.to]];
    const choices = element("div", { class: "fields" }, ...controls.map(([name, control]) => field(t(`period.${name}`), control)));
    const head = element("header", { class: "head" }, backLink(), heading);
    this.replaceChildren(head, element("section", {}, choices, this.files, this.note), this.results);
    heading.focus({ preventScroll: true });
    const linked = { since: Date.parse(parameters().get("from")), until: Date.parse(parameters().get("to")) };
    if (Number.isNaN(linked.since + linked.until)) return this.#choose("today");
    this.#fill("given", linked);
    return this.#load(linked);
  }

  // Load a preset range, or the one that was typed.
  #choose(preset) {
    const range = RANGES[preset]?.(this.store.now());
    if (range) {
      this.#fill(preset, range);
      return this.#load(range);
    }
    this.preset.value = preset;
    return this.#load({ since: Date.parse(this.from.value), until: Date.parse(this.to.value) });
  }

  #fill(preset, { since, until }) {
    this.preset.value = preset;
    this.from.value = fieldTime(since);
    this.to.value = fieldTime(until);
  }

  async #load({ since, until }) {
    this.#loading.abort();
    const { signal } = (this.#loading = new AbortController());
    this.#report = null;
    this.results.replaceChildren();
    this.files.replaceChildren();
    const problem = problemOf(since, until);
    setText(this.note, t(problem ?? "audit.loading"));
    if (problem) return;
    const range = { from: new Date(since).toISOString(), to: new Date(until).toISOString() };
    setParameters(range);
    const query = new URLSearchParams({ since: range.from, until: range.to });
    const answer = await fetch(`api/v1/report?${query}`, { signal }).catch(() => null);
    const body = await answer?.json().catch(() => null);
    if (signal.aborted) return;
    if (answer?.status === NO_HISTORY) return setText(this.note, t("history.none"));
    if (!answer?.ok || !body) {
      this.note.replaceChildren(t("audit.failed"), " ", foreign("span", body?.detail));
      return;
    }
    this.files.replaceChildren(...["", ".csv"].map((form) => download(form, query)));
    this.note.replaceChildren(...notesOn(body, since).map((text) => element("span", { class: "detail" }, text)));
    this.#send(body, false);
    if (!body.recordedSince) return;
    this.#report = body;
    this.#showReport();
  }

  #showReport() {
    this.#robots = this.store.robots.size;
    this.results.replaceChildren(...this.#sections(this.#report));
  }

  // Show the waiting times on the map, if its layer is on; `reveal`: switch it on.
  #send(report, reveal) {
    this.dispatchEvent(new CustomEvent("waiting", { detail: { report, reveal } }));
  }

  #sections(report) {
    const { orders, waiting, failures, robots } = report;
    const shares = waiting.map(({ cause, seconds }) => [textOf("reports.cause", cause), duration(seconds)]);
    const rows = failures.map((each) => [this.#who(each), t(`reports.kind.${each.kind}`), causeOf(each), number(each.count)]);
    return [
      section("reports.summary", summaryOf(report)),
      section("reports.orders", table(["from", "finished", "failed"], periodsOf(orders.hours))),
      section("reports.waiting", table(["cause", "timeSum"], shares)),
      section("reports.places", table(["place", "timeSum", "robotCount"], placeRows(report.waitingPlaces)), this.#mapButton(report)),
      section("reports.robots", table(["robot", "utilisation", "waiting", "stopped", "distance", "charges"], this.#robotRows(robots))),
      section("reports.failures", table(["robot", "kind", "cause", "count"], rows)),
    ];
  }

  #mapButton(report) {
    return button(t("reports.onMap"), () => this.#send(report, true), { hidden: !report.waitingPlaces.length });
  }

  #robotRows(robots) {
    const named = robots.map((each) => [this.store.robots.get(each.robot)?.name ?? each.robot, each]);
    return named.sort(([a], [b]) => byName(a, b)).map(([name, { robot, conditions, utilisation, waitingShare, distance, emptyDistance, charges, chargeAtStart }]) => [
      this.store.robots.has(robot) ? element("a", { class: "name", href: address("robots", robot), translate: "no" }, name) : verbatim("span", name),
      bar(utilisation, percent(utilisation)),
      bar(waitingShare, t("reports.waitingOf", { share: percent(waitingShare), duration: duration(conditions.WAITING ?? 0) })),
      duration(STOPPED.reduce((sum, each) => sum + (conditions[each] ?? 0), 0)),
      distanceText(distance, emptyDistance),
      charges ? t("reports.chargesFrom", { count: number(charges), charge: number(chargeAtStart) }) : number(0),
    ]);
  }

  // The robot of a failure, or that of the vehicle of a failed order.
  #who({ robot, vehicle }) {
    const known = robot ? this.store.robots.get(robot) : vehicle && this.store.robotOfVehicle(vehicle);
    if (known) return element("a", { class: "name", href: address("robots", known.id), translate: "no" }, known.name);
    return verbatim("span", robot ?? vehicle ?? t("none"));
  }
}

// The key of the text that says why a range has no report; null if it may have one.
function problemOf(since, until) {
  if (Number.isNaN(since + until)) return "reports.incomplete";
  if (since >= until) return "reports.inverted";
  return until - since > LONGEST_DAYS * DAY + DAY / 24 ? "reports.tooLong" : null;
}

function notesOn({ recordedSince, recordedSeconds, until, missing }, since) {
  if (!recordedSince) return [t("history.empty")];
  const begin = Date.parse(recordedSince);
  const lost = (Date.parse(until) - begin) / 1000 - recordedSeconds;
  return [
    begin > since && t("reports.begins", { time: dateAndTime(begin), duration: duration((Date.parse(until) - begin) / 1000) }),
    lost >= INTERRUPTED && t("reports.interrupted", { duration: duration(lost) }),
    missing > 0 && plural("eventLog.historyGap", missing),
  ].filter(Boolean);
}

function download(form, query) {
  const kind = form ? "csv" : "json";
  return element("a", { href: `api/v1/report${form}?${query}`, download: `nena-report.${kind}` }, t(`period.${kind}`));
}

function summaryOf({ orders, utilisation, waitingShare, robots, waiting }) {
  const measured = robots.filter((each) => each.distance !== null);
  const total = sum(measured.map((each) => each.distance));
  const empties = measured.filter((each) => each.emptyDistance !== null);
  const share = sum(empties.map((each) => each.distance)) ? sum(empties.map((each) => each.emptyDistance)) / sum(empties.map((each) => each.distance)) : null;
  const { finished, failed, perHour, leadTimeP50, leadTimeP95, deadlines, onTime } = orders;
  const time = (seconds) => (seconds === null ? t("none") : duration(seconds));
  const facts = {
    finished: number(finished),
    perHour: perHour === null ? t("none") : number(perHour, 1),
    failed: number(failed),
    leadTimeP50: time(leadTimeP50),
    leadTimeP95: time(leadTimeP95),
    onTime: deadlines ? t("reports.onTimeOf", { share: percent(onTime / deadlines), onTime: number(onTime), deadlines: number(deadlines) }) : t("none"),
    utilisation: percent(utilisation),
    waitingShare: percent(waitingShare),
    waitingSum: duration(sum(waiting.map((each) => each.seconds))),
    distanceSum: measured.length ? distanceText(total, null) : t("none"),
    empty: percent(share),
    chargesSum: number(sum(robots.map((each) => each.charges))),
  };
  return element("dl", { class: "figures" }, ...Object.entries(facts).map(([name, text]) => element("div", {}, element("dt", {}, t(`reports.${name}`)), element("dd", {}, text))));
}

function sum(values) {
  return values.reduce((total, each) => total + each, 0);
}

// Rows of orders per hour, or per local day.
function periodsOf(hours) {
  const daily = hours.length > SHOWN_BY_HOUR;
  const periods = new Map();
  for (const { since, finished, failed } of hours) {
    const start = Date.parse(since);
    const key = daily ? midnight(start, 0) : start;
    const period = periods.get(key) ?? { start, finished: 0, failed: 0 };
    periods.set(key, { start: period.start, finished: period.finished + finished, failed: period.failed + failed });
  }
  const rows = [...periods.values()];
  const most = Math.max(1, ...rows.map((each) => each.finished));
  const two = new Set(rows.map((each) => midnight(each.start, 0))).size > 1;
  return rows.map(({ start, finished, failed }) => [labelOf(start, daily, two), bar(finished / most, number(finished)), number(failed)]);
}

function placeRows(places) {
  return places.slice(0, SHOWN_PLACES).map(({ place, seconds, robots }) => [
    element("a", { class: "name", href: address("places", place), translate: "no" }, place),
    bar(seconds / places[0].seconds, duration(seconds)),
    number(robots),
  ]);
}

function labelOf(start, daily, withDate) {
  const time = timeOfDay(start).slice(0, 5);
  const date = daily || withDate ? dateOf(start) : "";
  const label = [date, daily ? "" : time].filter(Boolean).join(", ");
  return element("time", { datetime: new Date(start).toISOString() }, label);
}

function percent(share) {
  return share === null ? t("none") : t("progress.value", { percent: number(100 * share) });
}

function distanceText(distance, empty) {
  if (distance === null) return t("none");
  const values = { distance: number(distance / 1000, 2), empty: percent(distance && empty !== null ? empty / distance : null) };
  return t(empty === null ? "reports.km" : "reports.kmEmpty", values);
}

function textOf(prefix, code) {
  return has(`${prefix}.${code}`) ? t(`${prefix}.${code}`) : verbatim("span", code);
}

function causeOf({ kind, cause, level }) {
  const words = { connection: () => t(`connection.${cause}`), error: () => errorText(cause), order: () => foreign("span", cause) }[kind]?.() ?? verbatim("span", cause);
  return level ? element("span", {}, words, " ", element("span", { class: "detail" }, textOf("level", level))) : words;
}

function bar(share, text) {
  const { bar: progress, value, box } = progressBar();
  progress.value = 100 * (share ?? 0);
  progress.setAttribute("aria-hidden", "true");
  value.textContent = text;
  return box;
}

// A table with these columns; each row has a text or an element per column.
function table(columns, rows) {
  if (!rows.length) return element("p", { class: "hint" }, t("none"));
  const titles = columns.map((name) => t(`reports.${name}`));
  const head = element("tr", {}, ...titles.map((title) => element("th", { scope: "col" }, title)));
  const body = rows.map((cells) => element("tr", {}, ...cells.map((cell, at) => element("td", { "data-title": titles[at] }, cell instanceof Element ? cell : element("span", {}, cell)))));
  return element("table", {}, element("thead", {}, head), element("tbody", {}, ...body));
}

customElements.define("nena-reports-page", ReportsPage);
