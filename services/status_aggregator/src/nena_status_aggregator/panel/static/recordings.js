// Recordings: the files of a black box and log reports, and the button that requests a new one.

import { command } from "./api.js";
import { button, element, refill, setText, verbatim } from "./dom.js";
import { outcome, run } from "./forms.js";
import { dateAndTime, number, t } from "./i18n.js";

const FETCH = "nena:fetchRecording";

/** Under this key, the order service sends its recordings as robots do. */
export const ORDER_SERVICE = "nena/order-service";

const KIB = 1024;
const LOOK_MS = 2000;
const LOOKS = 60;

class Recordings extends HTMLElement {
  /**
   * Show the recordings of a robot, or of ORDER_SERVICE. The button is shown only if commands are available; for a
   * robot, only if it has a black box.
   */
  show({ store, noCommands }, robotId) {
    this.store = store;
    this.robotId = robotId;
    this.list = element("ul", { class: "entries" });
    this.note = element("p", { class: "hint", role: "status" });
    this.result = element("output", { class: "result", role: "status" });
    this.fetchButton = button(t("robot.fetchRecording"), () => this.#request(), { hidden: true });
    this.replaceChildren(this.list, this.note, element("div", { class: "actions" }, this.fetchButton), this.result);
    this.#load();
    if (!noCommands) this.#offer();
    return this;
  }

  // Load the list; returns the names of the files.
  async #load() {
    const answer = await fetch(`api/v1/recordings?robot=${encodeURIComponent(this.robotId)}`).catch(() => null);
    const files = answer?.ok ? await answer.json() : [];
    refill(this.list, files, () => files.map(entry));
    const none = this.#ofOrderService ? "history.noRecordings" : "robot.noRecordings";
    setText(this.note, files.length ? "" : t(answer?.ok ? none : "robot.recordingsFailed"));
    return files.map((each) => each.name);
  }

  get #ofOrderService() {
    return this.robotId === ORDER_SERVICE;
  }

  async #offer() {
    if (this.#ofOrderService) {
      this.fetchButton.hidden = false;
      return;
    }
    const robot = this.store.robots.get(this.robotId);
    if (!robot?.body) return; // no factsheet received
    const path = [robot.manufacturer, robot.serialNumber].map(encodeURIComponent).join("/");
    const answer = await fetch(`api/v1/robots/${path}/actions`).catch(() => null);
    const actions = answer?.ok ? await answer.json() : [];
    this.fetchButton.hidden = !actions.some((each) => each.actionType === FETCH);
  }

  async #request() {
    let name;
    const done = await run(this.fetchButton, this.result, async () => {
      if (this.#ofOrderService) {
        ({ name } = await command(["recordings"], {}));
        return ["done.recording", { name: t("order.byItself") }, verbatim("span", name)];
      }
      const vehicle = this.store.robots.get(this.robotId)?.vehicle?.name;
      const answer = await command(["vehicles", vehicle, "instantActions"], { actionType: FETCH });
      name = answer.result;
      return outcome(answer, "done.recording", { name: vehicle, action: t("robot.fetchRecording") });
    });
    if (done && name) await this.#waitFor(name);
  }

  // The file arrives over MQTT, after the action has ended.
  async #waitFor(name) {
    for (let look = 0; look < LOOKS && this.isConnected; look += 1) {
      if ((await this.#load()).includes(name)) return;
      await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
    }
  }
}

function entry({ robot, name, size, received }) {
  const path = [...robot.split("/"), name].map(encodeURIComponent).join("/");
  const link = element("a", { href: `api/v1/recordings/${path}`, download: name, translate: "no" }, name);
  const time = element("time", { datetime: received }, dateAndTime(received));
  return element("li", {}, link, " ", time, " · ", t("unit.kib", { value: number(size / KIB) }));
}

customElements.define("nena-recordings", Recordings);
