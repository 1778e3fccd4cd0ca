// Paints robots: footprint, heading, planned route and goal. Sizes are in metres.

import { useOf } from "../explanations.js";
import { number, t } from "../i18n.js";
import { badgeOf, BADGE, loadBadge } from "./badges.js";
import { Labels } from "./labels.js";
import { trace } from "./lines.js";

const ABSENT = ["SILENT", "BROKEN", "OFFLINE"];
const ROBOT = { length: 0.9, width: 0.6 };
const LEAST_ROBOT = 16;
const RING = 7;
const HALO = 5;
const LOW_BATTERY = 20; // percent, as in the list
const BODY = 0.75; // approximate share of its circumscribed square that a footprint fills

/** Place the names of robots, `[{robot, at}]`, off all robots and if possible off other labels. Urgent ones come first. */
export function labelRobots(context, view, places, { layers, selected, jams }, others) {
  const bodies = layers.robots ? places.map(({ robot, at: [x, y] }) => boxAround(x, y, isMarked(robot, jams) ? reachOf(view, robot, jams) : BODY * radiusOf(view, robot))) : [];
  const labels = new Labels(context, view.width, bodies);
  if (!layers.robots || !layers.robotNames) return labels;
  const rank = ({ robot }) => [robot.id === selected, robot.urgent, jams.has(robot.vehicle?.name), true].indexOf(true);
  for (const { robot, at } of [...places].sort((a, b) => rank(a) - rank(b))) {
    const distance = reachOf(view, robot, jams) + (robot.id === selected ? HALO : 0) + 10;
    labels.put(nameOf(robot, jams), at, distance, { important: true, avoid: others, beside: true });
  }
  return labels;
}

function boxAround(x, y, reach) {
  return [x - reach, y - reach, x + reach, y + reach];
}

// The radius of a robot including its ring.
function reachOf(view, robot, jams) {
  return radiusOf(view, robot) + (isMarked(robot, jams) ? RING : 0);
}

// With the charge of a low battery, that it is out of use, and the number of robots that wait behind it.
function nameOf(robot, jams) {
  const low = robot.battery && robot.battery.charge < LOW_BATTERY && t("battery.charge", { charge: number(robot.battery.charge) });
  const more = [low, useOf(robot)].filter(Boolean).join(", ");
  const name = more ? `${robot.name} (${more})` : robot.name;
  const behind = jams.get(robot.vehicle?.name);
  return behind ? t("map.jam", { name, count: behind }) : name;
}

function isMarked(robot, jams) {
  return robot.urgent || jams.has(robot.vehicle?.name);
}

/** Paint robots, `[{robot, at}]`: `at` is the position on the screen. */
export function paintRobots(context, view, places, scene) {
  const { layers, colours } = scene;
  for (const { robot, at } of places) {
    const route = routeOf(robot, at, view, scene.plan);
    if (layers.routes) paintRoute(context, route, colourOf(robot, colours));
    if (layers.plans && robot.plan) paintPlan(context, view, robot.plan, colourOf(robot, colours));
    if (layers.goals && route.length) paintGoal(context, route.at(-1), colourOf(robot, colours));
  }
  if (!layers.robots) return;
  for (const { robot, at } of places) paintRobot(context, view, robot, at, scene);
  for (const { robot, at } of places) paintBadge(context, view, robot, at, scene);
}

// The sign of its condition at the upper right corner of a robot, and that of a load at the lower right one.
function paintBadge(context, view, robot, [x, y], { colours }) {
  const badge = badgeOf(robot.urgent ? "ERROR" : robot.condition, colourOf(robot, colours), colours.surface);
  const aside = BODY * radiusOf(view, robot);
  if (badge) context.drawImage(badge, x + aside - BADGE / 2, y - aside - BADGE / 2, BADGE, BADGE);
  const load = robot.loads?.length && loadBadge(colours.location, colours.surface);
  if (load) context.drawImage(load, x + aside - BADGE / 2, y + aside - BADGE / 2, BADGE, BADGE);
}

/** Return the colour of a robot: that of its condition; red if it needs attention. */
export function colourOf(robot, colours) {
  return robot.urgent ? colours.error : colours[robot.condition.toLowerCase()];
}

