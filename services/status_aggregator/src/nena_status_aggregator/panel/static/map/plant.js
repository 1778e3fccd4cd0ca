// From the plant model as it is published (millimetres) to what is drawn (metres).

const MM = 1000;

/** Make the drawing of a plant: points, ways (both directions of a connection are one), locations. */
export function drawPlan(plant) {
  const points = new Map(
    plant.points.map((each) => [
      each.name,
      { name: each.name, x: each.xMm / MM, y: each.yMm / MM, parking: each.type === "PARK_POSITION" },
    ]),
  );
  return { points, ways: ways(plant.paths, points), locations: plant.locations.map((each) => location(each, points)) };
}

function ways(paths, points) {
  const found = new Map();
  for (const path of paths) {
    const [from, to] = [points.get(path.source), points.get(path.destination)];
    if (!from || !to) continue;
    const opposite = found.get(`${path.destination} ${path.source}`);
    if (opposite && straight(path) && straight(opposite.path)) {
      opposite.forward ||= path.maxReverseVelocityMmS > 0;
      opposite.backward ||= path.maxVelocityMmS > 0;
      opposite.locked &&= path.locked;
    } else {
      found.set(`${path.source} ${path.destination}`, {
        path,
        course: course(path, from, to),
        curved: ["BEZIER", "BEZIER_3"].includes(path.layout.connectionType),
        forward: path.maxVelocityMmS > 0,
        backward: path.maxReverseVelocityMmS > 0,
        locked: path.locked,
      });
    }
  }
  return [...found.values()];
}

function straight(path) {
  return path.layout.controlPoints.length === 0;
}

function course(path, from, to) {
  const between = path.layout.controlPoints.map((each) => [each.xMm / MM, each.yMm / MM]);
  return [[from.x, from.y], ...between, [to.x, to.y]];
}

function location(each, points) {
  const place = each.layout.position ?? each;
  return {
    name: each.name,
    x: place.xMm / MM,
    y: place.yMm / MM,
    locked: each.locked,
    links: each.links.map((link) => points.get(link.point)).filter(Boolean),
  };
}

/** Give `[left, bottom, right, top]` of everything that has a place; null if nothing has. */
export function extent(places) {
  const all = [...places];
  if (!all.length) return null;
  const xs = all.map((each) => each.x);
  const ys = all.map((each) => each.y);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}
