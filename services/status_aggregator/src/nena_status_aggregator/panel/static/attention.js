// What needs a person: the count in the header and the title, the list, and notifications of the browser.

import { acknowledge, command } from "./api.js";
import { button, element, field, foreign, refill, setAttribute, setText, verbatim } from "./dom.js";
import { adviceFor, conditionText, reasonOf, setBy, statusOfOrder } from "./explanations.js";
import { charging } from "./fleet_commands.js";
import { outcome, run } from "./forms.js";
import { has, plural, t, timeOfDay } from "./i18n.js";
import { address } from "./router.js";
import { nameOfStop, personField } from "./stops.js";

const SOUND = "nena-sound";
const OWN_TEXT = ["battery_low", "taken_out"]; // kinds about a robot that its condition may not name

// The name of what a matter is about; a stop has only an ID.
const nameIn = ({ kind, subject }) => (kind === "stop" ? "" : subject);

/** Return what a matter is: a few words in the panel's language. */
function labelOf({ kind, robot, paths }, store) {
  if (paths?.length > 1) return t("attention.paths_locked", { count: paths.length });
  const shown = store.robots.get(robot);
  return shown && !OWN_TEXT.includes(kind) ? conditionText(shown) : t(`attention.${kind}`);
}

// The reason, `{text, foreign, names}`; `names`: it begins with a name; for what has no own words, empty.
function reasonFor({ kind, robot, subject, paths }, { store, plant }) {
  if (kind === "path_locked") return { text: [paths.slice(1).join(", "), setBy(plant.find(subject)?.thing.lockedBy)].filter(Boolean).join(" – "), names: true };
  const shown = store.robots.get(robot);
  if (shown) return { text: reasonOf(shown) };
  const order = kind.startsWith("order_") && store.orders.get(subject);
  if (order) return statusOfOrder(order, store);
  const stop = kind === "stop" && store.orderService.stops.find(({ name }) => name === subject);
  return stop ? { text: nameOfStop(stop), foreign: stop.reason } : {};
}

function adviceOf({ kind, robot }, fleet) {
  const shown = fleet.store.robots.get(robot);
  const full = kind === "battery_low" && shown?.vehicle && charging([shown], fleet).full;
  if (full) return full;
  return has(`attention.advice.${kind}`) ? t(`attention.advice.${kind}`) : shown ? adviceFor(shown) : "";
}

function linkOf({ kind, robot, subject }, store) {
  if (robot) return address("robots", robot);
  if (kind.startsWith("order_") && subject) return address("orders", subject);
  if (kind === "path_locked") return address("places", subject);
  if (store.isLockedPath(subject)) return address("places", subject);
  const head = store.robotOfVehicle(subject.split(", ")[0]);
  return head ? address("robots", head.id) : null;
}

// The button that ends a matter at once, `[text, send]`; the others are ended on the page of their robot or order.
const ENDS = {
  path_locked: ({ paths }, { plant }) => [
    paths.length > 1 ? "place.unlockAll" : "place.unlock",
    async () => {
      for (const path of paths) await plant.lock(path, false);
      return ["done.unlocked", { name: paths.join(", ") }];
    },
  ],
  order_held: ({ subject }, { person }) => ["order.resume", async () => (await command(["transportOrders", subject, "resume"], { by: person(), reason: "resumed at the control panel" }), ["done.resumed", { name: subject }])],
  robot_paused: ({ subject }) => ["command.resume", async () => outcome(await command(["vehicles", subject, "instantActions"], { actionType: "resume" }), "done.resume", { name: subject, action: t("command.resume") })],
  taken_out: ({ subject }, { person }) => ["attention.useAgain", async () => (await command(["vehicles", subject, "integrationLevel"], { integrationLevel: "TO_BE_UTILIZED", by: person() }, "PUT"), ["done.integration", { name: subject, level: t("integration.TO_BE_UTILIZED") }])],
};

/** The button in the header: how many matters nobody has acknowledged, and the most urgent one. */
class AttentionButton extends HTMLElement {
  /** Attach to the store; `list` is the element that the button shows. */
  show(store, list) {
    this.button = button("", () => this.#toggle(list), { "aria-expanded": "false", "aria-controls": list.id });
    this.replaceChildren(this.button);
    store.addEventListener("change", () => this.#update(store));
  }

  #toggle(list) {
    const open = document.body.toggleAttribute("data-attention");
    setAttribute(this.button, "aria-expanded", String(open));
    list.scrollIntoView({ block: "nearest" });
  }

  #update(store) {
    const open = store.attention.filter((each) => !each.acknowledged);
    const [first] = open.length ? open : store.attention; // acknowledged is not ended
    document.title = open.length ? `(${open.length}) NeNa` : "NeNa";
    setAttribute(this.button, "data-urgent", first?.urgent ? "" : null);
    const what = first && [labelOf(first, store), nameIn(first)].filter(Boolean).join(": "); // a long name is cut at its end
    const [text, count] = open.length ? ["attention.count", open.length] : ["attention.known", store.attention.length];
    setText(this.button, first ? plural(text, count, { what }) : t("attention.none"));
  }
}

customElements.define("nena-attention-button", AttentionButton);

/** One short tone for what is new, if switched on. A browser allows sound only once the page was used: the context is made then. */
class Sound {
  #audio = null;

