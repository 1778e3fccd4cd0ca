// Commands to transport orders: repeat, change, withdraw; to one on its page, or to several that are marked in the list.

import { ask, command, newKey } from "./api.js";
import { button, element, field, foreign, numberInput, numberOf, select, setText } from "./dom.js";
import { commandForm, run, vehicles } from "./forms.js";
import { fieldTime, number, plural, t } from "./i18n.js";
import { address } from "./router.js";

const COPIED = ["type", "priority", "intendedVehicle", "properties", "dispensable", "peripheralReservationToken", "onFailure", "timeout", "processingTimeout"];
const UNIQUE = /-[0-9a-f]{22}$/; // what the order service appends to an incomplete name
const NAME_LIMIT = 70; // characters, so that a unique name still fits
const WAITING = ["ACTIVE", "DISPATCHABLE"];

/** Return the request for an order like this one, as the order service knows it; a deadline that has passed is left out. */
export function repetitionOf(order) {
  const kept = Object.fromEntries(COPIED.map((key) => [key, order[key]]).filter(([, value]) => value !== null && value !== undefined));
  const deadline = Date.parse(order.deadline) > Date.now() ? { deadline: order.deadline } : {};
  const name = order.name.replace(UNIQUE, "").slice(0, NAME_LIMIT);
  return { ...kept, ...deadline, name, incompleteName: true, destinations: order.driveOrders.map(({ destination }) => destination) };
}

async function repeat(name, key) {
  return command(["transportOrders"], { ...repetitionOf(await ask("transportOrders", name)), idempotencyKey: key });
}

/** Withdraw an order; `immediate`: its robot stops at once, else it finishes the released part of its drive. */
export async function withdraw(name, immediate = true) {
  await command(["transportOrders", name, "withdrawal"], { reason: "withdrawn at the control panel", immediate });
  return ["done.withdrawn", { name }];
}

/** The buttons and forms of the page of an order. `edit(request)` opens the form of a new order. */
export class OrderCommands {
  #key = newKey();

