// Why a robot or an order is not moving: reasons, advice and the chain of causes.

import { element, foreign, refill } from "./dom.js";
import { jobOf, shownState } from "./fleet.js";
import { chosenLanguage, has, number, t, timeOfDay } from "./i18n.js";
import { nameAndState } from "./peripherals.js";
import { nameOfHolder, worded } from "./reasons.js";
import { address } from "./router.js";

const SINCE = {
  offline: "connectionSince",
  hibernating: "connectionSince",
  broken: "connectionSince",
  silent: "lastState",
  blind: "lastState",
};

const COORDINATE_NODE = /^(goal|start):/; // the order service's nodes at a coordinate instead of a point
const EVASION = "evasion-"; // its orders that move a robot out of the way

/** Return the name of a node; for a node at a coordinate, the coordinate. */
export function nodeName(robot, nodeId) {
  if (!COORDINATE_NODE.test(nodeId)) return nodeId;
  const node = robot.order?.ahead.find((each) => each.nodeId === nodeId);
  if (node === undefined || node.x === null) return t("dispatch.coordinate");
  return t("map.position", { x: number(node.x, 2), y: number(node.y, 2) });
}

/**
 * Return a robot's order, `{name, progress, id}`: the transport order to which it is assigned (`id`: its id), also between
 * two destinations; else its active VDA 5050 order; null if it has none.
 */
export function orderOf({ order, vehicle }, orders) {
  const progress = order?.active ? order.progress : null;
  const id = vehicle?.transportOrder;
  if (id) return { name: id, progress: orders.get(id)?.progress ?? progress, id };
  if (!order?.active) return null;
  return { name: nameOf(order.orderId), progress, id: null };
}

/** Return the name of a VDA 5050 order; for one that moves a robot out of the way, its purpose. */
export function nameOf(orderId) {
  return orderId.startsWith(EVASION) ? t("orders.evasion") : orderId;
}

/** Return the condition of a robot in one or two words; for an urgent one, what is wrong. */
export function conditionText(robot) {
  return t(robot.urgent ? `urgent.${robot.reasonCode}` : `condition.${robot.condition}`);
}

/** Return how a robot is used by the order service, in two or three words; empty for one that gets orders. */
export function useOf({ vehicle }) {
  const level = vehicle?.integrationLevel ?? "TO_BE_UTILIZED";
  return level === "TO_BE_UTILIZED" ? "" : t(`integration.${level}`).split(/[:,]/)[0];
}

/** Return who has locked or set something, and since when; empty if nobody is known. */
export function setBy(setter) {
  return setter ? t("order.heldBy", { by: nameOfHolder(setter.by), time: timeOfDay(setter.since) }) : "";
}

/** Return the name under which a robot is counted and filtered: its condition, URGENT, or OUT if it is idle because it is out of use. */
export function filterOf(robot) {
  if (robot.condition === "IDLE" && useOf(robot)) return "OUT";
  return robot.urgent ? "URGENT" : robot.condition;
}

const OF_ORDER_SERVICE = ["idle_why", "unheard_why", "taken_out", "waits_passing", "waits_standing", "waits_turn", "waits_locked", "waits_peripheral", "waits_other"];

/** Return whether the reason for a robot's condition comes from the order service. */
export function isOfOrderService(robot) {
  return OF_ORDER_SERVICE.includes(robot.reasonCode);
}

// Texts without the order service's English reason, by reason code.
const WITHOUT_WORDS = { idle_why: "reason.idle", unheard_why: "reason.unheard", taken_out: "reason.taken_out.plain", waits_other: "reason.waits_with_order" };

/** Return the reason for a robot's condition. */
export function reasonOf(robot) {
  const { reasonCode: code, reasonValues: values } = robot;
  if (code in WITHOUT_WORDS) {
    const { text: why } = worded(robot);
    if (why) return t(`reason.${code}`, { ...values, why });
    if (chosenLanguage() !== "en") return t(WITHOUT_WORDS[code], values);
  }
  if (code === "emergency_stop") return t(`reason.emergency_stop.${values.how === "remotely" ? "remote" : "manual"}`);
  if (!has(`reason.${code}`)) return robot.reason;
  const filled = { ...values };
  if (code === "error") filled.type = errorText(values.type);
  if (code === "mode") filled.mode = t(`mode.${values.mode}`);
  if (SINCE[code] && robot[SINCE[code]]) filled.since = timeOfDay(robot[SINCE[code]]);
  for (const key of ["place", "next", "at"]) if (key in filled) filled[key] = nodeName(robot, filled[key]);
  for (const key of ["limit", "charge"]) if (key in filled) filled[key] = number(filled[key]);
  return t(`reason.${code}`, filled);
}

