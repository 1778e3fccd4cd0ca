// A place and a heading in the plant's frame: typed, or pressed and dragged on the map.

import { t } from "../catalogue.js";
import { button, element } from "../dom.js";
import { field, numberInput, numberOf } from "./fields.js";

const RAD = Math.PI / 180;

/** Fields for x, y (m) and heading (degrees); shows on the map what is in them. */
export class PoseFields {
  constructor({ headingRequired = false } = {}) {
    this.x = numberInput({ name: "x", required: true });
    this.y = numberInput({ name: "y", required: true });
    const bounds = { name: "heading", min: -180, max: 180 };
    this.heading = numberInput(headingRequired ? { ...bounds, required: true } : bounds);
    this.element = element(
      "div",
      { class: "fields" },
      field(t("form.x"), this.x),
      field(t("form.y"), this.y),
      field(t(headingRequired ? "form.heading" : "form.headingOptional"), this.heading),
      button(t("form.pick"), () => this.#pick()),
    );
    this.element.addEventListener("input", () => this.show());
  }

  /** Give `{x, y, theta}`; `theta` (rad) is null where no heading is wanted. */
  get pose() {
    const degrees = numberOf(this.heading);
    return { x: numberOf(this.x), y: numberOf(this.y), theta: degrees === null ? null : degrees * RAD };
  }

  set pose({ x, y, theta }) {
    this.x.value = x.toFixed(2);
    this.y.value = y.toFixed(2);
    this.heading.value = theta === null ? "" : Math.round(theta / RAD);
    this.element.dispatchEvent(new Event("input", { bubbles: true }));
  }

  /** Show the pose on the map. */
  show() {
    const pose = this.pose;
    const complete = Number.isFinite(pose.x) && Number.isFinite(pose.y) && pose.x !== null && pose.y !== null;
    this.#tell("poseshow", complete ? pose : null);
  }

  #pick() {
    this.#tell("posepick", { take: (pose) => (this.pose = pose), done: () => this.element.querySelector("button").focus() });
  }

  #tell(name, detail) {
    document.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
