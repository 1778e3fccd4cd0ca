// Whether all messages were understood, and what was wrong with the last that was not.

import { plural, t } from "../catalogue.js";
import { element, foreign } from "../dom.js";
import { timeOfDay } from "../format.js";

class MessageHealth extends HTMLElement {
  show(store) {
    this.setAttribute("role", "status");
    store.addEventListener("change", (event) => {
      if (event.detail.parts.has("malformed")) this.#update(store.malformed);
    });
  }

  #update({ counts, lastTime, lastTopic, lastProblem }) {
    const total = Object.values(counts).reduce((sum, count) => sum + count, 0);
    this.classList.toggle("bad", total > 0);
    if (!total) {
      this.replaceChildren(t("messages.fine"));
      return;
    }
    const kinds = Object.entries(counts).map(([kind, count]) => t("messages.kind", { kind, count }));
    const text = plural("messages.malformed", total, { kinds: kinds.join(", ") });
    const last = t("messages.last", { time: timeOfDay(lastTime), topic: lastTopic });
    this.replaceChildren(element("strong", {}, text), ` ${last} `, foreign("span", lastProblem));
  }
}

customElements.define("nena-message-health", MessageHealth);
