// A plant model as it is drawn (m), and what is at a place of it. No DOM.

import { distanceToLine, flattened } from "../map/lines.js";
import { devices } from "./building.js";

const MM = 1000;
const NEAR = 11; // px
const NEAR_LINE = 7; // px

/** Return what to draw: points and locations by name, and lines, one for both directions of a way. */
export function makeScene(model) {
  const points = new Map((model.points ?? []).map((thing) => [thing.name, { name: thing.name, x: thing.xMm / MM, y: thing.yMm / MM, parking: thing.type === "PARK_POSITION", heading: thing.orientationDeg ?? null }]));
  const charging = new Set((model.locationTypes ?? []).filter((type) => (type.allowedOperations ?? []).includes("Charge")).map(({ name }) => name));
  const device = new Set(devices(model).map(({ name }) => name));
  const locations = new Map((model.locations ?? []).map((thing) => {
    const { xMm = 0, yMm = 0 } = thing.layout?.position ?? thing;
    return [thing.name, { name: thing.name, x: xMm / MM, y: yMm / MM, charging: charging.has(thing.type), device: device.has(thing.name), doors: new Set(), links: (thing.links ?? []).map(({ point }) => points.get(point)).filter(Boolean) }];
  }));
  const lines = new Map();
  for (const path of model.paths ?? []) {
    const [from, to] = [points.get(path.source), points.get(path.destination)];
    if (!from || !to) continue;
    const corners = (path.layout?.controlPoints ?? []).map((each) => [each.xMm / MM, each.yMm / MM]);
    const [forward, backward] = [(path.maxVelocityMmS ?? 1000) > 0, (path.maxReverseVelocityMmS ?? 0) > 0];
    const opposite = lines.get([path.destination, path.source, ...[...corners].reverse()].join(" "));
    if (opposite) {
      opposite.names.push(path.name);
      opposite.forward ||= backward;
      opposite.backward ||= forward;
      opposite.locked ||= Boolean(path.locked);
    } else {
      const curved = ["BEZIER", "BEZIER_3"].includes(path.layout?.connectionType);
      lines.set([path.source, path.destination, ...corners].join(" "), { names: [path.name], from, to, corners, curved, forward, backward, locked: Boolean(path.locked) });
    }
  }
  for (const path of model.paths ?? []) {
    for (const { location } of path.peripheralOperations ?? []) locations.get(location)?.doors.add(path.name);
  }
  const named = new Map([...lines.values()].flatMap((line) => line.names.map((name) => [name, line])));
  for (const each of locations.values()) each.doors = [...new Set([...each.doors].map((name) => named.get(name)).filter(Boolean))];
  const blocks = (model.blocks ?? []).map(({ name, color, members = [] }) => {
    const pick = (things) => members.map((each) => things.get(each)).filter(Boolean);
    return { name, colour: color, corners: [...pick(points), ...pick(locations)], lines: [...new Set(pick(named))] };
  });
  return { points, locations, lines: [...lines.values()], blocks };
}

/** Return two scenes: without and with only the named points and locations, and what is at them. */
export function parted(scene, names) {
  const touched = ({ from, to }) => names.has(from.name) || names.has(to.name);
  const linked = (each) => names.has(each.name) || each.links.some(({ name }) => names.has(name)) || each.doors.some(touched);
  const held = ({ corners, lines }) => corners.some(({ name }) => names.has(name)) || lines.some(touched);
  const part = (wanted) => ({
    blocks: scene.blocks.filter((block) => held(block) === wanted),
    points: new Map([...scene.points].filter(([name]) => names.has(name) === wanted)),
    locations: new Map([...scene.locations].filter(([, each]) => linked(each) === wanted)),
    lines: scene.lines.filter((line) => touched(line) === wanted),
  });
  return [part(false), part(true)];
}

/** Return the places of a line, with both ends, m. */
export function placesOf({ from, to, corners }) {
  return [[from.x, from.y], ...corners, [to.x, to.y]];
}

/** Return two scenes: without and with only a line. */
export function partedLine(scene, line) {
  const others = scene.lines.filter((each) => each !== line);
  return [{ ...scene, lines: others }, { points: new Map(), locations: new Map(), blocks: [], lines: [line] }];
}

/** Return the names of what is at a place of the screen: a point, a location, or the paths of a line; empty: nothing. */
export function hit(scene, view, [px, py]) {
  let [found, least] = [null, NEAR];
  for (const things of [scene.points, scene.locations]) {
    for (const each of things.values()) {
      const [x, y] = view.toScreen(each.x, each.y);
      const away = Math.hypot(x - px, y - py);
      if (away <= least) [found, least] = [[each.name], away];
    }
  }
  if (found) return found;
  least = NEAR_LINE;
  for (const line of scene.lines) {
    const away = distanceToLine([px, py], flattened({ line: placesOf(line).map(([x, y]) => view.toScreen(x, y)), curved: line.curved }));
    if (away < least) [found, least] = [line.names, away];
  }
  return found ?? [];
}

/** Return the names of the points and locations in a rectangle (m), given by two corners. */
export function inside(scene, [ax, ay], [bx, by]) {
  const within = ({ x, y }) => x >= Math.min(ax, bx) && x <= Math.max(ax, bx) && y >= Math.min(ay, by) && y <= Math.max(ay, by);
  return [...scene.points.values(), ...scene.locations.values()].filter(within).map(({ name }) => name);
}
