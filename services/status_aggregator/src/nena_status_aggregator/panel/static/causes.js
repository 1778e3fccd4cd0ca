// "Why does it stand?": the chain of causes, from what is seen to what is behind it.

import { t } from "./catalogue.js";
import { shownState } from "./order_state.js";
import { address } from "./router.js";
import { adviceFor, reasonOf } from "./reasons.js";

const DEPTH = 6;
const CANDIDATES = 8;
const NEAR = 0.75; // m

/**
 * Give the causes for a robot, a list of `{text, advice, foreign, link}`: `foreign` holds words of another program, in
 * English; `link` leads to what it is about.
 */
export function causesOfRobot(robot, fleet) {
  return [...causesOfPicture(fleet), ...chain(robot, fleet, new Set())];
}

/** Give the causes for an order. */
export function causesOfOrder(order, fleet) {
  const causes = causesOfPicture(fleet);
  causes.push({ text: t(`why.order.${shownState(order)}`), foreign: order.reason });
  if (order.final) return causes;
  const name = order.processingVehicle ?? order.intendedVehicle;
  const robot = name && robotOfVehicle(name, fleet);
  if (robot) return [...causes, ...chain(robot, fleet, new Set(), t("why.vehicle", { name }))];
  if (name) return [...causes, { text: t("why.vehicleUnknown", { name }) }];
  return [...causes, ...candidates(fleet)];
}

// What we see may be old: then everything else may be wrong.
function causesOfPicture({ store, link }) {
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

// Who is where this robot has to go next, and why that one stands.
function causesOfWaiting(robot, fleet, seen) {
  if (robot.reasonCode !== "waiting_for_release") return [];
  const place = robot.reasonValues.next;
  const others = [...fleet.store.robots.values()].filter((other) => other.id !== robot.id);
  const there = others.find((other) => other.vehicle?.currentPosition === place || isNear(other, place, fleet.plant));
  if (there) return chain(there, fleet, seen, t("why.isAt", { name: there.name, place }));
  const coming = others.find((other) => aheadOf(other).some((node) => node.nodeId === place && node.released));
  if (coming) return chain(coming, fleet, seen, t("why.goesTo", { name: coming.name, place }));
  return [{ text: t("why.notReleased", { place }) }];
}

function isNear({ position }, place, plant) {
  const point = plant.model?.points.find((each) => each.name === place);
  return Boolean(point && position) && Math.hypot(position.x - point.xMm / 1000, position.y - point.yMm / 1000) < NEAR;
}

function aheadOf(robot) {
  return robot.order?.active ? robot.order.ahead : [];
}

// What the order service says of the vehicle; of the first robot of a chain only.
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

// Of an order that any vehicle may take: why each cannot.
function candidates({ store }) {
  const vehicles = [...store.robots.values()].filter((robot) => robot.vehicle);
  if (!vehicles.length) return [{ text: t("why.noVehicles") }];
  return vehicles.slice(0, CANDIDATES).map((robot) => ({
    text: `${robot.name} – ${t(`condition.${robot.condition}`)}: ${reasonOf(robot)}`,
    link: address("robots", robot.id),
  }));
}
