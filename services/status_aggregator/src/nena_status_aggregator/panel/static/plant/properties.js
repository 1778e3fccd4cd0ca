// The form of what is selected: numbers beside what is drawn.

import { button, element, field, numberInput, numberOf, select, verbatim } from "../dom.js";
import { number, t } from "../i18n.js";
import { devices, placesBeside, withDoor, withWayBack } from "./building.js";
import { bend, reshaped, straightCurve } from "./curves.js";
import { change, find, put, rename } from "./model.js";

const MM = 1000;

/**
 * Return the elements of the form for the selected names. `edit(model, selection)` takes each change at once; `canvas` selects
 * others, turns paths, and adds rows.
 */
export function propertiesOf(model, selection, edit, canvas) {
  const found = selection.map((name) => find(model, name)).filter(Boolean);
  if (!found.length) return [element("p", { class: "hint" }, t("plant.nothing"))];
  const kinds = new Set(found.map(({ kind }) => kind));
  const title = found.length === 1 ? verbatim("strong", found[0].thing.name) : element("strong", {}, t("plant.several", { count: number(found.length) }));
  if (kinds.size > 1) return [title];
  const [kind] = kinds;
  const form = new Form(model, kind, found.map(({ thing }) => thing), edit);
  return [title, ...(kind === "point" ? pointFields(form) : kind === "path" ? pathFields(form, canvas) : locationFields(form))];
}

/** The fields of objects of a kind: what several have in common is changed in all of them. */
export class Form {
  constructor(model, kind, things, edit) {
    Object.assign(this, { model, list: `${kind}s`, things, names: things.map(({ name }) => name), edit, single: things.length === 1 ? things[0] : null });
  }

  apply(fields) {
    this.edit(change(this.model, this.list, this.names, fields), this.names);
  }

  name() {
    const input = element("input", { type: "text", value: this.single.name, maxlength: 200, translate: "no" });
    return changed(t("schedules.name"), input, () => this.edit(rename(this.model, this.list, this.single.name, input.value.trim()), [input.value.trim() || this.single.name]));
  }

  coordinate(key, axis) {
    const { xMm = 0, yMm = 0 } = this.single;
    const input = numberInput({ value: (axis ? yMm : xMm) / MM, step: 0.01, required: true });
    return changed(t(key), input, () => {
      const at = Math.round((numberOf(input) ?? 0) * MM);
      this.edit(put(this.model, this.single.name, axis ? xMm : at, axis ? at : yMm), this.names);
    });
  }

  /** A number of all objects, or of a `part` of each; `factor`: from the unit shown to that of the model. */
  amount(key, name, { factor = 1, least = 0, initial = null, required = true, part = null } = {}) {
    const values = new Set(this.things.map((thing) => (part ? thing[part] : thing)?.[name] ?? initial));
    const to = (value) => (part ? (thing) => ({ [part]: { ...thing[part], [name]: value } }) : { [name]: value });
    const value = values.size === 1 && [...values][0] !== null ? [...values][0] / factor : "";
    const input = numberInput({ value, min: least, required });
    return changed(t(key), input, () => {
      const given = numberOf(input);
      if (given !== null || !required) this.apply(to(given === null ? null : factor === 1 ? given : Math.round(given * factor)));
    });
  }

  check(key, read, fields) {
    const input = element("input", { type: "checkbox" });
    input.checked = this.things.every(read);
    return changed(t(key), input, () => this.apply(fields(input.checked)));
  }

  property(key, name) {
    const { [name]: value = "", ...others } = this.single.properties ?? {};
    const input = element("input", { type: "text", value, translate: "no" });
    return changed(t(key), input, () => this.apply({ properties: input.value.trim() ? { ...others, [name]: input.value.trim() } : others }));
  }

  properties() {
    const lines = Object.entries(this.single.properties ?? {}).map(([key, value]) => `${key}=${value}`);
    const input = element("textarea", { rows: Math.max(2, lines.length), translate: "no", spellcheck: "false" });
    input.value = lines.join("\n");
    return changed(t("plant.properties"), input, () => {
      const pairs = input.value.split("\n").filter((line) => line.includes("=")).map((line) => [line.slice(0, line.indexOf("=")).trim(), line.slice(line.indexOf("=") + 1).trim()]);
      this.apply({ properties: Object.fromEntries(pairs) });
    });
  }
}

function changed(label, control, action) {
  control.addEventListener("change", () => control.checkValidity() && action());
  return field(label, control);
}

function pointFields(form) {
  const parking = form.check("plant.parking", ({ type }) => type === "PARK_POSITION", (on) => ({ type: on ? "PARK_POSITION" : "HALT_POSITION" }));
  const heading = form.amount("form.headingOptional", "orientationDeg", { least: -360, required: false });
  if (!form.single) return [heading, parking];
  return [form.name(), element("div", { class: "fields" }, form.coordinate("form.x", 0), form.coordinate("form.y", 1), heading), parking, form.properties()];
}

