// Command buttons of a robot, and the forms they open.

import { command, newKey, RefusedError } from "./api.js";
import { button, element, field, foreign, numberInput, numberOf, select, setAttribute, setText } from "./dom.js";
import { orderOf, reasonOf } from "./explanations.js";
import { charging } from "./fleet_commands.js";
import { commandForm, confirmation, outcome, PlaceFields, PoseFields, run } from "./forms.js";
import { number, t } from "./i18n.js";
import { distanceOffPaths, drawPlan } from "./map/plan_painter.js";

const OFF_PATHS = 1; // m

function dispatchForm(vehicle, plant, robot) {
  const place = new PlaceFields(plant);
  const pose = new PoseFields();
  const priority = numberInput({ name: "priority", value: 0, min: -1000, max: 1000, step: 1 });
  const kind = select([["place", t("dispatch.place")], ["coordinate", t("dispatch.coordinate")]], { name: "kind" });
  const chosen = element("div");
  const off = offPathsHint(pose, plant, robot);
  const choose = () => {
    chosen.replaceChildren(...(kind.value === "place" ? [place.element] : [pose.element, off]));
    if (kind.value === "place") document.dispatchEvent(new CustomEvent("poseshow", { detail: null }));
    else pose.show();
  };
  kind.addEventListener("change", choose);
  choose();
  let key = newKey();
  return commandForm({
    label: t("dispatch.title"),
    submit: t("dispatch.send"),
    fields: [field(t("dispatch.kind"), kind), chosen, field(t("form.priority"), priority)],
    send: async () => {
      const where = kind.value === "place" ? placeBody(place) : { coordinate: pose.pose };
      const body = { ...where, priority: numberOf(priority) ?? 0, idempotencyKey: key };
      const order = await command(["vehicles", vehicle, "dispatch"], body);
      key = newKey();
      return ["done.orderCreated", { name: order.name }];
    },
  });
}

// Says how far the straight drive to a coordinate leaves the paths; empty while it does not.
function offPathsHint(pose, plant, robot) {
  const hint = element("p", { class: "effect", role: "status" });
  const plan = plant.model && drawPlan(plant.model);
  pose.element.addEventListener("input", () => {
    const { x, y } = pose.pose;
    const from = robot()?.position;
    const known = plan?.named.size && from && Number.isFinite(x) && Number.isFinite(y) && x !== null && y !== null;
    const off = known ? distanceOffPaths(plan, [from.x, from.y], [x, y]) : 0;
    setText(hint, off > OFF_PATHS ? t("dispatch.offPaths", { distance: number(off, 1) }) : "");
  });
  return hint;
}

/** The integration levels, as in the API. */
export const LEVELS = ["TO_BE_UTILIZED", "TO_BE_RESPECTED", "TO_BE_NOTICED", "TO_BE_IGNORED"];
const UNSEEN = ["TO_BE_NOTICED", "TO_BE_IGNORED"]; // other robots do not avoid it

function levelForm({ name: vehicle, integrationLevel }, suggested, person) {
  const level = select([["", t("form.choose")], ...LEVELS.map((each) => [each, t(`integration.${each}`)])], { name: "level", required: true });
  level.value = suggested ?? integrationLevel;
  const details = element("div");
  const choose = () => {
    const sure = element("input", { type: "checkbox", name: "sure", required: true });
    const effect = element("p", { class: "effect" }, t("integration.effect", { name: vehicle }));
    details.replaceChildren(...(UNSEEN.includes(level.value) ? [effect, field(t("integration.sure", { name: vehicle }), sure)] : []));
  };
  level.addEventListener("change", choose);
  if (suggested) choose();
  return commandForm({
    label: t("integration.title"),
    submit: t("integration.send"),
    fields: [element("p", { class: "hint" }, t("integration.hint")), field(t("integration.title"), level), details],
    send: async () => {
      await command(["vehicles", vehicle, "integrationLevel"], { integrationLevel: level.value, by: person() }, "PUT");
      return ["done.integration", { name: vehicle, level: t(`integration.${level.value}`) }];
    },
  });
}

function placeBody(place) {
  const { locationName, operation } = place.destination;
  return place.isPoint ? { point: locationName, operation } : { locationName, operation };
}

