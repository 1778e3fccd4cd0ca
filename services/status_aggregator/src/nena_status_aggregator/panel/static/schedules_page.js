// Schedules and order templates: what they create and when, what came of the last runs, and the form that changes them.

import { command, fetchList, newKey, RefusedError } from "./api.js";
import { whenInWords, WhenFields } from "./cron_words.js";
import { button, element, field, foreign, numberInput, numberOf, select, verbatim } from "./dom.js";
import { commandForm, nameInput, run, StopFields, vehicles } from "./forms.js";
import { byName, dateAndTime, number, t } from "./i18n.js";
import { reasonElement } from "./reasons.js";
import { address, backLink } from "./router.js";

const EVERY = 10_000; // ms
const SHOWN_RUNS = 3;

class SchedulesPage extends HTMLElement {
  #loads = 0; // outdated answers are ignored
  #timer = null;

  /** Attach to `fleet`: {store, plant, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
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
    this.place = element("div");
    const add = button(t("schedules.new"), () => this.#edit(null));
    add.hidden = Boolean(this.fleet.noCommands);
    const head = element("header", { class: "head" }, backLink(), heading, add);
    this.replaceChildren(head, element("section", {}, this.note, this.result, this.place, this.list));
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
    this.names = new Set(schedules.map(({ name }) => name));
    this.note.replaceChildren(schedules.length ? "" : t("schedules.none"));
    const shown = JSON.stringify(schedules);
    if (this.list.shown === shown) return; // keeps the focus
    this.list.shown = shown;
    const focused = document.activeElement?.closest("li[data-schedule]")?.dataset.schedule;
    this.list.replaceChildren(...schedules.map((each) => this.#item(each)));
    if (focused) [...this.list.children].find(({ dataset }) => dataset.schedule === focused)?.querySelector("button")?.focus();
  }

  #item(schedule) {
    const { name, cron, transportOrder, createdOrders, skippedRuns } = schedule;
    const state = element("span", { class: "chip", "data-state": stateOf(schedule) }, t(`schedules.${stateOf(schedule)}`));
    const places = transportOrder.destinations.map((each) => each.locationName ?? t("dispatch.coordinate"));
    const facts = {
      order: verbatim("span", [...places, transportOrder.intendedVehicle].filter(Boolean).join(" · ")),
      when: element("span", { title: cron }, whenInWords(schedule)),
      next: nextOf(schedule),
      last: element("ul", { class: "entries" }, ...lastOf(schedule)),
      count: element("span", {}, t("schedules.counts", { created: number(createdOrders), skipped: number(skippedRuns) })),
    };
    if (cron === null) for (const key of ["next", "last", "count"]) delete facts[key];
    const rows = Object.entries(facts).flatMap(([key, value]) => [element("dt", {}, t(`schedules.${key}`)), element("dd", {}, value)]);
    const change = this.fleet.noCommands ? [] : this.#buttons(schedule);
    return element("li", { "data-schedule": name }, element("div", { class: "line" }, verbatim("strong", name), state, ...change), element("dl", { class: "facts" }, ...rows));
  }

  #buttons(schedule) {
    const { name, cron, enabled } = schedule;
    const direct = (key, label, send) => {
      const made = button(t(key), () => run(made, this.result, send), { "aria-label": t(label, { name }) });
      return made;
    };
    const pause = direct(enabled ? "command.pause" : "command.resume", enabled ? "schedules.pauseOne" : "schedules.resumeOne", () => this.#switch(name, !enabled));
    return [
      direct("schedules.run", "schedules.runOne", () => runNow(schedule)),
      ...(cron === null ? [] : [pause]),
      button(t("schedules.edit"), () => this.#edit(schedule), { "aria-label": t("schedules.editOne", { name }) }),
      button(t("schedules.delete"), () => this.#confirmDelete(name), { "aria-label": t("schedules.deleteOne", { name }) }),
    ];
  }

  async #switch(name, enabled) {
    await command(["schedules", name, "enabled"], { enabled }, "PUT");
    await this.#load();
    return [enabled ? "done.resume" : "schedules.wasPaused", { name }];
  }

  #confirmDelete(name) {
    const effect = element("p", { class: "effect", tabindex: -1 }, t("schedules.deleteEffect", { name }));
    this.#open(t("schedules.deleteOne", { name }), [effect], t("schedules.deleteSure"), async () => {
      await command(["schedules", name], {}, "DELETE");
      return ["schedules.deleted", { name }];
    });
    effect.focus();
  }

  // The form of a schedule; null: of a new one. What it does not show stays as it is.
  #edit(schedule) {
    const { plant, store } = this.fleet;
    if (!plant.model) return this.note.replaceChildren(t("map.empty.title"));
    const { name: known, nextRuns, lastRuns, createdOrders, skippedRuns, ...kept } = schedule ?? { transportOrder: {} };
    const name = nameInput({ required: true, maxlength: 80, value: known ?? "", readonly: known ? "" : null });
    const stops = new StopFields(plant, kept.transportOrder.destinations);
    const vehicle = select([["", t("orderForm.anyVehicle")], ...vehicles({ store, plant })], { name: "vehicle" });
    vehicle.value = kept.transportOrder.intendedVehicle ?? "";
    const priority = numberInput({ name: "priority", value: kept.transportOrder.priority ?? 0, min: -1000, max: 1000, step: 1 });
    const when = new WhenFields(kept);
    const more = element("div", { class: "fields" }, field(t("orders.vehicle"), vehicle), field(t("form.priority"), priority));
    this.#open(t(known ? "schedules.editOne" : "schedules.new", { name: known }), [field(t("schedules.name"), name), stops.element, more, when.element], t("order.save"), async () => {
      if (!known && this.names?.has(name.value)) throw new RefusedError({ detail: t("schedules.exists", { name: name.value }) });
      const order = { ...kept.transportOrder, destinations: stops.destinations, intendedVehicle: vehicle.value || null, priority: numberOf(priority) ?? 0 };
      await command(["schedules", name.value], { ...kept, ...when.definition, transportOrder: order }, "PUT");
      return ["schedules.saved", { name: name.value }];
    });
    (known ? stops.element.querySelector("select") : name).focus();
  }

  // Show a form above the list until it is sent or closed.
  #open(label, fields, submit, send) {
    const close = () => this.place.replaceChildren();
    const sent = async () => {
      const done = await send();
      close();
      this.result.dataset.level = "fine";
      this.result.replaceChildren(element("strong", {}, t(...done)));
      await this.#load();
      return done;
    };
    this.result.replaceChildren();
    this.place.replaceChildren(commandForm({ label, submit, fields, send: sent, more: [button(t("stops.cancel"), close)] }));
  }
}

// An order of a schedule or template at once: one of its own, which the schedule does not count.
async function runNow({ name, transportOrder }) {
  const order = await command(["transportOrders"], { ...transportOrder, name, incompleteName: true, idempotencyKey: newKey() });
  return ["done.orderCreated", { name: order.name }];
}

function stateOf({ cron, enabled, nextRuns }) {
  if (cron === null) return "TEMPLATE";
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
