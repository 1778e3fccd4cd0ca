// Changes of a plant model (NeNa's JSON, mm): each returns a new model, which shares what stays the same. No DOM.

import { flattened } from "../map/lines.js";
import { drawnLength, halves, lineOf, traced } from "./curves.js";

const LISTS = ["points", "paths", "locations"];
const SPEED = 1000; // mm/s

/** All versions of a model since it was opened: undo and redo without limit. */
export class History {
  past = [];
  future = [];

  constructor(present) {
    this.present = present;
  }

  /** Go on with another model; returns whether it is another one. */
  push(model) {
    if (model === this.present) return false;
    this.past.push(this.present);
    this.future = [];
    this.present = model;
    return true;
  }

  /** Return to the model before; returns whether there is one. */
  undo() {
    return this.#go(this.past, this.future);
  }

  /** Take back an undo; returns whether there was one. */
  redo() {
    return this.#go(this.future, this.past);
  }

  #go(from, to) {
    if (!from.length) return false;
    to.push(this.present);
    this.present = from.pop();
    return true;
  }
}

/** Return the kind (`point`, `path`, `location`) and the object of a name; null: there is none. */
export function find(model, name) {
  for (const list of LISTS) {
    const thing = (model[list] ?? []).find((each) => each.name === name);
    if (thing) return { kind: list.slice(0, -1), thing };
  }
  return null;
}

/** Return the first free name that begins with a prefix, such as `P12`. */
export function freshName(model, prefix) {
  const taken = new Set(["points", "paths", "locations", "locationTypes", "blocks", "vehicles"].flatMap((list) => (model[list] ?? []).map((each) => each.name)));
  for (let number = 1; ; number += 1) if (!taken.has(prefix + number)) return prefix + number;
}

/** Add an object to a list. */
export function add(model, list, thing) {
  return { ...model, [list]: [...(model[list] ?? []), thing] };
}

/** Move points and locations by a distance, mm. */
export function move(model, names, dx, dy) {
  if (!dx && !dy) return model;
  return place(model, (each) => (names.has(each.name) ? [(each.xMm ?? 0) + dx, (each.yMm ?? 0) + dy] : null));
}

/** Give points and locations one coordinate, that of the first name: `axis` is `xMm` or `yMm`. */
export function align(model, names, axis) {
  const [first] = placed(model, names);
  const at = first?.[axis] ?? 0;
  return place(model, (each) => (names.has(each.name) ? with_(each, axis, at) : null));
}

/** Spread points and locations evenly between the outermost ones. */
export function distribute(model, names, axis) {
  const all = placed(model, names).sort((a, b) => (a[axis] ?? 0) - (b[axis] ?? 0));
  if (all.length < 3) return model;
  const [least, most] = [all[0][axis] ?? 0, all.at(-1)[axis] ?? 0];
  const wanted = new Map(all.map((each, at) => [each.name, least + ((most - least) * at) / (all.length - 1)]));
  return place(model, (each) => (wanted.has(each.name) ? with_(each, axis, wanted.get(each.name)) : null));
}

/** Put one object at coordinates, mm. */
export function put(model, name, x, y) {
  return place(model, (each) => (each.name === name ? [x, y] : null));
}