function positionForm(vehicle, position) {
  const pose = new PoseFields({ headingRequired: true });
  const form = commandForm({
    label: t("position.title"),
    submit: t("position.title"),
    fields: [element("p", { class: "hint" }, t("position.hint")), pose.element],
    send: async () => {
      const body = { actionType: "initializePosition", pose: pose.pose };
      const answer = await command(["vehicles", vehicle, "instantActions"], body);
      return outcome(answer, "done.position", { name: vehicle, action: t("position.title") });
    },
  });
  // The robot may be known before its position.
  form.update = (robot) => robot?.position && pose.suggest(robot.position);
  form.update({ position });
  return form;
}

function sessionForm(vehicle, { namespace, domainId }) {
  const pattern = "/?([A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?"; // as ROS takes it
  const space = element("input", { type: "text", name: "namespace", required: true, pattern, maxlength: 200, spellcheck: "false" });
  space.value = namespace;
  const domain = numberInput({ name: "domainId", required: true, min: 0, max: 232, step: 1 });
  domain.value = domainId;
  const keep = element("input", { type: "checkbox", name: "keep" });
  return commandForm({
    label: t("session.title"),
    submit: t("integration.send"),
    fields: [
      element("p", { class: "hint" }, t("session.hint")),
      field(t("session.namespace"), space),
      field(t("session.domain"), domain),
      field(t("session.keep"), keep),
    ],
    send: async () => {
      const values = { namespace: space.value, domainId: numberOf(domain), keep: keep.checked };
      const parameters = Object.entries(values).map(([key, value]) => ({ key, value }));
      const body = { actionType: "nena:configureRosSession", parameters };
      const answer = await command(["vehicles", vehicle, "instantActions"], body);
      return outcome(answer, "done.address", { name: vehicle, action: t("session.title") });
    },
  });
}

/** Actions that every robot supports, offered until its factsheet has been received. */
const STANDARD = ["factsheetRequest", "stateRequest", "startPause", "stopPause", "cancelOrder"];
/** Needs a pose; has its own form. */
const ELSEWHERE = "initializePosition";

async function actionForm(vehicle, robot) {
  const known = await knownActions(robot);
  const actions = instantActions(known ?? []);
  const options = actions.map((each) => [each.actionType, each.actionType, true]);
  const kind = select([["", t("form.choose")], ...options], { name: "action", required: true });
  const details = element("div", { class: "fields" });
  let inputs = [];
  const choose = () => {
    const action = actions.find((each) => each.actionType === kind.value);
    inputs = (action?.actionParameters ?? []).map(parameter);
    const words = action?.description ? [foreign("p", action.description, { class: "hint" })] : [];
    const box = () => element("input", { type: "checkbox", name: "sure", required: true });
    const sure = kind.value === "shutdown" ? [field(t("action.byHand", { name: vehicle }), box())] : [];
    details.replaceChildren(...words, ...inputs.map((each) => each.element), ...sure);
  };
  kind.addEventListener("change", choose);
  return commandForm({
    label: t("action.title"),
    submit: t("action.send"),
    fields: [
      element("p", { class: "hint" }, t(known ? "action.hint" : "action.noFactsheet")),
      field(t("action.type"), kind),
      details,
    ],
    send: async () => {
      const parameters = inputs.map((each) => each.read()).filter(Boolean);
      const actionType = kind.value;
      const answer = await command(["vehicles", vehicle, "instantActions"], { actionType, parameters });
      return outcome(answer, "done.action", { name: vehicle, action: actionType });
    },
  });
}

async function knownActions(robot) {
  const path = [robot.manufacturer, robot.serialNumber, "actions"].map(encodeURIComponent).join("/");
  if (!robot.body) return null; // no factsheet received
  const answer = await fetch(`api/v1/robots/${path}`);
  return answer.ok ? answer.json() : null;
}

function instantActions(known) {
  const listed = known.filter(
    (each) => each.actionScopes.includes("INSTANT") && each.actionType !== ELSEWHERE,
  );
  const missing = STANDARD.filter((name) => !listed.some((each) => each.actionType === name));
  return [...listed, ...missing.map((actionType) => ({ actionType }))];
}

