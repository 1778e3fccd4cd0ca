// Where the plane of the plant (metres, y up) lies on the screen (CSS pixels, y down).

const LEAST = 0.5;
const MOST = 400;
const MARGIN = 48;

/** Scale in pixels per metre, and where the origin of the plane is on the screen. */
export class Viewport {
  scale = 20;
  x = 0;
  y = 0;
  width = 1;
  height = 1;

  /** Take a new size; the middle of the picture stays the middle. */
  resize(width, height) {
    this.x += (width - this.width) / 2;
    this.y += (height - this.height) / 2;
    this.width = width;
    this.height = height;
  }

  toScreen(x, y) {
    return [this.x + x * this.scale, this.y - y * this.scale];
  }

  toPlane(px, py) {
    return [(px - this.x) / this.scale, (this.y - py) / this.scale];
  }

  pan(dx, dy) {
    this.x += dx;
    this.y += dy;
  }

  /** Zoom so that what is at a place of the screen stays there. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toPlane(px, py);
    this.scale = Math.min(MOST, Math.max(LEAST, this.scale * factor));
    this.x = px - x * this.scale;
    this.y = py + y * this.scale;
  }

  /** Show everything within `[left, bottom, right, top]`. */
  fit([left, bottom, right, top]) {
    const wide = Math.max(1, right - left);
    const high = Math.max(1, top - bottom);
    const room = [Math.max(40, this.width - 2 * MARGIN), Math.max(40, this.height - 2 * MARGIN)];
    this.scale = Math.min(MOST, Math.max(LEAST, Math.min(room[0] / wide, room[1] / high)));
    this.x = this.width / 2 - ((left + right) / 2) * this.scale;
    this.y = this.height / 2 + ((bottom + top) / 2) * this.scale;
  }

  /** Bring a place of the plane to the middle. */
  centre(x, y) {
    const [px, py] = this.toScreen(x, y);
    this.pan(this.width / 2 - px, this.height / 2 - py);
  }

  /** Bring a place of the plane to the middle if it is out of sight. */
  reveal(x, y) {
    const [px, py] = this.toScreen(x, y);
    if (px < MARGIN || py < MARGIN || px > this.width - MARGIN || py > this.height - MARGIN) this.centre(x, y);
  }
}
