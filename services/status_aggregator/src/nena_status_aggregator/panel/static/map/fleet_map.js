// The map: plant and robots on a canvas, with layers, zoom and pose picking.

import { element, emptyBox, icon, setAttribute, setText } from "../dom.js";
import { number, t } from "../i18n.js";
import { inNextFrame, setDragged } from "../pace.js";
import "./context_menu.js";
import { Grids } from "./grids.js";
import { Painter, readColours } from "./painter.js";
import { drawPlan, extent, placeAt } from "./plan_painter.js";
import { TrafficPlan } from "./traffic.js";
import { Gestures, Viewport } from "./viewport.js";
import { WaitingTimes } from "./waiting.js";
import { Zones } from "./zones.js";

const KEY = "nena-hidden-layers";
const OLD_KEY = "nena-layers"; // choices of panels without the layer that is hidden by default

/** The layers from bottom to top; named by the texts under `layer.`. */
const LAYERS = ["grids", "zones", "blocks", "waiting", "paths", "points", "locations", "names", "routes", "goals", "plans", "traffic", "robots", "robotNames"];
const HIDDEN = "traffic"; // polls the order service
const WAITING = "waiting"; // needs a report; stored as WAITING_SHOWN, because choices of older panels do not name it
const WAITING_SHOWN = "+waiting";

/** Return the stored choice; all layers except the traffic plan and the waiting times are visible by default. */
function readLayers() {
  const stored = (localStorage.getItem(KEY) ?? `${localStorage.getItem(OLD_KEY) ?? ""} ${HIDDEN}`).split(" ");
  const shown = (name) => (name === WAITING ? stored.includes(WAITING_SHOWN) : !stored.includes(name));
  return Object.fromEntries(LAYERS.map((name) => [name, shown(name)]));
}

/** Store a choice. */
function storeLayers(layers) {
  const hidden = LAYERS.filter((name) => !layers[name]);
  localStorage.setItem(KEY, [...hidden, layers[WAITING] && WAITING_SHOWN].filter(Boolean).join(" "));
}

/** Fires `layers` when `chosen` has been replaced. */
class MapLayers extends HTMLElement {
  chosen = readLayers();

