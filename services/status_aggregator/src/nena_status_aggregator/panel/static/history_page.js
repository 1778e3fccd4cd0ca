// The history: a time slider that replays the map, and a list of events with filters, optionally grouped by order.

import { button, element, field, refill, refillSelect, select, setAttribute, setText, verbatim } from "./dom.js";
import { details } from "./event_texts.js";
import { hasFailed } from "./fleet.js";
import { byName, dateAndTime, fieldTime, number, plural, t } from "./i18n.js";
import { ORDER_SERVICE } from "./recordings.js";
import { backLink, parameters, setParameters } from "./router.js";

const PAGE = 1000;
const PAGES = 20;
const CODES = [
  "position", "condition", "connection", "operatingMode", "orderTaken", "orderEnded", "actionEnded", "errorRaised",
  "errorCleared", "charging", "loads", "map", "transportOrder", "link", "historyGap",
];

/**
 * Load the entries of a time range, at most PAGES pages of the latest, until `signal` aborts it. Returns `{entries, complete}`,
 * oldest first; null without a history.
 */
async function loadHistory(range, signal) {
  const entries = [];
  let before = null;
  for (let page = 0; page < PAGES; page += 1) {
    const answer = await fetch(`api/v1/history?${queryOf(range, { limit: PAGE, before })}`, { signal }).catch(() => null);
    const part = answer?.ok ? await answer.json().catch(() => null) : null; // null also if aborted
    if (!part) return null;
    entries.push(...part.entries);
    before = part.next;
    if (before === null) break;
  }
  return { entries: entries.reverse(), complete: before === null };
}

/** Return the URL of the same time range as a file, `csv` or `jsonl`; if given, only of one robot or kind. */
function exportAddress(range, form, { robot, kind }) {
  return `api/v1/history.${form}?${queryOf(range, { robot: robot || null }, kind ? [kind] : CODES)}`;
}

function queryOf({ since, until }, more, codes = CODES) {
  const query = new URLSearchParams({ since: new Date(since).toISOString(), until: new Date(until).toISOString() });
  for (const code of codes) query.append("code", code);
  for (const [name, value] of Object.entries(more)) if (value !== null) query.set(name, value);
  return query;
}

const GAP = 15_000;

/**
 * The history by time. `entries` are those of the API, oldest first. Robots that did not move within the time range are
 * shown at their current position in the store.
 */
class Timeline {
  #store;
  #tracks = new Map();
  #conditions = new Map();

