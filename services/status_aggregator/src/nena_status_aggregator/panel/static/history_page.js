// The history: a time slider that replays the map, and a list of events with filters, optionally grouped by order.

import { button, element, field, refill, refillSelect, select, setAttribute, setText, verbatim } from "./dom.js";
import { details } from "./event_texts.js";
import { byName, dateAndTime, fieldTime, number, plural, t } from "./i18n.js";
import { ORDER_SERVICE } from "./recordings.js";
import { loadReplay } from "./replay.js";
import { backLink, parameters, setParameters } from "./router.js";

const CODES = [
  "condition", "connection", "operatingMode", "orderTaken", "orderEnded", "actionEnded", "errorRaised",
  "errorCleared", "charging", "loads", "map", "transportOrder", "jam", "stop", "link", "historyGap",
];

function queryOf({ since, until }, { robot, order, problems }, codes) {
  const query = new URLSearchParams({ since: new Date(since).toISOString(), until: new Date(until).toISOString() });
  const filters = { robot, orderPart: order, problems };
  for (const [name, value] of Object.entries(filters)) if (value) query.set(name, value);
  for (const code of codes) query.append("code", code);
  return query;
}

const RANGES = { minutes10: 600, hour: 3600, hours8: 28_800, day: 86_400 };
const SPEEDS = [1, 10, 60];
const FRAME = 100; // ms
const MINUTE = 60_000; // ms
const EARLIEST = Date.UTC(2000);
const LONGEST = 25 * 3600 * 1000; // ms, of a replay
const LISTED = 60;
const READ = 4 * LISTED; // events, of which those of a stop are one row
const STOPS = 15_000; // ms within which robots follow the begin or the end of a stop
const GROUPED = 1000; // events, when they are grouped by order
const LIST_FRAMES = 10; // of a replay, after which the list follows it
const MARKS = 300; // on the slider

/** Fires `replay` with what to show on the map, `{robots, areas, time}`; null: live data. */
class HistoryPage extends HTMLElement {
  #shown = null; // the replay
  #playing = null;
  #listing = false;
  #outdated = false; // the list
  #loading = new AbortController(); // of the last load

