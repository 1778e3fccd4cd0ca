// The page of a transport order, and the form that creates one.

import { ask, command, newKey } from "./api.js";
import { button, element, field, foreign, numberInput, numberOf, progressBar, refill, select, setAttribute, setText, verbatim } from "./dom.js";
import { details } from "./event_texts.js";
import { causesOfOrder } from "./explanations.js";
import { shownState } from "./fleet.js";
import { commandForm, run, StopFields, vehicles } from "./forms.js";
import { dateAndTime, has, number, t } from "./i18n.js";
import { nameOfHolder, worded } from "./reasons.js";
import { address, backLink } from "./router.js";

class OrderPage extends HTMLElement {
  #name = null;
  #version = null;

  /** Attach to `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
    fleet.store.addEventListener("change", () => this.#name && this.#update());
    fleet.plant.addEventListener("change", () => this.#name && this.#update());
    fleet.link.addEventListener("state", () => this.#name && this.#update());
  }

  /** Show an order; null hides the page. */
  open(name) {
    this.#name = name;
    this.#version = null;
    if (name) this.#build();
    else this.replaceChildren();
  }

  #build() {
    this.heading = verbatim("h2", this.#name, { tabindex: -1 });
    this.chip = element("span", { class: "chip" });
    this.why = element("nena-why-list");
    this.facts = element("dl", { class: "facts" });
    this.progress = progressBar();
    this.stops = element("ol", { class: "stops" });
    this.history = element("ol", { class: "history" }, element("li", { class: "hint" }, t("order.historyNone")));
    this.gone = element("p", { class: "hint" }, t("order.gone"));
    const head = element("header", { class: "head" }, backLink(), this.heading, this.chip);
    this.body = element(
      "div",
      {},
      section("why.orderTitle", this.why),
      section("robot.commands", this.#commands()),
      section("order.stops", this.progress.box, this.stops),
      section("robot.facts", this.facts),
    );
    this.replaceChildren(head, this.gone, this.body, section("order.history", this.history));
    this.#update();
    this.heading.focus({ preventScroll: true });
  }

  // Withdrawing asks for confirmation and shows the effect.
  #commands() {
    this.result = element("output", { class: "result", role: "status" });
    this.sure = button(t("order.withdrawSure", { name: this.#name }), () => run(this.sure, this.result, () => this.#ask("withdrawal", "withdrawn")), { class: "danger", "aria-describedby": "withdraw-effect" });
    this.withdraw = button(t("order.withdraw"), () => {
      this.effect.hidden = this.sure.hidden = !this.sure.hidden;
      if (!this.sure.hidden) this.effect.focus(); // not the button: a held Enter key would press it
    });
    this.effect = element("p", { class: "effect", id: "withdraw-effect", tabindex: -1 });
    this.effect.hidden = this.sure.hidden = true;
    this.hold = button(t("order.hold"), () => run(this.hold, this.result, () => this.#ask("hold", "held")));
    this.resume = button(t("order.resume"), () => run(this.resume, this.result, () => this.#ask("resume", "resumed")));
    this.off = element("p", { class: "hint" }, t(this.fleet.noCommands ?? ""));
    this.off.hidden = !this.fleet.noCommands;
    this.bar = element("div", { class: "actions" }, this.hold, this.resume, this.withdraw, this.sure);
    return element("div", {}, this.bar, this.effect, this.off, this.result);
  }

  async #ask(verb, done) {
    await command(["transportOrders", this.#name, verb], { reason: `${done} at the control panel` });
    return [`done.${done}`, { name: this.#name }];
  }

  #update() {
    const order = this.fleet.store.orders.get(this.#name);
    this.gone.hidden = Boolean(order);
    this.body.hidden = this.chip.hidden = !order;
    if (order?.version !== this.#version || this.#version === null) this.#loadHistory(order?.version ?? 0);
    if (!order) return;
    setText(this.chip, t(`state.${shownState(order)}`));
    setAttribute(this.chip, "data-state", shownState(order));
    this.why.show(causesOfOrder(order, this.fleet));
    this.bar.hidden = Boolean(this.fleet.noCommands);
    this.withdraw.disabled = order.final;
    this.hold.disabled = order.final || order.state === "WITHDRAWN";
    setText(this.effect, t(order.processingVehicle ? "confirm.withdrawDriving" : "confirm.withdrawWaiting", { name: order.name, vehicle: order.processingVehicle }));
    this.hold.hidden = Boolean(order.held);
    this.resume.hidden = !order.held;
    if (this.withdraw.disabled) this.effect.hidden = this.sure.hidden = true;
    this.progress.box.hidden = order.progress === null;
    this.progress.bar.value = order.progress ?? 0;
    setAttribute(this.progress.bar, "aria-label", t("progress.label", { name: order.id }));
    setText(this.progress.value, t("progress.value", { percent: number(order.progress ?? 0) }));
    refill(this.stops, [order.destinations, order.currentDestination], () => order.destinations.map(stop));
    refill(this.facts, factsOf(order), (facts) => facts.flatMap(([key, content]) => [element("dt", {}, t(key)), content()]));
  }

  async #loadHistory(version) {
    this.#version = version;
    const name = this.#name;
    const entries = this.fleet.enabled ? await ofOrderService(name) : await ofAggregator(name);
    if (name !== this.#name || !entries.length) return;
    this.history.replaceChildren(...entries.map(entry));
  }
}

async function ofOrderService(name) {
  const status = await ask("transportOrders", name).catch(() => null);
  return (status?.history ?? []).map((each) => ({
    time: each.timestamp,
    text: has(`event.${each.eventCode}`) ? t(`event.${each.eventCode}`) : each.eventCode,
    words: supplementsOf(each),
  }));
}

const FINAL = "nena:finalStateReached"; // with the state as its first supplement
const NAMES_ONLY = new Set(["nena:orderCreated", "nena:operationStarted", "nena:deadlinePassed", "nena:intendedVehicleChanged"]);

// The supplements of an entry: names, and a reason as the last one.
function supplementsOf({ eventCode, supplements, codedReason }) {
  const { text } = worded({ codedReason });
  const named = (each) => (eventCode === FINAL && has(`state.${each}`) ? t(`state.${each}`) : nameOfHolder(each));
  const names = (text ? supplements.slice(0, -1) : supplements).map(named);
  if (text) return element("span", {}, [...names, text].join(" · "));
  return (NAMES_ONLY.has(eventCode) ? verbatim : foreign)("span", names.join(" · "));
}

async function ofAggregator(name) {
  const answer = await fetch(`api/v1/history?order=${encodeURIComponent(name)}`).catch(() => null);
  const page = answer?.ok ? await answer.json() : { entries: [] };
  return page.entries.reverse().map((each) => ({ time: each.time, text: t(`eventLog.${each.code}`), words: details(each) }));
}

function section(key, ...content) {
  return element("section", {}, element("h3", {}, t(key)), ...content);
}

function entry({ time, text, words }) {
  return element("li", {}, element("time", { datetime: time }, dateAndTime(time)), element("strong", {}, text), words);
}

function stop(each) {
  return element(
    "li",
    { "data-state": each.state },
    verbatim("span", t("destination", each)),
    " ",
    element("strong", {}, t(`drive.${each.state}`)),
  );
}

function heldBy({ by, since }) {
  return verbatim("dd", t("order.heldBy", { by: nameOfHolder(by), time: dateAndTime(since) }));
}

function factsOf(order) {
  const words = (text) => () => element("dd", {}, text);
  const moment = (text) => () => verbatim("dd", dateAndTime(text));
  const vehicle = order.processingVehicle ?? order.intendedVehicle;
  return [
    ["orders.vehicle", vehicle && (() => verbatim("dd", vehicle))],
    ["form.priority", words(number(order.priority))],
    ["order.held", order.held && (() => heldBy(order.held))],
    ["order.type", order.type !== "-" && (() => verbatim("dd", order.type))],
    ["order.deadline", order.deadline && moment(order.deadline)],
    ["order.created", moment(order.created)],
    ["order.finished", order.finished && moment(order.finished)],
  ].filter(([, content]) => content);
}

customElements.define("nena-order-page", OrderPage);

class OrderForm extends HTMLElement {
  /** Attach to `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
    fleet.plant.addEventListener("change", () => !this.hidden && this.open("new"));
  }

  /** Start a new order; null hides the form. */
  open(begin) {
    if (begin === null) return this.replaceChildren();
    this.key = newKey();
    const heading = element("h2", { tabindex: -1 }, t("orderForm.title"));
    const head = element("header", { class: "head" }, backLink(), heading);
    const ready = !this.fleet.noCommands && this.fleet.plant.model;
    const missing = t(this.fleet.noCommands ?? "map.empty.title");
    this.replaceChildren(head, ready ? this.#form() : element("p", { class: "hint" }, missing));
    heading.focus({ preventScroll: true });
  }

  #form() {
    this.stops = new StopFields(this.fleet.plant);
    this.vehicle = select([["", t("orderForm.anyVehicle")], ...vehicles(this.fleet)], { name: "vehicle" });
    this.priority = numberInput({ name: "priority", value: 0, min: -1000, max: 1000, step: 1 });
    this.deadline = element("input", { type: "datetime-local", name: "deadline" });
    this.name = element("input", { type: "text", name: "name", maxlength: 100, pattern: "[A-Za-z0-9_:\\-][A-Za-z0-9_.:\\-]*" });
    const more = element(
      "div",
      { class: "fields" },
      field(t("orderForm.vehicle"), this.vehicle),
      field(t("form.priority"), this.priority),
      field(t("orderForm.deadline"), this.deadline),
      field(t("orderForm.name"), this.name),
    );
    return commandForm({
      label: t("orderForm.title"),
      submit: t("orderForm.send"),
      fields: [this.stops.element, more],
      send: () => this.#send(),
    });
  }

  async #send() {
    const deadline = this.deadline.value && new Date(this.deadline.value).toISOString();
    const wishes = { intendedVehicle: this.vehicle.value, deadline, name: this.name.value.trim() };
    const order = await command(["transportOrders"], {
      destinations: this.stops.destinations,
      priority: numberOf(this.priority) ?? 0,
      idempotencyKey: this.key,
      ...Object.fromEntries(Object.entries(wishes).filter(([, value]) => value)),
    });
    location.hash = address("orders", order.name);
    return ["done.orderCreated", { name: order.name }];
  }
}

customElements.define("nena-order-form", OrderForm);
