// Programs that the order service runs on a draft: its robot's map, a proposal from it, the clearance of paths, a simulation.

import { askUntil, command, RefusedError } from "../api.js";
import { button, element, field, foreign, numberInput, numberOf, refillSelect, select } from "../dom.js";
import { commandForm, run } from "../forms.js";
import { byName, dateAndTime, duration, number, t } from "../i18n.js";
import { loadMap } from "../map/grids.js";
import { turned } from "./model.js";

const SOON = 1000; // ms, between two looks at a program
const CLOSE = "PATH_TOO_CLOSE";
const KEPT = ["PROPOSE", "CHECK", "SIMULATE"]; // programs whose last results the order service keeps
const SURE = 0.15; // a cell of a robot's map may be occupied with this probability; what is unknown is drawn a little darker
const PLACES = 4; // two pairs: in the plan, on the map

/** Sections of the Plant page for one draft. Fires `findings` and `map`. */
export class Trials extends EventTarget {
  findings = [];
  map = null; // {grid, image}, as the robots' maps
  #robots = new Map(); // by id, with a map
  #checked = null; // what the clearance was checked for
  #due = false; // whether the draft has changed since
  #last = Promise.resolve();
  #marks = Object.fromEntries(KEPT.map((program) => [program, element("p", { class: "hint" })])); // of whom and when a result is
  #results = new Map(); // by program