  /** Attach to `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
    fleet.store.addEventListener("change", () => this.firstElementChild && this.#offerRobots());
  }

  /** Show the history; null hides it. */
  open(view) {
    this.#stop();
    this.#loading.abort();
    this.#shown = null;
    this.#replay(null);
    if (view === null) return this.replaceChildren();
    const linked = parameters();
    const ranges = [...Object.keys(RANGES).map((name) => [name, t(`history.${name}`)]), ["given", t("period.given")]];
    this.range = select(ranges, { name: "range" });
    this.from = element("input", { type: "datetime-local" });
    this.to = element("input", { type: "datetime-local" });
    this.filters = this.#filters(linked);
    this.speed = select(SPEEDS.map((each) => [each, t("history.speed", { factor: each })]), { name: "speed" });
    this.slider = element("input", { type: "range", step: 100, "aria-label": t("history.time"), class: "slider" });
    this.marks = element("div", { class: "marks", "aria-hidden": "true" }); // the list has the same
    this.play = button(t("history.play"), () => (this.#playing ? this.#stop() : this.#start()));
    this.clock = verbatim("output", "", { class: "number clock" });
    this.note = element("p", { class: "hint", role: "status" });
    this.files = element("p", { class: "files" });
    this.list = element("ol", { class: "history" });
    this.cut = element("p", { class: "hint" });
    this.opened = new Set();
    this.range.addEventListener("change", () => this.#choose());
    for (const input of [this.from, this.to]) input.addEventListener("change", () => this.#loadTyped());
    this.slider.addEventListener("input", () => this.#moved());
    const heading = element("h2", { tabindex: -1 }, t("order.history"));
    const head = element("header", { class: "head" }, backLink(), heading);
    const times = Object.entries({ "period.range": this.range, "period.from": this.from, "period.to": this.to, "history.speedLabel": this.speed });
    const choices = element("div", { class: "fields" }, ...times.map(([name, control]) => field(t(name), control)), this.play, this.clock);
    const controls = element("section", {}, choices, this.slider, this.marks, this.note);
    const narrowing = element("div", { class: "fields" }, ...Object.entries(this.filters).map(([name, control]) => field(t(`history.by.${name}`), control)));
    narrowing.addEventListener("input", () => (this.#narrow(), this.#mark()));
    // The list grows while a replay plays: links above it stay where they are.
    const listed = element("section", {}, element("h3", {}, t("history.events")), narrowing, this.files, this.cut, this.list);
    const recordings = element("nena-recordings").show(this.fleet, ORDER_SERVICE);
    const recorded = element("section", {}, element("h3", {}, t("history.recordings")), recordings);
    this.replaceChildren(head, controls, listed, recorded);
    heading.focus({ preventScroll: true });
    const given = rangeOf(linked.get("from"), linked.get("to"));
    if (!given) return this.#choose();
    this.range.value = "given";
    return this.#load(given);
  }

  // Load the last minutes or hours, or what is typed.
  #choose() {
    const now = this.fleet.store.now();
    const seconds = RANGES[this.range.value];
    return seconds ? this.#load({ since: now - seconds * 1000, until: now }) : this.#loadTyped();
  }

  // A time range that is incomplete or inverted is not loaded: what was loaded before stays.
  #loadTyped() {
    this.range.value = "given";
    const range = rangeOf(this.from.value, this.to.value);
    if (range) return this.#load(range);
    this.#loading.abort(); // it would replace the note
    this.#stop();
    return setText(this.note, t(this.from.value && this.to.value ? "reports.inverted" : "reports.incomplete"));
  }

  #filters(linked) {
    const all = ["", t("audit.all")];
    const kinds = CODES.map((code) => [code, t(`eventLog.${code}`)]);
    const made = {
      robot: select(this.#robotOptions(linked.get("robot"))),
      order: element("input", { type: "search" }),
      kind: select([all, ...kinds]),
      level: select([all, ["problems", t("history.problems")]]),
      grouped: element("input", { type: "checkbox" }),
    };
    for (const name of ["robot", "order", "kind", "level"]) made[name].value = linked.get(name) ?? "";
    made.grouped.checked = Boolean(linked.get("grouped"));
    return made;
  }

  // Robots to choose from, including `chosen` even if it is unknown.
  #robotOptions(chosen) {
    const robots = [...this.fleet.store.robots.values()].sort((a, b) => byName(a.name, b.name)).map(({ id, name }) => [id, name, true]);
    const known = !chosen || robots.some(([id]) => id === chosen) ? [] : [[chosen, chosen, true]];
    return [["", t("audit.all")], ...known, ...robots];
  }

  // The page may be opened before the robots are known.
  #offerRobots() {
    const { robot } = this.filters;
    const options = this.#robotOptions(robot.value);
    const offered = [...robot.options].map((each) => [each.value, each.text]);
    if (JSON.stringify(options.map(([id, name]) => [id, name])) === JSON.stringify(offered)) return;
    refillSelect(robot, options);
    this.#moved();
  }

  get #chosen() {
    const { robot, order, kind, level, grouped } = this.filters;
    return { robot: robot.value, order: order.value.trim(), kind: kind.value, level: level.value, grouped: grouped.checked ? "1" : "" };
  }

  // Keep the filters and the time range in the address, so that it can be shared, also while the history loads.
  #address() {
    const { since, until } = this.loaded;
    setParameters({ from: new Date(since).toISOString(), to: new Date(until).toISOString(), ...this.#chosen });
  }

  #narrow() {
    this.#address();
    const { kind, problems, ...chosen } = this.#filter;
    this.files.replaceChildren(...["csv", "jsonl"].map((form) => download(this.loaded, form, { problems, ...chosen }, kind ? [kind] : ["position", ...CODES])));
    this.#listEvents();
  }

  // The filters as those of the server.
  get #filter() {
    const { level, ...chosen } = this.#chosen;
    return { ...chosen, problems: level === "problems" };
  }

  // Mark the times of problems below the slider, as far as the filters leave them; the latest if there are many.
  async #mark() {
    const found = await this.#fetchEvents({ ...this.#filter, problems: true }, this.loaded.until, MARKS);
    if (!found) return;
    const [begin, end] = [Number(this.slider.min), Number(this.slider.max)];
    const times = found.entries.map((entry) => Date.parse(entry.time)).filter((time) => time >= begin);
    const shares = [...new Set(times.map((time) => ((100 * (time - begin)) / (end - begin)).toFixed(1)))];
    this.marks.replaceChildren(
      ...shares.map((share) => {
        const mark = element("i");
        mark.style.left = `${share}%`;
        return mark;
      }),
    );
  }

