// From the plant model as it is published (millimetres) to what is drawn (metres).

const MM = 1000;

/** Make the drawing of a plant: points, ways (both directions of a connection are one), locations, blocks. */
export function drawPlan(plant) {
  const points = new Map(
    plant.points.map((each) => [
      each.name,
      { name: each.name, x: each.xMm / MM, y: each.yMm / MM, parking: each.type === "PARK_POSITION" },
    ]),
  );
  const courses = new Map(plant.paths.flatMap((path) => courseOf(path, points)));
  return {
    name: plant.name,
    points,
    ways: ways(plant.paths, courses),
    locations: plant.locations.map((each) => location(each, points)),
    blocks: plant.blocks.map((each) => block(each, points, courses)),
    between: between(plant.paths, courses),
  };
}

// Name of a path, and the line that it takes.
function courseOf(path, points) {
  const [from, to] = [points.get(path.source), points.get(path.destination)];
  if (!from || !to) return [];
  const corners = path.layout.controlPoints.map((each) => [each.xMm / MM, each.yMm / MM]);
  const curved = ["BEZIER", "BEZIER_3"].includes(path.layout.connectionType);
  return [[path.name, { line: [[from.x, from.y], ...corners, [to.x, to.y]], curved }]];
}

function ways(paths, courses) {
  const found = new Map();
  for (const path of paths) {
    const course = courses.get(path.name);
    if (!course) continue;
    const opposite = found.get(`${path.destination} ${path.source}`);
    if (opposite && course.line.length === 2 && opposite.line.length === 2) {
      opposite.forward ||= path.maxReverseVelocityMmS > 0;
      opposite.backward ||= path.maxVelocityMmS > 0;
      opposite.locked &&= path.locked;
    } else {
      found.set(`${path.source} ${path.destination}`, {
        ...course,
        forward: path.maxVelocityMmS > 0,
        backward: path.maxReverseVelocityMmS > 0,
        locked: path.locked,
      });
    }
  }
  return [...found.values()];
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

function block(each, points, courses) {
  const corners = each.members.map((name) => points.get(name)).filter(Boolean);
  const lines = each.members.map((name) => courses.get(name)).filter(Boolean);
  const places = [...corners.map(({ x, y }) => [x, y]), ...lines.flatMap(({ line }) => [line[0], line.at(-1)])];
  const mean = (axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length;
  return { name: each.name, colour: each.color, corners, lines, x: mean(0), y: mean(1), empty: !places.length };
}

// The line from one point to its neighbour, whichever way the path was drawn.
function between(paths, courses) {
  const found = new Map();
  for (const path of paths) {
    const course = courses.get(path.name);
    if (!course) continue;
    if (path.maxVelocityMmS > 0) found.set(`${path.source} ${path.destination}`, course);
    if (path.maxReverseVelocityMmS > 0) {
      found.set(`${path.destination} ${path.source}`, { ...course, line: [...course.line].reverse() });
    }
  }
  return found;
}

/** Give `[left, bottom, right, top]` of everything that has a place; null if nothing has. */
export function extent(places) {
  const all = [...places];
  if (!all.length) return null;
  const xs = all.map((each) => each.x);
  const ys = all.map((each) => each.y);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}