  constructor(entries, store) {
    this.#store = store;
    this.events = entries.filter((entry) => entry.code !== "position");
    for (const entry of entries) {
      const at = Date.parse(entry.time);
      if (entry.code === "position") append(this.#tracks, entry.robot, { ...entry.values, at });
      if (entry.code === "condition") append(this.#conditions, entry.robot, { ...entry.values, at });
    }
  }

  /** Return the robots at a time, as the map needs them. */
  robotsAt(time) {
    return [...this.#store.robots.values()].map((robot) => this.#robotAt(robot, time)).filter((robot) => robot.position);
  }

  /** Return the index of the last event before a time; -1 if there is none. */
  lastEvent(time) {
    return this.events.findLastIndex((entry) => Date.parse(entry.time) <= time);
  }

  #robotAt({ id, name, body, condition, position }, time) {
    const track = this.#tracks.get(id);
    const moved = track && placeAt(track, time);
    const changes = this.#conditions.get(id) ?? [];
    const last = changes.findLast((change) => change.at <= time);
    return {
      id,
      name,
      body,
      condition: last?.condition ?? changes[0]?.before ?? condition,
      position: moved ?? position,
    };
  }
}

function append(map, key, value) {
  if (!map.has(key)) map.set(key, []);
  map.get(key).push(value);
}

// Before the first position, the robot was less than one track step away. Between two positions it moves in a straight line.
function placeAt(track, time) {
  const at = track.findLastIndex((place) => place.at <= time);
  const [from, to] = [track[Math.max(at, 0)], track[at + 1]];
  const share = at >= 0 && to && to.at - from.at < GAP ? (time - from.at) / (to.at - from.at) : 0;
  const between = (name) => from[name] + share * ((to ?? from)[name] - from[name]);
  return { x: between("x"), y: between("y"), theta: from.theta, localized: true };
}

const STOPPED = ["ERROR", "BROKEN", "SILENT", "BLOCKED"];
const PROBLEMS = {
  actionEnded: ({ status }) => status === "FAILED",
  condition: ({ condition }) => STOPPED.includes(condition),
  connection: ({ state }) => state !== "ONLINE",
  errorRaised: () => true,
  historyGap: () => true,
  link: ({ connected }) => !connected,
  orderEnded: ({ outcome }) => outcome === "abandoned",
  transportOrder: ({ state, outcome, gaveWay }) => hasFailed({ outcome: outcome ?? state }) && !gaveWay, // older events: gaveWay
};

// Whether an entry fits the chosen filters.
function fits(entry, { robot, order, kind, level }) {
  if (robot && entry.robot !== robot) return false;
  if (order && !entry.order?.toLowerCase().includes(order.toLowerCase())) return false;
  if (kind && entry.code !== kind) return false;
  return !level || Boolean(PROBLEMS[entry.code]?.(entry.values));
}

const RANGES = { minutes10: 600, hour: 3600, hours8: 28_800, day: 86_400 };
const SPEEDS = [1, 10, 60];
const FRAME = 100; // ms
const MINUTE = 60_000; // ms
const EARLIEST = Date.UTC(2000);
const LISTED = 60;
const MARKS = 300; // on the slider

/** Fires `replay` with the robots to show on the map; null: live data. */
class HistoryPage extends HTMLElement {
  #timeline = null;
  #playing = null;
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
    this.#timeline = null;
    this.#replay(null);
    if (view === null) return this.replaceChildren();
    const linked = parameters();
    const ranges = [...Object.keys(RANGES), "given"].map((name) => [name, t(`history.${name}`)]);
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
    const heading = element("h2", { tabindex: -1 }, t("history.title"));
    const head = element("header", { class: "head" }, backLink(), heading);
    const times = Object.entries({ range: this.range, from: this.from, to: this.to, speedLabel: this.speed });
    const choices = element("div", { class: "fields" }, ...times.map(([name, control]) => field(t(`history.${name}`), control)), this.play, this.clock);
    const controls = element("section", {}, choices, this.slider, this.marks, this.note);
    const narrowing = element("div", { class: "fields" }, ...Object.entries(this.filters).map(([name, control]) => field(t(`history.by.${name}`), control)));
    narrowing.addEventListener("input", () => this.#narrow());
    // The list grows while a replay plays: links above it stay where they are.
    const listed = element("section", {}, element("h3", {}, t("history.events")), narrowing, this.files, this.cut, this.list);
    const recordings = element("nena-recordings").show(this.fleet, ORDER_SERVICE);
    const recorded = element("section", {}, element("h3", {}, t("history.recordings")), recordings);
    this.replaceChildren(head, controls, recorded, listed);
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
    const all = ["", t("history.all")];
    const kinds = CODES.filter((code) => code !== "position").map((code) => [code, t(`eventLog.${code}`)]);
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
    return [["", t("history.all")], ...known, ...robots];
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
    if (!this.#timeline) return;
    this.files.replaceChildren(...["csv", "jsonl"].map((form) => download(this.loaded, form, this.#chosen)));
    this.#mark();
    this.#moved();
  }

  // Mark the times of problems below the slider, as far as the filters leave them; the latest if there are many.
  #mark() {
    const [begin, end] = [Number(this.slider.min), Number(this.slider.max)];
    const chosen = { ...this.#chosen, level: "problems" };
    const times = this.#timeline.events.filter((entry) => fits(entry, chosen)).slice(-MARKS).map((entry) => Date.parse(entry.time));
    const shares = [...new Set(times.filter((time) => time >= begin).map((time) => ((100 * (time - begin)) / (end - begin)).toFixed(1)))];
    this.marks.replaceChildren(
      ...shares.map((share) => {
        const mark = element("i");
        mark.style.left = `${share}%`;
        return mark;
      }),
    );
  }

  async #load(range) {
    this.#stop();
    this.#loading.abort();
    const { signal } = (this.#loading = new AbortController());
    setText(this.note, t("history.loading"));
    this.from.value = fieldTime(range.since);
    this.to.value = fieldTime(range.until + MINUTE - 1); // the latest events stay in the range if only its start is changed
    this.loaded = range;
    this.#address();
    const found = await loadHistory(range, signal);
    if (signal.aborted) return;
    this.#timeline = found && new Timeline(found.entries, this.fleet.store);
    setText(this.note, noteOn(found));
    for (const control of [this.slider, this.play]) control.disabled = !found?.entries.length;
    if (!found) return;
    const begin = found.entries.length ? Date.parse(found.entries[0].time) - 1000 : range.since; // nothing changed before
    setAttribute(this.slider, "min", begin);
    setAttribute(this.slider, "max", range.until);
    this.slider.value = range.until;
    this.#narrow();
  }

  // Show the fleet at the slider's time.
  #moved() {
    if (!this.#timeline) return;
    const time = Number(this.slider.value);
    setText(this.clock, dateAndTime(time));
    setAttribute(this.slider, "aria-valuetext", dateAndTime(time));
    this.#replay(this.#timeline.robotsAt(time));
    const chosen = this.#chosen;
    const past = this.#timeline.events.slice(0, this.#timeline.lastEvent(time) + 1);
    const found = past.filter((entry) => fits(entry, chosen)).reverse();
    const names = Object.fromEntries([...this.fleet.store.robots.values()].map((robot) => [robot.id, robot.name]));
    const shown = chosen.grouped ? found : found.slice(0, LISTED);
    const content = [shown.map((entry) => entry.id), chosen.grouped];
    refill(this.list, content, () => (chosen.grouped ? this.#groups(shown, names) : shown.map((entry) => this.#event(entry, names))));
    const of = chosen.grouped ? new Set(found.map((entry) => entry.order ?? "")).size : found.length;
    setText(this.cut, of > LISTED ? t("history.listed", { count: number(LISTED), of: number(of) }) : "");
  }

  // One row per order, latest first, and one for events without an order.
  #groups(found, names) {
    const groups = new Map();
    for (const entry of found) append(groups, entry.order ?? "", entry);
    return [...groups].slice(0, LISTED).map(([order, entries]) => {
      const title = order ? verbatim("strong", order) : element("strong", {}, t("history.noOrder"));
      const latest = element("span", {}, `${dateAndTime(entries[0].time)} · ${plural("history.count", entries.length)}`);
      const rows = element("ol", { class: "history" }, ...entries.slice(0, LISTED).map((entry) => this.#event(entry, names)));
      const made = element("details", {}, element("summary", {}, title, " ", latest), rows);
      made.open = this.opened.has(order);
      made.addEventListener("toggle", () => (made.open ? this.opened.add(order) : this.opened.delete(order)));
      return element("li", { class: "group" }, made);
    });
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
    setText(this.play, t("history.pause"));
    this.#playing = setInterval(() => {
      this.#go(Number(this.slider.value) + FRAME * Number(this.speed.value));
      if (Number(this.slider.value) >= Number(this.slider.max)) this.#stop();
    }, FRAME);
  }

  #stop() {
    clearInterval(this.#playing);
    this.#playing = null;
    if (this.play) setText(this.play, t("history.play"));
  }

  #replay(robots) {
    const time = robots && dateAndTime(Number(this.slider.value));
    this.dispatchEvent(new CustomEvent("replay", { detail: robots && { robots, time } }));
  }
}

function noteOn(found) {
  if (!found) return t("history.none");
  if (!found.entries.length) return t("history.empty");
  return found.complete ? "" : t("history.cut");
}

// The time range in the address; null if it is missing or invalid.
// A year that is still being typed, such as 0202, makes no range.
function rangeOf(from, to) {
  const [since, until] = [Date.parse(from), Date.parse(to)];
  return since >= EARLIEST && since < until ? { since, until } : null;
}

function download(range, form, chosen) {
  return element("a", { href: exportAddress(range, form, chosen), download: `nena-history.${form}` }, t(`history.${form}`));
}

customElements.define("nena-history-page", HistoryPage);