  // The latest events before a time; null without a history, or if another time range is loaded meanwhile.
  async #fetchEvents({ kind, ...filter }, until, limit) {
    const { signal } = this.#loading;
    const query = queryOf({ since: this.loaded.since, until }, filter, kind ? [kind] : CODES);
    query.set("limit", limit);
    const answer = await fetch(`api/v1/history?${query}`, { signal }).catch(() => null);
    const found = answer?.ok ? await answer.json().catch(() => null) : null;
    return signal.aborted ? null : found;
  }

  async #load(range) {
    this.#stop();
    this.#loading.abort();
    const { signal } = (this.#loading = new AbortController());
    setText(this.note, t("audit.loading"));
    this.from.value = fieldTime(range.since);
    this.to.value = fieldTime(range.until + MINUTE - 1); // the latest events stay in the range if only its start is changed
    this.loaded = range;
    this.#shown = null;
    this.#enable(false); // the slider is moved to the end once it is loaded
    this.#setTimes(range.since);
    this.marks.replaceChildren();
    this.#narrow();
    const long = range.until - range.since > LONGEST;
    const found = long ? null : await loadReplay(range, signal);
    if (signal.aborted) return;
    this.#shown = found;
    setText(this.note, long ? t("history.tooLong") : noteOn(found, range));
    this.#enable(found && !found.empty);
    // Nothing is known from before the first position.
    if (found?.recordedSince > range.since) this.#setTimes(Math.min(found.recordedSince - 1000, range.until));
    this.#mark();
    this.#showTime();
  }

  #enable(possible) {
    for (const control of [this.slider, this.play]) control.disabled = !possible;
  }

  // The slider's range; it is moved to the end.
  #setTimes(begin) {
    setAttribute(this.slider, "min", begin);
    setAttribute(this.slider, "max", this.loaded.until);
    this.slider.value = this.loaded.until;
  }

  // Show the fleet and the events at the slider's time.
  #moved() {
    this.#showTime();
    this.#listEvents();
  }

  #showTime() {
    const time = Number(this.slider.value);
    setText(this.clock, dateAndTime(time));
    setAttribute(this.slider, "aria-valuetext", dateAndTime(time));
    if (this.#shown) this.#replay({ robots: this.#shown.robotsAt(time, this.fleet.store.robots), areas: this.#shown.areasAt(time), time: dateAndTime(time) });
  }

  // List the events up to the slider's time. While one request runs, only the latest time waits for the next.
  async #listEvents() {
    this.#outdated = true;
    if (this.#listing) return;
    this.#listing = true;
    while (this.#outdated) {
      this.#outdated = false;
      const filter = this.#filter;
      const found = await this.#fetchEvents(filter, Number(this.slider.value) + 1, filter.grouped ? GROUPED : READ);
      if (found) this.#showEvents(found, filter.grouped);
    }
    this.#listing = false;
  }

  #showEvents({ entries, next }, grouped) {
    const names = Object.fromEntries([...this.fleet.store.robots.values()].map((robot) => [robot.id, robot.name]));
    const content = [entries.map((entry) => entry.id), grouped, names];
    const rows = grouped ? null : withoutFollowers(entries);
    refill(this.list, content, () => (grouped ? this.#groups(entries, names) : rows.slice(0, LISTED).map((each) => this.#row(each, names))));
    const more = next !== null || (grouped ? new Set(entries.map((entry) => entry.order)).size : rows.length) > LISTED;
    setText(this.cut, more ? t("history.listed", { count: number(this.list.children.length) }) : "");
  }

  // One row per order, latest first, and one for events without an order.
  #groups(found, names) {
    const groups = new Map();
    for (const entry of found) {
      const order = entry.order ?? "";
      groups.set(order, groups.get(order) ?? []).get(order).push(entry);
    }
    return [...groups].slice(0, LISTED).map(([order, entries]) => {
      const title = order ? verbatim("strong", order) : element("strong", {}, t("history.noOrder"));
      const latest = element("span", {}, `${dateAndTime(entries[0].time)} · ${plural("history.count", entries.length)}`);
      return element("li", { class: "group" }, this.#openable(order, [title, " ", latest], entries.slice(0, LISTED), names));
    });
  }

  // The events below a title, shown if it is opened; open ones stay open when the list changes.
  #openable(key, title, entries, names) {
    const rows = element("ol", { class: "history" }, ...entries.map((entry) => this.#event(entry, names)));
    const made = element("details", {}, element("summary", {}, ...title), rows);
    made.open = this.opened.has(key);
    made.addEventListener("toggle", () => (made.open ? this.opened.add(key) : this.opened.delete(key)));
    return made;
  }

  #row({ entry, followers }, names) {
    const made = this.#event(entry, names);
    const robots = new Set(followers.map(({ robot }) => robot)).size;
    if (robots) made.append(this.#openable(entry.id, [plural("attention.robots", robots)], followers, names));
    return made;
  }

  #event(entry, names) {
    const jump = button(dateAndTime(entry.time), () => this.#go(Date.parse(entry.time)), { class: "time", translate: "no" });
    const who = entry.robot ? (names[entry.robot] ?? entry.robot) : (entry.order ?? "");
    const what = element("div", {}, element("strong", {}, t(`eventLog.${entry.code}`)), " ", verbatim("span", who));
    return element("li", {}, jump, what, details(entry));
  }

  #go(time) {
    this.slider.value = time;
    this.#moved();
  }

  #start() {
    if (Number(this.slider.value) >= Number(this.slider.max)) this.slider.value = this.slider.min;
    setText(this.play, t("command.pause"));
    let frames = 0;
    this.#playing = setInterval(() => {
      this.slider.value = Number(this.slider.value) + FRAME * Number(this.speed.value);
      this.#showTime();
      if (Number(this.slider.value) >= Number(this.slider.max)) this.#stop();
      frames += 1;
      if (frames % LIST_FRAMES === 0 || !this.#playing) this.#listEvents();
    }, FRAME);
  }

  #stop() {
    clearInterval(this.#playing);
    this.#playing = null;
    if (this.play) setText(this.play, t("history.play"));
  }

  #replay(detail) {
    this.dispatchEvent(new CustomEvent("replay", { detail }));
  }
}

