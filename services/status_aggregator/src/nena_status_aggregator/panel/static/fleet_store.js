// The fleet as the event stream tells it: a snapshot, kept up to date by deltas.

const PARTS = ["plant", "link", "malformed"];

/**
 * Holds robots and orders by id, and the other parts. Fires `change` with
 * `{robots, orders, parts}`: sets of what changed, so that views touch nothing else.
 */
export class FleetStore extends EventTarget {
  robots = new Map();
  orders = new Map();
  plant = null;
  link = { connected: false, since: null };
  malformed = { counts: {} };
  share = "1/1";
  #offset = 0;

  /** Give the server's time in milliseconds, as far as we know it. */
  now() {
    return Date.now() + this.#offset;
  }

  /** Begin anew with everything. */
  takeSnapshot(snapshot) {
    this.#offset = Date.parse(snapshot.time) - Date.now();
    this.share = snapshot.share;
    const before = { robots: this.robots, orders: this.orders };
    this.robots = new Map(snapshot.robots.map((robot) => [robot.id, robot]));
    this.orders = new Map(snapshot.orders.map((order) => [order.id, order]));
    for (const part of PARTS) this[part] = snapshot[part];
    this.#tell({
      robots: new Set([...before.robots.keys(), ...this.robots.keys()]),
      orders: new Set([...before.orders.keys(), ...this.orders.keys()]),
      parts: new Set(PARTS),
    });
  }

  /** Take in what changed. */
  takeDelta(delta) {
    this.#tell({
      robots: patch(this.robots, delta.robots, delta.robotsGone),
      orders: patch(this.orders, delta.orders, delta.ordersGone),
      parts: new Set(PARTS.filter((part) => part in delta && this.#setPart(part, delta[part]))),
    });
  }

  #setPart(part, value) {
    this[part] = value;
    return true;
  }

  #tell(detail) {
    this.dispatchEvent(new CustomEvent("change", { detail }));
  }
}

function patch(views, patches = [], gone = []) {
  for (const id of gone) views.delete(id);
  for (const each of patches) views.set(each.id, { ...views.get(each.id), ...each });
  return new Set([...gone, ...patches.map((each) => each.id)]);
}