  constructor(name, fleet, edit) {
    this.name = name;
    this.fleet = fleet;
    this.result = element("output", { class: "result", role: "status" });
    this.place = element("div"); // of the form that is open
    const verb = (key, send, attributes = {}) => {
      const made = button(t(key), () => run(made, this.result, send), attributes);
      return made;
    };
    this.repeat = verb("order.repeat", () => this.#repeat());
    this.edit = verb("order.repeatEdited", async () => {
      edit(repetitionOf(await ask("transportOrders", name)));
      return ["orderForm.title"];
    });
    this.change = button(t("order.change"), () => this.#openChange());
    this.hold = verb("order.hold", () => this.#ask("hold", "held"));
    this.resume = verb("order.resume", () => this.#ask("resume", "resumed"));
    this.withdraw = button(t("order.withdraw"), () => this.#toggle(this.question.hidden));
    this.effect = element("p", { class: "effect", id: "withdraw-effect", tabindex: -1 });
    const sure = (key, immediate) => verb(key, () => withdraw(name, immediate), { class: "danger", "aria-describedby": "withdraw-effect" });
    this.gently = sure("order.withdrawGently", false);
    this.atOnce = sure("order.withdrawAtOnce", true);
    this.question = element("div", { class: "question", hidden: true }, this.effect, element("div", { class: "actions" }, this.gently, this.atOnce));
    this.off = element("p", { class: "hint" }, t(fleet.noCommands ?? ""));
    this.off.hidden = !fleet.noCommands;
    this.bar = element("div", { class: "actions" }, this.repeat, this.edit, this.change, this.hold, this.resume, this.withdraw);
    this.element = element("div", {}, this.bar, this.question, this.place, this.off, this.result);
  }

  /** Offer what is possible for the order as it is now. */
  update(order) {
    this.order = order;
    this.bar.hidden = Boolean(this.fleet.noCommands);
    this.repeat.hidden = this.edit.hidden = order.automatic;
    this.change.hidden = !WAITING.includes(order.state);
    if (this.change.hidden) this.place.replaceChildren();
    this.withdraw.disabled = order.final;
    this.hold.disabled = order.final || order.state === "WITHDRAWN";
    this.hold.hidden = Boolean(order.held);
    this.resume.hidden = !order.held;
    this.gently.hidden = !order.processingVehicle || order.state === "WITHDRAWN";
    setText(this.atOnce, t(order.processingVehicle ? "order.withdrawAtOnce" : "order.withdrawSure", { name: order.name }));
    setText(this.effect, t(order.processingVehicle ? "confirm.withdrawDriving" : "confirm.withdrawWaiting", { name: order.name, vehicle: order.processingVehicle }));
    if (order.final) this.#toggle(false);
  }

  #toggle(shown) {
    this.question.hidden = !shown;
    if (shown) this.effect.focus(); // not a button: a held Enter key would press it
  }

  async #ask(verb, done) {
    await command(["transportOrders", this.name, verb], { by: this.fleet.person(), reason: `${done} at the control panel` });
    return [`done.${done}`, { name: this.name }];
  }

  async #repeat() {
    const { name } = await repeat(this.name, this.#key);
    this.#key = newKey();
    return ["done.orderCreated", { name }, element("a", { href: address("orders", name) }, t("order.open"))];
  }

  async #openChange() {
    if (this.place.firstChild) return this.place.replaceChildren();
    const { timeout } = await ask("transportOrders", this.name).catch(() => ({}));
    const { priority: urgency, intendedVehicle, deadline: until } = this.order;
    const priority = numberInput({ name: "priority", value: urgency, min: -1000, max: 1000, step: 1, required: true });
    const vehicle = select([["", t("orderForm.anyVehicle")], ...vehicles(this.fleet)], { name: "vehicle" });
    vehicle.value = intendedVehicle ?? "";
    const deadline = element("input", { type: "datetime-local", name: "deadline", value: until ? fieldTime(new Date(until)) : "" });
    const limit = numberInput({ name: "timeout", value: timeout ? timeout / 60 : "", min: 0.1, step: "any" });
    const before = { priority: urgency, intendedVehicle, deadline: deadline.value, timeout: timeout ?? null };
    const send = async () => {
      const now = { priority: numberOf(priority), intendedVehicle: vehicle.value || null, deadline: deadline.value, timeout: numberOf(limit) && numberOf(limit) * 60 };
      const changed = Object.entries(now).filter(([key, value]) => value !== before[key]);
      if (!changed.length) return ["order.unchanged", { name: this.name }];
      const body = Object.fromEntries(changed.map(([key, value]) => [key, key === "deadline" ? value && new Date(value).toISOString() || null : value]));
      await command(["transportOrders", this.name], body, "PATCH");
      Object.assign(before, now);
      return ["done.changed", { name: this.name }];
    };
    const fields = element("div", { class: "fields" }, field(t("form.priority"), priority), field(t("orders.vehicle"), vehicle), field(t("orders.deadline"), deadline), field(t("order.timeoutMinutes"), limit));
    this.place.replaceChildren(commandForm({ label: t("order.changeTitle", { name: this.name }), submit: t("order.save"), fields: [fields], send }));
    priority.focus();
  }
}

/** Repeats or withdraws the marked orders of the list, or sets the priority of those that wait. */
class SeveralOrders extends HTMLElement {
  /** Attach to the table in which orders are marked. */
  show(table) {
    this.table = table;
    this.count = element("strong");
    this.repeat = button(t("order.repeat"), () => this.#send("repeat", this.#marked(), ({ name }) => repeat(name, newKey())));
    this.withdraw = button(t("several.withdraw"), () => (this.sure.hidden = !this.sure.hidden));
    this.sure = button("", () => this.#send("withdraw", this.#marked().filter(({ final }) => !final), ({ name }) => withdraw(name)), { class: "danger", hidden: true });
    this.priority = numberInput({ name: "priority", value: 0, min: -1000, max: 1000, step: 1, "aria-label": t("form.priority") });
    this.prioritise = button(t("several.priority"), () => this.priority.reportValidity() && this.#send("priority", this.#waiting(), ({ name }) => this.#setPriority(name)));
    const clear = button(t("several.clear"), () => table.mark([...table.marked], false));
    this.bar = element("div", { class: "actions" }, this.count, this.repeat, this.withdraw, this.sure, this.priority, this.prioritise, clear);
    this.result = element("output", { class: "result", role: "status" });
    this.replaceChildren(this.bar, this.result);
    for (const name of ["marked", "count"]) table.addEventListener(name, () => this.#update());
    table.addEventListener("marked", () => this.result.replaceChildren());
    this.#update();
  }

  #marked() {
    return [...this.table.marked].map((id) => this.table.store.orders.get(id)).filter(Boolean);
  }

  #waiting() {
    return this.#marked().filter(({ state }) => WAITING.includes(state));
  }

  #setPriority(name) {
    return command(["transportOrders", name], { priority: numberOf(this.priority) ?? 0 }, "PATCH");
  }

  #update() {
    const orders = this.#marked();
    this.priority.hidden = this.prioritise.hidden = !this.#waiting().length;
    const open = orders.filter(({ final }) => !final).length;
    this.bar.hidden = !this.table.marked.size;
    this.withdraw.disabled = !open;
    if (!open) this.sure.hidden = true;
    setText(this.count, plural("several.orders", orders.length));
    setText(this.sure, plural("several.sure.withdraw", open));
  }

  async #send(kind, orders, send) {
    if (this.bar.getAttribute("aria-busy")) return;
    this.bar.setAttribute("aria-busy", "true");
    this.sure.hidden = true;
    const answers = await Promise.allSettled(orders.map(send));
    this.bar.removeAttribute("aria-busy");
    const failed = answers.flatMap(({ reason }, at) => (reason ? [[orders[at].name, reason.message]] : []));
    this.table.mark([...this.table.marked], false);
    this.result.dataset.level = failed.length ? "bad" : "fine";
    const done = t(`several.done.${kind}`, { count: number(orders.length - failed.length), of: number(orders.length) });
    const lines = failed.map(([name, why]) => element("li", {}, `${name}: `, why ? foreign("span", why) : t("command.unanswered")));
    this.result.replaceChildren(element("strong", {}, done), ...(lines.length ? [element("ul", {}, ...lines)] : []));
  }
}

customElements.define("nena-several-orders", SeveralOrders);
