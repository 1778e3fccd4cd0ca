// The transport orders: state and reason, vehicle, destinations, progress; living ones first, then the latest.

import { t } from "../catalogue.js";
import { element, foreign, progressBar, setAttribute, setText, verbatim } from "../dom.js";
import { age, byName, number } from "../format.js";
import { select } from "../forms/fields.js";
import { shownState } from "../order_state.js";
import { address } from "../router.js";
import { LiveTable, cell } from "./live_table.js";

class OrderTable extends LiveTable {
  columns = ["orders.name", "orders.state", "orders.vehicle", "orders.destinations", "orders.progress"];
  empty = "orders.empty";
  compare = (a, b) =>
    a.final - b.final || Date.parse(b.created) - Date.parse(a.created) || byName(a.id, b.id);

  show(store) {
    this.follow(store, "orders");
    this.filter = new OrderFilter(() => this.refresh());
    this.accept = (order) => this.filter.accepts(order);
    this.prepend(this.filter.element);
  }

  makeRow(id) {
    const parts = {
      created: element("span", { class: "detail" }),
      chip: element("span", { class: "chip" }),
      reason: foreign("span", "", { class: "reason" }),
      unconfirmed: element("span", { class: "reason" }),
      vehicle: element("span", { class: "nowrap" }),
      destinations: verbatim("ol", "", { class: "destinations" }),
      progress: progressBar(),
    };
    const row = element(
      "tr",
      { "data-order": id },
      cell("orders.name", verbatim("a", id, { class: "name", title: id, href: address("orders", id) }), parts.created),
      cell("orders.state", parts.chip, parts.reason, parts.unconfirmed),
      cell("orders.vehicle", parts.vehicle),
      cell("orders.destinations", parts.destinations),
      cell("orders.progress", parts.progress.box),
    );
    return { row, update: (order, now) => update(parts, row, order, now) };
  }
}

const SHOWN = {
  all: () => true,
  open: (order) => !order.final,
  held: (order) => shownState(order) === "HELD",
  finished: (order) => order.state === "FINISHED",
  failed: (order) => ["FAILED", "UNROUTABLE"].includes(order.state),
};

// Which orders are shown: by state, and by a word in name, vehicle or destination.
class OrderFilter {
  constructor(changed) {
    this.state = select(Object.keys(SHOWN).map((name) => [name, t(`filter.${name}`)]), { "aria-label": t("filter.state") });
    this.word = element("input", { type: "search", placeholder: t("filter.word"), "aria-label": t("filter.word") });
    this.element = element("div", { class: "filter" }, this.state, this.word);
    this.element.addEventListener("input", changed);
  }

  accepts(order) {
    const places = order.destinations.map((each) => each.place);
    const words = [order.name, order.intendedVehicle, order.processingVehicle, order.type, ...places];
    const wanted = this.word.value.trim().toLowerCase();
    return SHOWN[this.state.value](order) && words.some((each) => each?.toLowerCase().includes(wanted));
  }
}

function update(parts, row, order, now) {
  row.classList.toggle("final", order.final);
  setText(parts.created, t("orders.created", { age: age((now - Date.parse(order.created)) / 1000) }));
  setText(parts.chip, t(`state.${shownState(order)}`));
  setAttribute(parts.chip, "data-state", shownState(order));
  setText(parts.reason, order.confirmed ? order.reason : "");
  setText(parts.unconfirmed, order.confirmed ? "" : t("orders.unconfirmed"));
  setText(parts.vehicle, vehicle(order));
  setAttribute(parts.vehicle, "translate", order.processingVehicle ? "no" : null);
  updateDestinations(parts.destinations, order);
  parts.progress.box.hidden = order.progress === null;
  parts.progress.bar.value = order.progress ?? 0;
  setAttribute(parts.progress.bar, "aria-label", t("progress.label", { name: order.id }));
  setText(parts.progress.value, t("progress.value", { percent: number(order.progress ?? 0) }));
}

function vehicle(order) {
  if (order.processingVehicle) return order.processingVehicle;
  return order.intendedVehicle ? t("orders.intended", { name: order.intendedVehicle }) : t("none");
}

function updateDestinations(list, order) {
  const items = order.destinations.map((each, at) => ({
    text: t("destination", each),
    state: at === order.currentDestination && !order.final ? "CURRENT" : each.state,
  }));
  const shown = JSON.stringify(items);
  if (list.shown === shown) return;
  list.shown = shown;
  list.replaceChildren(
    ...items.map((item) =>
      element("li", { "data-state": item.state, "aria-current": item.state === "CURRENT" && "step" }, item.text),
    ),
  );
}

customElements.define("nena-order-table", OrderTable);
