// Creates a transport order from the plant's points, locations and operations.

import { t } from "../catalogue.js";
import { command, newKey } from "../commands.js";
import { button, element } from "../dom.js";
import { byName } from "../format.js";
import { commandForm } from "../forms/command_form.js";
import { field, numberInput, numberOf, select } from "../forms/fields.js";
import { PlaceFields } from "../forms/place_fields.js";
import { address } from "../router.js";

class OrderForm extends HTMLElement {
  #stops = [];

  /** Prepare; `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
    fleet.plant.addEventListener("change", () => !this.hidden && this.open("new"));
  }

  /** Begin a new order; null: none. */
  open(begin) {
    if (begin === null) return this.replaceChildren();
    this.key = newKey();
    this.#stops = [];
    this.list = element("ol", { class: "stops" });
    const heading = element("h2", { tabindex: -1 }, t("orderForm.title"));
    const head = element("header", { class: "head" }, element("a", { href: "#/", class: "back" }, t("page.back")), heading);
    const ready = !this.fleet.noCommands && this.fleet.plant.model;
    const missing = t(this.fleet.noCommands ?? "map.empty.title");
    this.replaceChildren(head, ready ? this.#form() : element("p", { class: "hint" }, missing));
    if (ready) this.#addStop();
    heading.focus({ preventScroll: true });
  }

  #form() {
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
      fields: [this.list, button(t("orderForm.addStop"), () => this.#addStop()), more],
      send: () => this.#send(),
    });
  }

  #addStop() {
    const stop = new PlaceFields(this.fleet.plant);
    const remove = button(t("orderForm.removeStop"), () => {
      if (this.#stops.length === 1) return; // an order has at least one
      this.#stops = this.#stops.filter((each) => each !== stop);
      row.remove();
    });
    const row = element("li", {}, stop.element, remove);
    this.#stops.push(stop);
    this.list.append(row);
    stop.place.focus();
  }

  async #send() {
    const deadline = this.deadline.value && new Date(this.deadline.value).toISOString();
    const wishes = { intendedVehicle: this.vehicle.value, deadline, name: this.name.value.trim() };
    const order = await command(["transportOrders"], {
      destinations: this.#stops.map((each) => each.destination),
      priority: numberOf(this.priority) ?? 0,
      idempotencyKey: this.key,
      ...Object.fromEntries(Object.entries(wishes).filter(([, value]) => value)),
    });
    location.hash = address("orders", order.name);
    return ["command.orderCreated", { name: order.name }];
  }
}

function vehicles({ store, plant }) {
  const known = [...store.robots.values()].map((robot) => robot.vehicle?.name).filter(Boolean);
  const names = new Set([...(plant.model?.vehicles ?? []).map((each) => each.name), ...known]);
  return [...names].sort(byName).map((name) => [name, name, true]);
}

customElements.define("nena-order-form", OrderForm);
