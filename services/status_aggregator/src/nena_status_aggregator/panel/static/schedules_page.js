// Schedules: when they create transport orders, what came of the last runs, and whether they are paused.

import { command, fetchList } from "./api.js";
import { button, element, foreign, verbatim } from "./dom.js";
import { run } from "./forms.js";
import { byName, dateAndTime, number, t } from "./i18n.js";
import { reasonElement } from "./reasons.js";
import { address, backLink } from "./router.js";

const EVERY = 10_000; // ms
const SHOWN_RUNS = 3;

class SchedulesPage extends HTMLElement {
  #loads = 0; // outdated answers are ignored
  #timer = null;

  /** Attach to `fleet`: {noCommands}. */
  show({ noCommands }) {
    this.noCommands = noCommands;
  }

  /** Show the page; null hides it. */
  open(view) {
    this.#loads += 1;
    clearInterval(this.#timer);
    if (view === null) return this.replaceChildren();
    this.note = element("p", { class: "hint", role: "status" }, t("audit.loading"));
    this.result = element("output", { class: "result", role: "status" });
    this.list = element("ul", { class: "entries schedules" });
    const heading = element("h2", { tabindex: -1 }, t("schedules.title"));
    const head = element("header", { class: "head" }, backLink(), heading);
    this.replaceChildren(head, element("section", {}, this.note, this.result, this.list));
    heading.focus({ preventScroll: true });
    this.#timer = setInterval(() => document.hidden || this.#load(), EVERY);
    return this.#load();
  }

  async #load() {
    const load = (this.#loads += 1);
    const answer = await fetchList("schedules", {}).catch((error) => error);
    if (load !== this.#loads) return;
    if (answer instanceof Error) {
      this.note.replaceChildren(t("audit.failed"), " ", foreign("span", answer.message));
      return;
    }
    const schedules = [...answer.schedules].sort((a, b) => byName(a.name, b.name));
    this.note.replaceChildren(schedules.length ? "" : t("schedules.none"));
    const shown = JSON.stringify(schedules);
    if (this.list.shown === shown) return; // keeps the focus
    this.list.shown = shown;
    const focused = document.activeElement?.closest("li[data-schedule]")?.dataset.schedule;
    this.list.replaceChildren(...schedules.map((each) => this.#item(each)));
    if (focused) [...this.list.children].find(({ dataset }) => dataset.schedule === focused)?.querySelector("button")?.focus();
  }

  #item(schedule) {
    const { name, cron, timeZone, enabled, transportOrder, createdOrders, skippedRuns } = schedule;
    const state = element("span", { class: "chip", "data-state": stateOf(schedule) }, t(`schedules.${stateOf(schedule)}`));
    const places = transportOrder.destinations.map((each) => each.locationName ?? t("dispatch.coordinate"));
    const facts = {
      order: verbatim("span", [...places, transportOrder.intendedVehicle].filter(Boolean).join(" · ")),
      cron: verbatim("span", `${cron} (${timeZone})`),
      next: nextOf(schedule),
      last: element("ul", { class: "entries" }, ...lastOf(schedule)),
      count: element("span", {}, t("schedules.counts", { created: number(createdOrders), skipped: number(skippedRuns) })),
    };
    const rows = Object.entries(facts).flatMap(([key, value]) => [element("dt", {}, t(`schedules.${key}`)), element("dd", {}, value)]);
    const change = !this.noCommands && this.#button(name, enabled);
    return element("li", { "data-schedule": name }, element("div", { class: "line" }, verbatim("strong", name), state, change), element("dl", { class: "facts" }, ...rows));
  }

  #button(name, enabled) {
    const made = button(t(enabled ? "command.pause" : "command.resume"), () => run(made, this.result, () => this.#switch(name, !enabled)), {
      "aria-label": t(enabled ? "schedules.pauseOne" : "schedules.resumeOne", { name }),
    });
    return made;
  }

  async #switch(name, enabled) {
    await command(["schedules", name, "enabled"], { enabled }, "PUT");
    await this.#load();
    return [enabled ? "schedules.resumed" : "schedules.wasPaused", { name }];
  }
}

function stateOf({ enabled, nextRuns }) {
  if (!enabled) return "HELD";
  return nextRuns.length ? "ACTIVE" : "FINISHED";
}

function nextOf({ nextRuns }) {
  if (!nextRuns.length) return element("span", {}, t("none"));
  return element("time", { datetime: nextRuns[0] }, dateAndTime(nextRuns[0]));
}

function lastOf({ lastRuns }) {
  if (!lastRuns.length) return [element("li", {}, t("none"))];
  return lastRuns.slice(0, SHOWN_RUNS).map(({ planned, transportOrder, reason, codedReason }) => {
    const order = transportOrder && verbatim("a", transportOrder, { href: address("orders", transportOrder) });
    const outcome = order || element("strong", { class: "bad" }, t("schedules.noOrder"));
    return element("li", {}, element("time", { datetime: planned }, dateAndTime(planned)), " ", outcome, " ", reasonElement("span", { reason, codedReason }, { class: "hint" }));
  });
}

customElements.define("nena-schedules-page", SchedulesPage);
