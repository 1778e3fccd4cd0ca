// Texts that leave each other alone: each stands under or over its thing, where there is room.

const FONT = "12px system-ui, sans-serif";
const SMALL = "11px system-ui, sans-serif";
const HALF = 7;
const widths = new Map();

/** The texts of one picture. Where there is no room a text is left out, unless it must be seen. */
export class Labels {
  /** The boxes of the texts that are there, `[left, top, right, bottom]`. */
  taken;

  /** `over`: boxes of other texts, which these keep off if they can; where they cannot, a plate hides them. */
  constructor(context, width, colours, over = []) {
    this.taken = [...over];
    this.context = context;
    this.width = width;
    this.colours = colours;
  }

  /** Write a text `distance` pixels from the middle of its thing. */
  put(text, [middle, centre], distance, important) {
    const { context, colours } = this;
    context.font = important ? FONT : SMALL;
    const half = widthOf(context, text) / 2 + 3;
    const x = Math.max(half, Math.min(this.width - half, middle));
    const boxes = [distance, -distance].map((off) => [x - half, centre + off - HALF, x + half, centre + off + HALF]);
    const free = boxes.find((box) => !this.taken.some((each) => overlap(each, box)));
    if (!free && !important) return;
    const box = free ?? boxes[0];
    this.taken.push(box);
    if (!free) this.#paintPlate(box);
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

  #paintPlate([left, top, right, bottom]) {
    const { context } = this;
    context.globalAlpha = 0.9;
    context.fillStyle = this.colours.surface;
    context.beginPath();
    context.roundRect(left, top, right - left, bottom - top, 3);
    context.fill();
    context.globalAlpha = 1;
  }
}

function widthOf(context, text) {
  const key = `${context.font} ${text}`;
  if (!widths.has(key)) widths.set(key, context.measureText(text).width);
  return widths.get(key);
}

function overlap(a, b) {
  return a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
}
