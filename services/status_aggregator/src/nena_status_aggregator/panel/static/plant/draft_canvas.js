// The canvas on which a draft is drawn: mouse, touch and keys become changes of the model.

import { element, setAttribute, setText } from "../dom.js";
import { number, t } from "../i18n.js";
import { middle } from "../map/lines.js";
import { readColours } from "../map/painter.js";
import { extent } from "../map/plan_painter.js";
import { Viewport } from "../map/viewport.js";
import { devices, join, placesAlong, stationRow, turn, withDoor } from "./building.js";
import { bend } from "./curves.js";
import { DraftPainter } from "./draft_painter.js";
import { add, connect, find, freshName, move, remove, snapped, split } from "./model.js";
import { hit, inside, makeScene, parted, partedLine, placesOf } from "./scene.js";

const MM = 1000;
const CLICK = 4; // px
const HANDLE = 10; // px
const ZOOM = 1.25;
const PAN = 60; // px
const FINE = 0.1; // m, steps of the arrow keys without a grid
const ROOM = 12; // m, the least that is shown
const BESIDE = 1; // m, a point that is added by key
const REACH = 3000; // mm, from a station of a row to the path beside it
const NAMED = 14; // px per m, from which names are shown

/**
 * Fires `edit` with the changed model and the names to select, `selected` with names, and `block` for its key. Set `tool` (select,
 * point, oneWay, twoWay, location, row, ruler), `grid` and `spacing` (m), `stationType` (makes the model, the type's name and the
 * prefix of the name of a new location).
 */
class DraftCanvas extends HTMLElement {
  view = new Viewport();
  tool = "select";
  grid = 0.5;
  spacing = 2;
  selection = [];
  findings = new Map();
  robots = [];
  grids = [];
  waiting = null; // shares by name: where robots waited
  picked = null; // called with a place (m) by the tool `pick`
  #scene = makeScene({});
  #painter = new DraftPainter();
  #gesture = null;
  #kept = []; // stay selected while Tab moves on
  #leaving = false; // the next Tab leaves the canvas
  #pending = false;