// A field for one parameter: `read()` returns it as sent, or null if it is omitted.
function parameter({ key, valueDataType, description, isOptional }) {
  const control = controlFor(valueDataType, isOptional);
  const label = t(isOptional ? "action.optional" : "action.parameter", { key });
  const words = description ? [foreign("span", description, { class: "hint" })] : [];
  const made = element("div", {}, field(label, control), ...words);
  control.addEventListener("input", () => control.setCustomValidity(""));
  return { element: made, read: () => (control.value === "" ? null : { key, value: valueOf(control, valueDataType) }) };
}

function controlFor(type, optional) {
  const required = !optional;
  const choice = [["", t("form.choose")], ["true", t("form.yes")], ["false", t("form.no")]];
  if (type === "BOOL") return select(choice, { required });
  if (type === "INTEGER") return numberInput({ step: 1, required });
  if (type === "NUMBER") return numberInput({ required });
  if (type === "STRING") return element("input", { type: "text", required });
  const hint = type === "ARRAY" ? "[ ]" : "{ }";
  const area = element("textarea", { rows: 3, required, placeholder: hint, spellcheck: "false" });
  area.addEventListener("change", () => area.setCustomValidity(fits(area.value) ? "" : t("form.json")));
  return area;
}

function fits(text) {
  try {
    JSON.parse(text || "null");
    return true;
  } catch {
    return false;
  }
}

function valueOf(control, type) {
  return type === "STRING" ? control.value : JSON.parse(control.value);
}

class RobotCommands extends HTMLElement {
  #open = null;
  #openers = new Map(); // by the key of the text

  /** Show the commands of one robot; `noCommands`: key of the reason why they are not available. */
  show({ store, plant, noCommands, person }, robotId) {
    this.store = store;
    this.plant = plant;
    this.robotId = robotId;
    this.note = element("p", { class: "hint" });
    this.result = element("output", { class: "result", role: "status" });
    this.place = element("div", { class: "opened" });
    this.pause = this.#direct("pause", () => this.#act("pause", "pause"));
    this.resume = this.#direct("resume", () => this.#act("resume", "resume"));
    this.cancel = this.#opener("command.cancel", () => this.#cancelForm());
    this.wake = this.#direct("wake", () => this.#act("stopHibernation", "wake"));
    this.buttons = [
      this.wake,
      this.#opener("command.dispatch", () => dispatchForm(this.#vehicle, plant, () => this.#robot)),
      this.#opener("command.position", () => positionForm(this.#vehicle, this.#robot.position)),
      this.pause,
      this.resume,
      this.cancel,
      this.#opener("command.action", () => actionForm(this.#vehicle, this.#robot)),
      this.#opener("command.level", (level) => levelForm(this.#robot.vehicle, level, person)),
    ];
    this.charge = this.#direct("charge", () => this.#chargeNow());
    this.driverOn = this.#direct("driverOn", () => this.#act("nena:startRosSession", "driverOn"));
    this.driverOff = this.#opener("command.driverOff", () => this.#driverOffForm());
    this.sessionButtons = [
      this.driverOn,
      this.driverOff,
      this.#opener("command.address", () => sessionForm(this.#vehicle, this.#robot.rosSession)),
    ];
    this.buttons.push(this.charge, ...this.sessionButtons);
    this.noCommands = noCommands;
    this.bar = element("div", { class: "actions" }, ...this.buttons);
    this.replaceChildren(this.bar, this.note, this.result, this.place);
    this.update();
  }

  /** Open the form of a command; `value`: what to suggest in it. */
  begin(key, value) {
    const { opener, make } = this.#openers.get(key);
    this.#open = null;
    return this.#toggle(opener, () => make(value));
  }

