// The visible section of the plant, and mouse, touch and key input that moves it.

const LEAST = 0.5;
const MOST = 400;
const CLOSE = 30;
const MARGIN = 48;
const RIGHT = 80; // below the map's buttons, with the labels beside them

/** Maps plant coordinates (m, y up) to the screen (CSS pixels, y down): scale in pixels per metre, and the origin. */
export class Viewport {
  scale = 20;
  x = 0;
  y = 0;
  width = 1;
  height = 1;
  fitted = null; // what it was fitted to; null once it was moved

  /** Change the size; what it was fitted to still fits, else the centre stays the same. */
  resize(width, height) {
    this.x += (width - this.width) / 2;
    this.y += (height - this.height) / 2;
    this.width = width;
    this.height = height;
    if (this.fitted) this.fit(this.fitted);
  }

  toScreen(x, y) {
    return [this.x + x * this.scale, this.y - y * this.scale];
  }

  toPlane(px, py) {
    return [(px - this.x) / this.scale, (this.y - py) / this.scale];
  }

  /** Return the viewport that shows `margin` pixels more at each edge. */
  enlarged(margin) {
    const { scale, x, y, width, height } = this;
    return Object.assign(new Viewport(), { scale, x: x + margin, y: y + margin, width: width + 2 * margin, height: height + 2 * margin });
  }

  pan(dx, dy) {
    this.fitted = null;
    this.x += dx;
    this.y += dy;
  }

  /** Zoom around a point of the screen. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    this.fitted = null;
    const [x, y] = this.toPlane(px, py);
    this.scale = Math.min(MOST, Math.max(LEAST, this.scale * factor));
    this.x = px - x * this.scale;
    this.y = py + y * this.scale;
  }

  /** Zoom to `[left, bottom, right, top]`. */
  fit(box) {
    const [left, bottom, right, top] = box;
    this.fitted = box;
    const wide = Math.max(1, right - left);
    const high = Math.max(1, top - bottom);
    const room = [Math.max(40, this.width - MARGIN - RIGHT), Math.max(40, this.height - 2 * MARGIN)];
    this.scale = Math.min(MOST, Math.max(LEAST, Math.min(room[0] / wide, room[1] / high)));
    this.x = (this.width + MARGIN - RIGHT) / 2 - ((left + right) / 2) * this.scale;
    this.y = this.height / 2 + ((bottom + top) / 2) * this.scale;
  }

  /** Centre a position. */
  centre(x, y) {
    const [px, py] = this.toScreen(x, y);
    this.pan(this.width / 2 - px, this.height / 2 - py);
  }

  /** Centre a position, near enough (pixels per metre) to tell it from its neighbours. */
  reveal(x, y, close = CLOSE) {
    if (this.scale < close) this.zoom(close / this.scale);
    this.centre(x, y);
  }
}

const ZOOM = 1.25;
const STEP = 60;
const CLICK = 4;
const DRAG = 12;
const LONG_PRESS = 500; // ms

/**
 * Moves a viewport. Calls `host`: `moved(byHand)` after a change, `rested()` at the end of a drag, `picked(x, y)` on a click
 * or tap, `menu([x, y])` on a right click or long press, `menu(null)` by the keyboard, `hovered([x, y])` in metres or with null,
 * and `fit()` for the key 0.
 */
export class Gestures {
  #pointers = new Map();
  #travel = 0;
  #picking = null;
  #press = null; // the timer of a long press

  constructor(canvas, view, host) {
    this.view = view;
    this.host = host;
    for (const [name, handler] of Object.entries(this.#handlers())) canvas.addEventListener(name, handler);
    this.canvas = canvas;
  }

  /** Whether the map is being dragged by one pointer. */
  get dragged() {
    return this.#pointers.size === 1 && this.#travel >= CLICK;
  }

  /** Zoom by one step. */
  step(direction) {
    this.#zoom(ZOOM ** direction);
  }

  /**
   * Pick a pose: the next press sets the position, dragging the heading. Calls `take({x, y, theta})` on each step, with
   * theta null without a drag, and `done()` at the end, also after Escape.
   */
  pickPose(take, done) {
    this.#pick(done, ([x, y], [dx, dy]) => {
      take({ x, y, theta: Math.hypot(dx, dy) < DRAG ? null : Math.atan2(-dy, dx) });
    });
  }

