// The context menu of a robot, point, location or path on the map: by right click, long press or the keyboard.

import { element, setAttribute } from "../dom.js";
import { t } from "../i18n.js";
import { LEVELS } from "../robot_commands.js";

// What has an effect: a path that the stop of an area locks cannot be unlocked before the stop ends.
function pathCommands(path, twoWay) {
  if (path.stop) return [];
  if (path.locked) return ["unlock"];
  return twoWay ? ["lock", "lockBoth"] : ["lock"];
}

/**
 * Fires `command`, which bubbles, with `{view, id, name, value}`: the command to begin on the page of a robot or place, which
 * asks for what is missing and shows the result; `name` is null to show only the page.
 */
class MapMenu extends HTMLElement {
  connectedCallback() {
    this.hidden = true;
    this.setAttribute("role", "menu");
    this.addEventListener("contextmenu", (event) => event.preventDefault());
    this.addEventListener("keydown", (event) => this.#key(event));
    this.addEventListener("focusout", (event) => event.relatedTarget !== this.back && this.#closeFor(event.relatedTarget));
    document.addEventListener("pointerdown", (event) => this.#closeFor(event.target), { capture: true });
  }

  /** Open the menu of a robot at a place of the map (px). `back`: gets the focus after Escape. */
  openForRobot(robot, at, back) {
    const vehicle = robot.vehicle?.name;
    const levels = LEVELS.map((level) => this.#item(t(`integration.${level}`), "robots", robot.id, "command.level", level));
    levels.forEach((each, at) => {
      setAttribute(each, "role", "menuitemradio");
      setAttribute(each, "aria-checked", String(LEVELS[at] === robot.vehicle?.integrationLevel));
    });
    const title = element("div", { class: "group", role: "presentation" }, t("integration.title"));
    const group = element("div", { role: "group", "aria-label": t("integration.title") }, title, ...levels);
    const commands = vehicle ? [this.#item(t("command.dispatch"), "robots", robot.id, "command.dispatch"), group] : [];
    this.#open(robot.name, [this.#item(t("map.menu.page"), "robots", robot.id, null), ...commands], at, back);
  }

  /** Open the menu of a place or path, as the plant store finds it; `twoWay`: a path has an opposite one. */
  openForPlace({ kind, thing }, twoWay, at, back) {
    const commands = kind === "path" ? pathCommands(thing, twoWay) : thing.links?.length === 0 ? [] : ["send"];
    const items = commands.map((name) => this.#item(t(`place.${name}`), "places", thing.name, name));
    this.#open(thing.name, [this.#item(t("map.menu.page"), "places", thing.name, null), ...items], at, back);
  }

  #open(name, items, [x, y], back) {
    this.back = back;
    this.setAttribute("aria-label", t("map.menu", { name }));
    this.replaceChildren(element("strong", { translate: "no", role: "presentation" }, name), ...items);
    this.items = [...this.querySelectorAll("button")];
    this.hidden = false;
    const room = this.parentElement;
    this.style.left = `${Math.max(0, Math.min(x, room.clientWidth - this.offsetWidth))}px`;
    this.style.top = `${Math.max(0, Math.min(y, room.clientHeight - this.offsetHeight))}px`;
    this.items[0].focus({ preventScroll: true });
  }

  #item(text, view, id, name, value) {
    const item = element("button", { type: "button", role: "menuitem", tabindex: -1 }, text);
    item.addEventListener("click", () => {
      this.#close();
      this.dispatchEvent(new CustomEvent("command", { bubbles: true, detail: { view, id, name, value } }));
    });
    return item;
  }

  // The finger that opened the menu gives the focus to the map when it is lifted: that closes nothing.
  #closeFor(other) {
    if (other && !this.contains(other)) this.#close();
  }

  // Removing the item with the focus closes the menu again.
  #close() {
    if (this.hidden) return;
    this.hidden = true;
    this.replaceChildren();
  }

  #key(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    const at = this.items.indexOf(document.activeElement);
    if (step) this.items[(at + step + this.items.length) % this.items.length].focus();
    else if (event.key === "Home") this.items[0].focus();
    else if (event.key === "End") this.items.at(-1).focus();
    else if (event.key === "Escape") {
      this.#close();
      this.back.focus({ preventScroll: true });
    } else return;
    event.preventDefault();
  }
}

customElements.define("nena-map-menu", MapMenu);
