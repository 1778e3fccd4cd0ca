// Commands to several robots at once: pause, resume, cancel their orders, send to park or to charge.

import { command, newKey } from "./api.js";
import { button, element, foreign, setText, verbatim } from "./dom.js";
import { orderOf, reasonOf } from "./explanations.js";
import { byName, number, plural, t } from "./i18n.js";
import { reasonElement } from "./reasons.js";

const LINES = 12; // of a confirmation
const CHARGED = 95; // percent from which a robot can leave its charger to another

/**
 * A command to each of some robots: `make(robots, fleet)` returns its `jobs`, each `{name, line, send}`, and `left`: texts on robots
 * that are left out. `line` says what will happen, unless the names of the robots are enough.
 */
const COMMANDS = {
  pause: { make: (robots) => ({ jobs: robots.map((robot) => ({ name: robot.name, send: () => act(robot, "pause") })), left: [] }) },
  resume: { asks: true, make: resuming },
  cancel: { asks: true, make: cancelling },
  park: { asks: true, make: parking },
  charge: { asks: true, make: charging },
};

/** Sends a command to each of the marked robots. */
class FleetCommands extends HTMLElement {
  /** Attach to the table in which robots are marked, and the plant model. */
  show(table, plant) {
    this.table = table;
    this.plant = plant;
    this.count = element("strong");
    const start = (kind) => () => (COMMANDS[kind].asks ? this.#ask(kind) : this.#send(kind, this.#plan(kind)));
    this.buttons = Object.fromEntries(Object.keys(COMMANDS).map((kind) => [kind, button(t(`several.${kind}`), start(kind))]));
    const all = button(t("several.all"), () => table.mark(table.ids, true));
    const clear = button(t("several.clear"), () => table.mark([...table.marked], false));
    this.unseen = element("p", { class: "hint" });
    this.effect = element("p", { class: "effect", id: "several-effect", tabindex: -1 });
    this.lines = element("ul", { class: "entries" });
    this.sure = button("", () => this.#send(this.asked, this.planned), { class: "danger", "aria-describedby": "several-effect" });
    this.question = element("div", { class: "question", hidden: true }, this.effect, this.lines, element("div", { class: "actions" }, this.sure));
    this.result = element("output", { class: "result", role: "status" });
    this.bar = element("div", { class: "actions" }, this.count, ...Object.values(this.buttons), all, clear);
    this.replaceChildren(this.bar, this.unseen, this.question, this.result);
    for (const name of ["marked", "count"]) table.addEventListener(name, () => this.#update());
    table.addEventListener("marked", () => {
      this.#close();
      this.result.replaceChildren();
    });
    this.#update();
  }

  // Marked robots that can be commanded, and the names of the others; `hidden`: of those that the list does not show.
  #marked() {
    const { marked, store, ids } = this.table;
    const robots = [...marked].map((id) => store.robots.get(id)).filter(Boolean).sort((a, b) => byName(a.name, b.name));
    const shown = new Set(ids);
    return {
      robots: robots.filter(({ vehicle }) => vehicle),
      skipped: namesOf(robots.filter(({ vehicle }) => !vehicle)),
      hidden: namesOf(robots.filter(({ id }) => !shown.has(id))),
    };
  }

  #update() {
    const { robots, hidden } = this.#marked();
    this.bar.hidden = this.table.marked.size === 0;
    setText(this.count, plural("several.marked", this.table.marked.size));
    for (const each of Object.values(this.buttons)) each.disabled = !robots.length;
    this.unseen.hidden = !hidden.length;
    setText(this.unseen, t("several.unseen", { names: hidden.join(", ") }));
  }

  #plan(kind) {
    const { robots, skipped } = this.#marked();
    const { jobs, left } = COMMANDS[kind].make(robots, { store: this.table.store, plant: this.plant });
    return { jobs, left: [...left, skipped.length && t("several.skipped", { names: skipped.join(", ") })].filter(Boolean) };
  }