/** Return what to do about it; empty if nothing is needed. */
export function adviceFor(robot) {
  const key = `advice.${robot.reasonCode}`;
  return has(key) ? t(key) : "";
}

// 2.x: nodeUnreachable
const typeOf = (errorType) => errorType.replace(/([a-z])([A-Z])/g, "$1_$2").toUpperCase();

/** Return what to do about an error, by its type; empty for other types. */
export function adviceForError({ errorType }) {
  const key = `errorAdvice.${typeOf(errorType)}`;
  return has(key) ? t(key) : "";
}

/** Return the type of an error in words; of other types, the name. */
export function errorText(errorType) {
  const key = `errorType.${typeOf(errorType)}`;
  return has(key) ? t(key) : errorType;
}

const DEPTH = 6;
const CANDIDATES = 8;
const NEAR = 0.75; // m
const STANDING = new Set(["OFFLINE", "BROKEN", "SILENT", "MANUAL", "ERROR", "BLOCKED"]); // with an order, which waits for a person

/**
 * Return the causes for a robot, a list of `{text, advice, reason, foreign, link}`: `reason` is the order service's reason,
 * `foreign` an English text of another program, `link` the address of the robot or order concerned.
 */
export function causesOfRobot(robot, fleet) {
  return [...causesOfStaleData(fleet), ...chain(robot, fleet, new Set())];
}

/**
 * Return what an order does or waits for, `{text, foreign}`: `foreign` is the English reason of an order service without
 * codes. In other languages it is left out where the order's robot or destination says the same.
 */
export function statusOfOrder(order, store) {
  const reason = worded(order);
  if (reason.text || chosenLanguage() === "en") return reason;
  if (order.held && !order.final) return { text: t("order.heldBy", { by: order.held.by, time: timeOfDay(order.held.since) }), foreign: order.held.reason };
  if (order.final) return { text: "", foreign: order.state === "FINISHED" ? "" : order.reason };
  const robot = order.processingVehicle && store.robotOfVehicle(order.processingVehicle);
  if (robot && (saysThatItWaits(robot) || STANDING.has(robot.condition))) return { text: reasonOf(robot), foreign: "" };
  const current = order.destinations[order.currentDestination];
  if (order.state === "BEING_PROCESSED" && current) return { text: `${t("destination", current)} (${t(`drive.${current.state}`)})`, foreign: "" };
  return { text: t(`why.order.${order.state}`), foreign: order.reason };
}

/** Return the causes for an order's status. */
export function causesOfOrder(order, fleet) {
  const causes = causesOfStaleData(fleet);
  causes.push(...quoted(t(`why.order.${shownState(order)}`), order));
  if (order.final) return causes;
  const name = order.processingVehicle ?? order.intendedVehicle;
  const robot = name && fleet.store.robotOfVehicle(name);
  if (robot) return [...causes, ...chain(robot, fleet, new Set(), t("why.vehicle", { name }))];
  if (name) return [...causes, { text: t("why.vehicleUnknown", { name }) }];
  return [...causes, ...candidates(fleet)];
}

// If the data may be out of date, everything else may be wrong.
function causesOfStaleData({ store, link }) {
  if (!link.connected) return [{ text: t("why.stale"), advice: t("why.stale.advice") }];
  if (!store.link.connected) return [{ text: t("why.blind"), advice: t("why.blind.advice") }];
  if (store.orderService.up === false) return [{ text: t("why.orderService"), advice: t("why.orderService.advice") }];
  return [];
}

function chain(robot, fleet, seen, lead = "") {
  if (seen.has(robot.id) || seen.size >= DEPTH) return [];
  seen.add(robot.id);
  const reason = robot.reasonCode === "idle_why" ? t("reason.idle") : reasonOf(robot); // its text is quoted anyway
  const text = [lead, conditionAnd(robot, reason)].filter(Boolean).join(" ");
  const own = { text, advice: adviceFor(robot), link: lead ? address("robots", robot.id) : null };
  return [own, ...causesOfWaiting(robot, fleet, seen), ...causesOfFleet(robot, fleet, lead)];
}

// The condition of a robot and the reason; for a robot that waits for others only the reason, which includes it.
function conditionAnd(robot, reason) {
  return saysThatItWaits(robot) ? reason : `${conditionText(robot)}: ${reason}`;
}

function saysThatItWaits(robot) {
  return robot.reasonCode.startsWith("waits") || robot.reasonCode === "waiting_for_release";
}