// Entries, the latest first, as `{entry, followers}`: those of the robots that a stop pauses or that continue at its end are its followers.
function withoutFollowers(entries) {
  const stops = entries.filter(({ code }) => code === "stop");
  const ofStop = ({ code, time, values }) =>
    stops.find(({ values: { active }, ...stop }) => {
      const ofRobot = code === "condition" && (active ? /^(stopped|paused)/.test(values.reason) : values.before === "BLOCKED");
      const ofOrder = code === "transportOrder" && active && /"(is|all|area)_paused"/.test(JSON.stringify(values.codedReason ?? ""));
      return (ofRobot || ofOrder) && Math.abs(Date.parse(time) - Date.parse(stop.time)) <= STOPS;
    });
  const rows = new Map(entries.map((entry) => [entry.id, { entry, followers: [] }]));
  for (const entry of entries) {
    const stop = ofStop(entry);
    if (!stop) continue;
    rows.get(stop.id).followers.push(entry);
    rows.delete(entry.id);
  }
  return [...rows.values()];
}

function noteOn(found, { since }) {
  if (!found) return t("history.none");
  if (found.empty) return t("history.empty");
  if (found.recordedSince === null) return t("history.noPositions");
  return found.recordedSince > since + MINUTE ? t("history.begins", { time: dateAndTime(found.recordedSince) }) : "";
}

// The time range in the address; null if it is missing or invalid.
// A year that is still being typed, such as 0202, makes no range.
function rangeOf(from, to) {
  const [since, until] = [Date.parse(from), Date.parse(to)];
  return since >= EARLIEST && since < until ? { since, until } : null;
}

// The same time range and filters as a file, `csv` or `jsonl`.
function download(range, form, filter, codes) {
  return element("a", { href: `api/v1/history.${form}?${queryOf(range, filter, codes)}`, download: `nena-history.${form}` }, t(`period.${form}`));
}

customElements.define("nena-history-page", HistoryPage);