  constructor() {
    this.button = button(t("attention.sound"), () => this.#toggle());
    this.#show();
    for (const use of ["pointerdown", "keydown"]) document.addEventListener(use, () => this.#start());
  }

  get #on() {
    return localStorage.getItem(SOUND) === "on";
  }

  #show() {
    setAttribute(this.button, "aria-pressed", String(this.#on));
  }

  #start() {
    if (this.#on) this.#audio ??= new AudioContext();
  }

  #toggle() {
    localStorage.setItem(SOUND, this.#on ? "off" : "on");
    this.#show();
    this.#start();
    this.play(); // so that one hears it
  }

  play() {
    if (!this.#on || !this.#audio) return;
    const loudness = this.#audio.createGain();
    loudness.gain.value = 0.2;
    loudness.connect(this.#audio.destination);
    const tone = this.#audio.createOscillator();
    tone.frequency.value = 880; // Hz
    tone.connect(loudness);
    tone.start();
    tone.stop(this.#audio.currentTime + 0.3);
  }
}

/** The list: each matter with what it holds up, what to do, and buttons. */
class Attention extends HTMLElement {
  #rows = new Map();
  #known = null; // the IDs that were in the list before

  /** Attach to `fleet`: {store, plant, noCommands}. */
  show(fleet, session) {
    this.fleet = fleet;
    this.session = session;
    this.heading = element("h2", { id: "attention-title" });
    this.by = personField(session);
    this.name = field(t("attention.as"), this.by);
    this.notify = button(t("attention.notify"), async () => (await Notification.requestPermission(), this.#update()));
    this.sound = new Sound();
    this.list = element("ul", { class: "entries" });
    this.replaceChildren(element("div", { class: "title" }, this.heading, element("div", { class: "actions" }, this.name, this.notify, this.sound.button)), this.list);
    fleet.store.addEventListener("change", () => this.#update());
  }

  #update() {
    const { attention } = this.fleet.store;
    setText(this.heading, t(attention.length ? "attention.title" : "attention.none"));
    this.name.hidden = Boolean(this.session?.user) || !attention.some((each) => !each.acknowledged);
    this.notify.hidden = !("Notification" in window) || Notification.permission !== "default";
    const rows = attention.map((each) => this.#row(each));
    if (rows.length !== this.list.children.length || rows.some((row, at) => this.list.children[at] !== row)) this.list.replaceChildren(...rows);
    this.#rows = new Map(attention.map(({ id }, at) => [id, rows[at]]));
    this.#tell(attention);
  }

  #tell(attention) {
    const fresh = this.#known && attention.filter(({ id, acknowledged }) => !this.#known.has(id) && !acknowledged);
    this.#known = new Set(attention.map(({ id }) => id));
    if (!fresh?.length) return;
    this.sound.play();
    if (!("Notification" in window) || Notification.permission !== "granted") return;
    for (const each of fresh) new Notification(`${nameIn(each)} ${labelOf(each, this.fleet.store)}`.trim(), { body: adviceOf(each, this.fleet), tag: each.id });
  }

  #row(matter) {
    const { store } = this.fleet;
    const row = this.#rows.get(matter.id) ?? element("li");
    const shown = { matter, label: labelOf(matter, store), reason: reasonFor(matter, this.fleet), advice: adviceOf(matter, this.fleet), link: linkOf(matter, store) };
    refill(row, shown, () => this.#parts(shown));
    return row;
  }

  #parts({ matter, label, reason, advice, link }) {
    const { robotCount, orderCount, acknowledged, urgent } = matter;
    const chip = element("span", { class: "chip", "data-urgent": urgent ? "" : null, "data-condition": urgent ? null : "BLOCKED" }, label);
    const name = nameIn(matter) && verbatim(link ? "a" : "strong", matter.subject, { class: "name", href: link });
    const held = [robotCount && plural("attention.robots", robotCount), orderCount && plural("attention.orders", orderCount)].filter(Boolean);
    const since = t("attention.since", { time: timeOfDay(matter.since) });
    const facts = [since, held.length ? t("attention.holds", { what: held.join(", ") }) : "", acknowledged ? t("attention.by", { by: acknowledged.by }) : ""];
    const text = [
      chip, " ", name, element("span", { class: "detail" }, facts.filter(Boolean).join(" · ")),
      reason.text ? element("p", { class: reason.names ? null : "sentence" }, reason.text) : "",
      reason.foreign ? element("p", {}, foreign("q", reason.foreign)) : "",
      advice ? element("p", { class: "advice" }, advice) : "",
    ];
    return [element("div", {}, ...text), this.#buttons(matter)];
  }

  #buttons(matter) {
    const result = element("output", { class: "result", role: "status" });
    const made = [];
    const end = !this.fleet.noCommands && ENDS[matter.kind]?.(matter, this.fleet);
    if (end) made.push(button(t(end[0]), ({ currentTarget }) => run(currentTarget, result, end[1])));
    if (!matter.acknowledged && this.session?.role !== "viewer") made.push(button(t("attention.acknowledge"), ({ currentTarget }) => this.#acknowledge(currentTarget, result, matter.id)));
    return element("div", { class: "actions" }, ...made, result);
  }

  #acknowledge(pressed, result, id) {
    this.by.value = this.by.value.trim();
    if (!this.by.reportValidity()) return; // says that the name is missing
    return run(pressed, result, async () => (await acknowledge(id, this.by.value), ["attention.by", { by: this.by.value }]));
  }
}

customElements.define("nena-attention", Attention);
