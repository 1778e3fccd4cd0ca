// The fleet in the browser: robots, orders and devices from the event stream, and the plant model.

import { ask, command } from "./api.js";

const FAILURES = ["FAILED", "UNROUTABLE"];

/** Return the state to show; HELD for an order on hold, WAS_WITHDRAWN and GAVE_WAY for FAILED ones that are no failures. */
export function shownState(order) {
  if (order.outcome) return order.outcome === "WITHDRAWN" ? "WAS_WITHDRAWN" : order.outcome;
  return order.held ? "HELD" : order.state;
}

/** Return the state of a destination to show; LEFT if its order was not wanted any more. */
export function stopState({ state }, { outcome }) {
  return state === "FAILED" && ["WITHDRAWN", "GAVE_WAY"].includes(outcome) ? "LEFT" : state;
}

/** Return whether an order has ended in a failure. */
export function hasFailed({ outcome }) {
  return FAILURES.includes(outcome);
}

/** Return the job that a device executes, else the first one that waits for it; undefined if it has none. */
export function jobOf({ job, jobs }) {
  return job ?? jobs.find(({ finished }) => !finished);
}

const KINDS = ["robots", "orders", "peripherals"];
const PARTS = ["plant", "link", "orderService", "jams", "attention", "malformed"];

/**
 * Robots, orders and peripheral devices by id, and the other parts, kept up to date by the event stream. Fires `change` with
 * `{robots, orders, peripherals, parts}`: sets of what changed.
 */
export class FleetStore extends EventTarget {
  robots = new Map();
  orders = new Map();
  peripherals = new Map();
  plant = null;
  link = { connected: false, since: null };
  orderService = { up: null, lastSign: null, stops: [], brokerLacks: [] };
  jams = [];
  attention = [];
  malformed = { counts: {} };
  share = "1/1";
  #offset = 0;

  /** Return the estimated server time, ms. */
  now() {
    return Date.now() + this.#offset;
  }

  /** Return the robot of a vehicle of the order service. */
  robotOfVehicle(name) {
    return [...this.robots.values()].find((robot) => robot.vehicle?.name === name);
  }

  /** Return whether a head of a queue is a locked path. */
  isLockedPath(head) {
    return [...this.robots.values()].some(({ vehicle }) => vehicle?.wait?.cause === "LOCKED" && vehicle.wait.at === head);
  }

  /** Replace all data. */
  takeSnapshot(snapshot) {
    this.#offset = Date.parse(snapshot.time) - Date.now();
    this.share = snapshot.share;
    const changed = { parts: new Set(PARTS) };
    for (const kind of KINDS) {
      const before = this[kind];
      this[kind] = new Map(snapshot[kind].map((view) => [view.id, view]));
      changed[kind] = new Set([...before.keys(), ...this[kind].keys()]);
    }
    for (const part of PARTS) this[part] = snapshot[part];
    this.#emit(changed);
  }

  /** Apply a change. */
  takeDelta(delta) {
    const parts = new Set(PARTS.filter((part) => part in delta && this.#setPart(part, delta[part])));
    const changed = KINDS.map((kind) => [kind, patch(this[kind], delta[kind], delta[`${kind}Gone`])]);
    this.#emit({ ...Object.fromEntries(changed), parts });
  }

  #setPart(part, value) {
    this[part] = value;
    return true;
  }

  #emit(detail) {
    this.dispatchEvent(new CustomEvent("change", { detail }));
  }
}

function patch(views, patches = [], gone = []) {
  for (const id of gone) views.delete(id);
  for (const each of patches) views.set(each.id, { ...views.get(each.id), ...each });
  return new Set([...gone, ...patches.map((each) => each.id)]);
}

const LOCKS_EVERY = 5000;

/**
 * The plant model, loaded when the event stream reports a new version, with the current locks of its paths. `model` is null
 * without a plant model. Fires `change`, and `locks` if only those have changed.
 */
export class PlantStore extends EventTarget {
  model = null;
  #known = null;
  #locksFollowed = false;
  #listed = "";
  #asking = false;
  #store;
  #person;

