// Stops: a banner for each one, and the forms that begin and end them.

import { command } from "./api.js";
import { button, element, field, numberInput, numberOf, refill, setAttribute, setText, verbatim } from "./dom.js";
import { commandForm } from "./forms.js";
import { number, t, timeOfDay } from "./i18n.js";
import { reasonElement } from "./reasons.js";

const KEY = "nena-person";
const CONFIRMED_WITHIN = 10_000; // ms
const CORNERS = ["xMin", "yMin", "xMax", "yMax"];

/** Create the field for the name of the person: the signed-in user, else the name that was last entered in this browser. */
export function personField(session) {
  const by = element("input", { name: "by", required: true, maxlength: 100, autocomplete: "name" });
  by.value = session?.user ?? localStorage.getItem(KEY) ?? "";
  by.addEventListener("change", () => localStorage.setItem(KEY, by.value));
  return by;
}

/** Return the name of the person for a command without a field for it, asked for once; undefined: the signed-in user. */
export function personOf(session) {
  if (session?.user) return undefined;
  const name = localStorage.getItem(KEY) || prompt(t("stops.by"))?.trim().slice(0, 100);
  if (!name) throw Object.assign(new Error(), { key: "command.nameless" });
  localStorage.setItem(KEY, name);
  return name;
}

/** Return what a stop is called: what it pauses, who began it and when. */
export function nameOfStop({ area, by, since }) {
  return t(area ? "stops.area.paused" : "stops.all.paused", { by, time: timeOfDay(since) });
}

function firstEmpty(form) {
  return form.querySelector(form.querySelector("[name=by]").value ? "[name=reason]" : "[name=by]");
}

function reasonField() {
  return element("input", { name: "reason", required: true, maxlength: 500 });
}

/** Fields for the corners of an area (m), which can be drawn on the map and are shown there. */
class AreaFields {
  constructor() {
    this.corners = Object.fromEntries(CORNERS.map((name) => [name, numberInput({ name, required: true })]));
    this.pickButton = button(t("form.pick"), () => this.pick(this.pickButton));
    const fields = CORNERS.map((name) => field(t(`stops.${name}`), this.corners[name]));
    this.element = element("div", { class: "fields" }, ...fields, this.pickButton);
    this.element.addEventListener("input", () => this.show());
  }

  /** Return the area as in the order service's API. */
  get area() {
    return Object.fromEntries(CORNERS.map((name) => [name, numberOf(this.corners[name])]));
  }

  /** Show the area on the map. */
  show() {
    const complete = Object.values(this.area).every(Number.isFinite);
    document.dispatchEvent(new CustomEvent("areashow", { detail: complete ? this.area : null }));
  }

  #take(area) {
    for (const name of CORNERS) this.corners[name].value = area[name].toFixed(2);
    this.element.dispatchEvent(new Event("input", { bubbles: true }));
  }

  /** Let the user drag the area on the map; then `next` gets the focus. */
  pick(next) {
    const detail = { take: (area) => this.#take(area), done: () => next.focus() };
    document.dispatchEvent(new CustomEvent("areapick", { detail }));
  }
}

/** The buttons in the header that open the forms. */
class StopCommands extends HTMLElement {
  /** `stops`: the element that shows the forms. */
  show(stops, noCommands) {
    this.hidden = Boolean(noCommands);
    if (this.hidden) return;
    const all = button(t("stops.all"), () => this.#toggle(stops, "all"), { class: "danger" });
    const area = button(t("stops.area"), () => this.#toggle(stops, "area"));
    this.buttons = { all, area };
    for (const each of Object.values(this.buttons)) setAttribute(each, "aria-expanded", "false");
    stops.addEventListener("form", (event) => this.#mark(event.detail));
    this.replaceChildren(all, area);
  }

  #toggle(stops, kind) {
    const open = stops.opened === kind;
    stops.openForm(open ? null : kind);
    if (open) this.buttons[kind].focus();
  }

  #mark(opened) {
    for (const [kind, each] of Object.entries(this.buttons)) setAttribute(each, "aria-expanded", String(kind === opened));
  }
}

customElements.define("nena-stop-commands", StopCommands);

/** A banner for each active stop, with the form that ends it; and the forms that begin one. Fires `form`. */
class Stops extends HTMLElement {
  opened = null; // "all" or "area": the form that is open
  #rows = new Map();