  /** `page`: {name, canvas, model(), version(), edit(model), flush(), choose(tool)}. */
  constructor(page) {
    super();
    this.page = page;
    this.elements = [this.#mapSection(), this.#simulation()];
  }

  /** Load the draft's map and the last results, and follow a program that still runs. */
  async open() {
    await this.#loadMap();
    for (const program of KEPT) {
      const kept = await this.#ask("run", [["program", program]]);
      if (kept.state === "DONE") await this.#show(kept);
    }
    const last = await this.#ask("run");
    if (last.draft !== this.page.name || last.state !== "RUNNING") return;
    const form = last.program === "SIMULATE" ? this.simulate : this.work;
    run(form.querySelector("button.primary"), form.querySelector("output"), () => this.#follow(last).then(() => ["plant.ended", {}]));
  }

  #ask(what, parameters) {
    return askUntil(() => this.page.canvas.isConnected, ["plantDrafts", this.page.name, what], parameters);
  }

  /** Check the clearance of a changed draft, if it was checked before: once the program that runs has ended. */
  recheck() {
    this.#due = this.#checked !== null;
    this.#run({ program: "CHECK", ...this.#checked }, () => this.#due).catch(() => null);
  }

  // One after the other, as the order service runs them.
  #run(request, wanted = () => true) {
    const done = this.#last.then(async () => {
      if (!wanted()) return null;
      await this.page.flush();
      if (request.program === "CHECK") this.#due = false;
      return this.#follow(await command(["plantDrafts", this.page.name, "run"], request));
    });
    this.#last = done.catch(() => null);
    return done;
  }

  // Look at a program until it ends, and show its result. Meanwhile, another one may have begun.
  async #follow({ program, began }) {
    for (;;) {
      const latest = await this.#ask("run");
      const last = latest.began === began ? latest : await this.#ask("run", [["program", program]]);
      if (last.state === "DONE" && last.began === began) {
        await this.#show(last);
        return last;
      }
      const [detail = t("plant.cancelled"), ...errors] = last.state === "FAILED" ? last.texts : [];
      if (last.state !== "RUNNING") throw new RefusedError({ detail, errors });
      await new Promise((resolve) => setTimeout(resolve, SOON));
    }
  }

  async #show(result) {
    const { program } = result;
    if (program === "MAP") return this.#loadMap();
    if (program === "PROPOSE") this.#showProposal(result);
    else if (program === "SIMULATE") this.#showFigures(result);
    else this.findings = result.findings.filter(({ code }) => code === CLOSE);
    this.dispatchEvent(new Event("findings"));
    this.#results.set(program, result);
    this.mark();
  }

  /** Tell whose results are shown, and which are of an older state of the draft; a proposal depends on the map alone. */
  mark() {
    for (const [program, { version, began, by }] of this.#results) {
      const older = program !== "PROPOSE" && version < this.page.version() ? [" ", element("strong", {}, t("plant.older"))] : [];
      this.#marks[program].replaceChildren(`${t(`plant.${program.toLowerCase()}`)}: ${dateAndTime(began)}, ${by}.`, ...older);
    }
  }

  // The map

  #mapSection() {
    const files = element("input", { type: "file", multiple: true, required: true, accept: ".yaml,.yml,.pgm,.png,.bmp" });
    const filesField = field(t("plant.mapFiles"), files);
    this.source = select([]);
    this.source.addEventListener("change", () => (filesField.hidden = files.disabled = this.source.value !== ""));
    this.offer([]);
    const send = async () => this.#keep(await (this.source.value ? mapOf(this.#robots.get(this.source.value)) : mapIn([...files.files])));
    const upload = commandForm({ label: t("plant.map"), submit: t("plant.takeMap"), fields: [element("div", { class: "fields" }, field(t("plant.mapSource"), this.source), filesField)], send });
    const size = (key, value, attributes) => [key, numberInput({ value, step: 0.05, required: true, ...attributes })];
    const inputs = Object.fromEntries([size("robotWidth", 0.6, { min: 0.05, max: 10 }), size("robotLength", 0.8, { min: 0.05, max: 10 }), size("clearance", 0.1, { min: 0, max: 5 }), size("spacing", 3, { min: 0.5, max: 20 })]);
    const robot = () => Object.fromEntries(Object.entries(inputs).map(([key, input]) => [key, numberOf(input)]));
    const check = button(t("plant.check"), () => run(check, this.work.querySelector("output"), () => this.#check(robot())));
    const align = button(t("plant.alignMap"), () => this.#align(this.work.querySelector("output")));
    this.proposal = element("div");
    const fields = element("div", { class: "fields" }, ...Object.entries(inputs).map(([key, input]) => field(t(`plant.new.${key}`), input)));
    this.work = commandForm({ label: t("plant.fromMap"), submit: t("plant.propose"), fields: [fields], more: [check, align], send: () => this.#propose(robot()) });
    return element("section", { "aria-label": t("plant.map") }, element("h3", {}, t("plant.map")), upload, this.work, this.#marks.PROPOSE, this.proposal, this.#marks.CHECK);
  }

  /** Offer the maps of robots beside the upload. */
  offer(robots) {
    this.#robots = new Map(robots.map((robot) => [robot.id, robot]));
    const names = robots.map(({ id, vehicle }) => [id, t("plant.mapOf", { robot: vehicle?.name ?? id })]);
    refillSelect(this.source, [["", t("plant.ofFiles")], ...names.sort((a, b) => byName(a[1], b[1]))]);
  }

  async #keep(map) {
    await this.#run({ program: "MAP", map });
    return ["plant.mapKept", { name: map.name }];
  }

  async #loadMap() {
    const { map } = await this.#ask("map");
    if (!map) return;
    const bytes = Uint8Array.from(atob(map.picture), (each) => each.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], { type: "image/png" })); // no URL, which the page may not load
    this.map = { grid: { ...map, digest: map.picture }, image };
    this.dispatchEvent(new Event("map"));
    this.page.canvas.fit();
  }

  async #propose(robot) {
    const { model } = await this.#run({ program: "PROPOSE", ...robot });
    this.#takeProposal(model);
    return ["plant.proposed", {}];
  }

  #showProposal({ model, texts }) {
    const take = button(t("plant.takeProposal"), () => this.#takeProposal(model));
    this.proposal.replaceChildren(element("ul", { class: "hint" }, ...texts.map((each) => foreign("li", each))), element("div", { class: "actions" }, take));
  }

  // Robots and the name stay: a map knows neither.
  #takeProposal(model) {
    const { name, vehicles } = this.page.model();
    this.page.edit({ ...model, name, vehicles });
    this.page.canvas.fit();
  }

  async #check(robot) {
    this.#checked = robot;
    await this.#run({ program: "CHECK", ...robot });
    return ["plant.checked", {}];
  }

  // Two places of the plan, each followed by where it is on the map.
  #align(result) {
    const places = [];
    const { canvas } = this.page;
    const tell = () => result.replaceChildren(t(`plant.pick.${places.length % 2}`, { number: number(Math.floor(places.length / 2) + 1) }));
    this.page.choose("pick");
    canvas.focusDrawing();
    tell();
    canvas.picked = (place) => {
      places.push(place);
      if (places.length < PLACES) return tell();
      this.page.choose("select");
      const [from, to, other, otherTo] = places;
      const { model, error } = turned(this.page.model(), [from, other], [to, otherTo]);
      this.page.edit(model);
      result.replaceChildren(t("plant.aligned", { error: number(error, 2) }));
    };
  }

  // The simulation

  #simulation() {
    const robots = element("input", { type: "text", value: "3, 6", required: true, pattern: " *[0-9]+( *, *[0-9]+){0,5} *" });
    const hours = numberInput({ value: 0.5, min: 0.05, max: 8, step: 0.05, required: true });
    const orders = element("input", { type: "file", accept: ".csv" });
    const cancel = button(t("plant.cancel"), () => command(["plantDrafts", this.page.name, "run"], {}, "DELETE").catch(() => null));
    this.figures = element("div");
    const send = async () => {
      const request = { program: "SIMULATE", robots: robots.value.split(",").map(Number), hours: numberOf(hours), orders: (await orders.files[0]?.text()) ?? "" };
      await this.#run(request);
      return ["plant.ended", {}];
    };
    const fields = element("div", { class: "fields" }, field(t("plant.fleetSizes"), robots), field(t("plant.hours"), hours), field(t("plant.orders"), orders));
    this.simulate = commandForm({ label: t("plant.simulate"), submit: t("plant.simulate"), fields: [fields], more: [cancel], send });
    return element("section", { "aria-label": t("plant.simulate") }, element("h3", {}, t("plant.simulate")), element("p", { class: "hint" }, t("plant.simulateHint")), this.simulate, this.#marks.SIMULATE, this.figures);
  }

  #showFigures({ figures, activeFigures, texts }) {
    const heads = ["plant.fleet", "plant.perHour", "plant.waits", "plant.lead"].map((key) => element("th", { scope: "col" }, t(key)));
    const rows = figures.map((figure, at) => {
      const active = activeFigures[at];
      const beside = (show) => [figure, active].flatMap((each) => [each ? show(each) : "–", element("br")]);
      const heat = button(number(figure.robots), () => this.#showHeat(figure, heat), { "aria-pressed": "false", "aria-label": t("plant.showHeatOf", { robots: number(figure.robots) }) });
      const cells = [[heat], beside((each) => number(each.ordersPerHour, 0)), beside((each) => `${number(100 * (each.doing.waits ?? 0), 0)} %`), beside((each) => (each.leadP50 === null ? "–" : duration(each.leadP50)))];
      return element("tr", {}, ...cells.map((cell) => element("td", {}, ...cell)));
    });
    const table = element("table", {}, element("caption", {}, t("plant.beside")), element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...rows));
    const notes = new Set([...texts, ...figures.flatMap((each) => each.notes)]);
    this.figures.replaceChildren(table, element("ul", { class: "hint" }, ...[...notes].map((each) => foreign("li", each))));
  }

  // Where the robots of one fleet size waited; a second click hides it.
  #showHeat({ waitingByPlace }, heat) {
    const shown = heat.getAttribute("aria-pressed") === "true";
    for (const each of this.figures.querySelectorAll("[aria-pressed]")) each.setAttribute("aria-pressed", String(each === heat && !shown));
    const most = Math.max(...Object.values(waitingByPlace));
    this.page.canvas.waiting = shown ? null : new Map(Object.entries(waitingByPlace).map(([name, minutes]) => [name, { share: Math.sqrt(minutes / most) }]));
    this.page.canvas.draw();
  }
}

