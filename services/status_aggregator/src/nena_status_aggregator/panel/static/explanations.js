// Why a robot or an order is not moving: reasons, advice and the chain of causes.

import { element, foreign, refill } from "./dom.js";
import { shownState } from "./fleet.js";
import { chosenLanguage, has, number, t, timeOfDay } from "./i18n.js";
import { address } from "./router.js";

const SINCE = {
  offline: "connectionSince",
  hibernating: "connectionSince",
  broken: "connectionSince",
  silent: "lastState",
  blind: "lastState",
};

const COORDINATE_NODE = /^(goal|start):/; // the order service's nodes at a coordinate instead of a point
const EVASION = "evasion-"; // its orders that make a robot clear a route

/** Return the name of a node; a node at a coordinate is named by that. */
export function nodeName(robot, nodeId) {
  if (!COORDINATE_NODE.test(nodeId)) return nodeId;
  const node = robot.order?.ahead.find((each) => each.nodeId === nodeId);
  if (node === undefined || node.x === null) return t("dispatch.coordinate");
  return t("map.position", { x: number(node.x, 2), y: number(node.y, 2) });
}

/** Return the name of a robot's order: of the transport order, else of the VDA 5050 order. */
export function orderName({ order, vehicle }) {
  if (vehicle?.transportOrder) return vehicle.transportOrder;
  return order.orderId.startsWith(EVASION) ? t("orders.evasion") : order.orderId;
}

/** Return why a robot is in its condition. */
export function reasonOf(robot) {
  const { reasonCode: code, reasonValues: values } = robot;
  if (code === "idle_why" && chosenLanguage() !== "en") return t("reason.idle");
  if (code === "emergency_stop") return t(`reason.emergency_stop.${values.how === "remotely" ? "remote" : "manual"}`);
  if (!has(`reason.${code}`)) return robot.reason;
  const filled = { ...values };
  if (code === "mode") filled.mode = t(`mode.${values.mode}`);
  if (SINCE[code] && robot[SINCE[code]]) filled.since = timeOfDay(robot[SINCE[code]]);
  for (const key of ["place", "next"]) if (key in filled) filled[key] = nodeName(robot, filled[key]);
  for (const key of ["limit", "charge"]) if (key in filled) filled[key] = number(filled[key]);
  return t(`reason.${code}`, filled);
}

/** Return what to do about it; empty if nothing is needed. */
export function adviceFor(robot) {
  const key = `advice.${robot.reasonCode}`;
  return has(key) ? t(key) : "";
}

/** Return what to do about an error, by its type (2.x: nodeUnreachable); empty if only its own text helps. */
export function adviceForError(error) {
  const key = `errorAdvice.${error.errorType.replace(/([a-z])([A-Z])/g, "$1_$2").toUpperCase()}`;
  return has(key) ? t(key) : "";
}

const DEPTH = 6;
const CANDIDATES = 8;
const NEAR = 0.75; // m

/**
 * Return the causes for a robot, a list of `{text, advice, foreign, link}`: `foreign` holds the English words of another
 * program, `link` the address of the robot or order concerned.
 */
export function causesOfRobot(robot, fleet) {
  return [...causesOfStaleData(fleet), ...chain(robot, fleet, new Set())];
}

/** Return the causes for an order. */
export function causesOfOrder(order, fleet) {
  const causes = causesOfStaleData(fleet);
  causes.push({ text: t(`why.order.${shownState(order)}`), foreign: order.reason });
  if (order.final) return causes;
  const name = order.processingVehicle ?? order.intendedVehicle;
  const robot = name && robotOfVehicle(name, fleet);
  if (robot) return [...causes, ...chain(robot, fleet, new Set(), t("why.vehicle", { name }))];
  if (name) return [...causes, { text: t("why.vehicleUnknown", { name }) }];
  return [...causes, ...candidates(fleet)];
}

// Data may be out of date; then everything else may be wrong.
function causesOfStaleData({ store, link }) {
  if (!link.connected) return [{ text: t("why.stale"), advice: t("why.stale.advice") }];
  if (!store.link.connected) return [{ text: t("why.blind"), advice: t("why.blind.advice") }];
  return [];
}

function chain(robot, fleet, seen, lead = "") {
  if (seen.has(robot.id) || seen.size >= DEPTH) return [];
  seen.add(robot.id);
  const reason = robot.reasonCode === "idle_why" ? t("reason.idle") : reasonOf(robot); // its words are quoted anyway
  const text = `${lead}${lead && " "}${t(`condition.${robot.condition}`)}: ${reason}`;
  const own = { text, advice: adviceFor(robot), link: lead ? address("robots", robot.id) : null };
  return [own, ...causesOfWaiting(robot, fleet, seen), ...causesOfFleet(robot, fleet, lead)];
}

// The robot that occupies the next node, and why it is not moving.
function causesOfWaiting(robot, fleet, seen) {
  if (robot.reasonCode !== "waiting_for_release") return [];
  const place = robot.reasonValues.next;
  const others = [...fleet.store.robots.values()].filter((other) => other.id !== robot.id);
  const there = others.find((other) => other.vehicle?.currentPosition === place || isNear(other, place, fleet.plant));
  if (there) return chain(there, fleet, seen, t("why.isAt", { name: there.name, place }));
  const coming = others.find((other) => aheadOf(other).some((node) => node.nodeId === place && node.released));
  if (coming) return chain(coming, fleet, seen, t("why.goesTo", { name: coming.name, place }));
  return [{ text: t("why.notReleased", { place: nodeName(robot, place) }) }];
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
  if (!order) return [{ text: t("why.fleet"), foreign: robot.vehicle.reason }];
  const values = { name: order.name, state: t(`state.${shownState(order)}`) };
  return [{ text: t("why.hasOrder", values), foreign: order.reason, link: address("orders", order.id) }];
}

function robotOfVehicle(name, { store }) {
  return [...store.robots.values()].find((robot) => robot.vehicle?.name === name);
}

// For an order without a vehicle: why each vehicle cannot take it.
function candidates({ store }) {
  const vehicles = [...store.robots.values()].filter((robot) => robot.vehicle);
  if (!vehicles.length) return [{ text: t("why.noVehicles") }];
  return vehicles.slice(0, CANDIDATES).map((robot) => ({
    text: `${robot.name} – ${t(`condition.${robot.condition}`)}: ${reasonOf(robot)}`,
    link: address("robots", robot.id),
  }));
}

/** Shows a list of causes. */
class WhyList extends HTMLElement {
  show(causes) {
    refill(this, causes, () => [element("ol", { class: "causes" }, ...causes.map(item))]);
  }
}

function item({ text, advice, foreign: words, link }) {
  const said = link ? element("a", { href: link }, text) : text;
  const made = element("li", {}, said);
  if (words) made.append(" ", foreign("q", words));
  if (advice) made.append(element("p", { class: "advice" }, advice));
  return made;
}

customElements.define("nena-why-list", WhyList);
