// The page of a robot: why it is not moving, commands, order, errors, actions, goals, details, recordings, deviations.

import { button, element, foreign, progressBar, refill, setAttribute, setText, showProgress, verbatim } from "./dom.js";
import { adviceForError, causesOfRobot, conditionText, errorText, nodeName, orderOf, setBy, useOf } from "./explanations.js";
import { age, dateAndTime, degrees, has, number, t } from "./i18n.js";
import { address, backLink } from "./router.js";
import "./queue.js";
import "./recordings.js";
import "./robot_commands.js";

const TICK = 1000;

class RobotPage extends HTMLElement {
  #id = null;

  /** Attach to `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
    fleet.store.addEventListener("change", (event) => {
      if (this.#id && (event.detail.robots.size || event.detail.orders.size || event.detail.parts.size)) this.#update();
    });
    fleet.plant.addEventListener("change", () => this.#id && this.#update());
    fleet.link.addEventListener("state", () => this.#id && this.#update());
    setInterval(() => this.#id && this.#update(), TICK);
  }

  /** Show a robot; null hides the page. */
  open(id) {
    this.#id = id;
    if (id) this.#build();
    else this.replaceChildren();
  }

  /** Begin a command: `name` is its text's key, `value` what to suggest. */
  begin(name, value) {
    return this.commands.begin(name, value);
  }

