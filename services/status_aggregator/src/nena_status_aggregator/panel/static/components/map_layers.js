// A list of the map's layers to switch on and off.

import { t } from "../catalogue.js";
import { element } from "../dom.js";
import { icon } from "../icons.js";
import { LAYERS, keepLayers, readLayers } from "../map/layers.js";

/** Fires `layers` when `chosen` has changed, which is a new object then. */
class MapLayers extends HTMLElement {
  chosen = readLayers();

  connectedCallback() {
    const title = t("map.layers");
    const summary = element("summary", { title, "aria-label": title }, icon("layers"));
    const boxes = LAYERS.map((name) => this.#box(name));
    this.replaceChildren(element("details", {}, summary, element("fieldset", {}, element("legend", {}, title), ...boxes)));
  }

  #box(name) {
    const box = element("input", { type: "checkbox", name });
    box.checked = this.chosen[name];
    box.addEventListener("change", () => {
      this.chosen = { ...this.chosen, [name]: box.checked };
      keepLayers(this.chosen);
      this.dispatchEvent(new Event("layers"));
    });
    return element("label", {}, box, t(`layer.${name}`));
  }
}

customElements.define("nena-map-layers", MapLayers);
