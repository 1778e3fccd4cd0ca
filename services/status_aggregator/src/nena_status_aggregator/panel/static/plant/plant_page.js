// The plant: drafts and versions, and the editor of a draft with its findings, activation and files.

import { ask, askUntil, askWith, command, RefusedError } from "../api.js";
import { save } from "../csv.js";
import { button, element, emptyBox, field, foreign, numberInput, numberOf, refillSelect, renew, select, setText, verbatim } from "../dom.js";
import { commandForm, confirmation, run } from "../forms.js";
import { byName, dateAndTime, number, plural, t } from "../i18n.js";
import { Grids } from "../map/grids.js";
import { reasonElement } from "../reasons.js";
import { address, backLink, currentView } from "../router.js";
import { join } from "./building.js";
import "./draft_canvas.js";
import { Blocks, Vehicles } from "./listing.js";
import { add, align, distribute, freshName, History } from "./model.js";
import { propertiesOf } from "./properties.js";
import { DraftSaver } from "./saving.js";
import { Trials } from "./trials.js";

const TOOLS = ["select", "point", "oneWay", "twoWay", "location", "row", "ruler"];
const GRIDS = [0, 0.1, 0.25, 0.5, 1, 2];
const FORMATS = { nena: "NeNa JSON", opentcs: "openTCS XML", lif: "LIF 1.0", lif2: "LIF 2.0", "nav2-route": "Nav2 GeoJSON" };
// Types of locations, named so that a station can have the singular.
const STATIONS = {
  Stations: { allowedOperations: ["Load cargo", "Unload cargo"] },
  Chargers: { allowedOperations: ["Charge"] },
  Doors: { allowedPeripheralOperations: ["open", "close"] },
};
const SHOWN = 200; // differences and findings
const MM = 1000;
const DEGREES = 180 / Math.PI;

class PlantPage extends HTMLElement {
  #saver = null;
  #grids = new Grids();
  #opened = 0; // outdated answers are ignored

