// The live tables of robots and transport orders.

import { element, foreign, progressBar, refill, setAttribute, setText, showProgress, verbatim } from "./dom.js";
import { conditionText, filterOf, isOfOrderService, orderOf, reasonOf, setBy, statusOfOrder, useOf } from "./explanations.js";
import { hasFailed, shownState, stopState } from "./fleet.js";
import { age, byName, dateAndTime, number, plural, t } from "./i18n.js";
import { LiveTable, cell, filterChip, matches } from "./live_table.js";
import { nameAndState } from "./peripherals.js";
import { address, lists } from "./router.js";

const LOW_BATTERY = 20;

// The default order: robots that need attention, waiting, busy or idle, disconnected.
const RANKS = ["ERROR BROKEN SILENT BLOCKED MANUAL", "WAITING", "BUSY CHARGING IDLE", "OFFLINE"].map((names) => names.split(" "));

const STANDING = 1; // the last of the ranks whose rows show since when

function rankOf({ urgent, condition }) {
  return urgent ? -1 : RANKS.findIndex((names) => names.includes(condition));
}

// Whether the search is exactly this name.
function isNamed(name) {
  return lists.get("q").trim().toLowerCase() === name.toLowerCase();
}

class RobotTable extends LiveTable {
  columns = ["robots.name", "robots.condition", "robots.battery", "robots.order", "robots.lastState", "robots.since", "robots.place", "robots.load"];
  extra = ["since", "place", "load"];
  empty = "robots.empty";
  sortKey = "robotSort";
  first = (a, b) => b.urgent - a.urgent;
  usual = (a, b) => rankOf(a) - rankOf(b) || byName(a.name, b.name) || byName(a.id, b.id);
  comparators = {
    name: (a, b) => byName(a.name, b.name),
    condition: (a, b) => byName(conditionText(a), conditionText(b)),
    battery: (a, b) => (a.battery?.charge ?? Infinity) - (b.battery?.charge ?? Infinity),
    order: (a, b) => byName(this.#orderName(a), this.#orderName(b)),
    lastState: (a, b) => Date.parse(b.lastState ?? 0) - Date.parse(a.lastState ?? 0),
    since: (a, b) => Date.parse(a.conditionSince) - Date.parse(b.conditionSince), // the longest first
    place: (a, b) => byName(placeOf(a) ?? "\uffff", placeOf(b) ?? "\uffff"),
    load: (a, b) => (b.loads?.length ?? 0) - (a.loads?.length ?? 0),
  };

  /** Show the robots of the store; `commanded`: whether they can be selected for a command. */
  show(store, commanded) {
    this.commanded = commanded;
    this.follow(store, "robots");
  }

  accept(robot) {
    const conditions = lists.get("condition").split(",").filter(Boolean);
    if (isNamed(robot.name)) return true; // regardless of its condition
    if (conditions.length && !conditions.includes(filterOf(robot))) return false;
    return matches(lists.get("q"), [robot.name, robot.id, robot.vehicle?.currentPosition, orderOf(robot, this.store.orders)?.name]);
  }

  #orderName(robot) {
    return orderOf(robot, this.store.orders)?.name ?? "\uffff"; // after all names
  }