  #close() {
    this.question.hidden = true;
    this.asked = null;
  }

  // Show what will happen to which robots; a second click closes it.
  #ask(kind) {
    if (this.asked === kind) return this.#close();
    this.asked = kind;
    this.planned = this.#plan(kind);
    const { jobs, left } = this.planned;
    const lines = jobs.map(({ line }) => line).filter(Boolean);
    const more = lines.length - LINES;
    const texts = [...lines.slice(0, LINES), more > 0 && t("summary.more", { count: more }), ...left].filter(Boolean);
    setText(this.effect, t(jobs.length ? `several.effect.${kind}` : "several.nothing", { names: jobs.map(({ name }) => name).join(", ") }));
    this.lines.replaceChildren(...texts.map((text) => element("li", {}, text)));
    setText(this.sure, plural(`several.sure.${kind}`, jobs.length));
    this.sure.hidden = !jobs.length;
    this.question.hidden = false;
    this.result.replaceChildren();
    this.effect.focus();
  }

  async #send(kind, { jobs, left }) {
    if (this.bar.getAttribute("aria-busy")) return;
    this.bar.setAttribute("aria-busy", "true");
    if (this.question.contains(document.activeElement)) this.buttons[kind].focus();
    this.#close();
    this.result.dataset.level = "wait";
    setText(this.result, t("command.sent"));
    const answers = await Promise.allSettled(jobs.map(({ send }) => send()));
    this.bar.removeAttribute("aria-busy");
    const open = answers.flatMap((answer, at) => (answer.value?.status === "FINISHED" ? [] : [[jobs[at].name, answer]]));
    const count = { count: number(jobs.length - open.length), of: number(jobs.length) };
    const running = open.every(([, { value }]) => value?.status === "PENDING");
    this.result.dataset.level = open.length ? (running ? "wait" : "bad") : "fine";
    this.result.replaceChildren(element("strong", {}, t(`several.done.${kind}`, count)));
    const action = t(`several.${kind}`).replace(" …", "");
    const rows = open.map(([name, answer]) => unfinished(name, action, answer));
    if (!COMMANDS[kind].asks) rows.push(...left.map((text) => element("li", {}, text)));
    if (rows.length) this.result.append(element("ul", {}, ...rows));
  }
}

function namesOf(robots) {
  return robots.map(({ name }) => name);
}

const FINISHED = { status: "FINISHED" };

// An instant action; its answer has a `status`.
function act(robot, actionType) {
  return command(["vehicles", robot.vehicle.name, "instantActions"], { actionType });
}

function resuming(robots) {
  return { jobs: robots.map((robot) => ({ name: robot.name, send: () => act(robot, "resume") })), left: [] };
}

// A transport order is withdrawn at the order service; any other order is cancelled at the robot.
function cancelling(robots, { store }) {
  const orders = new Map(robots.map((robot) => [robot, orderOf(robot, store.orders)]));
  const free = namesOf(robots.filter((robot) => !orders.get(robot)));
  const jobs = robots.filter((robot) => orders.get(robot)).map((robot) => {
    const { name: order, id } = orders.get(robot);
    const load = robot.loads?.length ? ` ${t("confirm.loaded", { name: robot.name })}` : "";
    return {
      name: robot.name,
      line: t("several.line.cancel", { name: robot.name, order, doing: reasonOf(robot) }) + load,
      send: async () => {
        const now = orderOf(store.robots.get(robot.id) ?? {}, store.orders)?.name;
        if (now !== order) throw new Error(t("confirm.otherOrder", { name: order, now: now ?? t("none") }));
        if (!id) return act(robot, "cancelOrder");
        await command(["transportOrders", id, "withdrawal"], { reason: "withdrawn at the control panel" });
        return FINISHED;
      },
    };
  });
  return { jobs, left: [free.length && t("several.noOrder", { names: free.join(", ") })] };
}

// A parking order for each robot, to the nearest parking position (in a straight line) that is free and meant for no other robot.
function parking(robots, { store, plant }) {
  const points = (plant.model?.points ?? []).filter(({ type }) => type === "PARK_POSITION");
  const isParked = ({ vehicle }) => !vehicle.transportOrder && points.some(({ name }) => name === vehicle.currentPosition);
  const places = free(points.map((point) => ({ ...point, stands: [point.name], operation: "PARK" })), store);
  const sent = sending(robots.filter((robot) => !isParked(robot)), () => places, { type: "Park", dispensable: true });
  const parked = namesOf(robots.filter(isParked));
  return { jobs: sent.jobs, left: [parked.length && t("several.parked", { names: parked.join(", ") }), sent.unplaced && t("several.noPlace", { names: sent.unplaced })] };
}