// A map as it is uploaded: of the files that map_saver wrote.
async function mapIn(files) {
  const sheet = files.find(({ name }) => /\.ya?ml$/i.test(name));
  const image = files.find((file) => file !== sheet);
  if (!sheet || !image) throw new RefusedError({ detail: t("plant.mapFiles") });
  return { name: sheet.name.replace(/\.ya?ml$/i, ""), yaml: await sheet.text(), image: await base64(image) };
}

// The same of a robot's map, which is drawn on white as map_saver would.
async function mapOf({ id, grid }) {
  const { mapId: name, digest, resolution, x, y, theta } = grid;
  const sheet = new OffscreenCanvas(grid.width, grid.height);
  const context = sheet.getContext("2d", { alpha: false });
  context.fillStyle = "white";
  context.fillRect(0, 0, grid.width, grid.height);
  context.drawImage(await loadMap(id, digest), 0, 0);
  const yaml = `{mode: scale, free_thresh: ${SURE}, resolution: ${resolution}, origin: [${x}, ${y}, ${theta}], image: ""}`;
  return { name, yaml, image: await base64(await sheet.convertToBlob()) };
}

function base64(file) {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.addEventListener("load", () => resolve(reader.result.slice(reader.result.indexOf(",") + 1)));
    reader.addEventListener("error", () => reject(new RefusedError({ detail: reader.error.message })));
    reader.readAsDataURL(file);
  });
}
