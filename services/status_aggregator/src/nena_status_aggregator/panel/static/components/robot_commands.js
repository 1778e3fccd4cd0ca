// Buttons with which a person commands one robot; some open a form under them.

import { t } from "../catalogue.js";
import { command } from "../commands.js";
import { button, element, setAttribute } from "../dom.js";
import { actionForm } from "../forms/action_form.js";
import { outcome, run } from "../forms/command_form.js";
import { dispatchForm } from "../forms/dispatch_form.js";
import { positionForm } from "../forms/position_form.js";
import { sessionForm } from "../forms/session_form.js";

class RobotCommands extends HTMLElement {
  #open = null;

  /** Prepare for one robot; `noCommands`: key of the text that says why there are none. */
  show({ store, plant, noCommands }, robotId) {
    this.store = store;
    this.plant = plant;
    this.robotId = robotId;
    this.note = element("p", { class: "hint" });
    this.result = element("output", { class: "result", role: "status" });
    this.place = element("div", { class: "opened" });
    this.buttons = [
      this.#opener("command.dispatch", () => dispatchForm(this.#vehicle, plant)),
      this.#opener("command.position", () => positionForm(this.#vehicle, this.#robot.position)),
      this.#direct("command.pause", () => this.#act("pause")),
      this.#direct("command.resume", () => this.#act("resume")),
      this.#direct("command.cancel", () => this.#cancel()),
      this.#opener("command.action", () => actionForm(this.#vehicle, this.#robot)),
    ];
    this.driverOn = this.#direct("command.driverOn", () => this.#act("nena:startRosSession"));
    this.driverOff = this.#direct("command.driverOff", () => this.#act("nena:stopRosSession"));
    this.sessionButtons = [
      this.driverOn,
      this.driverOff,
      this.#opener("command.address", () => sessionForm(this.#vehicle, this.#robot.rosSession)),
    ];
    this.buttons.push(...this.sessionButtons);
    this.noCommands = noCommands;
    this.replaceChildren(element("div", { class: "actions" }, ...this.buttons), this.note, this.result, this.place);
    this.update();
  }

  /** Take in that the robot has changed. */
  update() {
    const possible = !this.noCommands && Boolean(this.#vehicle);
    for (const each of this.buttons) each.disabled = !possible;
    this.#updateSession(possible);
    this.note.hidden = possible;
    this.note.textContent = t(this.noCommands ?? "command.unknownVehicle");
  }

  // A robot without a ROS session has no driver to switch; one in a state is not switched into that state.
  #updateSession(possible) {
    const state = this.#robot?.rosSession?.state;
    for (const each of this.sessionButtons) each.hidden = !state;
    this.driverOn.disabled = !possible || ["ACTIVE", "INITIATING"].includes(state);
    this.driverOff.disabled = !possible || ["NOT_ACTIVE", "TERMINATING"].includes(state);
  }

  get #robot() {
    return this.store.robots.get(this.robotId);
  }

  get #vehicle() {
    return this.#robot?.vehicle?.name;
  }

  #direct(key, send) {
    const made = button(t(key), () => run(made, this.result, send));
    return made;
  }

  #opener(key, make) {
    const made = button(t(key), () => this.#toggle(made, make), { "aria-expanded": "false" });
    return made;
  }

  async #toggle(opener, make) {
    const close = this.#open === opener;
    document.dispatchEvent(new CustomEvent("poseshow", { detail: null }));
    this.#open = close ? null : opener;
    for (const each of this.buttons) {
      if (each.hasAttribute("aria-expanded")) setAttribute(each, "aria-expanded", String(each === this.#open));
    }
    this.result.replaceChildren();
    this.place.replaceChildren(...(close ? [] : [await make()]));
    this.place.querySelector("select, input")?.focus();
  }

  async #act(actionType) {
    return outcome(await command(["vehicles", this.#vehicle, "instantActions"], { actionType }));
  }

  // A transport order is withdrawn, so that the order service knows; another order of the robot is cancelled at the robot.
  async #cancel() {
    const order = this.#robot.vehicle.transportOrder;
    if (!order) return this.#act("cancelOrder");
    const answer = await command(["transportOrders", order, "withdrawal"], { reason: "withdrawn at the control panel" });
    return ["command.withdrawn", { name: order }, answer.reason];
  }
}

customElements.define("nena-robot-commands", RobotCommands);