/** Plan an order for each robot to recharge at the nearest free charger that it can use: `{jobs, left, full}`; `full`: which charged robots take the others. */
export function charging(robots, { store, plant }) {
  const own = (robot) => plant.model?.vehicles.find(({ name }) => name === robot.vehicle.name)?.properties["vda5050:rechargeOperation"] ?? "Charge";
  const locations = (plant.model?.locations ?? []).filter(({ locked }) => !locked);
  const places = locations.map((each) => ({ ...each, stands: each.links.map(({ point }) => point) }));
  const unused = new Set(free(places, store));
  const usable = (robot) => places.filter(({ name }) => plant.operationsAt(name).includes(own(robot)));
  const chargers = (robot) => usable(robot).filter((each) => unused.has(each)).map((each) => ({ ...each, operation: own(robot) }));
  const charges = (robot) => Boolean(robot.battery?.charging);
  const sent = sending(robots.filter((robot) => !charges(robot)), chargers, { type: "Charge" });
  const names = namesOf(robots.filter(charges));
  const at = new Set(robots.flatMap(usable).flatMap(({ name, stands }) => [name, ...stands]));
  const charged = [...store.robots.values()].filter(({ battery, vehicle }) => battery?.charge >= CHARGED && at.has(vehicle?.currentPosition));
  const shown = charged.map(({ name, battery }) => `${name} (${t("battery.charge", { charge: number(battery.charge) })})`).join(", ");
  const full = sent.unplaced && shown && t("several.full", { names: shown });
  return { jobs: sent.jobs, left: [names.length && t("several.charging", { names: names.join(", ") }), sent.unplaced && t("several.noCharger", { names: sent.unplaced }), full], full };
}

// An order for each robot to the nearest of its places, each of which takes one; `unplaced`: names of those that get none.
function sending(robots, placesOf, fields) {
  const [jobs, taken] = [[], new Set()];
  for (const robot of robots.filter(({ position }) => position)) {
    const places = placesOf(robot).filter((place) => !taken.has(place.name));
    const nearest = places.reduce((best, each) => (best && apart(robot, best) <= apart(robot, each) ? best : each), null);
    if (!nearest) continue;
    taken.add(nearest.name);
    jobs.push(sendingJob(robot, nearest, fields));
  }
  const sent = new Set(jobs.map(({ name }) => name));
  return { jobs, unplaced: namesOf(robots).filter((name) => !sent.has(name)).join(", ") };
}

// Places at which no robot stands, and that no order is for.
function free(places, store) {
  const taken = [...store.robots.values()].map(({ vehicle }) => vehicle?.currentPosition);
  const meant = [...store.orders.values()].filter(({ final }) => !final).flatMap(({ destinations }) => destinations.map(({ place }) => place));
  const excluded = new Set([...taken, ...meant]);
  return places.filter(({ name, stands }) => ![name, ...stands].some((each) => excluded.has(each)));
}

function apart({ position }, { xMm, yMm }) {
  return Math.hypot(position.x - xMm / 1000, position.y - yMm / 1000);
}

function sendingJob({ name, vehicle }, { name: place, operation }, fields) {
  const body = { destinations: [{ locationName: place, operation }], intendedVehicle: vehicle.name, ...fields, idempotencyKey: newKey() };
  const send = async () => {
    await command(["transportOrders"], body);
    return FINISHED;
  };
  const after = vehicle.transportOrder;
  return { name, line: after ? t("several.line.sendLater", { name, place, order: after }) : t("several.line.send", { name, place }), send };
}

// A robot that has not done it (yet), and why.
function unfinished(name, action, { reason, value }) {
  if (value) {
    const result = value.result ? [" – ", foreign("span", value.result)] : [];
    return element("li", {}, t(`command.${value.status}`, { name, action }), " ", reasonElement("span", value), ...result);
  }
  return element("li", {}, verbatim("span", name), ": ", reason.message ? foreign("span", reason.message) : t("command.unanswered"));
}

customElements.define("nena-fleet-commands", FleetCommands);