  #build() {
    this.heading = verbatim("h2", "", { tabindex: -1 });
    this.chip = element("span", { class: "chip" });
    this.use = element("span", { class: "use" });
    this.why = element("nena-why-list");
    this.commands = element("nena-robot-commands");
    this.facts = element("dl", { class: "facts" });
    this.progress = progressBar();
    this.route = element("ol", { class: "route" });
    this.order = element("section", {}, element("h3", {}, t("robots.order")), this.progress.box, this.route);
    this.errors = this.#section("robot.errors");
    this.actions = this.#section("robot.actions");
    this.goals = this.#section("robot.goals");
    this.deviations = this.#section("robot.deviations");
    this.queue = element("nena-queue");
    this.queueSection = element("section", {}, this.queue);
    this.recordings = element("nena-recordings");
    this.gone = element("p", { class: "hint" }, t("robot.gone"));
    const toMap = button(t("robot.toMap"), () => this.dispatchEvent(new CustomEvent("reveal", { detail: this.#id })));
    const head = element("header", { class: "head" }, backLink(), this.heading, this.chip, this.use, toMap);
    this.whyTitle = element("h3");
    const whySection = element("section", {}, this.whyTitle, this.why);
    const commandSection = element("section", {}, element("h3", {}, t("robot.commands")), this.commands);
    const recordingSection = element("section", {}, element("h3", {}, t("robot.recordings")), this.recordings);
    const factSection = element("section", {}, element("h3", {}, t("map.menu.page")), this.facts);
    this.body = element("div", {}, whySection, this.queueSection, commandSection, this.order, this.errors, this.actions, this.goals, factSection, recordingSection, this.deviations);
    this.replaceChildren(head, this.gone, this.body);
    this.commands.show(this.fleet, this.#id);
    this.queueOf = null;
    this.recordings.show(this.fleet, this.#id);
    this.#update();
    this.heading.focus({ preventScroll: true });
  }

  #section(key) {
    const made = element("section", {}, element("h3", {}, t(key)), element("div"));
    return made;
  }

  #update() {
    const robot = this.fleet.store.robots.get(this.#id);
    this.gone.hidden = Boolean(robot);
    this.body.hidden = this.chip.hidden = !robot;
    setText(this.heading, robot?.name ?? this.#id);
    if (!robot) return;
    setText(this.chip, conditionText(robot));
    setAttribute(this.chip, "data-condition", robot.condition);
    setAttribute(this.chip, "data-urgent", robot.urgent && "");
    setText(this.use, [useOf(robot), setBy(robot.vehicle?.levelSet)].filter(Boolean).join(" "));
    setText(this.whyTitle, t(robot.driving ? "why.drives" : "why.title"));
    this.why.show(causesOfRobot(robot, this.fleet));
    this.#updateQueue(robot.vehicle?.name ?? null);
    this.commands.update();
    refill(this.facts, factsOf(robot, this.fleet.store.now()), rows);
    this.#updateOrder(robot);
    fillList(this.errors, robot.errors, error);
    fillList(this.actions, robot.actions, action);
    const goals = goalsOf(robot);
    fillList(this.goals, goals, (each) => goal(each, goals));
    const deviations = robot.problem ? [...robot.deviations, robot.problem] : robot.deviations;
    fillList(this.deviations, deviations, (each) => element("li", {}, foreign("p", each)));
  }

  // Shown again for another vehicle: a robot may be known before its vehicle is.
  #updateQueue(vehicle) {
    if (vehicle && vehicle !== this.queueOf) this.queue.show(this.fleet, vehicle, (level) => this.commands.begin("command.level", level));
    else if (vehicle) this.queue.update();
    this.queueOf = vehicle;
    this.queueSection.hidden = !vehicle || this.queue.hidden;
  }

  #updateOrder(robot) {
    const order = orderOf(robot, this.fleet.store.orders);
    this.order.hidden = !order;
    if (!order) return;
    showProgress(this.progress, order);
    refill(this.route, [order, robot.order], () => routeOf(robot, order));
  }
}

function fillList(section, entries, make) {
  section.hidden = entries.length === 0;
  refill(section.lastElementChild, entries, () => [element("ul", { class: "entries" }, ...entries.map(make))]);
}

function routeOf(robot, { name, id }) {
  const nodeOf = (nodeId) => (nodeId ? nodeName(robot, nodeId) : t("none"));
  const title = id
    ? element("li", {}, element("a", { href: address("orders", id), translate: "no" }, name))
    : verbatim("li", name);
  if (!robot.order?.active) return [title];
  const last = element("li", { class: "done" }, t("robot.lastNode", { node: nodeOf(robot.order.lastNodeId) }));
  const steps = robot.order.ahead.map(({ nodeId, released }) =>
    element("li", { class: released ? "released" : "" }, t(released ? "robot.node" : "robot.nodeWaiting", { node: nodeOf(nodeId) })),
  );
  return [title, last, ...steps];
}

function error(each) {
  const advice = adviceForError(each);
  const made = element("li", { "data-level": each.errorLevel });
  made.append(element("strong", {}, t(`level.${each.errorLevel}`)), " ", element("span", {}, errorText(each.errorType)));
  if (each.description) made.append(foreign("p", each.description));
  if (each.hint) made.append(foreign("p", each.hint, { class: "advice" }));
  if (advice) made.append(element("p", { class: "advice" }, advice));
  const about = Object.entries(each.references).map(([key, value]) => `${key} ${value}`);
  if (about.length) made.append(verbatim("p", about.join(" · "), { class: "detail" }));
  return made;
}

function action(each) {
  const made = element("li", { "data-status": each.status });
  made.append(verbatim("span", each.actionType ?? each.actionId), " ", element("strong", {}, t(`action.${each.status}`)));
  if (each.result) made.append(foreign("p", each.result));
  return made;
}

function goal(each, goals) {
  const external = each.infoType === "externalGoal";
  const status = replaced(each, goals) ? "REPLACED" : (each.references.status ?? "");
  const made = element("li", {}, t(external ? "goal.external" : "goal.own"), " ");
  if (has(`goal.${status}`)) made.append(element("strong", {}, t(`goal.${status}`)));
  else made.append(verbatim("strong", status));
  const details = element("summary", {}, t("goal.details"));
  made.append(element("details", {}, details, verbatim("p", each.references.goalId, { class: "detail" })));
  return made;
}

const RUNNING = ["ACCEPTED", "EXECUTING", "CANCELING"];

// Navigation goals; without an order only those in progress, as the robot keeps reporting the last ones.
function goalsOf({ condition, information }) {
  const goals = information.filter((each) => "goalId" in each.references);
  const idle = ["IDLE", "CHARGING"].includes(condition);
  return idle ? goals.filter((each) => RUNNING.includes(each.references.status)) : goals;
}

// Nav2 reports a goal as aborted when the agent's next goal takes its place.
function replaced({ infoType, references }, goals) {
  const running = ["ACCEPTED", "EXECUTING"];
  const next = goals.some((other) => other.infoType === infoType && running.includes(other.references.status));
  return infoType === "goal" && references.status === "ABORTED" && next;
}

// Rows `[key, text, same]` about the robot; `same`: the value is the same in all languages.
function factsOf(robot, now) {
  const at = robot.position;
  const { vx, vy } = robot.velocity ?? {};
  const speed = vx == null ? null : Math.hypot(vx, vy ?? 0);
  return [
    ["eventLog.connection", t(`connection.${robot.connection ?? "NONE"}`)],
    ["fact.session", t(`session.${robot.session}`)],
    ["fact.ros", robot.rosSession && t("fact.rosText", robot.rosSession), true],
    ["robots.lastState", robot.lastState && t("orders.created", { age: age((now - Date.parse(robot.lastState)) / 1000) })],
    ["eventLog.operatingMode", robot.operatingMode && t(`mode.${robot.operatingMode}`)],
    ["eventLog.position", at && t("map.position", { x: number(at.x, 2), y: number(at.y, 2) })],
    ["fact.heading", at && degrees(at.theta)],
    ["fact.localized", at && t(at.localized ? "form.yes" : "form.no")],
    ["fact.speed", speed === null ? null : t("unit.speed", { value: number(speed, 2) })],
    ["robots.battery", robot.battery && batteryText(robot.battery)],
    ["eventLog.loads", robot.loads && loadsText(robot.loads), Boolean(robot.loads?.length)],
    ["fact.map", at?.mapId, true],
    ["fact.maps", robot.maps?.length && robot.maps.map(mapText).join(", "), true],
    ["fact.body", robot.body && t("fact.bodyText", { ...robot.body, length: number(robot.body.length, 2), width: number(robot.body.width, 2) })],
    ["fact.topics", `${robot.manufacturer} / ${robot.serialNumber}`, true],
    ["fact.version", robot.protocolVersion, true],
    ["fact.clock", robot.clockSkew !== null && t("robots.skew", { seconds: number(robot.clockSkew) })],
    ["fact.since", dateAndTime(robot.conditionSince), true],
  ].filter(([, text]) => text);
}

function mapText({ mapId, mapVersion, status }) {
  const map = `${mapId} ${mapVersion}`;
  return status === "DISABLED" ? t("fact.mapDisabled", { map }) : map;
}

function rows(facts) {
  return facts.flatMap(([key, text, same]) => [
    element("dt", {}, t(key)),
    same ? verbatim("dd", text) : element("dd", {}, text),
  ]);
}

function batteryText({ charge, charging, voltage, range }) {
  const parts = [t("battery.charge", { charge: number(charge) })];
  if (charging) parts.push(t("battery.charging"));
  if (voltage) parts.push(t("unit.volt", { value: number(voltage, 1) }));
  if (range) parts.push(t("unit.range", { value: number(range) }));
  return parts.join(", ");
}

function loadsText(loads) {
  if (!loads.length) return t("fact.noLoads");
  return loads.map((load) => load.loadId ?? load.loadType ?? t("fact.load")).join(", ");
}

customElements.define("nena-robot-page", RobotPage);