  connectedCallback() {
    if (this.canvas) return;
    this.canvas = element("canvas", { tabindex: 0, role: "application", "aria-describedby": "plant-keys" });
    this.readout = element("div", { class: "legend" });
    this.told = element("p", { class: "unseen", role: "status" });
    this.replaceChildren(this.canvas, this.readout, this.told);
    new ResizeObserver(() => this.#resize()).observe(this.canvas);
    document.addEventListener("themechange", () => this.#recolour());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#recolour());
    const listen = (name, handler) => this.canvas.addEventListener(name, handler);
    listen("pointerdown", (event) => this.#down(event));
    listen("pointermove", (event) => this.#move(event));
    listen("pointerup", (event) => this.#up(event));
    listen("pointercancel", () => this.#cancel());
    listen("keydown", (event) => this.#key(event));
    listen("blur", () => (this.#leaving = false));
    listen("wheel", (event) => {
      event.preventDefault();
      this.#zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
    });
    this.#recolour();
  }

  /** Whether something is being dragged. */
  get busy() {
    return this.#gesture !== null;
  }

  /** Show another version of the model with these names selected. */
  show(model, selection = this.selection) {
    const first = !this.model;
    this.model = model;
    this.#scene = makeScene(model);
    setAttribute(this.canvas, "aria-label", t("plant.canvas", { points: number(this.#scene.points.size), paths: number((model.paths ?? []).length) }));
    this.select(selection.filter((name) => find(model, name)));
    if (first) this.fit();
  }

  /** Select objects by name. */
  select(names) {
    this.selection = names;
    const found = names.length && find(this.model, names.at(-1));
    setText(this.told, found ? this.#describe(found, names.length) : "");
    const [a, b] = names.map((name) => this.#scene.points.get(name) ?? this.#scene.locations.get(name));
    if (names.length === 2 && a && b) this.#readLength([a.x, a.y], [b.x, b.y]);
    this.dispatchEvent(new CustomEvent("selected", { detail: names }));
    this.draw();
  }

  /** Select an object, or the members of a block, and bring it into sight. */
  reveal(name) {
    const members = this.model.blocks?.find((block) => block.name === name)?.members ?? [name];
    const names = members.filter((each) => find(this.model, each));
    if (!names.length) return;
    const thing = this.#placeOf(names[0]);
    if (thing) this.view.reveal(thing.x, thing.y, NAMED);
    this.select(names);
  }

  // Where an object is (m), or the beginning of a path.
  #placeOf(name) {
    return this.#scene.points.get(name) ?? this.#scene.locations.get(name) ?? this.#scene.lines.find(({ names }) => names.includes(name))?.from;
  }

  /** Zoom to everything, but not to less than a small room. */
  fit() {
    const things = [...this.#scene.points.values(), ...this.#scene.locations.values(), ...this.robots, ...this.grids.flatMap(({ grid }) => corners(grid))];
    const [left, bottom, right, top] = extent(things) ?? [0, 0, 0, 0];
    const more = (from, to) => Math.max(0, (ROOM - (to - from)) / 2);
    const [wide, high] = [more(left, right), more(bottom, top)];
    this.view.fit([left - wide, bottom - high, right + wide, top + high]);
    this.draw();
  }

  /** Make the drawing ready for keys. */
  focusDrawing() {
    this.canvas.focus({ preventScroll: true });
  }

  /** Add a point in the middle of the selected path, beside the selected point, or in the middle of the view. */
  addPoint() {
    const line = this.#scene.lines.find(({ names }) => names.includes(this.selection.at(-1)));
    if (!line) return this.#addPointAt(this.#beside([Math.max(BESIDE, this.grid), 0]));
    this.#addPointAt(middle(placesOf(line), line.curved).slice(0, 2), line.names);
  }

  /** Add a location beside the selected point, which serves it, or in the middle of the view. */
  addLocation() {
    const point = this.#scene.points.get(this.selection.at(-1))?.name;
    this.#addLocationAt(this.#beside([0, Math.max(BESIDE, this.grid)]), point);
  }

  #beside([dx, dy]) {
    const from = this.#scene.points.get(this.selection.at(-1));
    return from ? [from.x + dx, from.y + dy] : this.view.toPlane(this.view.width / 2, this.view.height / 2);
  }

  /** Connect the selected objects in the order in which they were selected. */
  connect(twoWay) {
    const names = this.selection;
    this.#edit(names.slice(1).reduce((model, name, at) => connect(model, names[at], name, twoWay), this.model), names);
  }

  /** Join the selected points, or the paths through the only one. */
  join() {
    this.#edit(join(this.model, this.selection), this.selection.slice(0, 1));
  }

  /** Turn the selected paths: one way, both ways, the other way. */
  turn() {
    const lines = this.#scene.lines.filter(({ names }) => names.some((name) => this.selection.includes(name)));
    const model = lines.reduce((made, { names }) => turn(made, names), this.model);
    const isTurned = ({ source, destination }) => lines.some(({ from, to }) => (from.name === source && to.name === destination) || (from.name === destination && to.name === source));
    this.#edit(model, (model.paths ?? []).filter(isTurned).map(({ name }) => name));
  }

  /** Add a row of stations at these places (mm), served by the path beside them. */
  addRow(places) {
    const { model, ...named } = this.stationType(this.model);
    const made = stationRow(model, places, named, REACH);
    this.#edit(made, made.locations.slice(-places.length).map(({ name }) => name));
  }

  /** Remove the selected objects. */
  remove() {
    if (this.selection.length) this.#edit(remove(this.model, this.selection), []);
  }

  /** Paint in the next frame. */
  draw() {
    if (this.#pending) return;
    this.#pending = true;
    requestAnimationFrame(() => {
      this.#pending = false;
      if (!this.canvas.width || !this.canvas.height) return;
      const { drag, box, ruler, row, parts } = this.#gesture ?? {};
      const bent = this.#bent();
      const { selection, findings, grids, waiting, robots, grid, colours } = this;
      const [still, moving] = parts ?? [this.#scene, null];
      this.#painter.paint(this.canvas, this.view, { still, moving, selection, findings, grids, waiting, robots, grid, drag, box, ruler, row, bent, colours });
    });
  }

  // The line whose control points can be dragged: the only one that is selected.
  #bent() {
    if (!this.selection.length) return undefined;
    return this.#scene.lines.find(({ corners, names }) => corners.length && this.selection.every((name) => names.includes(name)));
  }

  #describe({ kind, thing }, count) {
    if (count > 1) return t("plant.several", { count: number(count) });
    const place = kind === "path" ? t("map.scale", { length: number(thing.lengthMm / MM, 2) }) : t("map.position", { x: number((thing.xMm ?? 0) / MM, 2), y: number((thing.yMm ?? 0) / MM, 2) });
    return `${t(`plant.kind.${kind}`)} ${thing.name}, ${place}`;
  }

  #edit(model, selection) {
    if (model === this.model) return this.draw();
    this.dispatchEvent(new CustomEvent("edit", { detail: { model, selection } }));
  }

  #snap([x, y]) {
    return [x, y].map((each) => snapped(each * MM, this.grid * MM));
  }

  #addPointAt(place, lines = []) {
    const [xMm, yMm] = this.#snap(place);
    const point = { name: freshName(this.model, "P"), xMm, yMm };
    const made = lines.length ? split(this.model, lines, point) : add(this.model, "points", point);
    this.#edit(made, [point.name]);
  }

  #addLocationAt(place, point = null) {
    const [xMm, yMm] = this.#snap(place);
    const { model, type, prefix } = this.stationType(this.model);
    const name = freshName(model, prefix);
    const made = add(model, "locations", { name, type, xMm, yMm });
    this.#edit(point ? connect(made, name, point, false) : made, [name]);
  }

  #down(event) {
    if (event.button > 1 || this.#gesture) return;
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    const at = [event.offsetX, event.offsetY];
    const place = this.view.toPlane(...at);
    const names = event.button ? [] : hit(this.#scene, this.view, at);
    const handle = event.button || this.tool !== "select" ? null : this.#handleAt(at);
    this.#gesture = { at, last: at, place, names, kind: event.button ? "pan" : handle ? "bend" : this.#kindOf(event, names), ...handle };
    if (this.#gesture.kind === "move") this.#grab(event, names);
    else if (this.#gesture.kind === "bend") Object.assign(this.#gesture, { parts: partedLine(this.#scene, this.#gesture.line), from: this.#gesture.line.corners[this.#gesture.index] });
  }

  #handleAt([px, py]) {
    const line = this.#bent();
    const away = ([x, y]) => Math.hypot(x - px, y - py);
    const index = line?.corners.findIndex((corner) => away(this.view.toScreen(...corner)) <= HANDLE) ?? -1;
    return index < 0 ? null : { line, index };
  }

  #kindOf(event, names) {
    if (this.tool === "ruler" || this.tool === "row") return this.tool;
    const isThing = names.length === 1 && find(this.model, names[0])?.kind !== "path";
    if (this.tool === "oneWay" || this.tool === "twoWay") return isThing ? "connect" : "pan";
    if (this.tool !== "select") return "pan";
    if (names.length) return "move";
    return event.shiftKey ? "box" : "pan";
  }

  // Select what is grabbed, unless it is already; what moves is everything that is selected, and the ends of paths.
  #grab(event, names) {
    const isSelected = names.some((name) => this.selection.includes(name));
    if (event.shiftKey || event.ctrlKey) this.select(isSelected ? this.selection.filter((name) => !names.includes(name)) : [...this.selection, ...names]);
    else if (!isSelected) this.select(names);
    const moved = new Set(this.selection);
    for (const line of this.#scene.lines) if (line.names.some((name) => moved.has(name))) moved.add(line.from.name).add(line.to.name);
    const things = [...moved].map((name) => this.#scene.points.get(name) ?? this.#scene.locations.get(name)).filter(Boolean);
    const held = things.find(({ name }) => names.includes(name)) ?? things[0];
    Object.assign(this.#gesture, { moved, held, things: things.map((thing) => ({ thing, x: thing.x, y: thing.y })), by: [0, 0], parts: parted(this.#scene, moved) });
  }

  #move(event) {
    const here = [event.offsetX, event.offsetY];
    const place = this.view.toPlane(...here);
    const gesture = this.#gesture;
    if (!gesture) return this.#read(place);
    gesture.travel = Math.max(gesture.travel ?? 0, Math.hypot(here[0] - gesture.at[0], here[1] - gesture.at[1]));
    if (gesture.travel < CLICK) return;
    if (gesture.kind === "pan") this.view.pan(here[0] - gesture.last[0], here[1] - gesture.last[1]);
    else if (gesture.kind === "move") this.#drag(place);
    else if (gesture.kind === "box") gesture.box = [gesture.place, place];
    else if (gesture.kind === "bend") this.#dragHandle(place);
    else if (gesture.kind === "row") this.#dragRow(place);
    else gesture[gesture.kind === "ruler" ? "ruler" : "drag"] = [gesture.place, place];
    if (gesture.kind === "ruler" || gesture.kind === "connect") this.#readLength(gesture.place, place);
    gesture.last = here;
    this.draw();
  }

  #dragHandle(place) {
    const { line, index } = this.#gesture;
    line.corners[index] = this.#snap(place).map((each) => each / MM);
    this.#read(line.corners[index]);
  }

  #dragRow(place) {
    const [from, to] = [this.#gesture.place, place].map((each) => this.#snap(each));
    this.#gesture.row = placesAlong(from, to, this.spacing * MM).map(([x, y]) => [x / MM, y / MM]);
    setText(this.readout, t("plant.rowOf", { count: number(this.#gesture.row.length), length: number(Math.hypot(to[0] - from[0], to[1] - from[1]) / MM, 2) }));
  }

  #drag([x, y]) {
    const { place, things, held } = this.#gesture;
    const from = things.find(({ thing }) => thing === held);
    if (!from) return;
    const [toX, toY] = this.#snap([from.x + x - place[0], from.y + y - place[1]]).map((each) => each / MM);
    this.#gesture.by = [toX - from.x, toY - from.y];
    for (const each of things) Object.assign(each.thing, { x: each.x + this.#gesture.by[0], y: each.y + this.#gesture.by[1] });
    this.#read([toX, toY]);
  }

  #up(event) {
    const gesture = this.#gesture;
    if (!gesture) return;
    this.#gesture = null;
    const place = this.view.toPlane(event.offsetX, event.offsetY);
    if ((gesture.travel ?? 0) < CLICK) this.#click(gesture, event);
    else if (gesture.kind === "move") this.#edit(move(this.model, gesture.moved, ...gesture.by.map((each) => Math.round(each * MM))), this.selection);
    else if (gesture.kind === "box") this.select([...new Set([...this.selection, ...inside(this.#scene, gesture.place, place)])]);
    else if (gesture.kind === "bend") this.#edit(bend(this.model, gesture.line.names, gesture.index, gesture.line.corners[gesture.index].map((each) => Math.round(each * MM))), this.selection);
    else if (gesture.kind === "row") this.addRow(gesture.row.map(([x, y]) => [x * MM, y * MM]));
    else if (gesture.kind === "connect") this.#connectTo(gesture.names[0], place, [event.offsetX, event.offsetY]);
    this.draw();
  }

  // To what is there, or to a new point; from a door to the path that it is on.
  #connectTo(from, place, at) {
    const there = hit(this.#scene, this.view, at);
    const [to] = there.filter((name) => find(this.model, name).kind !== "path");
    if (there.length && !to && devices(this.model).some(({ name }) => name === from)) return this.#edit(withDoor(this.model, there, from), there);
    const twoWay = this.tool === "twoWay";
    if (to) return this.#edit(connect(this.model, from, to, twoWay), [to]);
    const [xMm, yMm] = this.#snap(place);
    const point = { name: freshName(this.model, "P"), xMm, yMm };
    this.#edit(connect(add(this.model, "points", point), from, point.name, twoWay), [point.name]);
  }

  #click({ kind, names, place }, event) {
    if (kind === "bend") return;
    const thing = this.#scene.points.get(names[0]) ?? this.#scene.locations.get(names[0]);
    if (this.tool === "pick") return this.picked(thing ? [thing.x, thing.y] : place);
    if (kind === "move") {
      if (!event.shiftKey && !event.ctrlKey) this.select(names); // of several, only this one
      return;
    }
    const isFree = !names.length || find(this.model, names[0]).kind === "path";
    if (this.tool === "point" && isFree) this.#addPointAt(place, names);
    else if (this.tool === "location" && isFree) this.#addLocationAt(place);
    else if (!event.shiftKey || names.length) this.select(names);
  }

  #cancel() {
    for (const { thing, x, y } of this.#gesture?.things ?? []) Object.assign(thing, { x, y });
    if (this.#gesture?.line) this.#gesture.line.corners[this.#gesture.index] = this.#gesture.from;
    this.#gesture = null;
    this.draw();
  }

  #read([x, y]) {
    setText(this.readout, t("map.position", { x: number(x, 2), y: number(y, 2) }));
  }

  #readLength([ax, ay], [bx, by]) {
    const angle = (Math.atan2(by - ay, bx - ax) * 180) / Math.PI;
    setText(this.readout, t("plant.measured", { length: number(Math.hypot(bx - ax, by - ay), 2), angle: number(angle, 0) }));
  }

  #key(event) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const commands = { Delete: () => this.remove(), Backspace: () => this.remove(), Escape: () => this.#escape(), " ": () => (this.#kept = this.selection), p: () => this.addPoint(), l: () => this.addLocation(), b: () => this.dispatchEvent(new Event("block")), c: () => this.connect(false), C: () => this.connect(true), j: () => this.join(), w: () => this.turn(), 0: () => this.fit(), "+": () => this.#zoom(ZOOM), "=": () => this.#zoom(ZOOM), "-": () => this.#zoom(1 / ZOOM) };
    if (event.key === "Tab") {
      if (!this.#next(event.shiftKey ? -1 : 1)) return;
    } else if (event.ctrlKey || event.metaKey) {
      if (event.key !== "a") return; // undo and redo belong to the page
      this.select([...this.#scene.points.keys(), ...this.#scene.locations.keys()]);
    } else if (arrows[event.key]) this.#step(arrows[event.key], event.shiftKey ? 10 : 1);
    else if (commands[event.key]) commands[event.key]();
    else return;
    event.preventDefault();
  }

  #zoom(...how) {
    this.view.zoom(...how);
    this.draw();
  }

  // Back to nothing selected; from there, Tab leaves the canvas.
  #escape() {
    if (this.busy) return this.#cancel();
    this.#leaving = !this.selection.length;
    this.#kept = [];
    this.select([]);
  }

  // Select the next object; false at the end, where Tab leaves the canvas.
  #next(direction) {
    if (this.#leaving) return false;
    const all = [...this.#scene.points.keys(), ...this.#scene.locations.keys(), ...this.#scene.lines.map(({ names }) => names[0])];
    const at = all.indexOf(this.selection.at(-1));
    const name = all[at < 0 ? (direction > 0 ? 0 : -1) : at + direction];
    if (!name) return false;
    const names = this.#scene.lines.find((line) => line.names.includes(name))?.names ?? [name];
    const { x, y } = this.#placeOf(name);
    const [px, py] = this.view.toScreen(x, y);
    if (px < 0 || py < 0 || px > this.view.width || py > this.view.height) this.view.centre(x, y);
    this.select([...this.#kept.filter((each) => !names.includes(each)), ...names]);
    return true;
  }

  #step([dx, dy], times) {
    const step = (this.grid || FINE) * times * MM;
    if (this.selection.length) return this.#edit(move(this.model, new Set(this.selection), dx * step, dy * step), this.selection);
    this.view.pan(-dx * PAN, dy * PAN);
    this.draw();
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return; // hidden
    this.canvas.width = width * devicePixelRatio;
    this.canvas.height = height * devicePixelRatio;
    this.view.resize(width, height);
    this.draw();
  }

  #recolour() {
    this.colours = readColours(this);
    this.draw();
  }
}

function corners({ x, y, theta, resolution, width, height }) {
  const [right, up] = [width * resolution, height * resolution];
  const at = (along, across) => ({ x: x + along * Math.cos(theta) - across * Math.sin(theta), y: y + along * Math.sin(theta) + across * Math.cos(theta) });
  return [at(0, 0), at(right, 0), at(0, up), at(right, up)];
}

customElements.define("nena-draft-canvas", DraftCanvas);