  makeRow(id) {
    const name = verbatim("a", "", { class: "name", href: address("robots", id) });
    const box = this.makeBox(id);
    const parts = {
      name,
      box,
      model: verbatim("span", "", { class: "detail" }),
      chip: element("span", { class: "chip" }),
      use: element("span", { class: "use of-orders" }),
      waited: element("span", { class: "number" }),
      reason: element("span", { class: "reason" }),
      head: element("span", { class: "detail of-orders" }),
      marks: element("span", { class: "detail marks" }),
      battery: element("span", { class: "number" }),
      charging: element("span", { class: "detail" }),
      order: verbatim("a", "", { class: "order" }),
      progress: progressBar(),
      age: element("span", { class: "number" }),
      since: element("span", { class: "number" }),
      place: verbatim("a", ""),
      load: element("span", { class: "number" }),
    };
    const row = element(
      "tr",
      { "data-robot": id },
      cell("robots.name", parts.box, parts.name, parts.model),
      cell("robots.condition", element("div", { class: "line" }, parts.chip, parts.use, parts.waited, parts.head), element("div", { class: "line" }, parts.reason, parts.marks)),
      cell("robots.battery", parts.battery, parts.charging),
      cell("robots.order", parts.order, parts.progress.box),
      cell("robots.lastState", parts.age),
      cell("robots.since", parts.since),
      cell("robots.place", parts.place),
      cell("robots.load", parts.load),
    );
    const update = (robot, now) => {
      this.showMark(row, box, robot);
      updateRobotRow(parts, row, robot, now, this.store);
    };
    return { row, update };
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
  setText(parts.use, useOf(robot));
  setAttribute(parts.use, "title", setBy(robot.vehicle?.levelSet));
  setText(parts.waited, rankOf(robot) <= STANDING ? age((now - Date.parse(robot.conditionSince)) / 1000) : "");
  setText(parts.reason, reasonOf(robot));
  setAttribute(parts.reason, "title", reasonOf(robot)); // cut off in a narrow column
  parts.reason.classList.toggle("of-orders", isOfOrderService(robot));
  refill(parts.head, headOf(robot, store), headLink);
  setText(parts.marks, marks(robot).join(" · "));
  updateBattery(parts, robot.battery);
  updateOrder(parts, orderOf(robot, store.orders));
  const seconds = robot.lastState ? (now - Date.parse(robot.lastState)) / 1000 : null;
  setText(parts.age, seconds === null ? t("age.never") : age(seconds));
  parts.age.classList.toggle("bad", seconds === null || seconds > robot.silenceLimit);
  updateExtras(parts, robot, now);
}

function placeOf({ vehicle }) {
  return vehicle?.currentPosition ?? null;
}

function updateExtras(parts, robot, now) {
  const place = placeOf(robot);
  setText(parts.since, age((now - Date.parse(robot.conditionSince)) / 1000));
  setText(parts.place, place ?? t("none"));
  setAttribute(parts.place, "href", place && address("places", place));
  setText(parts.load, robot.loads ? number(robot.loads.length) : t("none"));
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
  setAttribute(parts.order, "href", order?.id && address("orders", order.id));
  for (const part of [parts.order, parts.progress.box]) part.classList.toggle("of-orders", Boolean(order?.id));
  showProgress(parts.progress, order);
}

// Text and address of the head of a robot's queue, or of the device that it waits for; only a text for a circle; else null.
function headOf({ reasonCode, reasonValues, vehicle }, store) {
  const device = reasonCode === "waits_peripheral" && store.peripherals.get(reasonValues.at);
  if (device) return { text: nameAndState(device), href: address("places", device.id) };
  const { head, circle } = vehicle?.wait ?? {};
  if (circle?.length) return { text: t("robots.circle", { names: circle.join(", ") }) };
  if (head && store.isLockedPath(head)) return { text: t("robots.headPath", { name: head }), href: address("places", head) };
  const robot = head && store.robotOfVehicle(head);
  if (!robot) return null;
  return { text: t("robots.head", { name: head, condition: conditionText(robot) }), href: address("robots", robot.id) };
}

function headLink(head) {
  if (!head) return [];
  return [head.href ? element("a", { href: head.href, title: head.text }, head.text) : element("strong", { title: head.text }, head.text)];
}

customElements.define("nena-robot-table", RobotTable);

class OrderTable extends LiveTable {
  columns = ["orders.name", "orders.state", "orders.vehicle", "orders.destinations", "orders.progress", "orders.type", "orders.priority", "orders.deadline"];
  extra = ["type", "priority", "deadline"];
  empty = "orders.empty";
  sortKey = "orderSort";
  first = () => 0;
  usual = (a, b) =>
    a.final - b.final ||
    Boolean(b.held) - Boolean(a.held) ||
    Date.parse(b.created) - Date.parse(a.created) ||
    byName(a.id, b.id);
  comparators = {
    name: (a, b) => byName(a.name, b.name),
    state: (a, b) => byName(t(`state.${shownState(a)}`), t(`state.${shownState(b)}`)),
    vehicle: (a, b) => byName(vehicle(a), vehicle(b)),
    progress: (a, b) => (a.progress ?? -1) - (b.progress ?? -1),
    type: (a, b) => byName(a.type, b.type),
    priority: (a, b) => b.priority - a.priority, // the highest first
    deadline: (a, b) => Date.parse(a.deadline ?? "9999") - Date.parse(b.deadline ?? "9999"),
  };

