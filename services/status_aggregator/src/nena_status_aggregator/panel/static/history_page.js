// The history: a time slider that replays the map, and a list of events.

import { button, element, field, foreign, refill, select, setAttribute, setText, verbatim } from "./dom.js";
import { dateAndTime, t } from "./i18n.js";

const PAGE = 1000;
const PAGES = 20;
const CODES = [
  "position", "condition", "connection", "operatingMode", "orderTaken", "orderEnded", "actionEnded", "errorRaised",
  "errorCleared", "charging", "loads", "map", "transportOrder", "link", "historyGap",
];

/** Load the entries since a time, at most PAGES pages of the latest. Returns `{entries, complete}`, oldest first; null without a history. */
export async function loadHistory(since) {
  const entries = [];
  let before = null;
  for (let page = 0; page < PAGES; page += 1) {
    const answer = await fetch(`api/v1/history?${queryOf(since, { limit: PAGE, before })}`).catch(() => null);
    if (!answer?.ok) return null;
    const part = await answer.json();
    entries.push(...part.entries);
    before = part.next;
    if (before === null) break;
  }
  return { entries: entries.reverse(), complete: before === null };
}

/** Return the address of the same time range as a file, `csv` or `jsonl`. */
export function exportAddress(since, form) {
  return `api/v1/history.${form}?${queryOf(since, {})}`;
}

function queryOf(since, more) {
  const query = new URLSearchParams({ since: new Date(since).toISOString() });
  for (const code of CODES) query.append("code", code);
  for (const [name, value] of Object.entries(more)) if (value !== null) query.set(name, value);
  return query;
}

const GAP = 15_000;

/**
 * The history by time. `entries` are those of the API, oldest first; `robots` are the current ones: a robot that did not
 * move within the time range is shown at its current position.
 */
export class Timeline {
  #robots;
  #tracks = new Map();
  #conditions = new Map();

  constructor(entries, robots) {
    this.#robots = robots;
    this.events = entries.filter((entry) => entry.code !== "position");
    for (const entry of entries) {
      const at = Date.parse(entry.time);
      if (entry.code === "position") append(this.#tracks, entry.robot, { at, ...entry.values });
      if (entry.code === "condition") append(this.#conditions, entry.robot, { at, ...entry.values });
    }
  }

  /** Return the robots at a time, as the map needs them. */
  robotsAt(time) {
    return this.#robots.map((robot) => this.#robotAt(robot, time)).filter((robot) => robot.position);
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

// Before the first position the robot was less than one track step away; between two it is drawn on a straight line.
function placeAt(track, time) {
  const at = track.findLastIndex((place) => place.at <= time);
  const [from, to] = [track[Math.max(at, 0)], track[at + 1]];
  const share = at >= 0 && to && to.at - from.at < GAP ? (time - from.at) / (to.at - from.at) : 0;
  const between = (name) => from[name] + share * ((to ?? from)[name] - from[name]);
  return { x: between("x"), y: between("y"), theta: from.theta, localized: true };
}

const RANGES = { minutes10: 600, hour: 3600, hours8: 28_800, day: 86_400 };
const SPEEDS = [1, 10, 60];
const FRAME = 100; // ms
const LISTED = 60;

/** Fires `replay` with the robots to show on the map; null: live data. */
class HistoryPage extends HTMLElement {
  #timeline = null;
  #playing = null;

  /** Attach to `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
  }

  /** Show the history; null hides it. */
  open(view) {
    this.#stop();
    this.#replay(null);
    if (view === null) return this.replaceChildren();
    this.range = select(Object.keys(RANGES).map((name) => [name, t(`history.${name}`)]), { name: "range" });
    this.speed = select(SPEEDS.map((each) => [each, t("history.speed", { factor: each })]), { name: "speed" });
    this.slider = element("input", { type: "range", step: 100, "aria-label": t("history.time"), class: "slider" });
    this.play = button(t("history.play"), () => (this.#playing ? this.#stop() : this.#start()));
    this.clock = verbatim("output", "", { class: "number clock" });
    this.note = element("p", { class: "hint", role: "status" });
    this.files = element("p", { class: "files" });
    this.list = element("ol", { class: "history" });
    this.range.addEventListener("change", () => this.#load());
    this.slider.addEventListener("input", () => this.#moved());
    const heading = element("h2", { tabindex: -1 }, t("history.title"));
    const head = element("header", { class: "head" }, element("a", { href: "#/", class: "back" }, t("page.back")), heading);
    const choices = element("div", { class: "fields" }, field(t("history.range"), this.range), field(t("history.speedLabel"), this.speed), this.play, this.clock);
    const controls = element("section", {}, choices, this.slider, this.note);
    this.replaceChildren(head, controls, element("section", {}, element("h3", {}, t("history.events")), this.list, this.files));
    heading.focus({ preventScroll: true });
    return this.#load();
  }

  async #load() {
    this.#stop();
    setText(this.note, t("history.loading"));
    const now = this.fleet.store.now();
    const since = now - RANGES[this.range.value] * 1000;
    const found = await loadHistory(since);
    if (!this.isConnected || !this.list) return;
    this.#timeline = found && new Timeline(found.entries, [...this.fleet.store.robots.values()]);
    setText(this.note, noteOn(found));
    for (const control of [this.slider, this.play]) control.disabled = !found?.entries.length;
    if (!found) return;
    const begin = found.complete ? since : Date.parse(found.entries[0].time);
    setAttribute(this.slider, "min", begin);
    setAttribute(this.slider, "max", now);
    this.slider.value = now;
    this.files.replaceChildren(...["csv", "jsonl"].map((form) => download(since, form)));
    this.#moved();
  }

  // Show the fleet at the slider's time.
  #moved() {
    const time = Number(this.slider.value);
    setText(this.clock, dateAndTime(time));
    setAttribute(this.slider, "aria-valuetext", dateAndTime(time));
    this.#replay(this.#timeline.robotsAt(time));
    const last = this.#timeline.lastEvent(time);
    const shown = this.#timeline.events.slice(Math.max(0, last + 1 - LISTED), last + 1).reverse();
    const names = Object.fromEntries([...this.fleet.store.robots.values()].map((robot) => [robot.id, robot.name]));
    refill(this.list, [shown.map((entry) => entry.id), last], () => shown.map((entry) => this.#event(entry, names)));
  }

  #event(entry, names) {
    const jump = button(dateAndTime(entry.time), () => this.#go(Date.parse(entry.time)), { class: "time", translate: "no" });
    const who = entry.robot ? (names[entry.robot] ?? entry.robot) : (entry.order ?? "");
    const what = element("div", {}, element("strong", {}, t(`eventLog.${entry.code}`)), " ", verbatim("span", who));
    return element("li", {}, jump, what, foreign("span", entry.text));
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

function download(since, form) {
  return element("a", { href: exportAddress(since, form), download: `nena-history.${form}` }, t(`history.${form}`));
}

customElements.define("nena-history-page", HistoryPage);
