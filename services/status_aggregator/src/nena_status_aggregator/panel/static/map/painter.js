// Paints plan and robots on a canvas. Sizes of signs are pixels, sizes of things are metres.

const COLOURS = ["ink", "muted", "line", "surface", "way", "point", "location", "accent", "bad"];
const CONDITIONS = ["idle", "busy", "charging", "blocked", "error", "manual", "silent", "broken", "offline"];
const ABSENT = ["SILENT", "BROKEN", "OFFLINE"];
const FONT = "12px system-ui, sans-serif";
const SMALL = "11px system-ui, sans-serif";
const ROBOT = { length: 0.9, width: 0.6 };
const LEAST_ROBOT = 16;

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

/** Paint everything. `scene`: {plan, robots, selected, colours}; gives where the robots are on the screen. */
export function paint(context, view, scene) {
  context.clearRect(0, 0, view.width, view.height);
  const labels = new Labels(context, view.width, scene.colours);
  const places = scene.robots.map((robot) => ({ robot, at: view.toScreen(robot.position.x, robot.position.y) }));
  for (const { at } of places) labels.reserve(at[0] - 10, at[1] - 10, 20, 20);
  if (scene.plan) paintPlan(context, view, scene);
  for (const { robot, at } of places) paintAhead(context, view, robot, at, scene);
  for (const { robot, at } of places) paintRobot(context, view, robot, at, scene);
  for (const { robot, at } of places) labels.put(robot.name, at, robotRadius(view, robot) + 10, true);
  if (scene.plan) labelPlan(labels, view, scene.plan);
  return places;
}

function paintPlan(context, view, { plan, colours }) {
  context.lineCap = "round";
  for (const way of plan.ways) paintWay(context, view, way, colours);
  for (const location of plan.locations) paintLocation(context, view, location, colours);
  for (const point of plan.points.values()) paintPoint(context, view, point, colours);
}

function paintWay(context, view, way, colours) {
  const line = way.course.map(([x, y]) => view.toScreen(x, y));
  context.strokeStyle = way.locked ? colours.bad : colours.way;
  context.lineWidth = 2;
  context.setLineDash(way.locked ? [5, 5] : []);
  context.beginPath();
  context.moveTo(...line[0]);
  if (way.curved) for (let at = 1; at + 2 < line.length; at += 3) context.bezierCurveTo(...line[at], ...line[at + 1], ...line[at + 2]);
  else for (const corner of line.slice(1)) context.lineTo(...corner);
  context.stroke();
  context.setLineDash([]);
  if (way.forward !== way.backward) paintArrow(context, middle(line, way.curved), way.forward, colours.way);
}

// Where the middle of a course is, and which way it goes there.
function middle(line, curved) {
  if (curved && line.length === 4) {
    const at = (axis) => (line[0][axis] + 3 * line[1][axis] + 3 * line[2][axis] + line[3][axis]) / 8;
    const slope = (axis) => line[3][axis] + line[2][axis] - line[1][axis] - line[0][axis];
    return [at(0), at(1), Math.atan2(slope(1), slope(0))];
  }
  const half = Math.floor((line.length - 1) / 2);
  const [a, b] = [line[half], line[half + 1]];
  return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, Math.atan2(b[1] - a[1], b[0] - a[0])];
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
  for (const point of location.links) {
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(...view.toScreen(point.x, point.y));
    context.stroke();
  }
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

function labelPlan(labels, view, plan) {
  for (const each of plan.locations) {
    labels.put(each.name, view.toScreen(each.x, each.y), 18, true);
  }
  for (const each of plan.points.values()) {
    labels.put(each.name, view.toScreen(each.x, each.y), 14, false);
  }
}

function colourOf(robot, colours) {
  return colours[robot.condition.toLowerCase()];
}

// The way that the robot has still to go: the released part solid, the rest dashed.
function paintAhead(context, view, robot, at, { plan, colours }) {
  if (!robot.order?.active) return;
  context.strokeStyle = colourOf(robot, colours);
  context.lineWidth = 3;
  context.globalAlpha = 0.55;
  let from = at;
  for (const node of robot.order.ahead) {
    const place = node.x === null ? plan?.points.get(node.nodeId) : node;
    if (!place) continue;
    const to = view.toScreen(place.x, place.y);
    context.setLineDash(node.released ? [] : [4, 7]);
    context.beginPath();
    context.moveTo(...from);
    context.lineTo(...to);
    context.stroke();
    from = to;
  }
  context.setLineDash([]);
  context.globalAlpha = 1;
}

function bodyOf(view, robot) {
  const { length, width } = robot.body?.length && robot.body?.width ? robot.body : ROBOT;
  const factor = Math.max(view.scale, LEAST_ROBOT / Math.max(length, width));
  return [length * factor, width * factor];
}

function robotRadius(view, robot) {
  const [length, width] = bodyOf(view, robot);
  return Math.hypot(length, width) / 2;
}

function paintRobot(context, view, robot, [x, y], { selected, colours }) {
  const [length, width] = bodyOf(view, robot);
  const colour = colourOf(robot, colours);
  context.save();
  context.translate(x, y);
  if (robot.id === selected) paintHalo(context, robotRadius(view, robot) + 5, colours.accent);
  context.rotate(-robot.position.theta);
  context.globalAlpha = ABSENT.includes(robot.condition) || !robot.position.localized ? 0.55 : 1;
  context.beginPath();
  context.roundRect(-length / 2, -width / 2, length, width, Math.min(length, width) / 4);
  context.fillStyle = colour;
  context.fill();
  context.strokeStyle = colours.surface;
  context.lineWidth = 1.5;
  context.stroke();
  const nose = Math.min(length, width) * 0.3;
  context.beginPath();
  context.moveTo(length / 2 - nose * 0.4, 0);
  context.lineTo(length / 2 - nose * 1.6, -nose);
  context.lineTo(length / 2 - nose * 1.6, nose);
  context.closePath();
  context.fillStyle = colours.surface;
  context.fill();
  context.restore();
}

function paintHalo(context, radius, colour) {
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.strokeStyle = colour;
  context.lineWidth = 2.5;
  context.stroke();
}

// Texts that leave each other alone: each stands under or over its thing, where there is room. Where there is
// none it is left out, unless it must be seen.
class Labels {
  #taken = [];

  constructor(context, width, colours) {
    this.context = context;
    this.width = width;
    this.colours = colours;
  }

  reserve(x, y, width, height) {
    this.#taken.push([x, y, x + width, y + height]);
  }

  put(text, [middle, centre], distance, important) {
    const { context, colours } = this;
    context.font = important ? FONT : SMALL;
    const half = context.measureText(text).width / 2 + 3;
    const x = Math.max(half, Math.min(this.width - half, middle));
    const boxes = [distance, -distance].map((off) => [x - half, centre + off - 7, x + half, centre + off + 7]);
    const free = boxes.find((box) => !this.#taken.some((each) => overlap(each, box)));
    if (!free && !important) return;
    const box = free ?? boxes[0];
    this.#taken.push(box);
    const y = (box[1] + box[3]) / 2;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeStyle = colours.surface;
    context.strokeText(text, x, y);
    context.fillStyle = important ? colours.ink : colours.muted;
    context.fillText(text, x, y);
  }
}

function overlap(a, b) {
  return a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
}
