// The signs at the robots on the map: of conditions, as on the chips of the lists (style.css), and of loads.

/** Size of a badge, px. */
export const BADGE = 14;

// BUSY and IDLE have none: a robot with an order has a route, one without has none.
const SIGNS = { WAITING: "…", CHARGING: "+", BLOCKED: "=", MANUAL: "M", SILENT: "?", BROKEN: "×", OFFLINE: "–", ERROR: "!" };
const DARK_ON = { WAITING: "#19222d" }; // white is not legible on amber
const drawn = new Map();

/** Return the picture of a load. */
export function loadBadge(colour, paper) {
  const key = `load ${colour} ${paper} ${devicePixelRatio}`;
  if (!drawn.has(key)) {
    const picture = draw("", colour, paper, paper);
    picture.getContext("2d").fillRect(4.5, 4.5, 5, 5); // the sign ■ fills the circle in some fonts
    drawn.set(key, picture);
  }
  return drawn.get(key);
}

/** Return the picture of a condition's sign; undefined for a condition without one. */
export function badgeOf(condition, colour, paper) {
  const sign = SIGNS[condition];
  if (!sign) return undefined;
  const key = `${sign} ${colour} ${paper} ${devicePixelRatio}`;
  if (!drawn.has(key)) drawn.set(key, draw(sign, colour, paper, DARK_ON[condition] ?? paper));
  return drawn.get(key);
}

function draw(sign, colour, paper, ink) {
  const picture = document.createElement("canvas");
  picture.width = picture.height = Math.ceil(BADGE * devicePixelRatio);
  const context = picture.getContext("2d");
  context.scale(devicePixelRatio, devicePixelRatio);
  context.beginPath();
  context.arc(BADGE / 2, BADGE / 2, BADGE / 2 - 1, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.fill();
  context.strokeStyle = paper;
  context.lineWidth = 1.5;
  context.stroke();
  context.fillStyle = ink;
  context.font = "bold 10px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(sign, BADGE / 2, BADGE / 2 + 0.5);
  return picture;
}