  /** Show the orders of the store, below chips that filter them by state; `commanded`: whether they can be selected for a command. */
  show(store, commanded) {
    this.commanded = commanded;
    this.follow(store, "orders");
    this.chips = Object.keys(SHOWN).map((name) => [name, filterChip("", () => lists.set({ state: lists.get("state") === name ? "" : name }))]);
    this.automatic = filterChip(t("filter.automatic"), () => lists.set({ automatic: lists.get("automatic") ? "" : "1" }));
    const label = { class: "filter", role: "group", "aria-label": t("filter.state") };
    this.prepend(element("div", label, ...this.chips.map(([, chip]) => chip), this.automatic));
    this.addEventListener("count", () => this.#count());
    this.#count();
  }

  accept(order) {
    const places = order.destinations.map((each) => each.place);
    if (isNamed(order.name)) return true;
    const state = lists.get("state");
    const chosen = Object.hasOwn(SHOWN, state) ? SHOWN[state] : () => true;
    return isListed(order) && chosen(order) && matches(lists.get("q"), [order.name, order.intendedVehicle, order.processingVehicle, order.type, ...places]);
  }

  #count() {
    const all = [...this.store.orders.values()];
    const orders = all.filter(isListed);
    this.automatic.show(t("filter.automatic"), all.some(({ automatic }) => automatic), Boolean(lists.get("automatic")));
    for (const [name, chip] of this.chips) {
      const count = orders.filter(SHOWN[name]).length;
      chip.show(t(`filter.${name}`, { count: number(count) }), count, lists.get("state") === name);
    }
  }

  makeRow(id) {
    const box = this.makeBox(id);
    const parts = {
      created: element("span", { class: "detail" }),
      chip: element("span", { class: "chip" }),
      doing: element("span", { class: "reason of-orders" }),
      reason: foreign("span", "", { class: "reason of-orders" }),
      unconfirmed: element("span", { class: "reason" }),
      vehicle: element("span", { class: "nowrap" }),
      destinations: verbatim("ol", "", { class: "destinations" }),
      progress: progressBar(),
      type: verbatim("span", ""),
      priority: element("span", { class: "number" }),
      deadline: element("time", { class: "number" }),
    };
    const row = element(
      "tr",
      { "data-order": id },
      cell("orders.name", box, verbatim("a", id, { class: "name", title: id, href: address("orders", id) }), parts.created),
      cell("orders.state", parts.chip, parts.doing, parts.reason, parts.unconfirmed),
      cell("orders.vehicle", parts.vehicle),
      cell("orders.destinations", parts.destinations),
      cell("orders.progress", parts.progress.box),
      cell("orders.type", parts.type),
      cell("orders.priority", parts.priority),
      cell("orders.deadline", parts.deadline),
    );
    const update = (order, now) => {
      this.showMark(row, box, order);
      updateOrderRow(parts, row, order, now, this.store);
    };
    return { row, update };
  }
}

// Each order is in one of them, so that their sum is the number of orders.
const SHOWN = {
  open: (order) => !order.final && shownState(order) !== "HELD",
  held: (order) => shownState(order) === "HELD",
  failed: hasFailed,
  withdrawn: (order) => ["WAS_WITHDRAWN", "GAVE_WAY"].includes(shownState(order)),
  finished: (order) => order.state === "FINISHED",
};

// Orders that the order service created to park or recharge robots are shown on request.
function isListed({ automatic }) {
  return !automatic || Boolean(lists.get("automatic"));
}

function updateOrderRow(parts, row, order, now, store) {
  row.classList.toggle("final", order.final);
  setText(parts.created, t("orders.created", { age: age((now - Date.parse(order.created)) / 1000) }));
  setText(parts.chip, t(`state.${shownState(order)}`));
  setAttribute(parts.chip, "data-state", shownState(order));
  const { text, foreign: words } = statusOfOrder(order, store);
  setText(parts.doing, order.confirmed ? text : "");
  setText(parts.reason, order.confirmed ? words : "");
  setText(parts.unconfirmed, order.confirmed ? "" : t("orders.unconfirmed"));
  setText(parts.vehicle, vehicle(order));
  setAttribute(parts.vehicle, "translate", order.processingVehicle ? "no" : null);
  updateDestinations(parts.destinations, order);
  showProgress(parts.progress, order);
  setText(parts.type, order.type);
  setText(parts.priority, number(order.priority));
  setText(parts.deadline, order.deadline ? dateAndTime(order.deadline) : t("none"));
  setAttribute(parts.deadline, "datetime", order.deadline);
}

function vehicle(order) {
  if (order.processingVehicle) return order.processingVehicle;
  return order.intendedVehicle ? t("orders.intended", { name: order.intendedVehicle }) : t("none");
}

function updateDestinations(list, order) {
  const items = order.destinations.map((each, at) => ({
    place: each.place,
    operation: each.operation,
    state: at === order.currentDestination && !order.final ? "CURRENT" : stopState(each, order),
  }));
  setAttribute(list, "title", order.destinations.map((each) => t("destination", each)).join(" → "));
  refill(list, items, () => items.map(({ place, operation, state }) => element("li", { "data-state": state, "aria-current": state === "CURRENT" && "step" }, place, element("span", {}, `: ${operation}`))));
}

customElements.define("nena-order-table", OrderTable);
