// Labels of the map, placed beside their objects without overlaps.

const FONT = "12px system-ui, sans-serif";
const SMALL = "11px system-ui, sans-serif";
const HALF = 7;
const GAP = 4;
const widths = new Map();

/** Places and paints labels; labels without room are omitted. */
export class Labels {
  /** Placed labels, `{text, box, important}`; a box is `[left, top, right, bottom]`. */
  placed = [];

  /** `taken`: boxes that stay free of labels. */
  constructor(context, width, taken = []) {
    this.context = context;
    this.width = width;
    this.taken = [...taken];
  }

  /**
   * Place a label below or above its object, `distance` pixels from its centre, if possible without covering `avoid`;
   * else beside it, if `beside`.
   */
  put(text, at, distance, { important = false, avoid = [], beside = false } = {}) {
    const [below, above, ...sides] = this.#boxes(text, at, distance, important);
    const free = [below, above].filter((box) => isFree(box, this.taken));
    const seen = (each) => each[0] >= 0 && each[2] <= this.width;
    const box = free.find((each) => isFree(each, avoid)) ?? free[0] ?? (beside && sides.find((each) => seen(each) && isFree(each, this.taken)));
    if (!box) return;
    this.taken.push(box);
    this.placed.push({ text, box, important });
  }

  /** Paint the placed labels. */
  paint(colours) {
    const { context } = this;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 5; // also covers what is between two words
    context.lineJoin = "round";
    context.strokeStyle = colours.surface;
    for (const { text, box, important } of this.placed) {
      const [x, y] = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
      context.font = important ? FONT : SMALL;
      context.strokeText(text, x, y);
      context.fillStyle = important ? colours.ink : colours.muted;
      context.fillText(text, x, y);
    }
  }

  #boxes(text, [middle, centre], distance, important) {
    const half = widthOf(this.context, text, important ? FONT : SMALL) / 2 + 3;
    const x = Math.max(half, Math.min(this.width - half, middle));
    const aside = half + Math.max(0, distance - HALF) + GAP;
    const centres = [[x, centre + distance], [x, centre - distance], [middle + aside, centre], [middle - aside, centre]];
    return centres.map(([atX, atY]) => [atX - half, atY - HALF, atX + half, atY + HALF]);
  }
}

function widthOf(context, text, font) {
  const key = `${font} ${text}`;
  if (!widths.has(key)) {
    context.font = font;
    widths.set(key, context.measureText(text).width);
  }
  return widths.get(key);
}

function isFree(box, taken) {
  return !taken.some((each) => overlap(each, box));
}

/** Return whether two boxes overlap. */
export function overlap(a, b) {
  return a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
}