  /** Attach to the store. */
  show(store, session, noCommands) {
    this.store = store;
    this.session = session;
    this.noCommands = noCommands;
    this.list = element("div", { role: "status", "aria-live": "assertive" });
    this.forms = element("div");
    this.replaceChildren(this.list, this.forms);
    store.addEventListener("change", (event) => event.detail.parts.has("orderService") && this.#update(store.orderService.stops));
    this.#update(store.orderService.stops);
  }

  /** Open the form that begins a stop of `all` robots or of an `area`; null: none. */
  openForm(kind) {
    this.opened = kind;
    for (const name of ["areashow", "areapick"]) document.dispatchEvent(new CustomEvent(name, { detail: null }));
    const area = kind === "area" ? new AreaFields() : null;
    this.forms.replaceChildren(...(kind ? [this.#beginForm(kind, area)] : []));
    this.dispatchEvent(new CustomEvent("form", { detail: kind }));
    const first = kind && firstEmpty(this.forms);
    if (area) area.pick(first);
    else first?.focus();
  }

  #beginForm(kind, area) {
    const [by, reason] = [personField(this.session), reasonField()];
    const named = element("div", { class: "fields" }, field(t("stops.by"), by), field(t("stops.reason"), reason));
    const hint = element("p", { class: "hint" }, t(`stops.${kind}.${area && this.store.orderService.up === false ? "down" : "hint"}`));
    return commandForm({
      label: t(`stops.${kind}`),
      submit: t(`stops.${kind}.send`),
      fields: [hint, named, ...(area ? [area.element] : [])],
      more: [button(t("stops.cancel"), () => this.openForm(null))],
      send: async () => {
        await command(["stops"], { by: by.value, reason: reason.value, ...(area && { area: area.area }) });
        this.openForm(null);
        return ["done.stop", {}];
      },
    });
  }

  #update(stops) {
    const names = new Set(stops.map(({ name }) => name));
    for (const [name, row] of this.#rows) {
      if (names.has(name)) continue;
      row.box.remove();
      this.#rows.delete(name);
    }
    for (const stop of stops) {
      if (!this.#rows.has(stop.name)) this.#add(stop);
      this.#fill(this.#rows.get(stop.name), stop);
    }
  }

  #add(stop) {
    const row = { title: element("strong"), reason: verbatim("q"), count: element("span"), direct: element("p", {}, t("stops.direct")), others: element("p") };
    const line = element("div", { class: "line" }, row.title, row.reason, row.count);
    row.box = element("section", { class: "stop", "data-stop": stop.name }, line, row.direct, row.others);
    if (!this.noCommands) {
      const form = this.#endForm(stop.name);
      const end = button(t("stops.end"), () => {
        form.hidden = !form.hidden;
        setAttribute(end, "aria-expanded", String(!form.hidden));
        if (!form.hidden) firstEmpty(form).focus();
      });
      setAttribute(end, "aria-expanded", "false");
      form.hidden = true;
      line.append(end);
      row.box.append(form);
    }
    this.#rows.set(stop.name, row);
    this.list.append(row.box);
    setTimeout(() => this.#update(this.store.orderService.stops), CONFIRMED_WITHIN); // then it says what to do
  }

  #fill(row, stop) {
    setText(row.title, nameOfStop(stop));
    setText(row.reason, stop.reason);
    const none = t(stop.area ? "stops.area.none" : "stops.all.none");
    setText(row.count, stop.vehicles ? t("stops.count", { paused: number(stop.paused), count: number(stop.vehicles) }) : none);
    row.direct.hidden = !stop.direct;
    row.others.hidden = !stop.notPaused.length;
    const late = this.store.now() - Date.parse(stop.since) >= CONFIRMED_WITHIN;
    const seconds = number(CONFIRMED_WITHIN / 1000);
    refill(row.others, stop.notPaused, () => [
      element("strong", {}, t(late ? "stops.unconfirmed" : "stops.confirming", { count: number(stop.vehicles - stop.paused), seconds })),
      ...stop.notPaused.flatMap((each) => [" ", verbatim("span", each.vehicle), " (", reasonElement("span", each), ")"]),
    ]);
  }

  #endForm(name) {
    const [by, reason] = [personField(this.session), reasonField()];
    const hint = element("p", { class: "effect" }, t("stops.end.effect"));
    return commandForm({
      label: t("stops.end"),
      submit: t("stops.end.send"),
      fields: [hint, element("div", { class: "fields" }, field(t("stops.by"), by), field(t("stops.reason"), reason))],
      send: async () => {
        await command(["stops", name, "end"], { by: by.value, reason: reason.value });
        return ["done.stopEnded", {}];
      },
    });
  }
}

customElements.define("nena-stops", Stops);
