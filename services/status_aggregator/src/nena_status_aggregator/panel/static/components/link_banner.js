// Says when what the page shows is not what is: no line to the server, or the server has no broker.

import { t } from "../catalogue.js";
import { setText } from "../dom.js";
import { timeOfDay } from "../format.js";

class LinkBanner extends HTMLElement {
  show(store, link) {
    this.setAttribute("role", "status");
    this.setAttribute("aria-live", "assertive");
    const update = () => this.#update(store, link);
    link.addEventListener("state", update);
    store.addEventListener("change", (event) => event.detail.parts.has("link") && update());
    update();
  }

  #update(store, link) {
    const [level, text] = judge(store, link);
    this.dataset.level = level;
    this.hidden = level === "fine";
    setText(this, text);
  }
}

function judge(store, link) {
  if (!link.everConnected) {
    return link.failed ? ["bad", t("link.never")] : ["wait", t("link.connecting")];
  }
  if (!link.connected) return ["bad", t("link.lost", { time: timeOfDay(link.lastNews) })];
  if (store.link.connected) return ["fine", t("link.back")];
  if (!store.link.since) return ["bad", t("link.broker.never")];
  return ["bad", t("link.broker", { time: timeOfDay(store.link.since) })];
}

customElements.define("nena-link-banner", LinkBanner);
