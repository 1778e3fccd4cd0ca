// The plan of traffic control, polled while it is shown and painted over the plant.

import { ask } from "../api.js";
import { number, t } from "../i18n.js";
import { Labels } from "./labels.js";
import { trace } from "./lines.js";
import { colourOf } from "./robot_painter.js";

const PAUSE = 1000;
const HELD = 7;
const PLANNED = 2.5;
const HEAD = 9;

/** The plans of vehicles by name, polled every second while `wanted()`. Fires `change`. */
export class TrafficPlan extends EventTarget {
  vehicles = [];

  /** Start polling. */
  async follow(wanted) {
    for (;;) {
      const shown = wanted() && !document.hidden;
      const plan = shown ? await ask("traffic", "plan").catch(() => null) : null;
      if (shown || this.vehicles.length) {
        this.vehicles = plan?.vehicles ?? [];
        this.dispatchEvent(new Event("change"));
      }
      await new Promise((go) => setTimeout(go, PAUSE));
    }
  }
}

/**
 * Paint for each vehicle what it holds (solid), what is planned (dashed), and whom it waits for. Returns the labels with its
 * times of arrival, to be painted above the robots; those that would cover boxes of other labels, `taken`, are omitted.
 */
export function paintTraffic(context, view, scene, taken) {
  const { plan, robots, colours } = scene;
  const named = new Map(robots.filter((robot) => robot.vehicle).map((robot) => [robot.vehicle.name, robot]));
  const labels = new Labels(context, view.width, taken);
  const places = new Map();
  for (const vehicle of scene.traffic) {
    const robot = named.get(vehicle.vehicle);
    const start = robot ? robot.position : plan.points.get(vehicle.at);
    if (start) places.set(vehicle.vehicle, view.toScreen(start.x, start.y));
  }
  const shown = scene.traffic.filter((vehicle) => places.has(vehicle.vehicle));
  const colour = (vehicle) => (named.has(vehicle.vehicle) ? colourOf(named.get(vehicle.vehicle), colours) : colours.muted);
  for (const vehicle of shown) paintWay(context, view, plan, vehicle, places.get(vehicle.vehicle), colour(vehicle));
  for (const vehicle of shown) labelTimes(labels, view, plan, vehicle);
  for (const vehicle of shown) paintWait(context, view, plan, vehicle, places, colours.bad);
  return labels;
}

function paintWay(context, view, plan, vehicle, start, colour) {
  context.strokeStyle = colour;
  let [from, last] = [start, vehicle.at];
  for (const { point, held } of vehicle.ahead) {
    const place = plan.points.get(point);
    if (!place) continue;
    const to = view.toScreen(place.x, place.y);
    const shape = plan.between.get(`${last} ${point}`);
    const between = from === start ? [] : (shape?.line.slice(1, -1).map(([x, y]) => view.toScreen(x, y)) ?? []);
    context.lineWidth = held ? HELD : PLANNED;
    context.globalAlpha = held ? 0.55 : 0.85;
    context.setLineDash(held ? [] : [7, 6]);
    context.beginPath();
    context.moveTo(...from);
    trace(context, [from, ...between, to], Boolean(shape?.curved) && between.length > 0);
    context.stroke();
    [from, last] = [to, point];
  }
  context.setLineDash([]);
  context.globalAlpha = 1;
}

function labelTimes(labels, view, plan, vehicle) {
  for (const { point, seconds } of vehicle.ahead) {
    const place = plan.points.get(point);
    if (!place || seconds === null) continue;
    labels.put(t("age.seconds", { count: number(seconds) }), view.toScreen(place.x, place.y), 14);
  }
}

// An arrow from the waiting vehicle to the place it waits for, and a line from there to the vehicle it waits for.
function paintWait(context, view, plan, vehicle, places, colour) {
  if (!vehicle.wait?.vehicles.length) return;
  const from = places.get(vehicle.vehicle);
  const place = placeOf(plan, vehicle.wait.at);
  const others = vehicle.wait.vehicles.map((name) => places.get(name)).filter(Boolean);
  const at = place ? view.toScreen(place.x, place.y) : others[0];
  if (!at) return;
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 2;
  if (place) {
    context.setLineDash([2, 4]);
    for (const other of others) {
      context.beginPath();
      context.moveTo(...at);
      context.lineTo(...other);
      context.stroke();
    }
    context.setLineDash([]);
  }
  paintArrow(context, from, at);
}

function paintArrow(context, [x, y], [goalX, goalY]) {
  const length = Math.hypot(goalX - x, goalY - y);
  if (length < 2 * HEAD) return;
  context.save();
  context.translate(x, y);
  context.rotate(Math.atan2(goalY - y, goalX - x));
  context.beginPath();
  context.moveTo(0, 0);
  context.lineTo(length - HEAD, 0);
  context.stroke();
  context.beginPath();
  context.moveTo(length, 0);
  context.lineTo(length - HEAD, -HEAD / 2);
  context.lineTo(length - HEAD, HEAD / 2);
  context.fill();
  context.restore();
}

// The position of a point, path, location or block.
function placeOf(plan, name) {
  const point = plan.points.get(name) ?? plan.locations.find((each) => each.name === name);
  if (point) return point;
  const path = plan.named.get(name);
  if (path) return { x: (path.line[0][0] + path.line.at(-1)[0]) / 2, y: (path.line[0][1] + path.line.at(-1)[1]) / 2 };
  return plan.blocks.find((each) => each.name === name && !each.empty) ?? null;
}