// The queue up to its head, or the device; without data from the order service, the robot that occupies the next node.
function causesOfWaiting(robot, fleet, seen) {
  if (robot.vehicle?.wait?.next) return causesOfQueue(robot, fleet);
  if (robot.reasonCode === "waits_peripheral") return causesOfDevice(robot.reasonValues.at, fleet.store);
  if (robot.reasonCode !== "waiting_for_release") return [];
  const place = robot.reasonValues.next;
  const others = [...fleet.store.robots.values()].filter((other) => other.id !== robot.id);
  const there = others.find((other) => other.vehicle?.currentPosition === place || isNear(other, place, fleet.plant));
  if (there) return chain(there, fleet, seen, t("why.isAt", { name: there.name, place }));
  const coming = others.find((other) => aheadOf(other).some((node) => node.nodeId === place && node.released));
  if (coming) return chain(coming, fleet, seen, t("why.goesTo", { name: coming.name, place }));
  return [{ text: t("why.notReleased", { place: nodeName(robot, place) }) }];
}

function causesOfDevice(location, store) {
  const device = store.peripherals.get(location);
  if (!device) return [];
  return quoted(nameAndState(device), jobOf(device), address("places", location));
}

function causesOfQueue(robot, fleet) {
  const { circle } = robot.vehicle.wait;
  const names = queueOf(robot, fleet.store);
  const near = names.slice(0, DEPTH);
  const causes = near.map((name) => causeOfVehicle(name, fleet.store));
  if (names.length > DEPTH + 1) causes.push({ text: t("why.more", { count: names.length - DEPTH - 1 }) });
  if (names.length > DEPTH) causes.push(causeOfVehicle(names.at(-1), fleet.store));
  if (circle.length) causes.push({ text: t("why.circle", { names: circle.join(", ") }), advice: t("why.circle.advice") });
  return causes;
}

// The names of the vehicles before a robot, up to the head, or once around a circle.
function queueOf(robot, store) {
  const names = [];
  for (let next = robot.vehicle.wait.next; next && next !== robot.vehicle.name && !names.includes(next); ) {
    names.push(next);
    next = store.robotOfVehicle(next)?.vehicle.wait?.next;
  }
  return names;
}

function causeOfVehicle(name, store) {
  if (store.isLockedPath(name)) return { text: t("robots.headPath", { name }), advice: t("queue.unlock"), link: address("places", name) };
  const robot = store.robotOfVehicle(name);
  if (!robot) return { text: t("why.vehicleUnknown", { name }) };
  const reason = reasonOf(robot);
  const text = saysThatItWaits(robot) ? `${name}: ${reason}` : t("why.queue", { name, condition: conditionText(robot), reason });
  return { text, advice: adviceFor(robot), link: address("robots", robot.id) };
}

function isNear({ position }, place, plant) {
  const point = plant.model?.points.find((each) => each.name === place);
  return Boolean(point && position) && Math.hypot(position.x - point.xMm / 1000, position.y - point.yMm / 1000) < NEAR;
}

function aheadOf(robot) {
  return robot.order?.active ? robot.order.ahead : [];
}

// The order service's reason, for the first robot of a chain only.
function causesOfFleet(robot, { store }, lead) {
  if (lead) return [];
  if (!robot.vehicle) return [{ text: t("why.noVehicle"), advice: t("why.noVehicle.advice") }];
  const order = store.orders.get(robot.vehicle.transportOrder);
  if (!order) return quoted(t("why.fleet"), robot.vehicle);
  const values = { name: order.name, state: t(`state.${shownState(order)}`) };
  return quoted(t("why.hasOrder", values), order, address("orders", order.id));
}

// A cause with a reason of the order service.
function quoted(text, explained, link = null) {
  const { text: reason, foreign: words } = worded(explained ?? {});
  return [{ text, reason, foreign: words, link }];
}

// For an order without a vehicle: why each vehicle cannot execute it.
function candidates({ store }) {
  const vehicles = [...store.robots.values()].filter((robot) => robot.vehicle);
  if (!vehicles.length) return [{ text: t("why.noVehicles") }];
  return vehicles.slice(0, CANDIDATES).map((robot) => ({
    text: `${robot.name} – ${conditionAnd(robot, reasonOf(robot))}`,
    link: address("robots", robot.id),
  }));
}

/** Shows a list of causes. */
class WhyList extends HTMLElement {
  show(causes) {
    refill(this, causes, () => [element("ol", { class: "causes" }, ...causes.map(item))]);
  }
}

function item({ text, advice, reason, foreign: words, link }) {
  const said = link ? element("a", { href: link }, text) : text;
  const made = element("li", {}, said);
  if (reason) made.append(" ", element("q", {}, reason));
  if (words) made.append(" ", foreign("q", words));
  if (advice) made.append(element("p", { class: "advice" }, advice));
  return made;
}

customElements.define("nena-why-list", WhyList);