  /** Update the buttons after a change of the robot. */
  update() {
    const possible = !this.noCommands && Boolean(this.#vehicle);
    this.bar.hidden = !possible;
    this.place.firstElementChild?.update?.(this.#robot);
    this.#updatePause();
    this.#updateSession();
    this.cancel.disabled = !this.#order;
    this.#openers.get("command.dispatch").opener.disabled = !this.plant.model; // which names the places
    this.charge.disabled = !this.plant.model || Boolean(this.#robot?.battery?.charging);
    this.wake.hidden = this.#robot?.connection !== "HIBERNATING";
    this.note.hidden = possible;
    this.note.textContent = t(this.noCommands ?? "command.unknownVehicle");
  }

  // Only the one of the two that has an effect; it receives the focus.
  #updatePause() {
    const paused = Boolean(this.#robot?.paused);
    const [shown, other] = paused ? [this.resume, this.pause] : [this.pause, this.resume];
    const focused = document.activeElement === other;
    shown.hidden = false;
    other.hidden = true;
    this.resume.disabled = Boolean(this.#robot?.reasonCode.startsWith("stopped")); // only the end of the stop resumes it
    if (focused) shown.focus();
  }

  // Only for robots with a ROS session; only the button that changes its state is enabled.
  #updateSession() {
    const state = this.#robot?.rosSession?.state;
    for (const each of this.sessionButtons) each.hidden = !state;
    this.driverOn.disabled = ["ACTIVE", "INITIATING"].includes(state);
    this.driverOff.disabled = ["NOT_ACTIVE", "TERMINATING"].includes(state);
  }

  get #robot() {
    return this.store.robots.get(this.robotId);
  }

  get #vehicle() {
    return this.#robot?.vehicle?.name;
  }

  get #order() {
    return this.#robot && orderOf(this.#robot, this.store.orders);
  }

  #direct(name, send) {
    const made = button(t(`command.${name}`), () => run(made, this.result, send));
    return made;
  }

  #opener(key, make) {
    const made = button(t(key), () => this.#toggle(made, make), { "aria-expanded": "false" });
    this.#openers.set(key, { opener: made, make });
    return made;
  }

  async #toggle(opener, make) {
    const close = this.#open === opener;
    document.dispatchEvent(new CustomEvent("poseshow", { detail: null }));
    this.#open = close ? null : opener;
    for (const each of this.buttons) {
      if (each.hasAttribute("aria-expanded")) setAttribute(each, "aria-expanded", String(each === this.#open));
    }
    this.result.replaceChildren();
    this.place.replaceChildren(...(close ? [] : [await make()]));
    this.place.querySelector("select, input, .effect")?.focus();
  }

  // `name`: of the command, as in the texts under `command.` and `done.`.
  async #act(actionType, name) {
    const vehicle = this.#vehicle;
    const answer = await command(["vehicles", vehicle, "instantActions"], { actionType });
    return outcome(answer, `done.${name}`, { name: vehicle, action: t(`command.${name}`).replace(" …", "") });
  }

  async #chargeNow() {
    const { jobs, left } = charging([this.#robot], this);
    if (!jobs.length) throw new RefusedError({ detail: left.filter(Boolean).join(" ") });
    await jobs[0].send();
    return ["done.charge", { line: jobs[0].line }];
  }

  // A transport order is withdrawn at the order service; any other order is cancelled at the robot.
  #cancelForm() {
    const robot = this.#robot;
    const order = this.#order;
    if (!order) return element("p", { class: "hint" }, t("confirm.noOrder"));
    const values = { name: robot.name, order: order.name, doing: reasonOf(robot) };
    const load = robot.loads?.length ? ` ${t("confirm.loaded", values)}` : "";
    return confirmation({
      label: t("confirm.cancelTitle"),
      effect: t(order.id ? "confirm.withdraw" : "confirm.cancel", values) + load,
      submit: t("order.withdrawSure", { name: order.name }),
      send: () => {
        this.#checkStill(order);
        return order.id ? this.#withdraw(order.id) : this.#act("cancelOrder", "cancel");
      },
    });
  }

  // The robot may have another order by now than the one that was confirmed.
  #checkStill({ name }) {
    const now = this.#order?.name;
    if (now !== name) throw new RefusedError({ detail: t("confirm.otherOrder", { name, now: now ?? t("none") }) });
  }

  async #withdraw(order) {
    await command(["transportOrders", order, "withdrawal"], { reason: "withdrawn at the control panel" });
    return ["done.withdrawn", { name: order }];
  }

  #driverOffForm() {
    return confirmation({
      label: t("confirm.driverOffTitle"),
      effect: t("confirm.driverOff", { name: this.#robot.name }),
      submit: t("confirm.driverOffSend"),
      send: () => this.#act("nena:stopRosSession", "driverOff"),
    });
  }
}

customElements.define("nena-robot-commands", RobotCommands);
