// The map: plant and robots on a canvas that can be moved and zoomed by mouse, touch and keys.

import { t } from "../catalogue.js";
import { element, emptyBox, setAttribute, setText } from "../dom.js";
import { number } from "../format.js";
import { icon } from "../icons.js";
import { paint, readColours } from "../map/painter.js";
import { drawPlan, extent } from "../map/plant.js";
import { Viewport } from "../map/viewport.js";

const ZOOM = 1.25;
const STEP = 60;
const REACH = 18;
const CLICK = 4;
const SCALE_LENGTHS = [0.5, 1, 2, 5, 10, 20, 50, 100, 200];

class FleetMap extends HTMLElement {
  view = new Viewport();
  #plan = null;
  #plantVersion = null;
  #fitted = false;
  #pending = false;
  #places = [];
  #pointers = new Map();
  #moved = 0;

  show(store) {
    this.store = store;
    this.#build();
    store.addEventListener("change", (event) => this.#change(event.detail));
    new ResizeObserver(() => this.#resize()).observe(this.canvas);
    document.addEventListener("themechange", () => this.#recolour());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#recolour());
    this.#recolour();
  }

  /** Mark one robot; null: none. */
  select(id) {
    this.selected = id;
    this.#draw();
  }

  /** Bring the map, and a robot on it, into sight. */
  reveal(id) {
    this.closest("section").scrollIntoView({ block: "nearest" });
    const position = this.store.robots.get(id)?.position;
    if (position) this.view.reveal(position.x, position.y);
    this.#draw();
  }

  /** Show everything that has a place. */
  fit() {
    const robots = this.#robots().map((robot) => robot.position);
    const box = extent([...(this.#plan ? [...this.#plan.points.values(), ...this.#plan.locations] : []), ...robots]);
    if (!box) return;
    this.view.fit(box);
    this.#fitted = true;
    this.#draw();
  }

  #build() {
    this.canvas = element("canvas", { tabindex: 0, role: "application" });
    this.note = emptyBox(t("map.empty.title"), t("map.empty.text"));
    this.bar = element("span", { class: "scale-bar" });
    this.readout = element("span", { class: "readout number" });
    const tools = element(
      "div",
      { class: "tools" },
      this.#tool("plus", "map.in", () => this.#zoom(ZOOM)),
      this.#tool("minus", "map.out", () => this.#zoom(1 / ZOOM)),
      this.#tool("fit", "map.fit", () => this.fit()),
    );
    this.replaceChildren(this.canvas, this.note, tools, element("div", { class: "legend" }, this.bar, this.readout));
    this.context = this.canvas.getContext("2d");
    for (const [name, handler] of Object.entries(this.#handlers())) this.canvas.addEventListener(name, handler);
  }

  #tool(sign, key, action) {
    const button = element("button", { type: "button", title: t(key), "aria-label": t(key) }, icon(sign));
    button.addEventListener("click", action);
    return button;
  }

  #handlers() {
    return {
      keydown: (event) => this.#key(event),
      wheel: (event) => {
        event.preventDefault();
        this.#zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
      },
      pointerdown: (event) => {
        this.canvas.setPointerCapture(event.pointerId);
        this.#pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
        this.#moved = 0;
      },
      pointermove: (event) => this.#move(event),
      pointerup: (event) => {
        this.#pointers.delete(event.pointerId);
        if (this.#moved < CLICK) this.#pick(event.offsetX, event.offsetY);
      },
      pointercancel: (event) => this.#pointers.delete(event.pointerId),
      pointerleave: () => setText(this.readout, ""),
    };
  }

  #change({ robots, parts }) {
    if (parts.has("plant")) this.#loadPlant();
    if (robots.size || parts.has("plant")) {
      if (!this.#fitted) this.fit();
      this.#describe();
      this.#draw();
    }
  }

  async #loadPlant() {
    const plant = this.store.plant;
    this.note.hidden = plant !== null;
    if (plant?.version === this.#plantVersion && plant?.name === this.#plan?.name) return;
    const answer = plant ? await fetch("api/v1/plant") : null;
    this.#plan = answer?.ok ? { ...drawPlan(await answer.json()), name: plant.name } : null;
    this.#plantVersion = this.#plan ? plant.version : null;
    this.fit();
    this.#describe();
    this.#draw();
  }

  #robots() {
    return [...this.store.robots.values()].filter((robot) => robot.position);
  }

  #describe() {
    const values = { plant: this.#plan?.name, points: this.#plan?.points.size, robots: this.store.robots.size };
    setAttribute(this.canvas, "aria-label", t(this.#plan ? "map.label" : "map.label.empty", values));
  }

  #key(event) {
    const moves = { ArrowLeft: [STEP, 0], ArrowRight: [-STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
    if (moves[event.key]) this.view.pan(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") this.view.zoom(ZOOM);
    else if (event.key === "-") this.view.zoom(1 / ZOOM);
    else if (event.key === "0") this.fit();
    else return;
    event.preventDefault();
    this.#draw();
  }

  #zoom(factor, x, y) {
    this.view.zoom(factor, x, y);
    this.#draw();
  }

  #move(event) {
    const [x, y] = this.view.toPlane(event.offsetX, event.offsetY);
    setText(this.readout, t("map.position", { x: number(x, 2), y: number(y, 2) }));
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    const others = [...this.#pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    const here = [event.offsetX, event.offsetY];
    if (others.length) this.#pinch(before, here, others[0]);
    else this.view.pan(here[0] - before[0], here[1] - before[1]);
    this.#moved += Math.hypot(here[0] - before[0], here[1] - before[1]);
    this.#pointers.set(event.pointerId, here);
    this.#draw();
  }

  #pinch(before, here, other) {
    const apart = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
    this.view.zoom(apart(here) / Math.max(1, apart(before)), (here[0] + other[0]) / 2, (here[1] + other[1]) / 2);
  }

  #pick(x, y) {
    const near = ({ at }) => Math.hypot(at[0] - x, at[1] - y);
    const found = this.#places.filter((each) => near(each) < REACH).sort((a, b) => near(a) - near(b))[0];
    this.dispatchEvent(new CustomEvent("select", { detail: found?.robot.id ?? null }));
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const first = !this.#fitted;
    this.canvas.width = width * devicePixelRatio;
    this.canvas.height = height * devicePixelRatio;
    this.view.resize(width, height);
    if (first) this.fit();
    this.#draw();
  }

  #recolour() {
    this.colours = readColours(this);
    this.#draw();
  }

  #draw() {
    if (this.#pending) return;
    this.#pending = true;
    requestAnimationFrame(() => {
      this.#pending = false;
      this.context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
      const { selected, colours } = this;
      this.#places = paint(this.context, this.view, { plan: this.#plan, robots: this.#robots(), selected, colours });
      this.#drawScale();
    });
  }

  #drawScale() {
    const length = SCALE_LENGTHS.find((each) => each * this.view.scale >= 50) ?? SCALE_LENGTHS.at(-1);
    this.bar.style.width = `${length * this.view.scale}px`;
    setText(this.bar, t("map.scale", { length: number(length, length < 1 ? 1 : 0) }));
  }
}

customElements.define("nena-fleet-map", FleetMap);
