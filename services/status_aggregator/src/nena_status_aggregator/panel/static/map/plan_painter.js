// Paints the plant model: blocks, paths, locations, points and labels.

import { paintGrids } from "./grids.js";
import { Labels } from "./labels.js";
import { distanceToLine, flattened, middle, stroke, trace } from "./lines.js";
import { labelWaiting, paintWaiting } from "./waiting.js";
import { labelZones, paintZones } from "./zones.js";

const MM = 1000;

/**
 * Convert a published plant model (mm) to a drawing (m): points, lines (one for both directions), locations, blocks;
 * `between` and `named`: shapes of paths by their ends and by name.
 */
export function drawPlan(plant) {
  const points = new Map(
    plant.points.map((each) => [
      each.name,
      { name: each.name, x: each.xMm / MM, y: each.yMm / MM, parking: each.type === "PARK_POSITION" },
    ]),
  );
  const shapes = new Map(plant.paths.flatMap((path) => shapeOf(path, points)));
  return {
    name: plant.name,
    points,
    paths: paths(plant.paths, shapes),
    locations: plant.locations.map((each) => location(each, points)),
    blocks: plant.blocks.map((each) => block(each, points, shapes)),
    between: between(plant.paths, shapes),
    named: shapes,
  };
}

// Name and shape of a path: its line, which may be a Bézier curve.
function shapeOf(path, points) {
  const [from, to] = [points.get(path.source), points.get(path.destination)];
  if (!from || !to) return [];
  const corners = path.layout.controlPoints.map((each) => [each.xMm / MM, each.yMm / MM]);
  const curved = ["BEZIER", "BEZIER_3"].includes(path.layout.connectionType);
  return [[path.name, { line: [[from.x, from.y], ...corners, [to.x, to.y]], curved }]];
}

function paths(published, shapes) {
  const found = new Map();
  for (const path of published) {
    const shape = shapes.get(path.name);
    if (!shape) continue;
    const opposite = found.get(`${path.destination} ${path.source}`);
    if (opposite && shape.line.length === 2 && opposite.line.length === 2) {
      opposite.forward ||= path.maxReverseVelocityMmS > 0;
      opposite.backward ||= path.maxVelocityMmS > 0;
      opposite.locked ||= path.locked; // even if only one direction is locked
    } else {
      found.set(`${path.source} ${path.destination}`, {
        ...shape,
        forward: path.maxVelocityMmS > 0,
        backward: path.maxReverseVelocityMmS > 0,
        locked: path.locked,
      });
    }
  }
  return [...found.values()];
}

function location(each, points) {
  const place = each.layout.position ?? each;
  return {
    name: each.name,
    x: place.xMm / MM,
    y: place.yMm / MM,
    locked: each.locked,
    links: each.links.map((link) => points.get(link.point)).filter(Boolean),
  };
}

