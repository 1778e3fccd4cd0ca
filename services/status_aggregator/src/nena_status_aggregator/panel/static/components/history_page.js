// The history: a slider over the time moves the map, and a list says what happened.

import { t } from "../catalogue.js";
import { button, element, foreign, refill, setAttribute, setText, verbatim } from "../dom.js";
import { dateAndTime } from "../format.js";
import { field, select } from "../forms/fields.js";
import { exportAddress, loadHistory } from "../replay/load.js";
import { Timeline } from "../replay/timeline.js";

const RANGES = { minutes10: 600, hour: 3600, hours8: 28_800, day: 86_400 };
const SPEEDS = [1, 10, 60];
const FRAME = 100; // ms
const LISTED = 60;

/** Fires `replay` with the robots that the map is to show; null: those of now. */
class HistoryPage extends HTMLElement {
  #timeline = null;
  #playing = null;

  /** Prepare; `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
  }

  /** Show the history; null: hide it. */
  open(view) {
    this.#stop();
    this.#tell(null);
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

  // Show the time at which the slider stands.
  #moved() {
    const time = Number(this.slider.value);
    setText(this.clock, dateAndTime(time));
    setAttribute(this.slider, "aria-valuetext", dateAndTime(time));
    this.#tell(this.#timeline.robotsAt(time));
    const last = this.#timeline.lastEvent(time);
    const shown = this.#timeline.events.slice(Math.max(0, last + 1 - LISTED), last + 1).reverse();
    const names = Object.fromEntries([...this.fleet.store.robots.values()].map((robot) => [robot.id, robot.name]));
    refill(this.list, [shown.map((entry) => entry.id), last], () => shown.map((entry) => this.#event(entry, names)));
  }

  #event(entry, names) {
    const jump = button(dateAndTime(entry.time), () => this.#go(Date.parse(entry.time)), { class: "time", translate: "no" });
    const who = entry.robot ? (names[entry.robot] ?? entry.robot) : (entry.order ?? "");
    const what = element("div", {}, element("strong", {}, t(`happening.${entry.code}`)), " ", verbatim("span", who));
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

  #tell(robots) {
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
