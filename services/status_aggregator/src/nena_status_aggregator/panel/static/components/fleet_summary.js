// How many robots there are, and in which conditions; the ones that need somebody come first.

import { plural, t } from "../catalogue.js";
import { element } from "../dom.js";

export const CONDITIONS = [
  "ERROR",
  "BROKEN",
  "SILENT",
  "BLOCKED",
  "MANUAL",
  "BUSY",
  "CHARGING",
  "IDLE",
  "OFFLINE",
];

class FleetSummary extends HTMLElement {
  show(store) {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", t("summary.label"));
    store.addEventListener("change", () => this.#update([...store.robots.values()], store.share));
  }

  #update(robots, share) {
    const counts = CONDITIONS.map((name) => [name, robots.filter((each) => each.condition === name).length]);
    const total = robots.length ? plural("summary.robots", robots.length) : t("summary.none");
    const [number, of] = share.split("/");
    const text = JSON.stringify([total, counts, share]);
    if (this.shown === text) return;
    this.shown = text;
    this.replaceChildren(
      element("span", { class: "total" }, total),
      of === "1" ? "" : element("span", { class: "share" }, t("summary.share", { number, of })),
      ...counts
        .filter(([, count]) => count)
        .map(([name, count]) =>
          element("span", { class: "chip", "data-condition": name }, `${count} ${t(`condition.${name}`)}`),
        ),
    );
  }
}

customElements.define("nena-fleet-summary", FleetSummary);