function pathFields(form, canvas) {
  const speed = form.amount("plant.speed", "maxVelocityMmS", { factor: MM, initial: MM });
  const locked = form.check("plant.locked", ({ locked: is }) => Boolean(is), (on) => ({ locked: on }));
  const oneWays = form.things.filter((path) => !(form.model.paths ?? []).some((each) => each.source === path.destination && each.destination === path.source));
  const both = button(t("plant.addWayBack"), () => form.edit(withWayBack(form.model, oneWays.map(({ name }) => name)), form.names));
  const turn = button(t("plant.turn"), () => canvas.turn());
  const parts = form.names.map((name) => button(name, () => canvas.select([name]), { translate: "no" }));
  const actions = element("div", { class: "actions" }, ...(oneWays.length ? [both] : []), turn);
  const door = doorField(form);
  const points = new Map(form.model.points.map((each) => [each.name, each]));
  const curve = form.check("plant.curve", ({ layout }) => Boolean(layout?.controlPoints?.length), (on) => (path) => reshaped(path, points, on ? straightCurve(path, points) : []));
  const isWay = form.things.slice(1).every(({ source, destination }) => source === form.things[0].destination && destination === form.things[0].source);
  const isCurve = Boolean(form.things[0].layout?.controlPoints?.length);
  const row = !isWay ? [] : isCurve ? handleFields(form) : rowFields(form, canvas);
  if (!form.single) return [speed, locked, curve, ...door, actions, ...(parts.length < 5 ? [element("div", { class: "actions" }, ...parts)] : []), ...row];
  const length = form.amount("plant.length", "lengthMm", { factor: MM, least: 0.001 });
  return [form.name(), element("div", { class: "fields" }, length, speed), locked, curve, ...door, actions, form.properties(), ...row];
}

// The door, or another device, that is on all paths; without one in the plant, no field.
function doorField(form) {
  const known = devices(form.model).map(({ name }) => [name, name, true]);
  if (!known.length) return [];
  const doors = new Set(form.things.map(({ peripheralOperations }) => peripheralOperations?.[0]?.location ?? ""));
  const control = select([["", t("plant.noDoor")], ...known]);
  control.value = doors.size === 1 ? [...doors][0] : "";
  return [changed(t("plant.door"), control, () => form.edit(withDoor(form.model, form.names, control.value), form.names))];
}

// The control points of a path, or of both ways between two points.
function handleFields(form) {
  const inputs = form.things[0].layout.controlPoints.flatMap(({ xMm, yMm }, at) => [["plant.handleX", 0], ["plant.handleY", 1]].map(([key, axis]) => {
    const input = numberInput({ value: [xMm, yMm][axis] / MM, required: true });
    const place = () => [xMm, yMm].map((each, which) => (which === axis ? Math.round(numberOf(input) * MM) : each));
    return changed(t(key, { number: at + 1 }), input, () => form.edit(bend(form.model, form.names, at, place()), form.names));
  }));
  return [element("h4", {}, t("plant.handles")), element("div", { class: "fields" }, ...inputs)];
}

// A row of stations beside a path, or both ways between two points.
function rowFields(form, canvas) {
  const count = numberInput({ value: 3, min: 1, max: 200, step: 1, required: true });
  const distance = numberInput({ value: canvas.spacing, min: 0.1, required: true });
  const beside = numberInput({ value: 1, required: true });
  const make = button(t("plant.makeRow"), () => {
    if ([count, distance, beside].every((each) => each.reportValidity())) canvas.addRow(placesBeside(form.model, form.things[0], numberOf(count), numberOf(distance) * MM, numberOf(beside) * MM));
  });
  return [element("h4", {}, t("plant.row")), element("div", { class: "fields" }, field(t("plant.rowCount"), count), field(t("plant.spacing"), distance), field(t("plant.rowBeside"), beside)), element("div", { class: "actions" }, make)];
}

function locationFields(form) {
  const locked = form.check("plant.locked", ({ locked: is }) => Boolean(is), (on) => ({ locked: on }));
  if (!form.single) return [locked];
  const { single: location, model } = form;
  const types = model.locationTypes ?? [];
  const known = element("datalist", { id: "plant-types" }, ...types.map(({ name }) => element("option", { value: name })));
  const type = element("input", { type: "text", value: location.type, list: "plant-types", required: true, translate: "no" });
  const typeField = changed(t("plant.type"), type, () => {
    const made = types.some(({ name }) => name === type.value) ? model : { ...model, locationTypes: [...types, { name: type.value, allowedOperations: [] }] };
    form.edit(change(made, "locations", form.names, { type: type.value }), form.names);
  });
  const its = types.find(({ name }) => name === location.type);
  const list = its?.allowedPeripheralOperations?.length ? "allowedPeripheralOperations" : "allowedOperations";
  const operations = element("input", { type: "text", value: (its?.[list] ?? []).join(", "), translate: "no" });
  const operationsField = changed(t("plant.operations", { type: location.type }), operations, () => {
    const allowed = operations.value.split(",").map((each) => each.trim()).filter(Boolean);
    form.edit(change(model, "locationTypes", [location.type], { [list]: allowed }), form.names);
  });
  const unlink = (point) => button("×", () => form.apply({ links: location.links.filter((each) => each.point !== point) }), { "aria-label": t("plant.unlink", { point }) });
  const links = (location.links ?? []).map(({ point }) => element("li", {}, verbatim("span", point), " ", unlink(point)));
  const linked = links.length ? element("ul", { class: "entries" }, ...links) : element("p", { class: "hint" }, t(list === "allowedOperations" ? "plant.noLinks" : "plant.noDoors"));
  return [form.name(), element("div", { class: "fields" }, form.coordinate("form.x", 0), form.coordinate("form.y", 1)), typeField, known, operationsField, element("h4", {}, t("plant.links")), linked, locked, form.properties()];
}
