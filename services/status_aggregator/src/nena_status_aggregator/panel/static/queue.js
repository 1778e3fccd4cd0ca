// Who waits behind a robot or a locked path, and what ends the wait: another route, taking the robot out, leading around it.

import { ask, askWith, command } from "./api.js";
import { button, element, refill, setText, verbatim } from "./dom.js";
import { conditionText, orderOf } from "./explanations.js";
import { confirmation, run } from "./forms.js";
import { age, plural, t } from "./i18n.js";
import { address } from "./router.js";

const LISTED = 20;
const NAMED = 5;
const LOOK = 2000; // ms between two looks at the effect of a lock that is not confirmed yet
const LEFT_OUT = "TO_BE_IGNORED";

/** Return the robots that wait behind a head (a vehicle or a path) or in a circle with it, the longest first. */
export function robotsBehind(head, store) {
  const waits = ({ vehicle }) => vehicle && vehicle.name !== head && (vehicle.wait?.head === head || vehicle.wait?.circle.includes(head));
  return [...store.robots.values()].filter(waits).sort((a, b) => Date.parse(a.conditionSince) - Date.parse(b.conditionSince));
}

/** Return in a sentence which robots and orders a lock of these paths leaves without a route; empty if none. */
export async function effectOfLock([name, ...also]) {
  const { vehicles, orders } = await askWith(["paths", name, "lockPreview"], also.map((path) => ["also", path]));
  if (!orders.length) return "";
  return t("queue.noOtherRoute", { robots: plural("summary.robots", vehicles.length), orders: plural("attention.orders", orders.length), names: [...vehicles, ...orders].slice(0, NAMED).join(", ") });
}

/** Return the effect of a lock in a sentence, also if there is none, or if it cannot be known. */
export async function wordsOfLock(paths) {
  return (await effectOfLock(paths).catch(() => t("queue.effectUnknown"))) || t("queue.allHaveRoutes");
}

/** Lists who waits behind `head`; for a robot, with what ends the jam. */
class Queue extends HTMLElement {
  /** Attach to `fleet` for a head; `leaveOut`: opens the form that takes the robot out of traffic; null for a path. */
  show({ store, plant, noCommands }, head, leaveOut) {
    [this.store, this.plant, this.head] = [store, plant, head];
    this.heading = element("h3");
    this.list = element("ul", { class: "entries" });
    this.result = element("output", { class: "result", role: "status" });
    this.opened = element("div", { class: "opened" });
    const reroute = button(t("queue.reroute"), () => run(reroute, this.result, () => this.#reroute()));
    const out = button(t("queue.leaveOut"), () => leaveOut(LEFT_OUT));
    const around = button(t("queue.leadAround"), () => run(around, this.result, () => this.#askToLock()));
    const bar = element("div", { class: "actions" }, reroute, around, out);
    bar.hidden = Boolean(noCommands) || !leaveOut;
    this.replaceChildren(this.heading, this.list, element("p", { class: "advice" }, t(leaveOut ? "queue.advice" : "queue.unlock")), bar, this.result, this.opened);
    this.update();
  }

  /** Update the list after a change of the robots. */
  update() {
    const [behind, now] = [robotsBehind(this.head, this.store), this.store.now()];
    this.hidden = !behind.length && !this.result.hasChildNodes();
    const rows = behind.slice(0, LISTED).map((robot) => [robot.id, robot.name, conditionText(robot), age((now - Date.parse(robot.conditionSince)) / 1000), orderOf(robot, this.store.orders)]);
    refill(this.heading, behind.length, (count) => [plural("queue.title", count)]);
    refill(this.list, [rows, behind.length], () => [...rows.map(entry), ...(behind.length > LISTED ? [element("li", {}, t("why.more", { count: behind.length - LISTED }))] : [])]);
  }

  async #reroute() {
    const names = robotsBehind(this.head, this.store).map(({ vehicle }) => vehicle.name);
    const answers = await Promise.allSettled(names.map((name) => command(["vehicles", name, "rerouting"], { type: "REGULAR" })));
    const rerouted = answers.filter(({ value }) => value?.outcome === "REROUTED").length;
    return [rerouted ? "queue.rerouted" : "queue.noneRerouted", { count: rerouted, all: names.length }];
  }

  // The paths that the robot holds, and those that lead to the points that it holds; and what their locks would do.
  async #look() {
    const plan = await ask("traffic", "plan");
    const held = new Set(plan.vehicles.find(({ vehicle }) => vehicle === this.head)?.holds);
    const leads = ({ name, source, destination, maxReverseVelocityMmS: back }) => held.has(name) || held.has(destination) || (back > 0 && held.has(source));
    const paths = this.plant.model.paths.filter((path) => leads(path) && !path.locked).map(({ name }) => name);
    return { paths, effect: paths.length ? `${t("queue.locks", { names: paths.join(", ") })} ${await wordsOfLock(paths)}` : t("queue.nothingToLock", { name: this.head }) };
  }

  async #askToLock() {
    let { paths, effect } = await this.#look();
    if (!paths.length) return ["queue.nothingToLock", { name: this.head }];
    const asked = confirmation({
      label: t("queue.leadAround"),
      effect,
      submit: t("queue.leadAroundSure"),
      send: async () => {
        clearInterval(looking);
        for (const path of paths) await this.plant.lock(path, true);
        words.focus({ preventScroll: true }); // not on the button, which is disabled now
        asked.querySelector("button").disabled = true;
        return ["queue.locked", { name: this.head }, ...paths.flatMap((path) => [placeLink(path), " "])];
      },
    });
    const words = asked.querySelector(".effect");
    // What is confirmed is what is there now: the robot may have driven on, or others may have got a route.
    const looking = setInterval(async () => {
      const now = asked.isConnected ? await this.#look().catch(() => null) : clearInterval(looking);
      if (!now || asked.querySelector("[aria-busy]")) return;
      ({ paths, effect } = now);
      setText(words, effect);
      asked.querySelector("button").disabled = !paths.length;
    }, LOOK);
    this.opened.replaceChildren(asked);
    words.focus();
    return ["queue.confirm", {}];
  }
}

/** Create a link to the page of a place. */
export function placeLink(name) {
  return verbatim("a", name, { href: address("places", name) });
}

function entry([id, name, condition, since, order]) {
  const parts = [verbatim("a", name, { href: address("robots", id) }), ` ${condition}, ${since}`];
  if (order) parts.push(" · ", order.id ? verbatim("a", order.name, { href: address("orders", order.id) }) : verbatim("span", order.name));
  return element("li", {}, ...parts);
}

customElements.define("nena-queue", Queue);
