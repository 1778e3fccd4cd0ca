// Paints a draft of a plant: many paths and points in few strokes, and only what is in sight.

import { number, t } from "../i18n.js";
import { paintGrids } from "../map/grids.js";
import { Labels } from "../map/labels.js";
import { middle, stroke, trace } from "../map/lines.js";
import { paintBlock } from "../map/plan_painter.js";
import { paintWaiting } from "../map/waiting.js";
import { placesOf } from "./scene.js";

const EDGE = 40; // px
const MARGIN = 160; // px painted beyond the edges
const NAMES_FROM = 14; // px per m
const NAMES = 300;
const CHUNK = 50;
const HALF = 9; // px, of the image of a point
const ARROWS_FROM = 6; // px per m

/**
 * Paints a draft on a canvas. What stands still is an image that reaches beyond the edges: it is painted again when it changes, is
 * zoomed, or has been moved too far.
 */
export class DraftPainter {
  #sheet = document.createElement("canvas");
  #painted = [];
  #reach = null; // the viewport of the image

  /**
   * Paint. `shown`: {still, moving: scenes, selection: names, findings: Map of name to whether it is an error, grids,
   * waiting, robots, grid (m, 0: none), drag and ruler: [place, place], row: places, box: [corner, corner], bent: line with
   * handles, colours}.
   */
  paint(canvas, view, shown) {
    const wanted = [shown.still, shown.selection, shown.findings, shown.waiting, shown.grid, shown.colours, canvas.width, canvas.height, view.scale, shown.grids.map(({ grid }) => grid.digest).join()];
    const selected = new Set(shown.selection);
    if (!this.#shows(view) || wanted.some((each, at) => each !== this.#painted[at])) {
      this.#painted = wanted;
      this.#reach = view.enlarged(MARGIN);
      this.#sheet.width = Math.ceil(this.#reach.width * devicePixelRatio);
      this.#sheet.height = Math.ceil(this.#reach.height * devicePixelRatio);
      const context = this.#sheet.getContext("2d");
      context.scale(devicePixelRatio, devicePixelRatio);
      paintGrids(context, this.#reach, shown.grids, shown.colours.muted);
      if (shown.grid * view.scale >= 8) paintLattice(context, this.#reach, shown.grid, shown.colours.line);
      if (shown.waiting) paintWaiting(context, this.#reach, planOf(shown.still), shown.waiting, shown.colours.bad);
      paintScene(context, this.#reach, shown.still, selected, shown);
    }
    const context = canvas.getContext("2d");
    const [left, top] = [this.#reach.x - view.x, this.#reach.y - view.y].map((each) => Math.round(each * devicePixelRatio));
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(this.#sheet, left, top, canvas.width, canvas.height, 0, 0, canvas.width, canvas.height);
    context.scale(devicePixelRatio, devicePixelRatio);
    if (shown.moving) paintScene(context, view, shown.moving, selected, shown);
    for (const robot of shown.robots) paintRobot(context, view, robot, shown.colours);
    paintGesture(context, view, shown);
  }

  #shows(view) {
    if (!this.#reach) return false;
    const [left, top] = [this.#reach.x - view.x, this.#reach.y - view.y];
    return left >= 0 && top >= 0 && left + view.width <= this.#reach.width && top + view.height <= this.#reach.height;
  }
}

// The scene as the fleet's map has it.
function planOf({ points, locations, lines }) {
  const named = new Map(lines.flatMap((line) => line.names.map((name) => [name, { line: placesOf(line), curved: line.curved }])));
  return { named, points, locations: [...locations.values()], blocks: [] };
}

function paintScene(context, view, scene, selected, { findings, colours }) {
  const lines = scene.lines.filter((line) => crosses(view, line));
  const isSelected = ({ names }) => names.some((name) => selected.has(name));
  context.lineCap = "round";
  for (const block of scene.blocks) paintBlock(context, view, { ...block, lines: block.lines.map((line) => ({ line: placesOf(line), curved: line.curved })) }, colours);
  strokeLines(context, view, lines.filter((line) => !line.locked), colours.path, 2);
  strokeLines(context, view, lines.filter((line) => line.locked), colours.bad, 3);
  strokeLines(context, view, lines.filter(isSelected), colours.accent, 4);
  if (view.scale >= ARROWS_FROM) paintArrows(context, view, lines, colours.path);
  const locations = [...scene.locations.values()].filter((each) => inSight(view, each) || each.links.some((point) => inSight(view, point)));
  paintLocations(context, view, locations, selected, colours);
  const points = [...scene.points.values()].filter((each) => inSight(view, each));
  paintPoints(context, view, points, selected, colours);
  paintFindings(context, view, scene, lines, findings, colours);
  if (view.scale >= NAMES_FROM) paintNames(context, view, [...locations, ...points], scene.blocks, colours);
}

function inSight(view, { x, y }) {
  const [px, py] = view.toScreen(x, y);
  return px > -EDGE && py > -EDGE && px < view.width + EDGE && py < view.height + EDGE;
}

function crosses(view, { from, to, corners }) {
  const [left, top] = view.toPlane(-EDGE, -EDGE);
  const [right, bottom] = view.toPlane(view.width + EDGE, view.height + EDGE);
  if (corners.length) return true;
  return Math.max(from.x, to.x) > left && Math.min(from.x, to.x) < right && Math.max(from.y, to.y) > bottom && Math.min(from.y, to.y) < top;
}

function onScreen(view, line) {
  return placesOf(line).map(([x, y]) => view.toScreen(x, y));
}

function addLine(context, [ax, ay], [bx, by]) {
  context.moveTo(ax, ay);
  context.lineTo(bx, by);
}

// In chunks: without a graphics card, a stroke of all lines at once takes twice as long.
function strokeLines(context, view, lines, colour, width) {
  context.strokeStyle = colour;
  context.lineWidth = width;
  for (let at = 0; at < lines.length; at += CHUNK) {
    context.beginPath();
    for (const line of lines.slice(at, at + CHUNK)) {
      const places = onScreen(view, line);
      context.moveTo(...places[0]);
      trace(context, places, line.curved);
    }
    context.stroke();
  }
}

function paintArrows(context, view, lines, colour) {
  context.beginPath();
  for (const line of lines.filter((each) => each.forward !== each.backward)) {
    const [x, y, angle] = middle(onScreen(view, line), line.curved);
    const turned = line.forward ? angle : angle + Math.PI;
    const at = (along, across) => [x + along * Math.cos(turned) - across * Math.sin(turned), y + along * Math.sin(turned) + across * Math.cos(turned)];
    context.moveTo(...at(7, 0));
    for (const corner of [[-5, -5.5], [-2, 0], [-5, 5.5]]) context.lineTo(...at(...corner));
    context.closePath();
  }
  context.fillStyle = colour;
  context.fill();
}

// Stamped: 2,500 circles take 70 ms to draw, as images of a circle 3 ms.
function paintPoints(context, view, points, selected, colours) {
  context.strokeStyle = colours.point;
  context.lineWidth = 2;
  context.beginPath();
  for (const { x, y, heading } of points.filter((point) => point.heading !== null)) {
    const [px, py] = view.toScreen(x, y);
    const angle = (heading * Math.PI) / 180;
    addLine(context, [px, py], [px + 14 * Math.cos(angle), py - 14 * Math.sin(angle)]);
  }
  context.stroke();
  const stamps = stampsOf(colours);
  for (const point of points) {
    const [x, y] = view.toScreen(point.x, point.y);
    context.drawImage(stamps[Number(selected.has(point.name))][Number(point.parking)], x - HALF, y - HALF, 2 * HALF, 2 * HALF);
  }
}

const stamped = new WeakMap(); // by colours

function stampsOf(colours) {
  if (!stamped.has(colours)) stamped.set(colours, [false, true].map((marked) => [false, true].map((parking) => stamp(colours, marked, parking))));
  return stamped.get(colours);
}

function stamp(colours, marked, parking) {
  const sheet = document.createElement("canvas");
  sheet.width = sheet.height = 2 * HALF * devicePixelRatio;
  const context = sheet.getContext("2d");
  context.scale(devicePixelRatio, devicePixelRatio);
  context.translate(HALF, HALF);
  context.beginPath();
  if (parking) context.roundRect(-6, -6, 12, 12, 3);
  else context.arc(0, 0, 5, 0, 2 * Math.PI);
  context.fillStyle = marked ? colours.accent : colours.surface;
  context.fill();
  context.strokeStyle = marked ? colours.accent : colours.point;
  context.lineWidth = marked ? 3 : 2;
  context.stroke();
  if (!parking) return sheet;
  context.fillStyle = marked ? colours.surface : colours.point;
  context.font = "bold 9px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText("P", 0, 0.5);
  return sheet;
}

function paintLocations(context, view, locations, selected, colours) {
  context.lineWidth = 1.25;
  context.setLineDash([2, 4]);
  context.strokeStyle = colours.location;
  context.beginPath();
  for (const { x, y, links, doors } of locations) {
    for (const line of doors) addLine(context, view.toScreen(x, y), middle(onScreen(view, line), line.curved));
    for (const point of links) addLine(context, view.toScreen(x, y), view.toScreen(point.x, point.y));
  }
  context.stroke();
  context.setLineDash([]);
  for (const location of locations) {
    const [x, y] = view.toScreen(location.x, location.y);
    const marked = selected.has(location.name);
    context.beginPath();
    context.roundRect(x - 9, y - 7, 18, 14, 3);
    context.fillStyle = marked ? colours.accent : colours.surface;
    context.fill();
    context.strokeStyle = marked ? colours.accent : colours.location;
    context.stroke();
    context.fillStyle = marked ? colours.surface : colours.location;
    if (location.device) for (const side of [-5, 2]) context.fillRect(x + side, y - 4, 3, 8); // two wings
    else context.fillRect(x - 4, y - 1.5, 8, 3);
    if (location.charging) context.fillRect(x - 1.5, y - 4, 3, 8);
  }
}

function paintFindings(context, view, scene, lines, findings, colours) {
  const ring = (x, y, isError) => {
    context.beginPath();
    context.arc(...view.toScreen(x, y), 13, 0, 2 * Math.PI);
    context.strokeStyle = isError ? colours.bad : colours.blocked;
    context.lineWidth = 2.5;
    context.stroke();
  };
  for (const [name, isError] of findings) {
    const thing = scene.points.get(name) ?? scene.locations.get(name);
    if (thing) ring(thing.x, thing.y, isError);
    else for (const line of lines.filter(({ names }) => names.includes(name))) ring(...view.toPlane(...middle(onScreen(view, line), line.curved)), isError);
  }
}

function paintNames(context, view, things, blocks, colours) {
  const labels = new Labels(context, view.width);
  const named = things.slice(0, NAMES).map(({ name, x, y }) => [name, view.toScreen(x, y)]);
  const avoid = named.map(([, [x, y]]) => [x - HALF, y - HALF, x + HALF, y + HALF]);
  for (const [name, at] of named) labels.put(name, at, 16, { avoid });
  for (const { name, corners, lines } of blocks) {
    const places = [...corners, ...lines.flatMap(({ from, to }) => [from, to])];
    const mean = (axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length;
    const at = { x: mean("x"), y: mean("y") };
    if (places.length && inSight(view, at)) labels.put(name, view.toScreen(at.x, at.y), 32, { important: true });
  }
  labels.paint(colours);
}

function paintLattice(context, view, grid, colour) {
  const [left, top] = view.toPlane(0, 0);
  const [right, bottom] = view.toPlane(view.width, view.height);
  context.beginPath();
  for (let x = Math.ceil(left / grid) * grid; x < right; x += grid) addLine(context, view.toScreen(x, top), view.toScreen(x, bottom));
  for (let y = Math.ceil(bottom / grid) * grid; y < top; y += grid) addLine(context, view.toScreen(left, y), view.toScreen(right, y));
  context.globalAlpha = 0.5;
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.stroke();
  context.globalAlpha = 1;
}

function paintRobot(context, view, { name, x, y, theta }, colours) {
  const [px, py] = view.toScreen(x, y);
  context.save();
  context.translate(px, py);
  context.rotate(-theta);
  context.globalAlpha = 0.7;
  context.fillStyle = colours.busy;
  context.beginPath();
  context.moveTo(14, 0);
  for (const corner of [[-9, -8], [-5, 0], [-9, 8]]) context.lineTo(...corner);
  context.fill();
  context.restore();
  context.fillStyle = colours.ink;
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "bottom";
  context.fillText(name, px, py - 14);
}

function paintGesture(context, view, { drag, box, ruler, row = [], bent, colours }) {
  context.strokeStyle = colours.accent;
  context.lineWidth = 2;
  context.setLineDash([6, 4]);
  if (bent) paintHandles(context, view, bent, colours);
  for (const pair of [drag, ruler]) if (pair) stroke(context, pair.map((place) => view.toScreen(...place)));
  for (const place of row) {
    const [x, y] = view.toScreen(...place);
    context.strokeRect(x - 9, y - 7, 18, 14);
  }
  if (box) {
    const [left, top] = view.toScreen(...box[0]);
    const [right, bottom] = view.toScreen(...box[1]);
    context.strokeRect(left, top, right - left, bottom - top);
  }
  context.setLineDash([]);
}

// Of a curve, each control point hangs at its end. Its numbers are beside it.
function paintHandles(context, view, bent, colours) {
  const line = onScreen(view, bent);
  context.lineWidth = 1;
  for (const ends of bent.curved ? [line.slice(0, 2), line.slice(-2)] : []) stroke(context, ends);
  context.setLineDash([]);
  context.lineWidth = 2;
  context.fillStyle = colours.surface;
  for (const [x, y] of line.slice(1, -1)) {
    context.fillRect(x - 5, y - 5, 10, 10);
    context.strokeRect(x - 5, y - 5, 10, 10);
  }
  const labels = new Labels(context, view.width);
  for (const [x, y] of bent.corners) labels.put(t("map.position", { x: number(x, 2), y: number(y, 2) }), view.toScreen(x, y), 16, { important: true });
  labels.paint(colours);
  context.setLineDash([6, 4]);
}