function block(each, points, shapes) {
  const corners = each.members.map((name) => points.get(name)).filter(Boolean);
  const lines = each.members.map((name) => shapes.get(name)).filter(Boolean);
  const places = [...corners.map(({ x, y }) => [x, y]), ...lines.flatMap(({ line }) => [line[0], line.at(-1)])];
  const mean = (axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length;
  return { name: each.name, colour: each.color, corners, lines, x: mean(0), y: mean(1), empty: !places.length };
}

// Shapes by start and end point, for both directions of a path.
function between(published, shapes) {
  const found = new Map();
  for (const path of published) {
    const shape = shapes.get(path.name);
    if (!shape) continue;
    if (path.maxVelocityMmS > 0) found.set(`${path.source} ${path.destination}`, shape);
    if (path.maxReverseVelocityMmS > 0) {
      found.set(`${path.destination} ${path.source}`, { ...shape, line: [...shape.line].reverse() });
    }
  }
  return found;
}

/** Return the bounding box `[left, bottom, right, top]` of places; null if there are none. */
export function extent(places) {
  const all = [...places];
  if (!all.length) return null;
  const xs = all.map((each) => each.x);
  const ys = all.map((each) => each.y);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

const NEAR_PLACE = 10; // px
const NEAR_PATH = 7; // px

/** Return the name of the point, location or path at a place of the screen; null if there is none. */
export function placeAt(plan, view, [x, y]) {
  const to = (each) => distance([x, y], view.toScreen(each.x, each.y));
  const nearest = [...plan.points.values(), ...plan.locations].reduce((best, each) => (best && to(best) <= to(each) ? best : each), null);
  if (nearest && to(nearest) <= NEAR_PLACE) return nearest.name;
  let [found, least] = [null, NEAR_PATH];
  for (const [name, shape] of plan.named) {
    const apart = distanceToLine([x, y], screenLine(view, flattened(shape)));
    if (apart < least) [found, least] = [name, apart];
  }
  return found;
}

function distance([x, y], [otherX, otherY]) {
  return Math.hypot(x - otherX, y - otherY);
}

const SAMPLES = 100;

/** Return how far, m, the straight line between two places leaves the paths of a plan, at most. */
export function distanceOffPaths(plan, [ax, ay], [bx, by]) {
  const lines = [...plan.named.values()].map(flattened);
  const samples = Array.from({ length: SAMPLES + 1 }, (_, at) => [ax + ((bx - ax) * at) / SAMPLES, ay + ((by - ay) * at) / SAMPLES]);
  return Math.max(...samples.map((place) => Math.min(...lines.map((line) => distanceToLine(place, line)))));
}

/** Highlight the chosen point, location or path, below everything painted so far. */
export function paintMarked(context, view, { plan, place, colours }) {
  context.save();
  context.globalCompositeOperation = "destination-over";
  context.strokeStyle = colours.accent;
  context.lineCap = "round";
  const path = plan.named.get(place);
  const at = plan.points.get(place) ?? plan.locations.find((each) => each.name === place);
  if (path) {
    context.globalAlpha = 0.4;
    context.lineWidth = 12;
    stroke(context, screenLine(view, path.line), path.curved);
  } else if (at) {
    context.lineWidth = 3;
    context.beginPath();
    context.arc(...view.toScreen(at.x, at.y), 14, 0, 2 * Math.PI);
    context.stroke();
  }
  context.restore();
}

/** Paint grid maps and the visible layers of a plan, without labels. */
export function paintPlan(context, view, { plan, grids, colours, layers, waiting, zones }) {
  if (layers.grids) paintGrids(context, view, grids, colours.muted);
  if (layers.zones) paintZones(context, view, zones, colours);
  if (!plan) return;
  context.lineCap = "round";
  if (layers.blocks) for (const block of plan.blocks) paintBlock(context, view, block, colours);
  if (layers.waiting) paintWaiting(context, view, plan, waiting, colours.heat);
  if (layers.paths) for (const path of plan.paths) paintPath(context, view, path, colours);
  if (layers.locations) for (const location of plan.locations) paintLocation(context, view, location, colours);
  if (layers.points) for (const point of plan.points.values()) paintPoint(context, view, point, colours);
  if (layers.paths) for (const path of plan.paths.filter(({ locked }) => locked)) paintLock(context, view, path, colours);
}

/** Paint the labels of a plan: waiting times first, then zones, locations, points and blocks. Returns the visible ones. */
export function labelPlan(context, view, { plan, colours, layers, waiting, zones }) {
  if (!plan) return [];
  const labels = new Labels(context, view.width);
  if (layers.waiting) labelWaiting(labels, view, plan, waiting);
  if (layers.zones && layers.names) labelZones(labels, view, zones);
  if (layers.names) labelNames(labels, view, plan, layers);
  labels.paint(colours);
  return labels.placed.filter(({ box }) => inSight(view, box));
}

function labelNames(labels, view, plan, layers) {
  const put = (each, distance, important) => labels.put(each.name, view.toScreen(each.x, each.y), distance, { important });
  if (layers.locations) for (const each of plan.locations) put(each, 18, true);
  if (layers.points) for (const each of plan.points.values()) put(each, 14, false);
  if (layers.blocks) for (const each of plan.blocks.filter((block) => !block.empty)) put(each, 32, false);
}

/** Paint a block, `{colour, corners, lines}`, in a single stroke, so that overlapping parts keep one opacity. */
export function paintBlock(context, view, block, colours) {
  context.save();
  context.globalAlpha = 0.28;
  context.strokeStyle = block.colour || colours.accent;
  context.lineJoin = "round";
  context.lineWidth = 18;
  context.beginPath();
  for (const { line, curved } of block.lines) {
    const onScreen = screenLine(view, line);
    context.moveTo(...onScreen[0]);
    trace(context, onScreen, curved);
  }
  for (const corner of block.corners) {
    const [x, y] = view.toScreen(corner.x, corner.y);
    context.moveTo(x, y);
    context.lineTo(x + 0.01, y);
  }
  context.stroke();
  context.restore();
}

function inSight(view, [left, top, right, bottom]) {
  return right > 0 && bottom > 0 && left < view.width && top < view.height;
}

function screenLine(view, line) {
  return line.map(([x, y]) => view.toScreen(x, y));
}

function paintPath(context, view, path, colours) {
  const line = screenLine(view, path.line);
  context.strokeStyle = path.locked ? colours.bad : colours.path;
  context.lineWidth = path.locked ? 3 : 2;
  context.setLineDash(path.locked ? [5, 5] : []);
  stroke(context, line, path.curved);
  context.setLineDash([]);
  if (path.forward !== path.backward) paintArrow(context, middle(line, path.curved), path.forward, colours.path);
}

// As large at any zoom, and above the points, which cover a short path.
function paintLock(context, view, path, colours) {
  const [x, y] = middle(screenLine(view, path.line), path.curved);
  context.beginPath();
  context.arc(x, y, 6.5, 0, 2 * Math.PI);
  context.fillStyle = colours.bad;
  context.fill();
  context.fillStyle = colours.surface;
  context.fillRect(x - 4, y - 1.25, 8, 2.5);
}

function paintArrow(context, [x, y, angle], forward, colour) {
  context.save();
  context.translate(x, y);
  context.rotate(forward ? angle : angle + Math.PI);
  context.fillStyle = colour;
  context.beginPath();
  context.moveTo(7, 0);
  context.lineTo(-5, -5.5);
  context.lineTo(-2, 0);
  context.lineTo(-5, 5.5);
  context.closePath();
  context.fill();
  context.restore();
}

function paintPoint(context, view, point, colours) {
  const [x, y] = view.toScreen(point.x, point.y);
  context.beginPath();
  if (point.parking) context.roundRect(x - 6, y - 6, 12, 12, 3);
  else context.arc(x, y, 4.5, 0, 2 * Math.PI);
  context.fillStyle = colours.surface;
  context.fill();
  context.strokeStyle = colours.point;
  context.lineWidth = 2;
  context.stroke();
  if (!point.parking) return;
  context.fillStyle = colours.point;
  context.font = "bold 9px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText("P", x, y + 0.5);
}

function paintLocation(context, view, location, colours) {
  const [x, y] = view.toScreen(location.x, location.y);
  context.strokeStyle = colours.location;
  context.lineWidth = 1.25;
  context.setLineDash([2, 4]);
  for (const point of location.links) stroke(context, [[x, y], view.toScreen(point.x, point.y)], false);
  context.setLineDash(location.locked ? [3, 3] : []);
  context.beginPath();
  context.roundRect(x - 9, y - 7, 18, 14, 3);
  context.fillStyle = colours.surface;
  context.fill();
  context.stroke();
  context.setLineDash([]);
  context.fillStyle = colours.location;
  context.fillRect(x - 4, y - 2.5, 8, 5);
}
