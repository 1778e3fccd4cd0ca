// Paints the map: the cached plan, robots and the picked pose.

import { paintPlan } from "./plan_painter.js";
import { paintRobots } from "./robot_painter.js";
import { paintTraffic } from "./traffic.js";

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

const COLOURS = ["ink", "muted", "line", "surface", "path", "point", "location", "accent", "bad"];
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
   * Paint everything. `scene`: {plan, grids, robots, selected, colours, layers, pose, traffic}. Returns the screen positions of the
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
    if (scene.layers.traffic && scene.plan) paintTraffic(context, view, scene, this.#texts);
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
