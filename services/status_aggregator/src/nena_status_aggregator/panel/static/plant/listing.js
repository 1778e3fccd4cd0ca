// What has no place of its own on the drawing, blocks and robots: a list each, with the form of the one that is open.

import { button, element, field, renew, select } from "../dom.js";
import { number, t } from "../i18n.js";
import { blockOf } from "./building.js";
import { add, freshName } from "./model.js";
import { Form } from "./properties.js";

const MM = 1000;
const RULES = ["SINGLE_VEHICLE_ONLY", "SAME_DIRECTION_ONLY"];
const UNKNOWN = 20; // robots

// A list of objects of a kind. `edit(model)` takes each change; `fields(form)` returns the form of one.
class Listing {
  current = null; // the name of the open one
  #shown = null;

  constructor(kind, title, { edit, fields, opened }) {
    Object.assign(this, { kind, list: `${kind}s`, edit, fields, opened });
    this.items = element("ul", { class: "entries" });
    this.more = element("div", { class: "actions" });
    this.element = element("section", { "aria-label": title }, element("h3", {}, title), this.items, this.more);
  }

  show(model) {
    this.model = model;
    const things = model[this.list] ?? [];
    const shown = this.current === null ? things : model; // a form changes the whole model
    if (shown === this.#shown) return;
    this.#shown = shown;
    renew(this.items, things.map((thing) => this.#item(thing)));
  }

  /** Open the form of an object. */
  open(name) {
    this.current = name;
    this.#shown = null;
    this.show(this.model);
  }

  #item(thing) {
    const { name } = thing;
    const isOpen = name === this.current;
    const head = button(name, () => {
      this.open(isOpen ? null : name);
      this.opened(isOpen ? {} : thing);
    }, { translate: "no", "aria-expanded": String(isOpen) });
    const gone = button("×", () => this.edit({ ...this.model, [this.list]: this.model[this.list].filter((each) => each.name !== name) }), { "aria-label": t("plant.removeOne", { name }) });
    const form = new Form(this.model, this.kind, [thing], (model, [kept]) => {
      this.current = kept;
      this.edit(model);
    });
    return element("li", { "data-name": name }, head, " ", gone, ...(isOpen ? [element("div", { class: "command" }, form.name(), ...this.fields(form))] : []));
  }
}

/** The blocks of a draft. `selected()` returns names, and `select(names)` selects them. */
export class Blocks extends Listing {
  constructor(edit, selected, choose) {
    super("block", t("plant.blocks"), { edit, fields: (form) => this.#fields(form), opened: ({ members }) => members && choose(members) });
    this.selected = selected;
    this.maker = button(t("plant.makeBlock"), () => this.make());
    this.more.append(this.maker);
  }

  /** Make a block of what is selected. */
  make() {
    const members = blockOf(this.model, this.selected());
    if (!members.length) return;
    const name = freshName(this.model, t("plant.blockPrefix"));
    this.edit(add(this.model, "blocks", { name, members }));
    this.open(name);
  }

  #fields(form) {
    const { single: block } = form;
    const rule = select(RULES.map((each) => [each, t(`plant.rule.${each}`)]));
    rule.value = block.type ?? RULES[0];
    rule.addEventListener("change", () => form.apply({ type: rule.value }));
    const members = element("p", { class: "hint" }, t("plant.members", { count: number((block.members ?? []).length) }));
    const take = button(t("plant.takeMembers"), () => {
      const taken = blockOf(this.model, this.selected());
      if (taken.length) form.apply({ members: taken });
    });
    return [field(t("plant.rule"), rule), members, element("div", { class: "actions" }, take), form.properties()];
  }
}

/** The robots of a draft; those that have reported themselves, `known()` by their ids, are added with one click. `opened()`: another one is open. */
export class Vehicles extends Listing {
  constructor(edit, known, opened) {
    super("vehicle", t("plant.vehicles"), { edit, fields: vehicleFields, opened });
    this.known = known;
  }

  show(model) {
    super.show(model);
    const serials = new Set((model.vehicles ?? []).map(({ name, properties }) => properties?.["vda5050:serialNumber"] ?? name));
    const unknown = this.known().filter((id) => !serials.has(id.slice(id.indexOf("/") + 1)));
    const make = button(t("plant.newVehicle"), () => this.#make());
    renew(this.more, [...unknown.slice(0, UNKNOWN).map((id) => button(t("plant.addVehicle", { name: id }), () => this.#take(id))), make]);
  }

  // One that has not reported itself yet.
  #make() {
    const name = freshName(this.model, t("plant.vehiclePrefix"));
    this.edit(add(this.model, "vehicles", { name }));
    this.open(name);
  }

  #take(id) {
    const [manufacturer, serial] = [id.slice(0, id.indexOf("/")), id.slice(id.indexOf("/") + 1)];
    this.edit(add(this.model, "vehicles", { name: serial, properties: { "vda5050:manufacturer": manufacturer, "vda5050:serialNumber": serial } }));
  }
}

function vehicleFields(form) {
  const size = (key, name) => form.amount(key, name, { factor: MM, least: 0.001, initial: MM, part: "boundingBox" });
  const speed = form.amount("plant.speed", "maxVelocityMmS", { factor: MM, initial: MM });
  const key = [form.property("plant.manufacturer", "vda5050:manufacturer"), form.property("plant.serial", "vda5050:serialNumber")];
  return [element("div", { class: "fields" }, ...key, size("plant.length", "lengthMm"), size("plant.width", "widthMm"), speed), form.properties()];
}
