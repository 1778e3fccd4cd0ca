// Paints the map: the cached plan, robots and the picked pose.

import { overlap } from "./labels.js";
import { labelPlan, paintMarked, paintPlan } from "./plan_painter.js";
import { labelRobots, paintRobots } from "./robot_painter.js";
import { paintTraffic } from "./traffic.js";

const LENGTH = 44;
const HEAD = 11;

function paintPose(context, [x, y], theta, colour) {
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

// An area that is paused, or is being picked.
function paintArea(context, view, { xMin, yMin, xMax, yMax }, colour) {
  const [left, top] = view.toScreen(xMin, yMax);
  const [right, bottom] = view.toScreen(xMax, yMin);
  context.save();
  context.fillStyle = context.strokeStyle = colour;
  context.globalAlpha = 0.16;
  context.fillRect(left, top, right - left, bottom - top);
  context.globalAlpha = 1;
  context.lineWidth = 2;
  context.setLineDash([8, 4]);
  context.strokeRect(left, top, right - left, bottom - top);
  context.restore();
}

const COLOURS = ["ink", "muted", "line", "surface", "path", "point", "location", "accent", "bad", "heat"];
const CONDITIONS = ["idle", "busy", "waiting", "charging", "blocked", "error", "manual", "silent", "broken", "offline"];

/** Return the current colours of the style sheet. */
export function readColours(host) {
  const probe = document.createElement("span");
  host.append(probe);
  const colours = {};
  for (const name of [...COLOURS, ...CONDITIONS]) {
    probe.style.color = `var(--${name}-fill, var(--${name}))`;
    colours[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return colours;
}

/**
 * Paints on a canvas. The plan and the areas are cached as two images, without and with labels, and repainted only when
 * they change. While the map is dragged, everything is one image that reaches beyond the canvas.
 */
export class Painter {
  #canvas;
  #context;
  #bare = document.createElement("canvas");
  #sheet = document.createElement("canvas");
  #painted = [];
  #labels = [];
  #whole = document.createElement("canvas");
  #reach = null; // the viewport of this image

  constructor(canvas) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d");
  }

  /**
   * Paint everything. `scene`: {plan, grids, robots, selected, place, colours, layers, pose, traffic, jams, areas, waiting, zones}; `place`: name of a marked place or path;
   * `jams`: robots that wait behind a vehicle, by its name; `waiting`: waiting times by place. Returns the labels, `[{text, box}]`.
   */
  paint(view, scene) {
    this.#reach = null;
    return this.#paint(this.#canvas, view, scene);
  }

  /** Paint everything, and `margin` pixels beyond the edges, for `shift`. */
  paintBeyond(view, scene, margin) {
    if (!this.#shows(view)) {
      this.#reach = view.enlarged(margin);
      const { width, height } = this.#reach;
      Object.assign(this.#whole, { width: Math.ceil(width * devicePixelRatio), height: Math.ceil(height * devicePixelRatio) });
    }
    this.#paint(this.#whole, this.#reach, scene);
    this.shift(view);
  }

  /** Show what `paintBeyond` has painted at another place; returns false if the view reaches beyond it. */
  shift(view) {
    if (!this.#shows(view)) return false;
    const { width, height } = this.#canvas;
    const [left, top] = [this.#reach.x - view.x, this.#reach.y - view.y].map((each) => Math.round(each * devicePixelRatio));
    this.#context.setTransform(1, 0, 0, 1, 0, 0);
    this.#context.clearRect(0, 0, width, height);
    this.#context.drawImage(this.#whole, left, top, width, height, 0, 0, width, height);
    return true;
  }

  #shows(view) {
    if (this.#reach?.scale !== view.scale) return false;
    const [left, top] = [this.#reach.x - view.x, this.#reach.y - view.y];
    return left >= 0 && top >= 0 && left + view.width <= this.#reach.width && top + view.height <= this.#reach.height;
  }

  #paint(canvas, view, scene) {
    const context = canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    const planned = Boolean(scene.plan || scene.grids.length || scene.areas.length);
    if (planned) context.drawImage(this.#planPicture(canvas, view, scene), 0, 0);
    const places = scene.robots.map((robot) => ({ robot, at: view.toScreen(robot.position.x, robot.position.y) }));
    const inView = places.filter(({ at }) => inSight(view, at));
    const labels = planned ? this.#labels : [];
    const names = labelRobots(context, view, inView, scene, labels.map(({ box }) => box));
    const covered = new Set(labels.filter(({ box }) => names.taken.some((each) => overlap(each, box))));
    for (const { box } of covered) this.#uncover(canvas, box);
    const shown = [...names.placed, ...labels.filter((each) => !covered.has(each))];
    context.scale(devicePixelRatio, devicePixelRatio);
    if (scene.place && scene.plan) paintMarked(context, view, scene);
    const times = scene.layers.traffic && scene.plan ? paintTraffic(context, view, scene, shown.map(({ box }) => box)) : null;
    paintRobots(context, view, places.filter(({ robot, at }) => robot.order?.active || inSight(view, at)), scene);
    times?.paint(scene.colours);
    names.paint(scene.colours);
    if (scene.pose) paintPose(context, view.toScreen(scene.pose.x, scene.pose.y), scene.pose.theta, scene.colours.accent);
    return [...shown, ...(times?.placed ?? [])];
  }

  // Paint the plan without labels over the label in a box.
  #uncover(canvas, box) {
    const [left, top] = box.slice(0, 2).map((each) => Math.max(0, Math.floor((each - 1) * devicePixelRatio)));
    const right = Math.min(canvas.width, Math.ceil((box[2] + 1) * devicePixelRatio));
    const bottom = Math.min(canvas.height, Math.ceil((box[3] + 1) * devicePixelRatio));
    if (right <= left || bottom <= top) return;
    const area = [left, top, right - left, bottom - top];
    const context = canvas.getContext("2d");
    context.clearRect(...area);
    context.drawImage(this.#bare, ...area, ...area);
  }

  #planPicture({ width, height }, view, scene) {
    const wanted = [view.x, view.y, view.scale, width, height, scene.plan, scene.colours, scene.layers, scene.waiting, scene.zones];
    wanted.push(...scene.grids.flatMap(({ grid, image }) => [grid, image]), JSON.stringify(scene.areas));
    if (wanted.length !== this.#painted.length || wanted.some((each, at) => each !== this.#painted[at])) {
      this.#painted = wanted;
      const bare = cleared(this.#bare, width, height);
      bare.scale(devicePixelRatio, devicePixelRatio);
      paintPlan(bare, view, scene);
      for (const area of scene.areas) paintArea(bare, view, area, scene.colours.blocked);
      const context = cleared(this.#sheet, width, height);
      context.drawImage(this.#bare, 0, 0);
      context.scale(devicePixelRatio, devicePixelRatio);
      this.#labels = labelPlan(context, view, scene);
    }
    return this.#sheet;
  }
}

// Note that setting the size clears the canvas.
function cleared(sheet, width, height) {
  Object.assign(sheet, { width, height });
  return sheet.getContext("2d");
}

function inSight(view, [x, y]) {
  return x > -100 && y > -100 && x < view.width + 100 && y < view.height + 100;
}
