// The live tables of robots and transport orders.

import { element, emptyBox, foreign, progressBar, refill, select, setAttribute, setText, verbatim } from "./dom.js";
import { conditionText, isOfOrderService, orderOf, reasonOf } from "./explanations.js";
import { shownState } from "./fleet.js";
import { age, byName, number, plural, t } from "./i18n.js";
import { address } from "./router.js";

const TICK = 1000;

/**
 * A table of the views of one kind. Subclasses define `columns` (text keys), `empty` (text key), `compare` and
 * `makeRow(id)`, which returns `{row, update(view, now)}`; and `accept(view)` to filter.
 */
export class LiveTable extends HTMLElement {
  #rows = new Map();
  /** Returns whether a view is shown. */
  accept = () => true;

  /** Show the views of `kind` in the store, and follow their changes. */
  follow(store, kind) {
    this.store = store;
    this.views = () => store[kind];
    this.body = element("tbody");
    this.table = element("table", {}, this.#head(), this.body);
    this.note = emptyBox(t(`${this.empty}.title`), t(`${this.empty}.text`));
    this.replaceChildren(this.table, this.note);
    store.addEventListener("change", (event) => this.#change(event.detail[kind]));
    setInterval(() => this.refresh(), TICK);
    this.#change(new Set());
  }

  /** Return the row of a view. */
  rowOf(id) {
    return this.#rows.get(id)?.row;
  }

  /** Apply the filter and update all rows. */
  refresh() {
    this.#updateRows(this.views().keys());
  }

  #head() {
    const cells = this.columns.map((key) => element("th", { scope: "col" }, t(key)));
    return element("thead", {}, element("tr", {}, ...cells));
  }

  #change(ids) {
    const views = this.views();
    for (const id of ids) {
      if (!views.has(id)) {
        this.#rows.get(id)?.row.remove();
        this.#rows.delete(id);
      } else if (!this.#rows.has(id)) {
        this.#rows.set(id, this.makeRow(id));
      }
    }
    this.#updateRows([...ids].filter((id) => views.has(id)));
    this.#order();
    this.table.hidden = views.size === 0;
    this.note.hidden = views.size > 0;
  }

  #updateRows(ids) {
    const now = this.store.now();
    for (const id of ids) {
      const shown = this.#rows.get(id);
      if (!shown) continue;
      shown.row.hidden = !this.accept(this.views().get(id));
      shown.update(this.views().get(id), now);
    }
  }

  #order() {
    const wanted = [...this.views().values()].sort(this.compare).map((view) => this.#rows.get(view.id).row);
    wanted.forEach((row, at) => {
      if (this.body.children[at] !== row) this.body.insertBefore(row, this.body.children[at] ?? null);
    });
  }
}

/** Create a cell with its column's title, for narrow screens. */
export function cell(key, ...children) {
  return element("td", { "data-title": t(key) }, ...children);
}

const LOW_BATTERY = 20;

class RobotTable extends LiveTable {
  columns = ["robots.name", "robots.condition", "robots.battery", "robots.order", "robots.age"];
  empty = "robots.empty";
  compare = (a, b) => b.urgent - a.urgent || byName(a.name, b.name) || byName(a.id, b.id);

  show(store) {
    this.follow(store, "robots");
  }

  /** Highlight a robot; null: none. */
  select(id) {
    this.rowOf(this.selected)?.classList.remove("selected");
    this.selected = id;
    this.rowOf(id)?.classList.add("selected");
  }

  /** Scroll to the row of a robot. */
  reveal(id) {
    this.rowOf(id)?.scrollIntoView({ block: "nearest" });
  }

  makeRow(id) {
    const name = verbatim("a", "", { class: "name", href: address("robots", id) });
    const parts = {
      name,
      model: verbatim("span", "", { class: "detail" }),
      chip: element("span", { class: "chip" }),
      reason: element("span", { class: "reason" }),
      head: element("span", { class: "detail of-orders" }),
      marks: element("span", { class: "detail marks" }),
      battery: element("span", { class: "number" }),
      charging: element("span", { class: "detail" }),
      order: verbatim("span", "", { class: "order" }),
      progress: progressBar(),
      age: element("span", { class: "number" }),
    };
    const row = element(
      "tr",
      { "data-robot": id },
      cell("robots.name", parts.name, parts.model),
      cell("robots.condition", parts.chip, parts.reason, parts.head, parts.marks),
      cell("robots.battery", parts.battery, parts.charging),
      cell("robots.order", parts.order, parts.progress.box),
      cell("robots.age", parts.age),
    );
    return { row, update: (robot, now) => updateRobotRow(parts, row, robot, now, this.store) };
  }
}