  connectedCallback() {
    const title = t("map.layers");
    const summary = element("summary", { title, "aria-label": title }, icon("layers"));
    this.boxes = Object.fromEntries(LAYERS.map((name) => [name, this.#box(name)]));
    const labels = Object.entries(this.boxes).map(([name, box]) => element("label", {}, box, t(`layer.${name}`)));
    this.replaceChildren(element("details", {}, summary, element("fieldset", {}, element("legend", {}, title), ...labels)));
  }

  /** Show or hide a layer. */
  choose(name, shown) {
    this.boxes[name].checked = shown;
    this.chosen = { ...this.chosen, [name]: shown };
    storeLayers(this.chosen);
    this.dispatchEvent(new Event("layers"));
  }

  #box(name) {
    const box = element("input", { type: "checkbox", name });
    box.checked = this.chosen[name];
    box.addEventListener("change", () => this.choose(name, box.checked));
    return box;
  }
}

customElements.define("nena-map-layers", MapLayers);

const REACH = 18;
const PRESENTED = 1500; // ms
const MARGIN = 240; // px painted beyond the edges while the map is dragged
const SCALE_LENGTHS = [0.5, 1, 2, 5, 10, 20, 50, 100, 200];

class FleetMap extends HTMLElement {
  view = new Viewport();
  #plan = null;
  #fitted = false;
  #pending = false;
  #moved = false;
  #grids = new Grids();
  #traffic = new TrafficPlan();
  #waiting = new WaitingTimes();
  #zones = new Zones();

  /** Attach to `fleet`: {store, plant, enabled, noCommands}. */
  show({ store, plant, enabled, noCommands }) {
    this.store = store;
    this.plant = plant;
    this.noCommands = noCommands;
    this.#build();
    this.#traffic.addEventListener("change", () => this.#draw());
    this.#traffic.follow(() => enabled && this.layers.chosen.traffic && !this.replayed);
    this.#waiting.addEventListener("change", () => this.#showWaiting());
    this.#waiting.follow(() => this.layers.chosen.waiting, () => store.now());
    this.#zones.addEventListener("change", () => this.#draw());
    this.#zones.follow(() => enabled && this.layers.chosen.zones && store.orderService.up !== false);
    plant.addEventListener("change", () => this.#showPlant(plant.model));
    plant.addEventListener("locks", () => this.#showLocks(plant.model));
    store.addEventListener("change", (event) => this.#change(event.detail));
    this.#grids.addEventListener("change", () => this.#draw());
    new ResizeObserver(() => this.#resize()).observe(this.canvas);
    document.addEventListener("themechange", () => this.#recolour());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#recolour());
    this.#recolour();
  }

  /** Highlight a robot; null: none. */
  select(id) {
    this.selected = id;
    this.followTool.disabled = !id;
    if (!id) this.follow(false);
    this.#draw();
  }

  /** Highlight a point, location or path; null: none. */
  selectPlace(name) {
    this.place = name;
    this.#draw();
  }

  /** Start or stop centring the highlighted robot. */
  follow(on) {
    this.following = on;
    setAttribute(this.followTool, "aria-pressed", String(on));
    this.#draw();
  }

  /** Scroll to the map and show a robot on it. */
  reveal(id) {
    this.#present();
    const position = this.store.robots.get(id)?.position;
    if (position) this.view.reveal(position.x, position.y);
    this.#draw();
  }

  /** Show the pose that is being picked, `{x, y, theta}`; null: none. */
  showPose(pose) {
    this.pose = pose;
    this.#draw();
  }

  /** Show the area that is being picked; null: none. */
  showArea(area) {
    this.area = area;
    this.#draw();
  }

  /** Show `{robots, time}` of the history; null: live data. */
  replay(shown) {
    this.replayed = shown;
    this.past.hidden = !shown;
    setText(this.past, shown ? t("map.past", { time: shown.time }) : "");
    this.#draw();
  }

  /** Take the waiting times of a report; `reveal`: also show their layer, and scroll to the map. */
  showWaiting(report, reveal = false) {
    this.#waiting.take(report);
    if (!reveal) return;
    this.layers.choose("waiting", true);
    this.#present();
  }

  // Scroll to the map, and draw the eye to it.
  #present() {
    const section = this.closest("section");
    section.scrollIntoView({ block: "nearest" });
    section.animate({ outline: ["4px solid var(--accent)", "4px solid transparent"] }, { id: "present", duration: PRESENTED });
  }

  #showWaiting() {
    const shown = this.layers.chosen.waiting && this.#waiting.note;
    this.heat.hidden = !shown;
    setText(this.heat, shown || "");
    this.#draw();
  }

  /** Pick a position with a click and a heading with a drag: `take(pose)` on each step, `done()` at the end. */
  pickPose({ take, done }) {
    this.gestures.pickPose(take, this.#startPicking("map.pick", done));
  }

  /** Pick a place with a click: `take(name)` if one is there, then `done()`. */
  pickPlace({ take, done }) {
    const found = ({ x, y }) => {
      const name = this.#plan && placeAt(this.#plan, this.view, this.view.toScreen(x, y));
      if (name) take(name);
    };
    this.gestures.pickPose(found, this.#startPicking("map.pickPlace", done));
  }

  /** Pick a rectangle by dragging: `take(area)` on each step, `done()` at the end; null: end what is being picked. */
  pickArea(picking) {
    if (picking) this.gestures.pickArea(picking.take, this.#startPicking("map.pickArea", picking.done));
    else this.gestures.endPicking();
  }

  // Show a hint, and return what ends the picking.
  #startPicking(key, done) {
    this.closest("section").scrollIntoView({ block: "nearest" });
    setText(this.hint, t(key));
    this.hint.hidden = false;
    this.canvas.focus({ preventScroll: true });
    return () => {
      this.hint.hidden = true;
      done();
    };
  }

  /** Zoom to everything that has a position. */
  fit() {
    const robots = this.#robots().map((robot) => robot.position);
    const box = extent([...(this.#plan ? [...this.#plan.points.values(), ...this.#plan.locations] : []), ...robots]);
    this.follow(false);
    this.#fitted = Boolean(box) && this.canvas.clientWidth > 0; // a hidden map is fitted when it is shown
    if (!this.#fitted) return;
    this.view.fit(box);
    this.#draw();
  }

  #build() {
    this.canvas = element("canvas", { tabindex: 0, role: "application" });
    this.painter = new Painter(this.canvas);
    this.hint = element("div", { class: "hint pick", role: "status" });
    this.hint.hidden = true;
    this.past = element("div", { class: "hint past" });
    this.past.hidden = true;
    this.heat = element("div", { class: "hint heat" });
    this.heat.hidden = true;
    this.gestures = new Gestures(this.canvas, this.view, {
      moved: (byHand) => this.#move(byHand),
      rested: () => this.#move(false),
      picked: (x, y) => this.#pick(x, y),
      menu: (at) => this.#openMenu(at),
      hovered: (place) => this.#read(place),
      fit: () => this.fit(),
    });
    this.note = emptyBox(t("map.empty.title"), t("map.empty.text"));
    this.bar = element("span", { class: "scale-bar" });
    this.readout = element("span", { class: "readout number" });
    this.layers = element("nena-map-layers");
    this.layers.addEventListener("layers", () => {
      this.#waiting.load();
      this.#zones.load();
      this.#showWaiting();
    });
    const legend = element("div", { class: "legend" }, this.bar, this.readout);
    const notes = element("div", { class: "notes" }, this.past, this.heat, this.hint, this.note);
    this.menu = element("nena-map-menu");
    this.replaceChildren(this.canvas, notes, this.#tools(this.gestures), legend, this.menu);
  }

  #tools(gestures) {
    this.followTool = this.#tool("follow", "map.follow", () => this.follow(!this.following));
    this.followTool.disabled = true;
    setAttribute(this.followTool, "aria-pressed", "false");
    return element(
      "div",
      { class: "tools" },
      this.#tool("plus", "map.in", () => gestures.step(1)),
      this.#tool("minus", "map.out", () => gestures.step(-1)),
      this.#tool("fit", "map.fit", () => this.fit()),
      this.followTool,
      this.layers,
      this.#tool("screen", "map.fullScreen", () => this.#toggleFullScreen()),
    );
  }

  #tool(sign, key, action) {
    const button = element("button", { type: "button", title: t(key), "aria-label": t(key) }, icon(sign));
    button.addEventListener("click", action);
    return button;
  }

  #toggleFullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else this.closest("section").requestFullscreen();
  }

  #change({ robots, parts }) {
    if (parts.has("plant")) this.note.hidden = this.store.plant !== null;
    if (!robots.size && !parts.has("jams") && !parts.has("orderService")) return;
    if (!this.#fitted) this.fit();
    this.#describe();
    this.#draw();
  }

  #showPlant(model) {
    this.note.hidden = model !== null;
    this.#plan = model && drawPlan(model);
    this.fit();
    this.#describe();
  }

  #showLocks(model) {
    this.#plan = drawPlan(model);
    this.#draw();
  }

  #robots() {
    if (this.replayed) return this.replayed.robots;
    return [...this.store.robots.values()].filter((robot) => robot.position);
  }

  #describe() {
    const values = { plant: this.#plan?.name, points: this.#plan?.points.size, robots: this.store.robots.size };
    setAttribute(this.canvas, "aria-label", t(this.#plan ? "map.label" : "map.label.empty", values));
  }

  #read(place) {
    setText(this.readout, place ? t("map.position", { x: number(place[0], 2), y: number(place[1], 2) }) : "");
  }

  #pick(x, y) {
    const found = this.#robotAt(x, y);
    if (found) return this.dispatchEvent(new CustomEvent("select", { detail: found.id }));
    const place = this.#plan && placeAt(this.#plan, this.view, [x, y]);
    if (place) this.dispatchEvent(new CustomEvent("selectplace", { detail: place }));
  }

  // Open the menu of what is at a place of the screen, or of what is selected if that is null; false if nothing is there.
  #openMenu(at) {
    if (this.noCommands || this.replayed) return false;
    const robot = at ? this.#robotAt(...at) : this.store.robots.get(this.selected);
    const name = at ? this.#plan && placeAt(this.#plan, this.view, at) : this.place;
    const found = !robot && name && this.plant.find(name);
    if (!robot && !found) return false;
    const middle = at ?? [this.view.width / 2, this.view.height / 2];
    if (robot) this.menu.openForRobot(robot, middle, this.canvas);
    else this.menu.openForPlace(found, Boolean(this.plant.opposite(found.thing)), middle, this.canvas);
    return true;
  }

  // The robot at a place of the screen.
  #robotAt(x, y) {
    const places = this.#robots().map((robot) => ({ robot, at: this.view.toScreen(robot.position.x, robot.position.y) }));
    const near = ({ at }) => Math.hypot(at[0] - x, at[1] - y);
    return places.filter((each) => near(each) < REACH).sort((a, b) => near(a) - near(b))[0]?.robot;
  }

  // While the map is dragged, only the picture moves.
  #move(byHand) {
    if (byHand && this.following) this.follow(false);
    if (this.#moved) return;
    this.#moved = true;
    requestAnimationFrame(() => {
      this.#moved = false;
      const { dragged } = this.gestures;
      setDragged(dragged);
      if (!dragged || !this.painter.shift(this.view)) this.#paint();
    });
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return; // hidden
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
    inNextFrame(() => {
      this.#pending = false;
      this.#paint();
    });
  }

  #paint() {
    if (!this.canvas.width || !this.canvas.height) return; // drawing on an empty canvas fails
    const { selected, colours, pose } = this;
    const followed = this.following && this.#robots().find((robot) => robot.id === selected)?.position;
    if (followed) this.view.centre(followed.x, followed.y);
    const grids = this.#grids.of(this.store.robots.values(), selected);
    const traffic = this.#traffic.vehicles;
    const jams = this.replayed ? new Map(this.replayed.robots.flatMap(({ id, jam }) => (jam ? [[id, jam]] : []))) : jamsByVehicle(this.store.jams);
    const { place, layers: { chosen: layers } } = this;
    const stopped = this.replayed ? this.replayed.areas : this.store.orderService.stops.map(({ area }) => area);
    const areas = [...stopped, this.area].filter(Boolean);
    const [waiting, zones] = [this.#waiting.shares, this.#zones.list];
    const scene = { plan: this.#plan, grids, robots: this.#robots(), selected, place, colours, layers, pose, traffic, jams, areas, waiting, zones };
    if (this.gestures.dragged) return this.painter.paintBeyond(this.view, scene, MARGIN);
    this.labels = this.painter.paint(this.view, scene);
    this.#drawScale();
  }

  #drawScale() {
    const length = SCALE_LENGTHS.find((each) => each * this.view.scale >= 50) ?? SCALE_LENGTHS.at(-1);
    this.bar.style.width = `${length * this.view.scale}px`;
    setText(this.bar, t("map.scale", { length: number(length, length < 1 ? 1 : 0) }));
  }
}

// Waiting robots in jams, by the vehicle at the head, or by each vehicle of the circle.
function jamsByVehicle(jams) {
  return new Map(jams.flatMap(({ head, circle, robots }) => (head ? [head] : circle).map((name) => [name, robots])));
}

customElements.define("nena-fleet-map", FleetMap);
