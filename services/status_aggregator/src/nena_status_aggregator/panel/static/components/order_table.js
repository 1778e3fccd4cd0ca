// The transport orders: state and reason, vehicle, destinations, progress; living ones first, then the latest.

import { t } from "../catalogue.js";
import { element, progressBar, setAttribute, setText } from "../dom.js";
import { age, byName, number } from "../format.js";
import { LiveTable, cell } from "./live_table.js";

class OrderTable extends LiveTable {
  columns = ["orders.name", "orders.state", "orders.vehicle", "orders.destinations", "orders.progress"];
  empty = "orders.empty";
  compare = (a, b) =>
    a.final - b.final || Date.parse(b.created) - Date.parse(a.created) || byName(a.id, b.id);

  show(store) {
    this.follow(store, "orders");
  }

  makeRow(id) {
    const parts = {
      created: element("span", { class: "detail" }),
      chip: element("span", { class: "chip" }),
      reason: element("span", { class: "reason" }),
      vehicle: element("span", { class: "nowrap" }),
      destinations: element("ol", { class: "destinations" }),
      progress: progressBar(),
    };
    const row = element(
      "tr",
      { "data-order": id },
      cell("orders.name", element("span", { class: "name", title: id }, id), parts.created),
      cell("orders.state", parts.chip, parts.reason),
      cell("orders.vehicle", parts.vehicle),
      cell("orders.destinations", parts.destinations),
      cell("orders.progress", parts.progress.box),
    );
    return { row, update: (order, now) => update(parts, row, order, now) };
  }
}

function update(parts, row, order, now) {
  row.classList.toggle("final", order.final);
  setText(parts.created, t("orders.created", { age: age((now - Date.parse(order.created)) / 1000) }));
  setText(parts.chip, t(`state.${order.state}`));
  setAttribute(parts.chip, "data-state", order.state);
  setText(parts.reason, order.confirmed ? order.reason : t("orders.unconfirmed"));
  setText(parts.vehicle, vehicle(order));
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
