// Parts shared by the command forms: sending once and reporting the result, place and pose fields.

import { RefusedError } from "./api.js";
import { button, element, field, foreign, numberInput, numberOf, refillSelect, select, setAttribute } from "./dom.js";
import { byName, t } from "./i18n.js";
import { reasonElement } from "./reasons.js";

const NO_ANSWER = 502; // of the order service, to the aggregator: it may have done the command

/** The name of something new, as topics and addresses take it. */
export function nameInput(attributes) {
  return element("input", { type: "text", name: "name", pattern: "[A-Za-z0-9_:\\-][A-Za-z0-9_.:\\-]*", title: t("form.nameRule"), ...attributes });
}

/**
 * Create a form around `fields`. `send()` returns a promise of `[key, values, ...details]`: a text, and elements with
 * details, shown as the result. A second click while the first command is running has no effect.
 */
export function commandForm({ label, submit, send, fields = [], more = [] }) {
  const result = element("output", { class: "result", role: "status" });
  const button = element("button", { class: "primary" }, submit);
  const actions = element("div", { class: "actions" }, button, ...more);
  const form = element("form", { class: "command", "aria-label": label }, ...fields, actions, result);
  form.addEventListener("input", () => {
    form.dataset.touched = "";
    result.replaceChildren();
  });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (await run(button, result, send)) delete form.dataset.touched;
  });
  return form;
}

/** Shows the effect of a command, with the button that sends it. */
export function confirmation({ label, effect, submit, send }) {
  const form = commandForm({ label, submit, send, fields: [element("p", { class: "effect", id: "command-effect", tabindex: -1 }, effect)] });
  const sure = form.querySelector("button");
  sure.className = "danger";
  setAttribute(sure, "aria-describedby", "command-effect");
  return form;
}

/** Return the form with unsent input; null if there is none. */
export function unsentForm() {
  return document.querySelector("form.command[data-touched]");
}

// Answers that are no success.
const UNDONE = { "command.FAILED": "bad", "command.UNKNOWN": "bad", "command.PENDING": "wait", "queue.noneRerouted": "bad", "queue.nothingToLock": "bad", "queue.confirm": "wait" };

/** Send a command from a button and show its result in `result`. Returns whether it was done. */
export async function run(button, result, send) {
  if (button.getAttribute("aria-busy") === "true") return false;
  button.setAttribute("aria-busy", "true");
  show(result, "wait", t("command.sent"));
  try {
    const [key, values, ...details] = await send();
    show(result, UNDONE[key] ?? "fine", t(key, values), details);
    emit("poseshow", null);
    return true;
  } catch (error) {
    if (error instanceof RefusedError && error.status !== NO_ANSWER) show(result, "bad", t("command.refused"), [foreign("span", error.message)], error.errors);
    else show(result, "bad", t(error.key ?? "command.unanswered"));
    return false;
  } finally {
    button.removeAttribute("aria-busy");
  }
}

function show(result, level, text, details = [], errors = []) {
  result.dataset.level = level;
  result.replaceChildren(element("strong", {}, text));
  for (const each of details) result.append(" ", each);
  if (errors.length) result.append(element("ul", {}, ...errors.map((each) => foreign("li", each))));
  result.scrollIntoView({ block: "nearest" }); // below a form it can be out of sight
}

/**
 * Convert the answer to an instant action for {@link run}. `done` is the text for success; `values` (`name` of the
 * vehicle, `action`) are filled into each text.
 */
export function outcome(answer, done, values) {
  const result = answer.result ? [foreign("span", answer.result)] : [];
  if (answer.status === "FINISHED") return [done, values, ...result];
  return [`command.${answer.status}`, values, reasonElement("span", answer), ...result.flatMap((each) => ["–", each])];
}

