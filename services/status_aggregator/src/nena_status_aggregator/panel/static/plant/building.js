// Larger changes of a plant model: blocks, rows of stations, joined points, directions, doors. Each returns a new model. No DOM.

import { add, align, apart, change, connect, find, freshName, remove, rename, split } from "./model.js";

const NEAR = 300; // mm, a point that serves a station although it is not exactly beside it

/** Return the members of a block of these objects: with the paths between selected points. */
export function blockOf(model, names) {
  const chosen = new Set(names);
  const between = (model.paths ?? []).filter(({ source, destination }) => chosen.has(source) && chosen.has(destination));
  return [...new Set([...names, ...between.map(({ name }) => name)])];
}

/** Return places between two places at a distance from each other, beginning with the first. */
export function placesAlong([ax, ay], [bx, by], distance) {
  const length = Math.hypot(bx - ax, by - ay);
  const count = Math.floor(length / distance + 1e-6) + 1;
  return Array.from({ length: count }, (_, at) => (at ? [ax + ((bx - ax) * at * distance) / length, ay + ((by - ay) * at * distance) / length] : [ax, ay]));
}

/** Return the middle places beside a straight path at a distance from each other, `beside` to its left; mm. */
export function placesBeside(model, path, count, distance, beside) {
  const [a, b] = [find(model, path.source).thing, find(model, path.destination).thing];
  const length = apart(a, b) || 1;
  const [dx, dy] = [(b.xMm - a.xMm) / length, (b.yMm - a.yMm) / length];
  const first = (length - (count - 1) * distance) / 2;
  return Array.from({ length: count }, (_, at) => first + at * distance).map((along) => [a.xMm + dx * along - dy * beside, a.yMm + dy * along + dx * beside]);
}

/** Add a location of a type at each place (mm), and let the point beside it serve it: one within `reach`, or one that splits the path there. */
export function stationRow(model, places, { type, prefix }, reach) {
  const [first, last] = [places[0], places.at(-1)];
  const along = [last[0] - first[0], last[1] - first[1]];
  return places.reduce((made, place) => {
    const [xMm, yMm] = place.map(Math.round);
    const name = freshName(made, prefix);
    const [served, point] = pointBeside(made, { xMm, yMm }, along, reach);
    const stationed = add(served, "locations", { name, type, xMm, yMm });
    return point ? connect(stationed, name, point, false) : stationed;
  }, model);
}

// The model with a point beside a place of a row, and its name; null: neither path nor point is in reach. What lies in the row is not beside it.
function pointBeside(model, at, [dx, dy], reach) {
  const points = new Map((model.points ?? []).map((each) => [each.name, each]));
  const straight = (model.paths ?? []).filter(({ source, destination, layout }) => points.has(source) && points.has(destination) && !layout?.controlPoints?.length);
  const places = [
    ...straight.map(({ source, destination }) => ({ ends: [points.get(source), points.get(destination)] })).map(({ ends }) => ({ ends, foot: footOn(ends, at) })),
    ...[...points.values()].map((point) => ({ ends: [point], foot: point })),
  ];
  const away = ({ foot }) => apart(foot, at);
  const isBeside = ({ foot }) => Math.abs((foot.xMm - at.xMm) * dx + (foot.yMm - at.yMm) * dy) <= (away({ foot }) * Math.hypot(dx, dy)) / 2;
  const best = places.filter((each) => away(each) <= reach && isBeside(each)).reduce((least, each) => (least && away(least) <= away(each) ? least : each), null);
  if (!best) return [model, null];
  const near = best.ends.find((each) => apart(each, best.foot) <= NEAR);
  if (near) return [model, near.name];
  const ends = new Set(best.ends.map(({ name }) => name));
  const names = straight.filter(({ source, destination }) => ends.has(source) && ends.has(destination)).map(({ name }) => name);
  const point = { name: freshName(model, "P"), ...best.foot };
  return [split(model, names, point), point.name];
}

// The place of the line between two points that is nearest to a place.
function footOn([a, b], { xMm, yMm }) {
  const square = apart(a, b) ** 2;
  const share = square ? ((xMm - a.xMm) * (b.xMm - a.xMm) + (yMm - a.yMm) * (b.yMm - a.yMm)) / square : 0;
  const along = Math.max(0, Math.min(1, share));
  return { xMm: Math.round(a.xMm + along * (b.xMm - a.xMm)), yMm: Math.round(a.yMm + along * (b.yMm - a.yMm)) };
}

/** Join points at the place of the first one; or the paths through a single point, which is removed. */
export function join(model, names) {
  const points = names.filter((name) => find(model, name)?.kind === "point");
  return points.length > 1 ? merged(model, points) : points.length ? joinedAt(model, points[0]) : model;
}