  /** `person`: returns the name for a lock. */
  constructor(store, person) {
    super();
    this.#store = store;
    this.#person = person;
    store.addEventListener("change", ({ detail: { parts } }) => {
      if (parts.has("plant")) this.#load(store.plant);
      if (this.#locksFollowed && ((parts.has("attention") && this.#lockedOthers()) || parts.has("orderService"))) this.#loadLocks(); // a stop of an area locks paths
    });
  }

  /** Start loading the locks of the paths from the order service. */
  followLocks() {
    this.#locksFollowed = true;
    this.#loadLocks();
    setInterval(() => document.hidden || this.#loadLocks(), LOCKS_EVERY);
  }

  // Whether other paths are listed as locked than at the last look.
  #lockedOthers() {
    const before = this.#listed;
    this.#listed = this.#store.attention.flatMap(({ kind, paths }) => (kind === "path_locked" ? paths : [])).join();
    return this.#listed !== before;
  }

  /** Lock or unlock a path. */
  async lock(name, locked) {
    const path = await command(["paths", name, "lock"], { locked, by: this.#person() }, "PUT");
    this.#takeLocks([path]);
  }

  /** Return a point, location or path as `{kind, thing}`; null if the name is unknown. */
  find(name) {
    const kinds = { point: this.model?.points, location: this.model?.locations, path: this.model?.paths };
    for (const [kind, things] of Object.entries(kinds)) {
      const thing = things?.find((each) => each.name === name);
      if (thing) return { kind, thing };
    }
    return null;
  }

  /** Return the path in the opposite direction; undefined if there is none, or for a point or location. */
  opposite({ source, destination }) {
    return source && this.model.paths.find((path) => path.source === destination && path.destination === source);
  }

  async #loadLocks() {
    if (!this.model || this.#asking || this.#store.orderService.up === false) return;
    this.#asking = true;
    const answer = await ask("paths").catch(() => null);
    this.#asking = false;
    if (answer) this.#takeLocks(answer.paths);
  }

  #takeLocks(paths) {
    const known = new Map(paths.map((path) => [path.name, path]));
    const differs = (path, { locked, stop, lockedBy }) => locked !== path.locked || stop !== path.stop || lockedBy?.since !== path.lockedBy?.since;
    const changed = (this.model?.paths ?? []).filter((path) => known.has(path.name) && differs(path, known.get(path.name)));
    for (const path of changed) ({ locked: path.locked, stop: path.stop, lockedBy: path.lockedBy } = known.get(path.name));
    if (changed.length) this.dispatchEvent(new Event("locks"));
  }

  /** Return the operations allowed at a place; empty if the place does not exist. */
  operationsAt(name) {
    if (this.model?.points.some((point) => point.name === name)) return ["MOVE", "PARK"];
    const location = this.model?.locations.find((each) => each.name === name);
    if (!location) return [];
    const type = this.model.locationTypes.find((each) => each.name === location.type);
    const allowed = type?.allowedOperations ?? [];
    const linked = location.links.flatMap((link) => (link.allowedOperations.length ? link.allowedOperations : allowed));
    return [...new Set(linked), "NOP"];
  }

  async #load(plant) {
    const known = plant && `${plant.version} ${plant.name}`;
    if (known === this.#known) return;
    this.#known = known;
    const answer = plant ? await fetch("api/v1/plant") : null;
    this.model = answer?.ok ? await answer.json() : null;
    this.dispatchEvent(new Event("change"));
    if (this.#locksFollowed) this.#loadLocks();
  }
}

const SILENCE = 12_000; // the stream sends a heartbeat at least every 5 s
const PAUSES = [500, 1000, 2000, 4000];

/**
 * Feeds a store from the event stream. Fires `state` when `connected` changes or an attempt failed. It reconnects on its
 * own, because the browser's reconnect stops after some HTTP errors.
 */
export class EventLink extends EventTarget {
  connected = false;
  everConnected = false;
  failed = false;
  lastNews = null;
  #store;
  #url;
  #source = null;
  #lastId = null;
  #failures = 0;
  #watchdog = null;

  constructor(store, url) {
    super();
    this.#store = store;
    this.#url = url;
  }

  start() {
    const after = this.#lastId ? `?after=${encodeURIComponent(this.#lastId)}` : "";
    const source = new EventSource(this.#url + after);
    this.#source = source;
    source.onopen = () => this.#heard();
    source.onerror = () => this.#lost();
    source.addEventListener("heartbeat", () => this.#heard());
    source.addEventListener("snapshot", (event) => this.#take(event, "takeSnapshot"));
    source.addEventListener("delta", (event) => this.#take(event, "takeDelta"));
    this.#watch();
  }

  #take(event, method) {
    this.#lastId = event.lastEventId;
    this.#store[method](JSON.parse(event.data));
    this.#heard();
  }

  #heard() {
    this.lastNews = this.#store.now();
    this.#failures = 0;
    this.#watch();
    if (this.connected) return;
    this.connected = true;
    this.everConnected = true;
    this.dispatchEvent(new Event("state"));
  }

  #watch() {
    clearTimeout(this.#watchdog);
    this.#watchdog = setTimeout(() => this.#lost(), SILENCE);
  }

  #lost() {
    clearTimeout(this.#watchdog);
    this.#source.close();
    this.connected = false;
    this.failed = true;
    const pause = PAUSES[Math.min(this.#failures++, PAUSES.length - 1)];
    setTimeout(() => this.start(), pause);
    this.dispatchEvent(new Event("state"));
  }
}
