// Straight lines and Bézier curves on a canvas.

const STEPS = 12; // of a curve

/** Add a line (pixels) to the current canvas path; the pen is at its start. */
export function trace(context, line, curved) {
  if (curved && line.length >= 4) {
    for (let at = 1; at + 2 < line.length; at += 3) context.bezierCurveTo(...line[at], ...line[at + 1], ...line[at + 2]);
  } else {
    for (const corner of line.slice(1)) context.lineTo(...corner);
  }
}

/** Stroke a single line. */
export function stroke(context, line, curved) {
  context.beginPath();
  context.moveTo(...line[0]);
  trace(context, line, curved);
  context.stroke();
}

/** Return the middle of a line and its direction there, screen rad. */
export function middle(line, curved) {
  if (curved && line.length === 4) {
    const at = (axis) => (line[0][axis] + 3 * line[1][axis] + 3 * line[2][axis] + line[3][axis]) / 8;
    const slope = (axis) => line[3][axis] + line[2][axis] - line[1][axis] - line[0][axis];
    return [at(0), at(1), Math.atan2(slope(1), slope(0))];
  }
  const half = Math.floor((line.length - 1) / 2);
  const [a, b] = [line[half], line[half + 1]];
  return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, Math.atan2(b[1] - a[1], b[0] - a[0])];
}

/** Return a Bézier curve as a line through points of it. */
export function flattened({ line, curved }) {
  if (!curved || line.length < 4) return line;
  const points = [line[0]];
  for (let at = 0; at + 3 < line.length; at += 3) {
    for (let step = 1; step <= STEPS; step += 1) points.push(onCurve(line.slice(at, at + 4), step / STEPS));
  }
  return points;
}

function onCurve([a, b, c, d], at) {
  const left = 1 - at;
  return [0, 1].map((axis) => left ** 3 * a[axis] + 3 * left ** 2 * at * b[axis] + 3 * left * at ** 2 * c[axis] + at ** 3 * d[axis]);
}

/** Return how far a place is from a line. */
export function distanceToLine(place, line) {
  return Math.min(...line.slice(1).map((end, at) => distanceToSegment(place, line[at], end)));
}

function distanceToSegment([x, y], [ax, ay], [bx, by]) {
  const square = (bx - ax) ** 2 + (by - ay) ** 2;
  const share = square ? Math.max(0, Math.min(1, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / square)) : 0;
  return Math.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay));
}