/** Turn and move everything so that two places (m) come to two others; returns the model, and how much farther apart these are, m. */
export function turned(model, [a, b], [p, q]) {
  const angle = Math.atan2(q[1] - p[1], q[0] - p[0]) - Math.atan2(b[1] - a[1], b[0] - a[0]);
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  const spin = (x, y) => [cos * x - sin * y, sin * x + cos * y];
  const middle = spin((a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
  const by = [0, 1].map((axis) => 1000 * ((p[axis] + q[axis]) / 2 - middle[axis]));
  const to = (each) => spin(each.xMm ?? 0, each.yMm ?? 0).map((value, axis) => Math.round(value + by[axis]));
  const corner = (each) => Object.fromEntries(to(each).map((value, axis) => [["xMm", "yMm"][axis], value]));
  const degrees = (angle * 180) / Math.PI;
  const heading = ({ orientationDeg }) => (orientationDeg === undefined || orientationDeg === null ? {} : { orientationDeg: Math.round(((((orientationDeg + degrees + 180) % 360) + 360) % 360) - 180) });
  const curves = new Map((model.paths ?? []).map((path) => [path.name, path.layout?.controlPoints?.map(corner)]));
  const made = place({ ...model, points: (model.points ?? []).map((each) => ({ ...each, ...heading(each) })) }, to);
  const paths = made.paths.map((path) => (curves.get(path.name) ? { ...path, layout: { ...path.layout, controlPoints: curves.get(path.name) } } : path));
  return { model: { ...made, paths }, error: Math.abs(Math.hypot(q[0] - p[0], q[1] - p[1]) - Math.hypot(b[0] - a[0], b[1] - a[1])) };
}

function placed(model, names) {
  const all = new Map([...(model.points ?? []), ...(model.locations ?? [])].map((each) => [each.name, each]));
  return [...names].map((name) => all.get(name)).filter(Boolean);
}

function with_(each, axis, value) {
  return axis === "xMm" ? [value, each.yMm ?? 0] : [each.xMm ?? 0, value];
}

// Put points and locations where `where` says (null: as they are), and adapt the paths at them.
function place(model, where) {
  const shifts = new Map();
  const shifted = (each) => {
    const at = where(each);
    if (!at) return each;
    const [x, y] = at.map(Math.round);
    shifts.set(each.name, [x - (each.xMm ?? 0), y - (each.yMm ?? 0)]);
    const drawn = each.layout?.position;
    const [dx, dy] = shifts.get(each.name);
    const layout = drawn && { layout: { ...each.layout, position: { xMm: drawn.xMm + dx, yMm: drawn.yMm + dy } } };
    return { ...each, xMm: x, yMm: y, ...layout };
  };
  const points = (model.points ?? []).map(shifted);
  const locations = (model.locations ?? []).map(shifted);
  const [before, after] = [byName(model.points), byName(points)];
  const paths = (model.paths ?? []).map((path) => {
    const ends = [shifts.get(path.source), shifts.get(path.destination)];
    return ends[0] || ends[1] ? adapted(path, ends, before, after) : path;
  });
  return { ...model, points, locations, paths };
}

// A length that was set by hand keeps its ratio to what is drawn; the control points go with the nearer end.
function adapted(path, ends, before, after) {
  const [from, to] = ends.map((shift) => shift ?? [0, 0]);
  const corners = path.layout?.controlPoints ?? [];
  const share = (at) => (corners.length > 1 ? at / (corners.length - 1) : 0.5);
  const shift = (at, axis) => from[axis] + (to[axis] - from[axis]) * share(at);
  const controlPoints = corners.map((each, at) => ({ xMm: each.xMm + shift(at, 0), yMm: each.yMm + shift(at, 1) }));
  const moved = corners.length ? { ...path, layout: { ...path.layout, controlPoints } } : path;
  const [old, now] = [drawnLength(path, before), drawnLength(moved, after)];
  return traced({ ...moved, lengthMm: Math.max(1, Math.round(old ? (path.lengthMm * now) / old : now)) }, after, Boolean);
}

function byName(things) {
  return new Map((things ?? []).map((each) => [each.name, each]));
}

/** Return the distance of two objects, mm; 0 without one of them. */
export function apart(a, b) {
  return a && b ? Math.hypot((a.xMm ?? 0) - (b.xMm ?? 0), (a.yMm ?? 0) - (b.yMm ?? 0)) : 0;
}

/** Connect two points by a path, or by two for both directions; or a location and a point by a link. */
export function connect(model, from, to, twoWay) {
  const [a, b] = [find(model, from), find(model, to)];
  if (from === to || !a || !b) return model;
  if (a.kind === "location" && b.kind === "point") return link(model, from, to);
  if (a.kind === "point" && b.kind === "location") return link(model, to, from);
  if (a.kind !== "point" || b.kind !== "point") return model;
  const lengthMm = Math.max(1, Math.round(apart(a.thing, b.thing)));
  const ways = twoWay ? [[from, to], [to, from]] : [[from, to]];
  return ways.reduce((made, [source, destination]) => {
    if ((made.paths ?? []).some((each) => each.source === source && each.destination === destination)) return made;
    const name = find(made, pathName(source, destination)) ? freshName(made, `${pathName(source, destination)} `) : pathName(source, destination);
    return add(made, "paths", { name, source, destination, lengthMm, maxVelocityMmS: SPEED });
  }, model);
}

function pathName(source, destination) {
  return `${source} --- ${destination}`;
}

function link(model, location, point) {
  return change(model, "locations", [location], (each) => {
    const links = each.links ?? [];
    return links.some((known) => known.point === point) ? {} : { links: [...links, { point }] };
  });
}

/** Change the named objects of a list; `fields`: new values, or a function that returns them. */
export function change(model, list, names, fields) {
  const wanted = new Set(names);
  const changed = (each) => (wanted.has(each.name) ? { ...each, ...(typeof fields === "function" ? fields(each) : fields) } : each);
  return { ...model, [list]: (model[list] ?? []).map(changed) };
}

/** Rename an object, also where others name it; a path that is named after its ends follows them. */
export function rename(model, list, old, name) {
  if (!name || name === old) return model;
  const to = (each) => (each === old ? name : each);
  const made = change(model, list, [old], { name });
  if (list === "locationTypes") return { ...made, locations: (made.locations ?? []).map((each) => ({ ...each, type: to(each.type) })) };
  const renamed = new Map([[old, name]]);
  const paths = (made.paths ?? []).map((path) => {
    const [source, destination] = list === "points" ? [to(path.source), to(path.destination)] : [path.source, path.destination];
    const own = path.name === pathName(path.source, path.destination) ? pathName(source, destination) : path.name;
    if (own !== path.name) renamed.set(path.name, own);
    const peripheralOperations = path.peripheralOperations?.map((each) => (list === "locations" ? { ...each, location: to(each.location) } : each));
    return { ...path, name: own, source, destination, ...(peripheralOperations && { peripheralOperations }) };
  });
  const locations = (made.locations ?? []).map((each) => (list === "points" && each.links ? { ...each, links: each.links.map((one) => ({ ...one, point: to(one.point) })) } : each));
  const blocks = (made.blocks ?? []).map((each) => ({ ...each, members: (each.members ?? []).map((member) => renamed.get(member) ?? member) }));
  return { ...made, paths, locations, blocks };
}

/** Remove objects, with the paths and links at them. */
export function remove(model, names) {
  const gone = new Set(names);
  for (const path of model.paths ?? []) if (gone.has(path.source) || gone.has(path.destination)) gone.add(path.name);
  const rest = (list) => (model[list] ?? []).filter((each) => !gone.has(each.name));
  const doors = (path) => (path.peripheralOperations ? { ...path, peripheralOperations: path.peripheralOperations.filter((each) => !gone.has(each.location)) } : path);
  const linked = (each) => (each.links ? { ...each, links: each.links.filter(({ point }) => !gone.has(point)) } : each);
  const blocks = (model.blocks ?? []).map((each) => ({ ...each, members: (each.members ?? []).filter((member) => !gone.has(member)) }));
  return { ...model, points: rest("points"), paths: rest("paths").map(doors), locations: rest("locations").map(linked), blocks: blocks.filter(({ members }, at) => members.length || !model.blocks[at].members?.length) };
}

/** Insert a point into paths: each becomes two, in the blocks of the path; a curve becomes two curves. */
export function split(model, names, point) {
  const points = byName([...(model.points ?? []), point]);
  return names.reduce((made, name) => {
    const whole = find(made, name).thing;
    const { layout, peripheralOperations = [], ...path } = whole;
    const [from, to] = [points.get(path.source), points.get(path.destination)];
    const ratio = path.lengthMm / (drawnLength(whole, points) || 1);
    const { line, curved } = lineOf(whole, points);
    const curves = curved && line.length === 4 ? halves(line, shareAt(line, point)) : [];
    const part = (a, b, operations, at) => {
      const shape = curves.length && { layout: { ...layout, controlPoints: curves[at].map(([xMm, yMm]) => ({ xMm, yMm })) } };
      const drawn = { ...path, name: pathName(a.name, b.name), source: a.name, destination: b.name, peripheralOperations: operations, ...shape };
      return traced({ ...drawn, lengthMm: Math.max(1, Math.round(ratio * drawnLength(drawn, points))) }, points, Boolean);
    };
    const atEnd = ({ executionTrigger }) => executionTrigger === "AFTER_MOVEMENT";
    const parts = [part(from, point, peripheralOperations.filter((each) => !atEnd(each)), 0), part(point, to, peripheralOperations.filter(atEnd), 1)];
    const paths = made.paths.flatMap((each) => (each.name === name ? parts : [each]));
    const inside = (member) => (member === name ? [parts[0].name, point.name, parts[1].name] : [member]);
    const blocks = (made.blocks ?? []).map((each) => ({ ...each, members: [...new Set((each.members ?? []).flatMap(inside))] }));
    return { ...made, paths, blocks };
  }, add(model, "points", point));
}

// The share of a curve at which it is nearest to a point.
function shareAt(line, { xMm, yMm }) {
  const places = flattened({ line, curved: true });
  const away = ([x, y]) => Math.hypot(x - xMm, y - yMm);
  const nearest = places.reduce((least, each, at) => (away(each) < away(places[least]) ? at : least), 0);
  return nearest / (places.length - 1);
}

/** Round to a multiple of a grid, mm; 0: to whole mm. */
export function snapped(value, grid) {
  return grid ? Math.round(value / grid) * grid : Math.round(value);
}
