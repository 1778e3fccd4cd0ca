// Paints the plan: blocks, ways, locations, points and their names. Sizes of signs are pixels.

import { paintGrids } from "./grid_painter.js";
import { Labels } from "./labels.js";
import { middle, stroke, trace } from "./line.js";

/** Paint the maps of the robots and the layers of a plan, as far as they are on; gives the boxes of texts in sight. */
export function paintPlan(context, view, { plan, grids, colours, layers }) {
  if (layers.grids) paintGrids(context, view, grids, colours.muted);
  if (!plan) return [];
  context.lineCap = "round";
  if (layers.blocks) for (const block of plan.blocks) paintBlock(context, view, block, colours);
  if (layers.ways) for (const way of plan.ways) paintWay(context, view, way, colours);
  if (layers.locations) for (const location of plan.locations) paintLocation(context, view, location, colours);
  if (layers.points) for (const point of plan.points.values()) paintPoint(context, view, point, colours);
  const labels = new Labels(context, view.width, colours);
  if (layers.names) labelPlan(labels, view, plan, layers);
  return labels.taken.filter((box) => inSight(view, box));
}

// One stroke for all of it, so that it is even where its parts lie on each other.
function paintBlock(context, view, block, colours) {
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

function paintWay(context, view, way, colours) {
  const line = screenLine(view, way.line);
  context.strokeStyle = way.locked ? colours.bad : colours.way;
  context.lineWidth = 2;
  context.setLineDash(way.locked ? [5, 5] : []);
  stroke(context, line, way.curved);
  context.setLineDash([]);
  if (way.forward !== way.backward) paintArrow(context, middle(line, way.curved), way.forward, colours.way);
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

function labelPlan(labels, view, plan, layers) {
  const put = (each, distance, important) =>
    labels.put(each.name, view.toScreen(each.x, each.y), distance, important);
  if (layers.locations) for (const each of plan.locations) put(each, 18, true);
  if (layers.points) for (const each of plan.points.values()) put(each, 14, false);
  if (layers.blocks) for (const each of plan.blocks.filter((block) => !block.empty)) put(each, 32, false);
}