  /** Attach to `fleet`: {store, plant}. */
  show(fleet) {
    this.fleet = fleet;
    fleet.store.addEventListener("change", ({ detail }) => detail.robots.size && this.#showRobots());
    this.#grids.addEventListener("change", () => this.#showRobots());
    this.addEventListener("keydown", (event) => this.#key(event));
  }

  /** Show the page; null hides it. */
  async open(view) {
    const opened = (this.#opened += 1);
    delete document.body.dataset.drawing;
    await this.#saver?.close();
    if (opened !== this.#opened) return;
    this.#saver = this.canvas = null;
    if (view === null) return this.replaceChildren();
    const [, name] = currentView();
    if (name) document.body.dataset.drawing = "";
    this.replaceChildren(this.#head(t("plant.title")), element("p", { class: "hint", role: "status" }, t("audit.loading")));
    try {
      await (name ? this.#openDraft(name, opened) : this.#openList(opened));
    } catch (error) {
      if (opened === this.#opened) this.replaceChildren(this.#head(t("plant.title")), emptyBox(t("audit.failed"), foreign("span", error.message)));
    }
  }

  #head(title, ...more) {
    const back = currentView()[1] ? element("a", { href: address("plant"), class: "back" }, t("plant.back")) : backLink();
    this.heading = element("h2", { tabindex: -1 }, title);
    return element("header", { class: "head" }, back, this.heading, ...more);
  }

  // Drafts and versions

  async #openList(opened) {
    const [{ drafts }, { versions }] = await Promise.all(["plantDrafts", "plantVersions"].map((list) => askUntil(() => opened === this.#opened, [list])));
    if (opened !== this.#opened) return;
    this.result = element("output", { class: "result", role: "status" });
    const rows = drafts.map((draft) => this.#draftItem(draft));
    const list = rows.length ? element("ul", { class: "entries schedules" }, ...rows) : element("p", { class: "hint" }, t("plant.noDrafts"));
    const kept = element("ul", { class: "entries schedules" }, ...versions.map((version, at) => this.#versionItem(version, at === 0)));
    this.replaceChildren(
      this.#head(t("plant.title")),
      element("section", {}, element("p", { class: "hint" }, t("plant.hint")), this.#newForm(drafts)),
      element("section", {}, element("h3", {}, t("plant.drafts")), list, this.result),
      element("section", {}, element("h3", {}, t("plant.versions")), kept),
    );
    this.heading.focus({ preventScroll: true });
  }

  #newForm(drafts) {
    const name = element("input", { type: "text", required: true, maxlength: 80, pattern: "[^\\/]+", translate: "no" });
    const file = element("input", { type: "file", accept: ".json,.xml,.lif,.geojson" });
    const source = select(["active", "empty", "file"].map((each) => [each, t(`plant.from.${each}`)]));
    const fileField = field(t("plant.file"), file);
    const follow = () => {
      fileField.hidden = source.value !== "file";
      file.required = source.value === "file";
    };
    source.addEventListener("change", follow);
    follow();
    const content = { active: async () => ({ fromVersion: 0 }), empty: async () => ({}), file: async () => ({ file: await file.files[0].text() }) };
    const fields = element("div", { class: "fields" }, field(t("plant.draftName"), name), field(t("plant.source"), source), fileField);
    const send = async () => {
      if (drafts.some((each) => each.name === name.value)) throw new RefusedError({ detail: t("plant.taken", { name: name.value }) });
      return this.#create(name.value, await content[source.value]());
    };
    return commandForm({ label: t("plant.new"), submit: t("plant.new"), fields: [fields], send });
  }

  // Create a draft and go to it.
  async #create(name, content) {
    await command(["plantDrafts", name], { version: null, ...content }, "PUT");
    location.hash = address("plant", name);
    return ["schedules.saved", { name }];
  }

  #draftItem({ name, points, paths, locations, changed, by }) {
    const link = verbatim("a", name, { href: address("plant", name) });
    const what = element("span", { class: "hint" }, t("plant.size", { points: number(points), paths: number(paths), locations: number(locations) }), " · ", t("plant.savedBy", { time: dateAndTime(changed), by }));
    const gone = button(t("schedules.delete"), () => this.#confirmDelete(name, item), { "aria-label": t("schedules.deleteOne", { name }) });
    const item = element("li", { "data-draft": name }, element("div", { class: "line" }, element("strong", {}, link), what, gone));
    return item;
  }

  #confirmDelete(name, item) {
    const send = async () => {
      await command(["plantDrafts", name], {}, "DELETE");
      await this.#openList(this.#opened);
      return ["schedules.deleted", { name }];
    };
    item.append(confirmation({ label: t("schedules.deleteOne", { name }), effect: t("plant.deleteEffect"), submit: t("schedules.deleteSure"), send }));
    item.querySelector(".effect").focus();
  }

  #versionItem(version, isActive) {
    const { number: which, activated, by, draft, name, points, paths, locations } = version;
    const place = element("div");
    const differ = button(t("plant.differences"), async () => {
      const answer = await ask("plantVersions", String(which), "differences").catch((error) => error);
      place.replaceChildren(answer instanceof Error ? foreign("p", answer.message) : differencesList(answer));
    }, { "aria-label": t("plant.differencesOf", { number: which }) });
    const make = () => this.#create(t("plant.versionDraft", { number: which, time: now() }), { fromVersion: which });
    const back = button(t("plant.makeDraft"), () => run(back, this.result, make), { "aria-label": t("plant.makeDraftOf", { number: which }) });
    const head = element("div", { class: "line" }, element("strong", {}, t("plant.version", { number: which })), " ", verbatim("span", name), ...(isActive ? [element("span", { class: "chip", "data-state": "ACTIVE" }, t("schedules.ACTIVE"))] : []), differ, back);
    const from = draft ? t("plant.fromDraft", { draft }) : "";
    const who = by ? t("plant.activatedBy", { time: dateAndTime(activated), by }) : t("plant.fromFile", { time: dateAndTime(activated) });
    const size = t("plant.size", { points: number(points), paths: number(paths), locations: number(locations) });
    return element("li", { "data-version": which }, head, element("p", { class: "hint" }, [who, from, size].filter(Boolean).join(" · ")), place);
  }

  // The editor

  async #openDraft(name, opened) {
    const saver = new DraftSaver(name, () => Boolean(this.canvas?.busy));
    const model = await saver.open(() => opened === this.#opened);
    if (opened !== this.#opened) return saver.close();
    this.#saver = saver;
    this.name = name;
    this.history = new History(model);
    this.#build(name);
    saver.addEventListener("state", () => {
      this.#showState();
      if (saver.state !== "saved") return;
      this.trials.recheck();
      this.#findClosed();
    });
    saver.addEventListener("findings", () => this.#showFindings());
    saver.addEventListener("editors", () => this.#showEditors());
    saver.addEventListener("theirs", ({ detail }) => this.history.push(detail) && this.#refresh());
    this.#showState();
    this.#showFindings();
    this.#refresh([]);
    this.#showRobots();
    this.canvas.fit();
    this.trials.addEventListener("findings", () => this.#showFindings());
    this.trials.addEventListener("map", () => this.#showRobots());
    this.heading.focus({ preventScroll: true });
    await this.trials.open();
  }

  #build(name) {
    this.state = element("span", { class: "hint", role: "status" });
    this.editors = element("strong", { class: "bad", role: "status" });
    this.conflict = element("div", { role: "alert" });
    this.canvas = element("nena-draft-canvas");
    this.canvas.stationType = (model) => stationType(model, this.station.value);
    this.canvas.addEventListener("edit", ({ detail: { model, selection } }) => this.#edit(model, selection));
    this.canvas.addEventListener("selected", ({ detail }) => this.#showProperties(detail));
    this.properties = element("section", { class: "command", "aria-label": t("plant.propertiesOf") });
    this.findings = element("section", { "aria-label": t("plant.findings") });
    this.outcome = element("div", { role: "status", tabindex: -1 });
    const kept = (changed) => this.#edit(changed, this.canvas.selection);
    this.blocks = new Blocks(kept, () => this.canvas.selection, (names) => this.canvas.select(names));
    this.vehicles = new Vehicles(kept, () => [...this.fleet.store.robots.keys()], () => this.#findClosed());
    this.closed = [];
    this.canvas.addEventListener("block", () => this.blocks.make());
    this.trials = new Trials({ name, canvas: this.canvas, model: () => this.history.present, version: () => this.#saver.version, edit: (model) => this.#edit(model, []), flush: () => this.#saver.flush(), choose: (tool) => this.choose(tool) });
    const keys = element("p", { class: "hint", id: "plant-keys" }, t("plant.keys"));
    const aside = element("div", { class: "beside" }, this.conflict, this.properties, this.findings, this.#activation(), ...this.trials.elements, this.blocks.element, this.vehicles.element, this.#files());
    this.replaceChildren(this.#head(verbatim("span", name), this.state, this.editors), this.#toolbar(), element("div", { class: "drawing" }, element("div", { class: "sheet" }, this.canvas, keys), aside));
  }

  #toolbar() {
    const bar = element("div", { class: "actions toolbar", role: "toolbar", "aria-label": t("plant.tools") });
    const tools = TOOLS.map((tool) => button(t(`plant.tool.${tool}`), () => choose(tool), { "data-tool": tool }));
    const choose = (this.choose = (tool) => {
      this.canvas.tool = tool;
      for (const each of tools) each.setAttribute("aria-pressed", String(each.dataset.tool === tool));
      spacing.hidden = tool !== "row";
    });
    const act = (key, action) => button(t(key), action);
    this.undoTool = act("plant.undo", () => this.#go("undo"));
    this.redoTool = act("plant.redo", () => this.#go("redo"));
    const arrange = (key, how, axis) => act(key, () => this.#edit(how(this.history.present, new Set(this.canvas.selection), axis), this.canvas.selection));
    this.arranging = [arrange("plant.alignX", align, "xMm"), arrange("plant.alignY", align, "yMm"), arrange("plant.distributeX", distribute, "xMm"), arrange("plant.distributeY", distribute, "yMm")];
    this.removeTool = act("plant.delete", () => this.canvas.remove());
    this.joinTool = act("plant.join", () => this.canvas.join());
    const spacing = numberInput({ value: this.canvas.spacing, min: 0.1, required: true, "aria-label": t("plant.spacing"), title: t("plant.spacing") });
    spacing.addEventListener("change", () => spacing.checkValidity() && (this.canvas.spacing = numberOf(spacing)));
    this.station = select(Object.keys(STATIONS).map((each) => [each, t(`plant.station.${each}`)]), { "aria-label": t("plant.stationKind") });
    const grid = select(GRIDS.map((each) => [each, each ? t("plant.gridOf", { size: number(each, each % 1 ? 2 : 0) }) : t("plant.noGrid")]), { "aria-label": t("plant.grid") });
    grid.value = this.canvas.grid;
    grid.addEventListener("change", () => {
      this.canvas.grid = Number(grid.value);
      this.canvas.draw();
    });
    choose("select");
    this.robot = select([], { "aria-label": t("plant.hereRobot") });
    this.here = act("plant.here", () => this.#takeHere());
    bar.append(...tools, this.station, spacing, grid, this.undoTool, this.redoTool, this.removeTool, this.joinTool, ...this.arranging, act("map.fit", () => this.canvas.fit()), this.robot, this.here);
    return bar;
  }

  #edit(model, selection) {
    if (!this.history.push(model)) return;
    this.#saver.save(model);
    this.#refresh(selection);
  }

  #go(how) {
    if (!this.history[how]()) return;
    this.#saver.save(this.history.present);
    this.#refresh();
  }

  #refresh(selection = this.canvas.selection) {
    this.canvas.show(this.history.present, selection);
    this.undoTool.disabled = !this.history.past.length;
    this.redoTool.disabled = !this.history.future.length;
    this.blocks.show(this.history.present);
    this.#showVehicles();
  }

  #key(event) {
    if (!this.canvas || event.target.matches("input, textarea, select") || !(event.ctrlKey || event.metaKey)) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    this.#go(key === "z" && !event.shiftKey ? "undo" : "redo");
    event.preventDefault();
  }

  #showProperties(names) {
    const fields = propertiesOf(this.history.present, names, (model, selection) => this.#edit(model, selection), this.canvas);
    renew(this.properties, [element("h3", {}, t("plant.propertiesOf")), ...fields]);
    this.removeTool.disabled = this.blocks.maker.disabled = !names.length;
    for (const each of this.arranging) each.disabled = names.length < 2;
    this.joinTool.disabled = names.length < 2 && join(this.history.present, names) === this.history.present;
  }

  #showState() {
    const { state, error } = this.#saver;
    setText(this.state, t(`plant.state.${state}`));
    this.state.dataset.state = state;
    if (!["conflict", "gone", "refused"].includes(state)) return this.conflict.replaceChildren();
    const result = element("output", { class: "result", role: "status" });
    const again = button(t("plant.openTheirs"), () => this.open(""));
    const name = t("plant.copyName", { name: this.name.slice(0, 40), time: now() });
    const copy = button(t("plant.saveMine"), () => run(copy, result, () => this.#create(name, { model: this.history.present, mapOf: this.name })));
    const actions = { conflict: [again, copy], gone: [copy], refused: [] }[state];
    const errors = error.errors.map((each) => foreign("li", each));
    this.conflict.replaceChildren(element("section", {}, foreign("p", error.message), element("ul", {}, ...errors), element("div", { class: "actions" }, ...actions), result));
  }

  #showEditors() {
    const { editors } = this.#saver;
    setText(this.editors, editors.length ? t("plant.editors", { names: editors.join(", ") }) : "");
  }

  // The paths that the open robot may not use are among the findings.
  async #findClosed() {
    const { current } = this.vehicles;
    const draft = current && (await askWith(["plantDrafts", this.name], [["vehicle", current], ["known", this.#saver.version]]).catch(() => null));
    if (!this.canvas?.isConnected || this.vehicles.current !== current) return;
    this.closed = draft?.closed ?? [];
    this.#showFindings();
  }

  #showFindings() {
    this.trials.mark();
    const findings = [...this.closed, ...this.#saver.findings, ...this.trials.findings];
    const at = new Map();
    for (const { name, isError } of findings) at.set(name, isError || at.get(name) || false);
    this.canvas.findings = at;
    this.canvas.draw();
    const items = findings.slice(0, SHOWN).map(({ kind, name, text, code, isError, codedReason }) => {
      const place = name && kind !== "model" ? button(name, () => this.canvas.reveal(name), { translate: "no" }) : "";
      return element("li", { "data-code": code, "data-level": isError ? "FATAL" : "WARNING" }, element("strong", {}, t(isError ? "plant.error" : "plant.warning")), " ", place, codedReason ? "" : " ", reasonElement("span", { reason: text, codedReason }));
    });
    const none = element("p", { class: "hint" }, t("plant.noFindings"));
    const list = element("ul", { class: "entries", tabindex: 0, "aria-label": t("plant.findings") }, ...items);
    this.findings.replaceChildren(element("h3", {}, plural("plant.findingsOf", findings.length)), items.length ? list : none);
  }

  // What a robot shows, and vehicles

  #placed() {
    const robots = [...this.fleet.store.robots.values()].filter(({ position }) => position);
    return robots.map(({ id, vehicle, position }) => ({ id, name: vehicle?.name ?? id, ...position })).sort((a, b) => byName(a.name, b.name));
  }

  #showRobots() {
    if (!this.canvas?.isConnected) return;
    const robots = this.#placed();
    this.canvas.robots = robots;
    this.canvas.grids = this.trials.map ? [this.trials.map] : this.#grids.of(this.fleet.store.robots.values(), null);
    this.canvas.draw();
    refillSelect(this.robot, robots.map(({ id, name }) => [id, name, true]));
    this.trials.offer([...this.fleet.store.robots.values()].filter(({ grid }) => grid));
    this.here.disabled = !robots.length;
    this.#showVehicles();
  }

  // A point at the pose of a robot; on its map if the points of the plant name theirs.
  #takeHere() {
    const robot = this.#placed().find(({ id }) => id === this.robot.value);
    if (!robot) return;
    const model = this.history.present;
    const { mapId } = this.fleet.store.robots.get(robot.id).position;
    const isOnMap = mapId && (model.points ?? []).some(({ properties }) => properties?.["vda5050:mapId"]);
    const name = freshName(model, "P");
    const point = { name, xMm: Math.round(robot.x * MM), yMm: Math.round(robot.y * MM), orientationDeg: Math.round(robot.theta * DEGREES), ...(isOnMap && { properties: { "vda5050:mapId": mapId } }) };
    this.#edit(add(model, "points", point), [name]);
  }

  // Only after a change of the robots: a list is built anew.
  #showVehicles() {
    const shown = [this.history.present, [...this.fleet.store.robots.keys()].join()];
    if (shown.every((each, at) => each === this.vehicles.shown?.[at])) return;
    this.vehicles.shown = shown;
    this.vehicles.show(this.history.present);
  }

  // Activation and files

  #activation() {
    const compare = button(t("plant.differences"), () => this.#compare());
    const activate = button(t("plant.activate"), () => this.#prepare(), { class: "primary" });
    return element("section", { "aria-label": t("plant.activation") }, element("h3", {}, t("plant.activation")), element("div", { class: "actions" }, compare, activate), this.outcome);
  }

  async #compare() {
    this.outcome.replaceChildren(element("p", { class: "hint" }, t("audit.loading")));
    await this.#saver.flush();
    const answer = await ask("plantDrafts", this.name, "differences").catch((error) => error);
    const list = answer instanceof Error ? foreign("p", answer.message) : differencesList(answer, (name) => this.canvas.reveal(name));
    this.outcome.replaceChildren(list);
    return list;
  }

  // Show what it changes and what stands against it, before it is asked again.
  async #prepare() {
    const list = await this.#compare();
    const version = this.#saver.version;
    try {
      await command(["plantDrafts", this.name, "activation"], { version, checkOnly: true });
    } catch (error) {
      const reasons = (error.errors ?? []).map((each) => foreign("li", each));
      const conflicts = [element("strong", { class: "bad" }, t("plant.notYet")), " ", foreign("span", error.message), element("ul", {}, ...reasons)];
      return this.outcome.replaceChildren(element("div", { class: "result", "data-level": "bad" }, ...conflicts), list);
    }
    const send = async () => {
      const done = await command(["plantDrafts", this.name, "activation"], { version: this.#saver.version });
      const values = { name: done.name, points: number(done.points) };
      this.outcome.replaceChildren(element("strong", {}, t("plant.activated", values)));
      this.outcome.focus();
      return ["plant.activated", values];
    };
    const sure = confirmation({ label: t("plant.activation"), effect: t("plant.activationEffect"), submit: t("plant.activateSure"), send });
    this.outcome.replaceChildren(list, sure);
    sure.querySelector(".effect").focus();
  }

  #files() {
    const format = select(Object.entries(FORMATS).map(([each, name]) => [each, name, true]), { "aria-label": t("plant.format") });
    const result = element("output", { class: "result", role: "status" });
    const download = button(t("plant.files"), () => run(download, result, async () => {
      await this.#saver.flush();
      const { fileName, content, losses } = await askWith(["plantDrafts", this.name, "file"], [["format", format.value]]);
      save(fileName, content, "application/octet-stream");
      const lost = losses.length ? [element("p", {}, t("plant.lost")), element("ul", {}, ...losses.slice(0, SHOWN).map((each) => foreign("li", each)))] : [];
      return ["plant.downloaded", { name: fileName }, ...lost];
    }));
    return element("section", { "aria-label": t("plant.files") }, element("h3", {}, t("plant.files")), element("div", { class: "actions" }, format, download), result);
  }
}

function now() {
  return new Date().toISOString().slice(0, 19).replace("T", " ");
}

// The model with a location type of this kind, and the name of the type.
function stationType(model, name) {
  const types = model.locationTypes ?? [];
  const known = types.find((each) => each.name === name);
  return { model: known ? model : { ...model, locationTypes: [...types, { name, ...STATIONS[name] }] }, type: name, prefix: t(name === "Doors" ? "plant.doorPrefix" : "plant.stationPrefix") };
}

function differencesList({ differences, more }, reveal = null) {
  if (!differences.length) return element("p", { class: "hint" }, t("plant.same"));
  const items = differences.slice(0, SHOWN).map(({ change: what, kind, name, distance, fields }) => {
    const place = reveal && what !== "REMOVED" ? button(name, () => reveal(name), { translate: "no" }) : verbatim("span", name);
    const rest = fields.length ? [" ", verbatim("span", fields.join(", "), { class: "hint" })] : [];
    return element("li", { "data-change": what }, element("strong", {}, t(`plant.change.${what}`, { distance: number(distance ?? 0, 2) })), " ", t(`plant.kind.${kind.replace(" ", "_")}`), " ", place, ...rest);
  });
  const hidden = more + Math.max(0, differences.length - SHOWN);
  return element("div", {}, element("ul", { class: "entries differences", tabindex: 0, "aria-label": t("plant.differences") }, ...items), hidden ? element("p", { class: "hint" }, t("plant.more", { count: number(hidden) })) : "");
}

customElements.define("nena-plant-page", PlantPage);
