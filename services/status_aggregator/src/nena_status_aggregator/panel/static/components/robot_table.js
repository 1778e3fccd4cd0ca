// The robots: condition and reason, battery, order and progress, age of the last state.

import { plural, t } from "../catalogue.js";
import { element, progressBar, setAttribute, setText, verbatim } from "../dom.js";
import { age, byName, number } from "../format.js";
import { reasonOf } from "../reasons.js";
import { address } from "../router.js";
import { LiveTable, cell } from "./live_table.js";

const LOW_BATTERY = 20;

class RobotTable extends LiveTable {
  columns = ["robots.name", "robots.condition", "robots.battery", "robots.order", "robots.age"];
  empty = "robots.empty";
  compare = (a, b) => byName(a.name, b.name) || byName(a.id, b.id);

  show(store) {
    this.follow(store, "robots");
  }

  /** Mark one robot; null: none. */
  select(id) {
    this.rowOf(this.selected)?.classList.remove("selected");
    this.selected = id;
    this.rowOf(id)?.classList.add("selected");
  }

  /** Bring the row of a robot into sight. */
  reveal(id) {
    this.rowOf(id)?.scrollIntoView({ block: "nearest" });
  }

  makeRow(id) {
    const name = verbatim("a", "", { class: "name", href: address("robots", id) });
    const parts = {
      name,
      model: verbatim("span", "", { class: "detail" }),
      chip: element("span", { class: "chip" }),
      reason: element("span", { class: "reason" }),
      marks: element("span", { class: "detail marks" }),
      battery: element("span", { class: "number" }),
      charging: element("span", { class: "detail" }),
      order: verbatim("span", "", { class: "order" }),
      progress: progressBar(),
      age: element("span", { class: "number" }),
    };
    const row = element(
      "tr",
      { "data-robot": id },
      cell("robots.name", parts.name, parts.model),
      cell("robots.condition", parts.chip, parts.reason, parts.marks),
      cell("robots.battery", parts.battery, parts.charging),
      cell("robots.order", parts.order, parts.progress.box),
      cell("robots.age", parts.age),
    );
    return { row, update: (robot, now) => update(parts, row, robot, now) };
  }
}

function update(parts, row, robot, now) {
  setAttribute(row, "data-condition", robot.condition);
  setText(parts.name, robot.name);
  setAttribute(parts.name, "title", robot.name);
  setText(parts.model, robot.name === robot.serialNumber ? robot.manufacturer : robot.id);
  setText(parts.chip, t(`condition.${robot.condition}`));
  setAttribute(parts.chip, "data-condition", robot.condition);
  setText(parts.reason, reasonOf(robot));
  setText(parts.marks, marks(robot).join(" · "));
  updateBattery(parts, robot.battery);
  updateOrder(parts, robot);
  const seconds = robot.lastState ? (now - Date.parse(robot.lastState)) / 1000 : null;
  setText(parts.age, seconds === null ? t("age.never") : age(seconds));
  parts.age.classList.toggle("bad", seconds === null || seconds > robot.silenceLimit);
}

function marks(robot) {
  const warnings = robot.errors.filter((each) => ["WARNING", "URGENT"].includes(each.errorLevel)).length;
  const errors = robot.errors.length - warnings;
  return [
    errors > 1 && plural("robots.errors", errors),
    warnings && plural("robots.warnings", warnings),
    robot.loads?.length && plural("robots.loads", robot.loads.length),
    robot.clockSkew !== null && t("robots.skew", { seconds: number(robot.clockSkew) }),
    robot.malformed && plural("robots.unreadable", robot.malformed),
  ].filter(Boolean);
}

function updateBattery(parts, battery) {
  setText(parts.battery, battery ? t("battery.charge", { charge: number(battery.charge) }) : t("none"));
  parts.battery.classList.toggle("bad", Boolean(battery) && battery.charge < LOW_BATTERY);
  setText(parts.charging, battery?.charging ? t("battery.charging") : "");
}

function updateOrder(parts, robot) {
  const order = robot.order;
  const active = Boolean(order?.active);
  setText(parts.order, active ? (robot.vehicle?.transportOrder ?? order.orderId) : t("none"));
  setAttribute(parts.order, "title", active ? order.orderId : null);
  parts.progress.box.hidden = !active;
  if (!active) return;
  parts.progress.bar.value = order.progress;
  setAttribute(parts.progress.bar, "aria-label", t("progress.label", { name: order.orderId }));
  setText(parts.progress.value, t("progress.value", { percent: number(order.progress) }));
}

customElements.define("nena-robot-table", RobotTable);
