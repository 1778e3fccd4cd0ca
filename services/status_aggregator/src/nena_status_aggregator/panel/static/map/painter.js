// Paints the map. The plan is kept as a picture, and painted anew only where it would look different.

import { paintPlan } from "./plan_painter.js";
import { paintPose } from "./pose_painter.js";
import { paintRobots } from "./robot_painter.js";

const COLOURS = ["ink", "muted", "line", "surface", "way", "point", "location", "accent", "bad"];
const CONDITIONS = ["idle", "busy", "charging", "blocked", "error", "manual", "silent", "broken", "offline"];

/** Read the colours that the style sheet gives at present. */
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

/** Paints on one canvas. */
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
   * Paint everything. `scene`: {plan, grids, robots, selected, colours, layers, pose}; gives where the robots are on the
   * screen, as `[{robot, at}]`.
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
