// Mouse, touch and keys on the map.

const ZOOM = 1.25;
const STEP = 60;
const CLICK = 4;
const DRAG = 12;

/**
 * Moves a view. `host` is told: `moved(byHand)` when the view has changed, `picked(x, y)` of a click or tap,
 * `hovered([x, y])` in metres, or null, and `fit()` for the key 0.
 */
export class Gestures {
  #pointers = new Map();
  #travel = 0;
  #picking = null;

  constructor(canvas, view, host) {
    this.view = view;
    this.host = host;
    for (const [name, handler] of Object.entries(this.#handlers())) canvas.addEventListener(name, handler);
    this.canvas = canvas;
  }

  /** Zoom by one step. */
  step(direction) {
    this.#zoom(ZOOM ** direction);
  }

  /**
   * Take the next press as a place and the drag from it as a heading: `take({x, y, theta})` at each step, theta null while
   * there is no drag; `done()` at the end, also after Escape.
   */
  pickPose(take, done) {
    this.#picking = { take, done, from: null };
    this.canvas.classList.add("picking");
  }

  #endPicking() {
    const { done } = this.#picking;
    this.#picking = null;
    this.canvas.classList.remove("picking");
    done();
  }

  #takePose(event) {
    const { take, from } = this.#picking;
    const [x, y] = this.view.toPlane(...from);
    const [dx, dy] = [event.offsetX - from[0], event.offsetY - from[1]];
    take({ x, y, theta: Math.hypot(dx, dy) < DRAG ? null : Math.atan2(-dy, dx) });
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
      pointercancel: (event) => this.#pointers.delete(event.pointerId),
      pointerleave: () => this.host.hovered(null),
    };
  }

  #down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    if (this.#picking) this.#picking.from ??= [event.offsetX, event.offsetY];
    this.#pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    this.#travel = 0;
  }

  #move(event) {
    const here = [event.offsetX, event.offsetY];
    this.host.hovered(this.view.toPlane(...here));
    if (this.#picking?.from) return this.#takePose(event);
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    this.#pointers.set(event.pointerId, here);
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) this.#pinch(before, here, other);
    else this.view.pan(here[0] - before[0], here[1] - before[1]);
    this.#travel += Math.hypot(here[0] - before[0], here[1] - before[1]);
    this.host.moved(this.#travel >= CLICK);
  }

  #pinch(before, here, other) {
    const apart = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
    this.view.zoom(apart(here) / Math.max(1, apart(before)), (here[0] + other[0]) / 2, (here[1] + other[1]) / 2);
  }

  #up(event) {
    this.#pointers.delete(event.pointerId);
    if (this.#picking?.from) {
      this.#takePose(event);
      this.#endPicking();
    } else if (this.#travel < CLICK) this.host.picked(event.offsetX, event.offsetY);
  }

  #key(event) {
    const moves = { ArrowLeft: [STEP, 0], ArrowRight: [-STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
    if (event.key === "Escape" && this.#picking) this.#endPicking();
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
