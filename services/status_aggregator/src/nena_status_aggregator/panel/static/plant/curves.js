// The shape of paths: straight, or with control points. Places are in mm. No DOM.

import { flattened } from "../map/lines.js";

const CURVES = ["BEZIER", "BEZIER_3"];
const KNOTS = [0, 0, 0, 0, 1, 1, 1, 1]; // with them, a trajectory of degree 3 is a Bézier curve
const MM = 1000;

/** Return the line of a path, with both ends, and whether it is a curve; `points` by name. */
export function lineOf({ source, destination, layout }, points) {
  const corners = (layout?.controlPoints ?? []).map(({ xMm, yMm }) => [xMm, yMm]);
  const [from, to] = [points.get(source), points.get(destination)].map((point) => [point?.xMm ?? 0, point?.yMm ?? 0]);
  return { line: [from, ...corners, to], curved: CURVES.includes(layout?.connectionType) };
}

/** Return the length of a path as it is drawn. */
export function drawnLength(path, points) {
  const places = flattened(lineOf(path, points));
  return places.slice(1).reduce((sum, [x, y], at) => sum + Math.hypot(x - places[at][0], y - places[at][1]), 0);
}

/** Return the control points of a curve that still is straight. */
export function straightCurve(path, points) {
  const { line } = lineOf({ ...path, layout: null }, points);
  return [1, 2].map((third) => ({ xMm: line[0][0] + ((line[1][0] - line[0][0]) * third) / 3, yMm: line[0][1] + ((line[1][1] - line[0][1]) * third) / 3 }));
}

/** Return a path with other control points (none: straight). A length that was set by hand keeps its ratio to what is drawn. */
export function reshaped(path, points, controlPoints) {
  const drawn = controlPoints.length ? (path.layout?.controlPoints?.length ? path.layout.connectionType : "BEZIER") : "DIRECT";
  const made = { ...path, layout: { ...path.layout, connectionType: drawn, controlPoints } };
  const lengthMm = Math.max(1, Math.round((path.lengthMm * drawnLength(made, points)) / (drawnLength(path, points) || 1)));
  return traced({ ...made, lengthMm }, points, () => true);
}

/** Move a control point of the first path, and the same one of its way back. */
export function bend(model, names, index, [xMm, yMm]) {
  const points = new Map(model.points.map((each) => [each.name, each]));
  const moved = (path) => {
    const { controlPoints } = path.layout;
    const wanted = path.name === names[0] ? index : controlPoints.length - 1 - index;
    return reshaped(path, points, controlPoints.map((each, at) => (at === wanted ? { xMm, yMm } : each)));
  };
  return { ...model, paths: model.paths.map((path) => (names.includes(path.name) ? moved(path) : path)) };
}

/** Let the trajectories of vehicle types, those that `wanted` names, follow the drawn curve; others are left out: they would lead elsewhere. */
export function traced(path, points, wanted) {
  if (!path.vehicleTypes) return path;
  const { line, curved } = lineOf(path, points);
  const drawn = curved && line.length === 4 && { trajectory: { degree: 3, knotVector: KNOTS, controlPoints: line.map(([x, y]) => ({ x: x / MM, y: y / MM })) } };
  const vehicleTypes = path.vehicleTypes.map(({ trajectory, ...kept }) => ({ ...kept, ...(wanted(trajectory) && drawn) }));
  return { ...path, vehicleTypes };
}

/** Return two curves, each with its control points, into which a point at this share of a curve of four places cuts it. */
export function halves([a, b, c, d], share) {
  const between = (from, to) => [0, 1].map((axis) => from[axis] + (to[axis] - from[axis]) * share);
  const [ab, bc, cd] = [between(a, b), between(b, c), between(c, d)];
  return [[ab, between(ab, bc)], [between(bc, cd), cd]];
}
