// Paints the map: robot grid maps, the cached plan, robots and the picked pose.

import { paintPlan } from "./plan_painter.js";
import { paintRobots } from "./robot_painter.js";

/** The robots' grid maps as images. Fires `change` when an image has been loaded. */
export class Grids extends EventTarget {
  #images = new Map(); // by digest

  /** Return `[{grid, image}]` to paint: one per map, preferably the selected robot's. */
  of(robots, selected) {
    const chosen = new Map();
    for (const { id, grid } of robots) if (grid && (id === selected || !chosen.has(grid.mapId))) chosen.set(grid.mapId, { id, grid });
    const wanted = new Set([...chosen.values()].map(({ grid }) => grid.digest));
    for (const digest of this.#images.keys()) if (!wanted.has(digest)) this.#images.delete(digest);
    return [...chosen.values()].map(({ id, grid }) => ({ grid, image: this.#image(id, grid) })).filter(({ image }) => image);
  }

  // The image, or null while it is loading.
  #image(id, { digest }) {
    if (!this.#images.has(digest)) {
      this.#images.set(digest, null);
      this.#load(id, digest);
    }
    return this.#images.get(digest);
  }

  async #load(id, digest) {
    const [manufacturer, serial] = split(id).map(encodeURIComponent);
    const image = new Image();
    image.src = `api/v1/robots/${manufacturer}/${serial}/map?${digest}`;
    try {
      await image.decode();
    } catch {
      return; // the robot or its map no longer exists
    }
    if (this.#images.has(digest)) this.#images.set(digest, image);
    this.dispatchEvent(new Event("change"));
  }
}

function split(id) {
  const at = id.indexOf("/");
  return [id.slice(0, at), id.slice(at + 1)];
}

/** Return the image in one colour, with its opacity unchanged. */
export function tinted(image, colour) {
  const sheet = document.createElement("canvas");
  Object.assign(sheet, { width: image.width, height: image.height });
  const context = sheet.getContext("2d");
  context.drawImage(image, 0, 0);
  context.globalCompositeOperation = "source-in";
  context.fillStyle = colour;
  context.fillRect(0, 0, image.width, image.height);
  return sheet;
}

const tints = new WeakMap(); // by image: {colour, sheet}

/** Paint maps, `[{grid, image}]`; `grid` holds the pose of the lower left corner, m and rad. */
export function paintGrids(context, view, grids, colour) {
  for (const { grid, image } of grids) paintGrid(context, view, grid, tint(image, colour));
}

function tint(image, colour) {
  if (tints.get(image)?.colour !== colour) tints.set(image, { colour, sheet: tinted(image, colour) });
  return tints.get(image).sheet;
}

function paintGrid(context, view, grid, sheet) {
  const scale = grid.resolution * view.scale;
  context.save();
  context.translate(...view.toScreen(grid.x, grid.y));
  context.rotate(-grid.theta);
  context.imageSmoothingEnabled = scale < 1;
  context.drawImage(sheet, 0, -grid.height * scale, grid.width * scale, grid.height * scale);
  context.restore();
}

const LENGTH = 44;
const HEAD = 11;

export function paintPose(context, [x, y], theta, colour) {
  context.save();
  context.translate(x, y);
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 3;
  context.beginPath();
  context.arc(0, 0, 8, 0, 2 * Math.PI);
  context.stroke();
  if (theta !== null) paintArrow(context, theta);
  context.restore();
}

function paintArrow(context, theta) {
  context.rotate(-theta);
  context.beginPath();
  context.moveTo(8, 0);
  context.lineTo(LENGTH - HEAD, 0);
  context.stroke();
  context.beginPath();
  context.moveTo(LENGTH, 0);
  context.lineTo(LENGTH - HEAD - 2, -HEAD / 1.6);
  context.lineTo(LENGTH - HEAD - 2, HEAD / 1.6);
  context.fill();
}

const COLOURS = ["ink", "muted", "line", "surface", "way", "point", "location", "accent", "bad"];
const CONDITIONS = ["idle", "busy", "charging", "blocked", "error", "manual", "silent", "broken", "offline"];

/** Return the current colours of the style sheet. */
export function readColours(host) {
  const probe = document.createElement("span");
  host.append(probe);
  const colours = {};
  for (const name of [...COLOURS, ...CONDITIONS]) {
    probe.style.color = `var(--${name})`;
    colours[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return colours;
}

/** Paints on a canvas. The plan is cached as an image, and repainted only when it changes. */
export class Painter {
  #canvas;
  #context;
  #sheet = document.createElement("canvas");
  #painted = [];
  #texts = [];

  constructor(canvas) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d");
  }

  /**
   * Paint everything. `scene`: {plan, grids, robots, selected, colours, layers, pose}. Returns the screen positions of the
   * robots, `[{robot, at}]`.
   */
  paint(view, scene) {
    const context = this.#context;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.#canvas.width, this.#canvas.height);
    if (scene.plan || scene.grids.length) context.drawImage(this.#planPicture(view, scene), 0, 0);
    context.scale(devicePixelRatio, devicePixelRatio);
    const places = scene.robots.map((robot) => ({ robot, at: view.toScreen(robot.position.x, robot.position.y) }));
    const seen = places.filter(({ robot, at }) => robot.order?.active || inSight(view, at));
    paintRobots(context, view, seen, { ...scene, texts: this.#texts });
    if (scene.pose) paintPose(context, view.toScreen(scene.pose.x, scene.pose.y), scene.pose.theta, scene.colours.accent);
    return places;
  }

  #planPicture(view, scene) {
    const { width, height } = this.#canvas;
    const wanted = [view.x, view.y, view.scale, width, height, scene.plan, scene.colours, scene.layers];
    wanted.push(...scene.grids.flatMap(({ grid, image }) => [grid, image]));
    if (wanted.length !== this.#painted.length || wanted.some((each, at) => each !== this.#painted[at])) {
      this.#painted = wanted;
      Object.assign(this.#sheet, { width, height });
      const context = this.#sheet.getContext("2d");
      context.scale(devicePixelRatio, devicePixelRatio);
      this.#texts = paintPlan(context, view, scene);
    }
    return this.#sheet;
  }
}

function inSight(view, [x, y]) {
  return x > -100 && y > -100 && x < view.width + 100 && y < view.height + 100;
}
