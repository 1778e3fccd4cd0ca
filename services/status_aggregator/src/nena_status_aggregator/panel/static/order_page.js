// The page of a transport order, and the form that creates one.

import { ask, command, newKey } from "./api.js";
import { element, field, foreign, numberInput, numberOf, progressBar, refill, section, select, setAttribute, setText, showProgress, verbatim } from "./dom.js";
import { details } from "./event_texts.js";
import { causesOfOrder } from "./explanations.js";
import { shownState, stopState } from "./fleet.js";
import { commandForm, nameInput, StopFields, vehicles } from "./forms.js";
import { dateAndTime, duration, fieldTime, has, number, t } from "./i18n.js";
import { OrderCommands } from "./order_commands.js";
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
    this.history = element("ol", { class: "history" });
    this.gone = element("p", { class: "hint" }, t("order.gone"));
    const head = element("header", { class: "head" }, backLink(), this.heading, this.chip);
    this.commands = new OrderCommands(this.#name, this.fleet, (request) => this.dispatchEvent(new CustomEvent("edit", { detail: request })));
    this.status = null;
    this.body = element(
      "div",
      {},
      section("why.orderTitle", this.why),
      section("robot.commands", this.commands.element),
      section("orders.destinations", this.progress.box, this.stops),
      section("map.menu.page", this.facts),
    );
    this.replaceChildren(head, this.gone, this.body, section("order.history", this.history));
    this.#update();
    this.heading.focus({ preventScroll: true });
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
    this.commands.update(order);
    showProgress(this.progress, order);
    refill(this.stops, [order.destinations, order.currentDestination, order.outcome], () => order.destinations.map((each) => stop(each, order)));
    refill(this.facts, [...factsOf(order), ...moreFacts(order, this.status, this.fleet.store)], (facts) => facts.flatMap(([key, content]) => [element("dt", {}, t(key)), content()]));
  }

  async #loadHistory(version) {
    this.#version = version;
    const name = this.#name;
    const status = this.fleet.enabled ? await ask("transportOrders", name).catch(() => null) : null;
    const entries = this.fleet.enabled ? ofOrderService(status) : await ofAggregator(name);
    if (name !== this.#name) return;
    this.status = status;
    if (entries.length) this.history.replaceChildren(...entries.map(entry));
    else if (!this.history.hasChildNodes()) this.history.append(element("li", { class: "hint" }, t("order.historyNone")));
    if (status) this.#update();
  }
}

function ofOrderService(status) {
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

function entry({ time, text, words }) {
  return element("li", {}, element("time", { datetime: time }, dateAndTime(time)), element("strong", {}, text), words);
}

function stop(each, order) {
  const state = stopState(each, order);
  return element("li", { "data-state": state }, verbatim("span", t("destination", each)), " ", element("strong", {}, t(`drive.${state}`)));
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
    ["state.HELD", order.held && (() => heldBy(order.held))],
    ["orders.type", order.type !== "-" && (() => verbatim("dd", order.type))],
    ["orders.deadline", order.deadline && moment(order.deadline)],
    ["event.nena:orderCreated", moment(order.created)],
    ["order.createdBy", order.automatic ? words(t("order.byItself")) : order.createdBy && (() => verbatim("dd", nameOfHolder(order.createdBy)))],
    ["event.nena:finalStateReached", order.finished && moment(order.finished)],
  ].filter(([, content]) => content);
}

// Facts that link to other orders, or that only the order service knows.
function moreFacts(order, status, store) {
  const links = (names) => () => element("dd", {}, ...names.flatMap((name, at) => [at ? ", " : "", verbatim("a", name, { href: address("orders", name) })]));
  const before = order.dependencies;
  const after = [...store.orders.values()].filter(({ dependencies }) => dependencies.includes(order.name)).map(({ name }) => name);
  const policy = (status?.onFailure ?? []).map(({ do: measure, times, after: delay }) => t(`policy.${measure}`) + (times > 1 ? ` × ${number(times)}` : "") + (delay ? ` (${t("order.seconds", { seconds: number(delay) })})` : ""));
  return [
    ["order.waitsFor", before.length && links(before)],
    ["order.onDependencyFailure", before.length && status && (() => element("dd", {}, t(`dependency.${status.onDependencyFailure}`)))],
    ["order.waitedForBy", after.length && links(after)],
    ["order.sequence", status?.wrappingSequence && (() => verbatim("dd", status.wrappingSequence))],
    ["order.timeout", status?.timeout && (() => element("dd", {}, duration(status.timeout)))],
    ["order.onFailure", policy.length && (() => element("dd", {}, policy.join(" → ")))],
    ["order.properties", status?.properties.length && (() => verbatim("dd", status.properties.map(({ key, value }) => `${key}: ${value}`).join(", ")))],
  ].filter(([, content]) => content);
}

customElements.define("nena-order-page", OrderPage);

class OrderForm extends HTMLElement {
  /** Attach to `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
    fleet.plant.addEventListener("change", () => !this.hidden && this.open("new"));
  }

  /** Fill the form in with this request when it opens next. */
  fillIn(request) {
    this.first = request;
  }

  /** Start a new order; null hides the form. */
  open(begin) {
    if (begin === null) {
      this.first = undefined;
      return this.replaceChildren();
    }
    this.key = newKey();
    const heading = element("h2", { tabindex: -1 }, t("orderForm.title"));
    const head = element("header", { class: "head" }, backLink(), heading);
    const ready = !this.fleet.noCommands && this.fleet.plant.model;
    const missing = t(this.fleet.noCommands ?? "map.empty.title");
    this.replaceChildren(head, ready ? this.#form() : element("p", { class: "hint" }, missing));
    heading.focus({ preventScroll: true });
  }

  #form() {
    const { destinations, intendedVehicle = "", priority = 0, deadline, name = "" } = this.first ?? {};
    this.stops = new StopFields(this.fleet.plant, destinations);
    this.vehicle = select([["", t("orderForm.anyVehicle")], ...vehicles(this.fleet)], { name: "vehicle" });
    this.vehicle.value = intendedVehicle;
    this.priority = numberInput({ name: "priority", value: priority, min: -1000, max: 1000, step: 1 });
    this.deadline = element("input", { type: "datetime-local", name: "deadline", value: deadline ? fieldTime(new Date(deadline)) : "" });
    this.name = nameInput({ value: name, maxlength: 100 });
    const more = element(
      "div",
      { class: "fields" },
      field(t("orders.vehicle"), this.vehicle),
      field(t("form.priority"), this.priority),
      field(t("orders.deadline"), this.deadline),
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
    const { intendedVehicle, deadline: before, name, incompleteName, ...kept } = this.first ?? {}; // what the fields do not show
    const unique = wishes.name && wishes.name === name ? { incompleteName } : {};
    const order = await command(["transportOrders"], {
      ...kept,
      ...unique,
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