  /** Pick a rectangle, dragged from corner to corner: calls `take({xMin, yMin, xMax, yMax})` on each step, and `done()` at the end. */
  pickArea(take, done) {
    this.#pick(done, ([x, y], [dx, dy]) => {
      const [right, top] = [x + dx / this.view.scale, y - dy / this.view.scale];
      if (!dx || !dy) return; // without an extent
      take({ xMin: Math.min(x, right), yMin: Math.min(y, top), xMax: Math.max(x, right), yMax: Math.max(y, top) });
    });
  }

  // `read`: called with the place of the press (m), and how far it was dragged (pixels).
  #pick(done, read) {
    this.#picking = { read, done, from: null };
    this.canvas.classList.add("picking");
  }

  /** End what is being picked, if anything is. */
  endPicking() {
    if (!this.#picking) return;
    const { done } = this.#picking;
    this.#picking = null;
    this.canvas.classList.remove("picking");
    done();
  }

  #take(event) {
    const { read, from } = this.#picking;
    read(this.view.toPlane(...from), [event.offsetX - from[0], event.offsetY - from[1]]);
  }

  #handlers() {
    return {
      keydown: (event) => this.#key(event),
      wheel: (event) => {
        event.preventDefault();
        this.#zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
      },
      pointerdown: (event) => this.#down(event),
      pointermove: (event) => this.#move(event),
      pointerup: (event) => this.#up(event),
      pointercancel: (event) => this.#lift(event),
      lostpointercapture: (event) => this.#lift(event), // such as a canvas that is hidden during a drag
      pointerleave: () => this.host.hovered(null),
      contextmenu: (event) => this.#menu(event),
    };
  }

  // A long press also sends this event in some browsers, and some keyboards do.
  #menu(event) {
    if (this.dragged) return event.preventDefault();
    const placed = event.button === 2 || Boolean(event.pointerType); // a keyboard has none
    if (this.#picking || this.host.menu(placed ? [event.offsetX, event.offsetY] : null)) event.preventDefault();
  }

  #down(event) {
    if (event.button) return; // not the main one
    clearTimeout(this.#press);
    const here = [event.offsetX, event.offsetY];
    if (event.pointerType === "touch" && !this.#picking && !this.#pointers.size) this.#press = setTimeout(() => this.#pressed(here), LONG_PRESS);
    this.canvas.setPointerCapture(event.pointerId);
    if (this.#picking) this.#picking.from ??= [event.offsetX, event.offsetY];
    if (!this.#pointers.size) this.#travel = 0;
    this.#pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  }

  // The finger that opened a menu neither moves the map nor picks anything.
  #pressed(here) {
    if (this.host.menu(here)) this.#pointers.clear();
  }

  #move(event) {
    const here = [event.offsetX, event.offsetY];
    if (!this.dragged) this.host.hovered(this.view.toPlane(...here)); // a drag takes the place along
    if (this.#picking?.from) return this.#take(event);
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    this.#pointers.set(event.pointerId, here);
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) this.#pinch(before, here, other);
    else this.view.pan(here[0] - before[0], here[1] - before[1]);
    this.#travel += Math.hypot(here[0] - before[0], here[1] - before[1]);
    if (this.#travel >= CLICK) clearTimeout(this.#press);
    this.host.moved(this.#travel >= CLICK);
  }

  #pinch(before, here, other) {
    const apart = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
    this.view.zoom(apart(here) / Math.max(1, apart(before)), (here[0] + other[0]) / 2, (here[1] + other[1]) / 2);
  }

  #lift(event) {
    if (!this.#pointers.delete(event.pointerId)) return;
    clearTimeout(this.#press);
    if (!this.#pointers.size && this.#travel >= CLICK) this.host.rested();
  }

  #up(event) {
    if (!this.#pointers.has(event.pointerId)) return;
    this.#lift(event);
    if (this.#picking?.from) {
      this.#take(event);
      this.endPicking();
    } else if (this.#travel < CLICK) this.host.picked(event.offsetX, event.offsetY);
  }

  #key(event) {
    const moves = { ArrowLeft: [STEP, 0], ArrowRight: [-STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
    if (event.key === "Escape" && this.#picking) this.endPicking();
    else if (event.key === "ContextMenu" || (event.key === "F10" && event.shiftKey)) this.host.menu(null);
    else if (event.key === "0") this.host.fit();
    else if (event.key === "+" || event.key === "=") this.step(1);
    else if (event.key === "-") this.step(-1);
    else if (moves[event.key]) {
      this.view.pan(...moves[event.key]);
      this.host.moved(true);
    } else return;
    event.preventDefault();
  }

  #zoom(factor, x, y) {
    this.view.zoom(factor, x, y);
    this.host.moved(false);
  }
}
