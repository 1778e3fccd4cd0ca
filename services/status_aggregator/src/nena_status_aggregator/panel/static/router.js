// The current view is the part of the address after #, so that Back works and views can be shared.

import { element } from "./dom.js";
import { t } from "./i18n.js";

/** Return the address of a view, e.g. `address("robots", id)`. */
export function address(...parts) {
  return `#/${parts.map(encodeURIComponent).join("/")}`;
}

/** Return the parts of the current view's address. */
export function currentView() {
  if (!location.hash.startsWith("#/")) return [];
  return location.hash.slice(2).split("?")[0].split("/").map(decoded).filter(Boolean);
}

function decoded(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return "";
  }
}

/** Return the values of the current address, after its `?`. */
export function parameters() {
  return new URLSearchParams(location.hash.split("?")[1] ?? "");
}

let followed = ""; // the address that is shown: a new one counts only once its hashchange event has arrived

/** Replace the values of the current address; empty ones are omitted. Does nothing if the user has just gone elsewhere. */
export function setParameters(values) {
  if (location.hash !== followed) return;
  const kept = new URLSearchParams(Object.entries(values).filter(([, value]) => value));
  const view = location.hash.split("?")[0] || "#/";
  history.replaceState(history.state, "", kept.size ? `${view}?${kept}` : view);
  followed = location.hash;
}

/** Call back with the current view and on every change. An address such as `#robots` is an anchor in the page instead. */
export function followView(callback) {
  const look = () => {
    if (!/^(#\/|$)/.test(location.hash)) return;
    followed = location.hash;
    lists.read();
    callback(currentView());
  };
  addEventListener("hashchange", look);
  look();
}

/**
 * Settings of the lists, stored in the address after `#/?`: `tab`, `q` (search), `condition` (of robots), `state` (of orders),
 * `robotSort`, `orderSort` and `peripheralSort` (column, with `-` descending). Fires `change`.
 */
class ListView extends EventTarget {
  #values = new URLSearchParams();

  /** Return a value; empty if it is not set. */
  get(name) {
    return this.#values.get(name) ?? "";
  }

  /** Return the address of the lists with their current values. */
  get address() {
    return this.#values.size ? `#/?${this.#values}` : "#/";
  }

  /** Return the address of the lists with other values. */
  addressWith(values) {
    const changed = new URLSearchParams(this.#values);
    for (const [name, value] of Object.entries(values)) {
      if (value) changed.set(name, value);
      else changed.delete(name);
    }
    return changed.size ? `#/?${changed}` : "#/";
  }

  /** Change values, and show the lists if a page is open. */
  set(values) {
    const wanted = this.addressWith(values);
    if (currentView().length) {
      location.hash = wanted;
      return;
    }
    history.replaceState(history.state, "", wanted);
    this.read();
  }

  /** Read the values from the address, if it is that of the lists. */
  read() {
    if (currentView().length) return;
    this.#values = parameters();
    this.dispatchEvent(new Event("change"));
  }
}

export const lists = new ListView();

/** Create the link from a page back to the lists with their values. */
export function backLink() {
  return element("a", { href: lists.address, class: "back" }, t("page.back"));
}