/** Fields for a point or location and one of its operations. `destination`: what they show at first; `before`: the fields of the place before. */
export class PlaceFields {
  constructor(plant, destination = {}, before = null) {
    this.plant = plant;
    this.before = before;
    this.first = destination;
    this.place = select(placeOptions(plant.model), { name: "place", required: true });
    this.operation = select([], { name: "operation" });
    this.place.addEventListener("change", () => this.#showOperations());
    const pick = button(t("form.pick"), () => emit("placepick", { take: (name) => this.#choose(name), done: () => pick.focus() }));
    this.element = element("div", { class: "fields" }, field(t("robots.place"), this.place), field(t("form.operation"), this.operation), pick);
    this.place.value = destination.locationName ?? "";
    this.#showOperations();
    if (destination.operation) this.operation.value = destination.operation;
  }

  /** Return the destination as in the order service's API. The same operation keeps what the fields do not show. */
  get destination() {
    const kept = this.operation.value === this.first.operation ? this.first : {};
    return { ...kept, locationName: this.place.value, operation: this.operation.value };
  }

  /** Return whether a point is selected. */
  get isPoint() {
    return this.plant.model.points.some((point) => point.name === this.place.value);
  }

  #choose(name) {
    if (![...this.place.options].some(({ value }) => value === name)) return; // a path
    this.place.value = name;
    this.#showOperations();
    this.place.dispatchEvent(new Event("input", { bubbles: true }));
  }

  // What is loaded at one station is unloaded at the next.
  #showOperations() {
    const names = this.plant.operationsAt(this.place.value);
    refillSelect(this.operation, names.map(operation));
    const before = this.before?.destination.operation;
    if (this.operation.value === before && !this.isPoint) this.operation.value = names.find((name) => name !== before) ?? before;
  }
}

/** Fields for the destinations of an order: at least one. `destinations`: those they show at first. */
export class StopFields {
  #stops = [];

  constructor(plant, destinations = [{}]) {
    this.plant = plant;
    this.list = element("ol", { class: "stops" });
    this.element = element("div", {}, this.list, button(t("orderForm.addStop"), () => this.#add({}).place.focus()));
    for (const each of destinations) this.#add(each);
  }

  /** Return the destinations as in the order service's API. */
  get destinations() {
    return this.#stops.map((each) => each.destination);
  }

  // One without a place, such as a coordinate, can only be kept or removed.
  #add(destination) {
    const kept = destination.coordinate && { destination, element: element("span", {}, t("dispatch.coordinate")) };
    const stop = kept || new PlaceFields(this.plant, destination, this.#stops.at(-1));
    const remove = button(t("orderForm.removeStop"), () => {
      if (this.#stops.length === 1) return;
      this.#stops = this.#stops.filter((each) => each !== stop);
      row.remove();
    });
    const row = element("li", {}, stop.element, remove);
    this.#stops.push(stop);
    this.list.append(row);
    return stop;
  }
}

function emit(name, detail) {
  document.dispatchEvent(new CustomEvent(name, { detail }));
}

/** Return the options of a vehicle select: those of the plant model, and others known to the order service. */
export function vehicles({ store, plant }) {
  const known = [...store.robots.values()].map((robot) => robot.vehicle?.name).filter(Boolean);
  const names = new Set([...(plant.model?.vehicles ?? []).map((each) => each.name), ...known]);
  return [...names].sort(byName).map((name) => [name, name, true]);
}

/** Return the option of an operation select. */
export function operation(name) {
  return ["MOVE", "PARK", "NOP"].includes(name) ? [name, t(`operation.${name}`)] : [name, name, true];
}

function placeOptions(model) {
  const names = (things) => (things ?? []).map((each) => each.name).sort(byName).map((name) => [name, name, true]);
  return [
    ["", t("form.choose")],
    { group: t("layer.locations"), options: names(model?.locations) },
    { group: t("layer.points"), options: names(model?.points) },
  ];
}

const RAD = Math.PI / 180;

/** Fields for x, y (m) and heading (degrees). The pose is also shown on the map. */
export class PoseFields {
  #touched = false;

  constructor({ headingRequired = false } = {}) {
    this.x = numberInput({ name: "x", required: true });
    this.y = numberInput({ name: "y", required: true });
    const bounds = { name: "heading", min: -180, max: 180 };
    this.heading = numberInput(headingRequired ? { ...bounds, required: true } : bounds);
    this.element = element(
      "div",
      { class: "fields" },
      field(t("form.x"), this.x),
      field(t("form.y"), this.y),
      field(t(headingRequired ? "form.heading" : "form.headingOptional"), this.heading),
      button(t("form.pick"), () => this.#pick()),
    );
    this.element.addEventListener("input", () => {
      this.#touched = true;
      this.show();
    });
  }

  /** Return `{x, y, theta}`; `theta` (rad) is null if no heading is requested. */
  get pose() {
    const degrees = numberOf(this.heading);
    return { x: numberOf(this.x), y: numberOf(this.y), theta: degrees === null ? null : degrees * RAD };
  }

  set pose({ x, y, theta }) {
    this.x.value = x.toFixed(2);
    this.y.value = y.toFixed(2);
    this.heading.value = theta === null ? "" : Math.round(theta / RAD);
    this.element.dispatchEvent(new Event("input", { bubbles: true }));
  }

  /** Fill in a pose, unless one was entered, picked or filled in before. */
  suggest(pose) {
    if (this.#touched) return;
    this.pose = pose;
    delete this.element.closest("form")?.dataset.touched; // not typed by hand
  }

  /** Show the pose on the map. */
  show() {
    const pose = this.pose;
    const complete = Number.isFinite(pose.x) && Number.isFinite(pose.y) && pose.x !== null && pose.y !== null;
    emit("poseshow", complete ? pose : null);
  }

  #pick() {
    emit("posepick", { take: (pose) => (this.pose = pose), done: () => this.element.querySelector("button").focus() });
  }
}
