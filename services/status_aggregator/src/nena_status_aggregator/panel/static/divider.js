// The divider between the map and the lists of a wide page: dragged, or moved by arrow keys; a double click puts it back.

import { setAttribute } from "./dom.js";
import { t } from "./i18n.js";

const KEY = "nena-map-share";
const [LEAST, USUAL, MOST, STEP] = [20, 47, 80, 5]; // % of the page

class Divider extends HTMLElement {
  connectedCallback() {
    const fixed = { role: "separator", tabindex: 0, "aria-orientation": "vertical", "aria-controls": "map", "aria-label": t("map.divider"), title: t("map.divider") };
    const range = { "aria-valuemin": LEAST, "aria-valuemax": MOST };
    for (const [name, value] of Object.entries({ ...fixed, ...range })) setAttribute(this, name, value);
    this.addEventListener("pointerdown", (event) => this.setPointerCapture(event.pointerId));
    this.addEventListener("pointermove", (event) => this.hasPointerCapture(event.pointerId) && this.#drag(event.clientX));
    this.addEventListener("dblclick", () => this.#place(USUAL));
    this.addEventListener("keydown", (event) => this.#key(event));
    this.#place(Number(localStorage.getItem(KEY)) || USUAL);
  }

  #drag(x) {
    const { left, width } = this.parentElement.getBoundingClientRect();
    this.#place((100 * (x - left)) / width);
  }

  #key(event) {
    const step = { ArrowLeft: -STEP, ArrowRight: STEP }[event.key];
    if (!step) return;
    event.preventDefault();
    this.#place(this.share + step);
  }

  #place(share) {
    this.share = Math.round(Math.min(MOST, Math.max(LEAST, share)));
    localStorage.setItem(KEY, this.share);
    setAttribute(this, "aria-valuenow", this.share);
    this.parentElement.style.setProperty("--map-share", `${this.share}%`);
  }
}

customElements.define("nena-divider", Divider);
