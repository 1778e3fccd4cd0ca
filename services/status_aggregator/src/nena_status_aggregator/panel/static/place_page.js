// The page of a point, location or path: what holds it, what it is connected to, lock and unlock, and sending a robot there.

import { ask, command, newKey, RefusedError } from "./api.js";
import { button, element, field, refill, refillSelect, section, select, setText, verbatim } from "./dom.js";
import { conditionText, setBy } from "./explanations.js";
import { commandForm, operation, run, vehicles } from "./forms.js";
import { byName, t } from "./i18n.js";
import { effectOfLock, placeLink, wordsOfLock } from "./queue.js";
import { address, backLink } from "./router.js";

const PAUSE = 2000;

class PlacePage extends HTMLElement {
  #name = null;
  #asking = false;
  #held = null; // from the order service: vehicle, and whether it is there; null: unknown

  /** Attach to `fleet`: {store, link, plant, enabled, noCommands}. */
  show(fleet) {
    this.fleet = fleet;
    fleet.store.addEventListener("change", () => this.#name && this.#update());
    fleet.plant.addEventListener("change", () => this.#name && this.#build());
    fleet.plant.addEventListener("locks", () => this.#name && this.#update());
    if (fleet.enabled) setInterval(() => this.#name && !document.hidden && this.#ask(), PAUSE);
  }

  /** Show a place or path; null hides the page. */
  open(name) {
    this.#name = name;
    this.#held = null;
    if (!name) return this.replaceChildren();
    this.#build();
    if (this.fleet.enabled) this.#ask();
    this.heading.focus({ preventScroll: true });
  }

  /** Begin a command: `lock`, `lockBoth`, `unlock` or `send`. */
  begin(name) {
    if (name === "send") this.commands.querySelector("select")?.focus();
    else if (!this[name].hidden) this[name].click(); // disabled if it has no effect
  }

  #build() {
    const found = this.fleet.plant.find(this.#name);
    this.heading = verbatim("h2", this.#name, { tabindex: -1 });
    this.kind = element("span", { class: "chip" }, found ? t(`place.${found.kind}`) : "");
    this.kind.hidden = !found;
    this.asking = null; // the locks that the page asks about
    this.lockedBy = element("span");
    const head = element("header", { class: "head" }, backLink(), this.heading, this.kind, this.lockedBy);
    this.device = element("nena-peripheral-details");
    this.holders = element("div");
    this.commands = element("div");
    if (!found) return this.replaceChildren(head, element("p", { class: "hint" }, t("place.gone")));
    const { noCommands } = this.fleet;
    if (noCommands) this.commands.append(element("p", { class: "hint" }, t(noCommands)));
    else if (found.kind === "path") this.commands.append(this.#lockCommands());
    else this.commands.append(this.#sendForm());
    this.neighbours = element("p", { class: "places" }, ...this.#neighbours(found).map(placeLink));
    this.queue = element("nena-queue");
    this.queueSection = element("section", {}, this.queue);
    this.queue.show(this.fleet, this.#name, null);
    const sections = [this.queueSection, section("place.heldBy", this.holders), section("robot.commands", this.commands), section("place.near", this.neighbours)];
    const reachable = found.thing.links?.length !== 0; // a door beside a path has no links: no robot stops there
    this.replaceChildren(head, this.device, ...(reachable ? sections : []));
    this.#update();
  }

  // Points next to a place, and paths from or to it; for a path, its ends and the opposite path.
  #neighbours({ kind, thing }) {
    const { paths } = this.fleet.plant.model;
    if (kind === "location") return thing.links.map((link) => link.point);
    if (kind === "path") return [thing.source, thing.destination, this.fleet.plant.opposite(thing)?.name].filter(Boolean);
    const names = paths.filter((path) => [path.source, path.destination].includes(thing.name)).map((path) => path.name);
    return names.sort(byName);
  }

  // Locking and unlocking have separate buttons, so that a second click does not undo the first. Unlocking asks for confirmation.
  #lockCommands() {
    this.result = element("output", { class: "result", role: "status" });
    const opposite = this.fleet.plant.opposite(this.fleet.plant.find(this.#name).thing)?.name;
    const [one, both] = [[this.#name], [this.#name, opposite].filter(Boolean)];
    this.lock = button(t("place.lock"), () => this.#askLock(this.lock, one));
    this.lockBoth = button(t("place.lockBoth"), () => this.#askLock(this.lockBoth, both));
    this.unlock = button(t("place.unlock"), () => this.#askUnlock(one));
    this.unlockBoth = button(t("place.unlockBoth"), () => this.#askUnlock(both));
    this.lockBoth.hidden = this.unlockBoth.hidden = !opposite;
    this.effect = element("p", { class: "effect", id: "lock-effect", tabindex: -1 });
    this.asked = element("div", {}, this.effect);
    this.asked.hidden = true;
    const bar = element("div", { class: "actions" }, this.lock, this.lockBoth, this.unlock, this.unlockBoth);
    this.stopHint = element("p", { class: "hint" }, t("place.stopHint"));
    return element("div", {}, bar, this.stopHint, this.asked, element("p", { class: "hint" }, t("place.lockHint")), this.result);
  }

  // Asks only if robots or orders have no other route, or if that cannot be known.
  async #askLock(pressed, names) {
    if (pressed.getAttribute("aria-busy") === "true") return;
    pressed.setAttribute("aria-busy", "true");
    const effect = await effectOfLock(names).catch(() => t("queue.effectUnknown"));
    pressed.removeAttribute("aria-busy");
    if (!pressed.isConnected) return; // the page shows another place by now
    if (effect) this.#confirm("place.lockSure", effect, names, true);
    else await this.#lock(pressed, names, true);
  }

  #askUnlock(names) {
    this.#confirm("place.unlockSure", t("place.unlockEffect", { name: names.join(", ") }), names, false);
  }

  #confirm(key, effect, names, locked) {
    const sure = button(t(key), () => this.#lock(sure, names, locked), { class: "danger", "aria-describedby": "lock-effect" });
    setText(this.effect, effect);
    this.asked.replaceChildren(this.effect, element("div", { class: "actions" }, sure));
    this.asked.hidden = false;
    this.asking = { names, locked };
    this.effect.focus();
  }

  #lock(pressed, names, locked) {
    if (locked) this.asked.hidden = true;
    this.heading.focus({ preventScroll: true }); // the button will be disabled or hidden
    const done = t(locked ? "done.locked" : "done.unlocked", { name: names[0] });
    return run(pressed, this.result, async () => {
      for (const name of names) {
        await this.fleet.plant.lock(name, locked).catch((error) => {
          if (name === names[0]) throw error;
          throw new RefusedError({ detail: `${name}: ${error.message || t("command.unanswered")} (${done})` });
        });
      }
      this.asked.hidden = true;
      if (names.length === 1) return [locked ? "done.locked" : "done.unlocked", { name: names[0] }];
      return [locked ? "done.lockedBoth" : "done.unlockedBoth", { name: names.join(", ") }];
    });
  }

  #locked(name) {
    return Boolean(this.fleet.plant.find(name)?.thing.locked);
  }

  // Whether the stop of an area locks a path: it cannot be unlocked before the stop ends.
  #stopped(name) {
    return Boolean(this.fleet.plant.find(name)?.thing.stop);
  }

  #sendForm() {
    const vehicle = select([["", t("orderForm.anyVehicle")], ...vehicles(this.fleet)], { name: "vehicle" });
    const what = select([], { name: "operation" });
    refillSelect(what, this.fleet.plant.operationsAt(this.#name).map(operation));
    let key = newKey();
    return commandForm({
      label: t("place.send"),
      submit: t("place.send"),
      fields: [element("div", { class: "fields" }, field(t("orders.vehicle"), vehicle), field(t("form.operation"), what))],
      send: async () => {
        const destinations = [{ locationName: this.#name, operation: what.value }];
        const order = await command(["transportOrders"], { destinations, idempotencyKey: key, ...(vehicle.value && { intendedVehicle: vehicle.value }) });
        key = newKey();
        return ["done.orderCreated", { name: order.name }];
      },
    });
  }

  async #ask() {
    if (this.#asking) return;
    this.#asking = true;
    const away = this.fleet.store.orderService.up === false;
    const plan = away ? null : await ask("traffic", "plan").catch(() => null);
    this.#asking = false;
    const found = this.#name && this.fleet.plant.find(this.#name); // the plan is the same for all places
    if (!found) return;
    if (!this.asked?.hidden && this.asking?.locked) {
      const { names } = this.asking;
      const effect = await wordsOfLock(names);
      if (names === this.asking.names) setText(this.effect, effect); // it is still asked
    }
    this.#held = plan && plan.vehicles.flatMap((vehicle) => heldAs(vehicle, found));
    this.#update();
  }

  #update() {
    const found = this.fleet.plant.find(this.#name);
    if (!found) return;
    const { store } = this.fleet;
    this.queue.update();
    this.queueSection.hidden = this.queue.hidden;
    this.device.show(store.peripherals.get(this.#name), store);
    const robots = [...store.robots.values()];
    const standing = robots.filter((robot) => robot.vehicle?.currentPosition === this.#name).map((robot) => [robot.vehicle.name, "place.standsHere"]);
    const known = new Map([...(this.#held ?? []), ...standing]);
    const rows = [...known].sort(([a], [b]) => byName(a, b)).map(([name, how]) => {
      const robot = store.robotOfVehicle(name);
      return { name, id: robot?.id ?? null, text: t(how, { condition: robot ? conditionText(robot) : "" }) };
    });
    const none = t(this.#held || standing.length ? "place.free" : "place.unknown");
    refill(this.holders, [rows, none], () => [rows.length ? element("ul", { class: "entries" }, ...rows.map(holder)) : element("p", { class: "hint" }, none)]);
    if (found.kind !== "path") return;
    const locked = this.#locked(this.#name);
    const opposite = this.fleet.plant.opposite(found.thing)?.name;
    const other = opposite ? this.#locked(opposite) : locked;
    const stopped = this.#stopped(this.#name);
    const otherStopped = opposite ? this.#stopped(opposite) : stopped;
    setText(this.kind, t(locked ? "place.locked" : "place.path"));
    this.kind.dataset.state = locked ? "FAILED" : "";
    if (this.fleet.noCommands) return;
    if (this.asking?.names.every((name) => this.#locked(name) === this.asking.locked)) this.asked.hidden = true; // somebody else has done it
    setText(this.lockedBy, locked ? setBy(found.thing.lockedBy) : "");
    this.lock.disabled = locked;
    this.lockBoth.disabled = locked && other;
    this.unlock.disabled = !locked || stopped;
    this.unlockBoth.disabled = this.unlock.disabled && (!other || otherStopped);
    this.stopHint.hidden = !stopped && !otherStopped;
  }
}

function holder({ name, id, text }) {
  return element("li", {}, id ? verbatim("a", name, { href: address("robots", id) }) : verbatim("span", name), ` ${text}`);
}

// `[[vehicle, text]]` if a vehicle of the traffic plan holds a point or path, or is on it; for a location, one of its points.
function heldAs({ vehicle, at, ahead }, { kind, thing }) {
  const held = ahead.filter((each) => each.held).map((each) => each.point);
  if (kind === "path") {
    const way = [at, ...held];
    const runs = way.some((point, index) => index && [way[index - 1], point].sort().join() === [thing.source, thing.destination].sort().join());
    return runs ? [[vehicle, "place.holds"]] : [];
  }
  const points = kind === "point" ? [thing.name] : thing.links.map((link) => link.point);
  if (points.includes(at)) return [[vehicle, "place.standsHere"]];
  return points.some((point) => held.includes(point)) ? [[vehicle, "place.holds"]] : [];
}

customElements.define("nena-place-page", PlacePage);