function merged(model, [kept, ...others]) {
  const all = new Set([kept, ...others]);
  const aligned = align(align(model, all, "xMm"), all, "yMm");
  const made = others.reduce((sofar, name) => rename(sofar, "points", name, kept), aligned);
  const ways = new Set();
  const isFirst = ({ source, destination }) => source !== destination && ((source !== kept && destination !== kept) || ways.size < ways.add(`${source}\n${destination}`).size);
  const paths = made.paths.filter(isFirst);
  const gone = new Set(made.paths.map(({ name }) => name));
  for (const { name } of paths) gone.delete(name);
  const links = (each) => each.links.filter(({ point }, at) => each.links.findIndex((link) => link.point === point) === at);
  const locations = made.locations.map((each) => (each.links ? { ...each, links: links(each) } : each));
  const blocks = made.blocks.map((block) => ({ ...block, members: [...new Set(block.members)].filter((each) => !gone.has(each)) }));
  return { ...made, points: aligned.points.filter(({ name }) => name === kept || !all.has(name)), paths, locations, blocks };
}

// The slower of two parts, and closed if one of them is, is the whole.
function joinedAt(model, name) {
  const at = (model.paths ?? []).filter(({ source, destination }) => source === name || destination === name);
  const neighbours = new Set(at.flatMap(({ source, destination }) => [source, destination]).filter((each) => each !== name));
  if (neighbours.size !== 2) return model;
  const [a, b] = neighbours;
  const made = [[a, b], [b, a]].reduce((sofar, [from, to]) => {
    const [first, second] = [at.find(({ source }) => source === from), at.find(({ destination }) => destination === to)];
    if (!first || !second) return sofar;
    const connected = connect(sofar, from, to, false);
    if (connected === sofar) return sofar;
    const whole = connected.paths.at(-1).name;
    const least = (field, initial) => Math.min(first[field] ?? initial, second[field] ?? initial);
    const fields = {
      lengthMm: first.lengthMm + second.lengthMm,
      maxVelocityMmS: least("maxVelocityMmS", 1000),
      maxReverseVelocityMmS: least("maxReverseVelocityMmS", 0),
      locked: Boolean(first.locked || second.locked),
      properties: first.properties ?? {},
      peripheralOperations: [...(first.peripheralOperations ?? []), ...(second.peripheralOperations ?? [])],
      ...(first.vehicleTypes && { vehicleTypes: first.vehicleTypes.map(({ trajectory, ...kept }) => kept) }), // it is straight
    };
    const inside = ({ members = [] }) => (members.includes(first.name) || members.includes(second.name) ? [whole] : []);
    const blocks = (connected.blocks ?? []).map((block) => ({ ...block, members: [...(block.members ?? []), ...inside(block)] }));
    return { ...change(connected, "paths", [whole], fields), blocks };
  }, model);
  return made === model ? model : remove(made, [name]);
}

/** Add the way back of paths that have none: of the same shape, length and speed, in their blocks, through their doors. */
export function withWayBack(model, names) {
  return names.reduce((made, name) => {
    const { source, destination, lengthMm, maxVelocityMmS, locked, layout, peripheralOperations } = find(made, name).thing;
    const connected = connect(made, destination, source, false);
    const shape = layout?.controlPoints && { layout: { ...layout, controlPoints: [...layout.controlPoints].reverse() } };
    if (connected === made) return made;
    const back = connected.paths.at(-1).name;
    const inBlocks = (connected.blocks ?? []).map((block) => (block.members?.includes(name) ? { ...block, members: [...block.members, back] } : block));
    return { ...change(connected, "paths", [back], { lengthMm, maxVelocityMmS, locked, peripheralOperations, ...shape }), blocks: inBlocks };
  }, model);
}

/** Turn the paths between two points: one way, both ways, the other way. */
export function turn(model, names) {
  const [path, opposite] = names.map((name) => find(model, name).thing);
  if (opposite) return remove(model, [path.name]);
  return path.maxReverseVelocityMmS ? change(model, "paths", names, { maxReverseVelocityMmS: 0 }) : withWayBack(model, names);
}

/** Return the locations that are doors or other devices. */
export function devices(model) {
  const types = new Set((model.locationTypes ?? []).filter(({ allowedPeripheralOperations }) => allowedPeripheralOperations?.length).map(({ name }) => name));
  return (model.locations ?? []).filter(({ type }) => types.has(type));
}

/** Let a door open before robots enter these paths, and close behind them; without a name, nothing opens. Another device: its first and second operation. */
export function withDoor(model, names, location) {
  const { thing } = find(model, location) ?? {};
  const [open, close] = (thing && model.locationTypes.find(({ name }) => name === thing.type)?.allowedPeripheralOperations) ?? [];
  const peripheralOperations = [
    ...(open ? [{ name: open, location, executionTrigger: "AFTER_ALLOCATION", completionRequired: true }] : []),
    ...(close ? [{ name: close, location, executionTrigger: "AFTER_MOVEMENT", completionRequired: false }] : []),
  ];
  return change(model, "paths", names, { peripheralOperations });
}