function updateRobotRow(parts, row, robot, now, store) {
  setAttribute(row, "data-condition", robot.condition);
  setAttribute(row, "data-urgent", robot.urgent && "");
  setText(parts.name, robot.name);
  setAttribute(parts.name, "title", robot.name);
  setText(parts.model, robot.name === robot.serialNumber ? robot.manufacturer : robot.id);
  setText(parts.chip, conditionText(robot));
  setAttribute(parts.chip, "data-condition", robot.condition);
  setAttribute(parts.chip, "data-urgent", robot.urgent && "");
  setText(parts.reason, reasonOf(robot));
  parts.reason.classList.toggle("of-orders", isOfOrderService(robot));
  refill(parts.head, headOf(robot, store), headLink);
  setText(parts.marks, marks(robot).join(" · "));
  updateBattery(parts, robot.battery);
  updateOrder(parts, orderOf(robot, store.orders));
  const seconds = robot.lastState ? (now - Date.parse(robot.lastState)) / 1000 : null;
  setText(parts.age, seconds === null ? t("age.never") : age(seconds));
  parts.age.classList.toggle("bad", seconds === null || seconds > robot.silenceLimit);
}

function marks(robot) {
  const warnings = robot.errors.filter((each) => ["WARNING", "URGENT"].includes(each.errorLevel)).length;
  const errors = robot.errors.length - warnings;
  return [
    errors > 1 && plural("robots.errors", errors),
    warnings && plural("robots.warnings", warnings),
    robot.loads?.length && plural("robots.loads", robot.loads.length),
    robot.clockSkew !== null && t("robots.skew", { seconds: number(robot.clockSkew) }),
    robot.malformed && plural("robots.unreadable", robot.malformed),
    robot.deviations.length && t("robots.deviates"),
  ].filter(Boolean);
}

function updateBattery(parts, battery) {
  setText(parts.battery, battery ? t("battery.charge", { charge: number(battery.charge) }) : t("none"));
  parts.battery.classList.toggle("bad", Boolean(battery) && battery.charge < LOW_BATTERY);
  setText(parts.charging, battery?.charging ? t("battery.charging") : "");
}

function updateOrder(parts, order) {
  setText(parts.order, order?.name ?? t("none"));
  setAttribute(parts.order, "title", order?.name);
  for (const part of [parts.order, parts.progress.box]) part.classList.toggle("of-orders", Boolean(order?.id));
  const progress = order?.progress ?? null;
  parts.progress.box.hidden = progress === null;
  if (progress === null) return;
  parts.progress.bar.value = progress;
  setAttribute(parts.progress.bar, "aria-label", t("progress.label", { name: order.name }));
  setText(parts.progress.value, t("progress.value", { percent: number(progress) }));
}

// The head of the queue in which a robot waits: text and address; only a text in a circle; null if it waits for no robot.
function headOf({ vehicle }, store) {
  const { head, circle } = vehicle?.wait ?? {};
  if (circle?.length) return { text: t("robots.circle", { names: circle.join(", ") }) };
  const robot = head && store.robotOfVehicle(head);
  if (!robot) return null;
  return { text: t("robots.head", { name: head, condition: conditionText(robot) }), href: address("robots", robot.id) };
}

function headLink(head) {
  if (!head) return [];
  return [head.href ? element("a", { href: head.href }, head.text) : element("strong", {}, head.text)];
}

customElements.define("nena-robot-table", RobotTable);

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
      reason: foreign("span", "", { class: "reason of-orders" }),
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
    return { row, update: (order, now) => updateOrderRow(parts, row, order, now) };
  }
}

const SHOWN = {
  all: () => true,
  open: (order) => !order.final,
  held: (order) => shownState(order) === "HELD",
  finished: (order) => order.state === "FINISHED",
  failed: (order) => ["FAILED", "UNROUTABLE"].includes(order.state),
};

// Filters orders by state, and by a word in name, vehicle or destination.
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

function updateOrderRow(parts, row, order, now) {
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