// The remaining steps of the order, each with the line to its node.
function routeOf(robot, at, view, plan) {
  if (!robot.order?.active) return [];
  const steps = [];
  let [from, last] = [at, null];
  for (const node of robot.order.ahead) {
    const place = node.x === null ? plan?.points.get(node.nodeId) : node;
    if (!place) continue;
    const to = view.toScreen(place.x, place.y);
    const shape = last && plan?.between.get(`${last} ${node.nodeId}`);
    const between = shape?.line.slice(1, -1).map(([x, y]) => view.toScreen(x, y)) ?? [];
    steps.push({ line: [from, ...between, to], curved: Boolean(shape?.curved), released: node.released });
    [from, last] = [to, node.nodeId];
  }
  return steps;
}

// The base is solid, the horizon dashed.
function paintRoute(context, steps, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 3;
  context.globalAlpha = 0.6;
  for (const released of [true, false]) {
    context.setLineDash(released ? [] : [4, 7]);
    context.beginPath();
    for (const step of steps.filter((each) => each.released === released)) {
      context.moveTo(...step.line[0]);
      trace(context, step.line, step.curved);
    }
    context.stroke();
  }
  context.setLineDash([]);
  context.globalAlpha = 1;
}

function paintPlan(context, view, plan, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 1.5;
  context.setLineDash([2, 3]);
  context.beginPath();
  for (const [x, y] of plan) context.lineTo(...view.toScreen(x, y));
  context.stroke();
  context.setLineDash([]);
}

function paintGoal(context, { line, released }, colour) {
  const [x, y] = line.at(-1);
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 2;
  context.setLineDash(released ? [] : [3, 3]);
  context.beginPath();
  context.arc(x, y, 9, 0, 2 * Math.PI);
  context.stroke();
  context.setLineDash([]);
  context.beginPath();
  context.arc(x, y, 3, 0, 2 * Math.PI);
  context.fill();
}

function bodyOf(view, robot) {
  const { length, width } = robot.body?.length && robot.body?.width ? robot.body : ROBOT;
  const factor = Math.max(view.scale, LEAST_ROBOT / Math.max(length, width));
  return [length * factor, width * factor];
}

function radiusOf(view, robot) {
  return Math.hypot(...bodyOf(view, robot)) / 2;
}

function paintRobot(context, view, robot, [x, y], { selected, colours, jams }) {
  const [length, width] = bodyOf(view, robot);
  context.save();
  context.translate(x, y);
  if (isMarked(robot, jams)) paintRing(context, reachOf(view, robot, jams), colourOf(robot, colours), robot.urgent);
  if (robot.id === selected) paintHalo(context, radiusOf(view, robot) + HALO, colours.accent);
  context.rotate(-robot.position.theta);
  context.globalAlpha = ABSENT.includes(robot.condition) || !robot.position.localized || useOf(robot) ? 0.55 : 1;
  const outline = Math.max(length, width) > LEAST_ROBOT && robot.body?.outline; // too small to be visible otherwise
  context.beginPath();
  if (outline) traceOutline(context, outline, view.scale);
  else context.roundRect(-length / 2, -width / 2, length, width, Math.min(length, width) / 4);
  context.fillStyle = colourOf(robot, colours);
  context.fill();
  context.strokeStyle = colours.surface;
  context.lineWidth = 1.5;
  context.stroke();
  paintNose(context, length, width, colours.surface);
  context.restore();
}

// y points left in the robot's frame and down on the screen.
function traceOutline(context, outline, scale) {
  for (const [x, y] of outline) context.lineTo(x * scale, -y * scale);
  context.closePath();
}

function paintNose(context, length, width, colour) {
  const nose = Math.min(length, width) * 0.3;
  context.beginPath();
  context.moveTo(length / 2 - nose * 0.4, 0);
  context.lineTo(length / 2 - nose * 1.6, -nose);
  context.lineTo(length / 2 - nose * 1.6, nose);
  context.closePath();
  context.fillStyle = colour;
  context.fill();
}

// Ring around a robot that needs attention (solid) or behind which others wait (dashed).
function paintRing(context, radius, colour, solid) {
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.globalAlpha = 0.25;
  context.fillStyle = colour;
  context.fill();
  context.globalAlpha = 1;
  context.strokeStyle = colour;
  context.lineWidth = 3;
  context.setLineDash(solid ? [] : [5, 4]);
  context.stroke();
  context.setLineDash([]);
}

function paintHalo(context, radius, colour) {
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.strokeStyle = colour;
  context.lineWidth = 2.5;
  context.stroke();
}
