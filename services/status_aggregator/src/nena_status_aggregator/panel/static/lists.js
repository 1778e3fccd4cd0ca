// Beside the map: tabs of robots, orders and devices, one search for robots, orders and places, and commands to several robots.

import { command } from "./api.js";
import { button, element, foreign, refill, setAttribute, setText, verbatim } from "./dom.js";
import { byName, number, plural, t } from "./i18n.js";
import { matches } from "./live_table.js";
import { address, currentView, lists } from "./router.js";

const TABS = { robots: "robots.tab", orders: "orders.tab", peripherals: "peripherals.tab", map: "map.title" };
const narrow = matchMedia("(max-width: 900px)"); // the map is beside the lists otherwise

/**
 * Chooses the list; on a telephone also the map. When the search changes, a list without a match gives way to the one that
 * has some; later it changes only by hand.
 */
class Tabs extends HTMLElement {
  #searched = "";
  #undecided = false; // searched before the lists were loaded
  #given = null; // the list with matches instead

  /** Attach to the tables, by the tabs' names. */
  show(tables) {
    this.tables = tables;
    this.tabs = Object.keys(TABS).map((name) => [name, this.#tab(name)]);
    const row = element("div", { role: "tablist", "aria-label": t("lists.label") }, ...this.tabs.map(([, tab]) => tab));
    row.addEventListener("keydown", (event) => this.#key(event));
    this.replaceChildren(row);
    for (const table of Object.values(tables)) table.addEventListener("count", () => this.#update());
    narrow.addEventListener("change", () => this.#update());
    lists.addEventListener("change", () => this.#search());
    this.#update();
  }

  #tab(name) {
    const choose = () => {
      this.#given = null;
      this.#undecided = false;
      lists.set({ tab: name === "robots" ? "" : name });
    };
    const made = button("", choose, { role: "tab", id: `${name}-tab` });
    setAttribute(made, "aria-controls", name);
    return made;
  }

  #choose() {
    const tab = lists.get("tab");
    const wanted = Object.hasOwn(this.tables, tab) || (tab === "map" && narrow.matches) ? tab : "robots";
    if (wanted === "map") return wanted;
    if (this.#undecided) {
      const loaded = Object.values(this.tables).some((table) => table.loaded);
      const others = Object.keys(this.tables).filter((name) => this.tables[name].matching);
      this.#given = this.tables[wanted].matching ? null : others[0] ?? null;
      this.#undecided = !loaded;
    }
    return this.#given ?? wanted;
  }

  #search() {
    const searched = lists.get("q").trim();
    if (searched !== this.#searched) {
      this.#given = null;
      this.#undecided = searched !== "";
    }
    this.#searched = searched;
    this.#update();
  }

  #update() {
    const chosen = this.#choose();
    const changed = document.body.dataset.tab !== chosen;
    document.body.dataset.tab = chosen;
    for (const [name, tab] of this.tabs) {
      const count = this.tables[name]?.count;
      setText(tab, t(TABS[name], { count: number(count ?? 0) }));
      setAttribute(tab, "aria-selected", String(name === chosen));
      tab.tabIndex = name === chosen ? 0 : -1;
      tab.hidden = name === "peripherals" && name !== chosen && !this.tables.peripherals.loaded; // most sites have none
    }
    for (const name of Object.keys(this.tables)) document.getElementById(name).hidden = name !== chosen;
    if (changed) this.tables[chosen]?.refresh();
  }

  #key(event) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const seen = this.tabs.map(([, tab]) => tab).filter((tab) => tab.offsetParent);
    const next = seen[(seen.indexOf(document.activeElement) + step + seen.length) % seen.length];
    next.focus();
    next.click();
  }
}

customElements.define("nena-tabs", Tabs);

const PLACES = 6;

/** Searches robots, orders and places: the lists show what matches, Enter opens the first. */
class Search extends HTMLElement {
  /** Attach to the tables and the plant model. */
  show(tables, plant) {
    this.tables = tables;
    this.plant = plant;
    const words = { type: "search", placeholder: t("search.hint"), "aria-label": t("search.label"), "aria-keyshortcuts": "/" };
    this.input = element("input", words);
    this.places = element("div", { class: "places" });
    this.replaceChildren(this.input, this.places);
    this.input.addEventListener("input", () => lists.set({ q: this.input.value.trim() && this.input.value }));
    this.input.addEventListener("keydown", (event) => event.key === "Enter" && this.#open());
    lists.addEventListener("change", () => this.#update());
    plant.addEventListener("change", () => this.#update());
    document.addEventListener("keydown", (event) => this.#key(event));
    this.#update();
  }

  #key(event) {
    const typing = event.target.closest("input, textarea, select");
    if (event.key !== "/" || typing || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.input.focus();
    this.input.select();
  }

  #update() {
    if (this.input.value !== lists.get("q") && document.activeElement !== this.input) this.input.value = lists.get("q");
    refill(this.places, this.#matching().slice(0, PLACES), (names) => names.map((name) => element("a", { href: address("places", name), translate: "no" }, name)));
  }

  #matching() {
    const { points = [], locations = [], paths = [] } = this.plant.model ?? {};
    if (!lists.get("q").trim()) return [];
    const names = [locations, points, paths].flatMap((each) => each.map(({ name }) => name).sort(byName));
    return names.filter((name) => matches(lists.get("q"), [name]));
  }

  // The first match: an exact name before others, robots and orders before places.
  #open() {
    if (currentView().length) return lists.set({ q: this.input.value });
    const wanted = this.input.value.trim().toLowerCase();
    if (!wanted) return;
    const { robots, orders } = this.tables;
    const found = [
      ...robots.ids.map((id) => [robots.store.robots.get(id)?.name, address("robots", id)]),
      ...orders.ids.map((id) => [id, address("orders", id)]),
      ...this.#matching().map((name) => [name, address("places", name)]),
    ];
    const [, best] = found.find(([name]) => name?.toLowerCase() === wanted) ?? found[0] ?? [];
    if (best) location.hash = best;
  }
}

customElements.define("nena-search", Search);

/** Sends a command to each of the marked robots. */
class FleetCommands extends HTMLElement {
  /** Attach to the table in which robots are marked. */
  show(table) {
    this.table = table;
    this.count = element("strong");
    this.all = button(t("several.all"), () => table.mark(table.ids, true));
    this.pause = button(t("command.pause"), () => this.#send("pause"));
    this.resume = button(t("command.resume"), () => this.#askResume());
    const clear = button(t("several.clear"), () => table.mark([...table.marked], false));
    this.unseen = element("p", { class: "hint" });
    this.effect = element("p", { class: "effect", id: "several-effect", tabindex: -1 });
    this.sure = button("", () => this.#send("resume"), { class: "danger", "aria-describedby": "several-effect" });
    this.asked = element("div", {}, this.effect, element("div", { class: "actions" }, this.sure));
    this.result = element("output", { class: "result", role: "status" });
    this.bar = element("div", { class: "actions" }, this.count, this.pause, this.resume, this.all, clear);
    this.replaceChildren(this.bar, this.unseen, this.asked, this.result);
    for (const name of ["marked", "count"]) table.addEventListener(name, () => this.#update());
    table.addEventListener("marked", () => {
      this.asked.hidden = true;
      this.result.replaceChildren();
    });
    this.asked.hidden = true;
    this.#update();
  }

  // The names of marked robots that can be commanded or not; `hidden`: those that the list does not show.
  #names() {
    const { marked, store, ids } = this.table;
    const robots = [...marked].map((id) => store.robots.get(id)).filter(Boolean).sort((a, b) => byName(a.name, b.name));
    const shown = new Set(ids);
    const names = (chosen) => chosen.map(({ name }) => name);
    return {
      robots: robots.filter(({ vehicle }) => vehicle),
      skipped: names(robots.filter(({ vehicle }) => !vehicle)),
      hidden: names(robots.filter(({ id }) => !shown.has(id))),
    };
  }

  #update() {
    const { robots, hidden } = this.#names();
    this.bar.hidden = this.table.marked.size === 0;
    setText(this.count, plural("several.marked", this.table.marked.size));
    this.pause.disabled = this.resume.disabled = !robots.length;
    this.unseen.hidden = !hidden.length;
    setText(this.unseen, t("several.unseen", { names: hidden.join(", ") }));
  }

  // Paused robots start to move: it says which, and asks once.
  #askResume() {
    const { robots } = this.#names();
    this.asked.hidden = !this.asked.hidden;
    setText(this.effect, t("several.effect", { names: robots.map(({ name }) => name).join(", ") }));
    setText(this.sure, plural("several.sure", robots.length));
    if (!this.asked.hidden) this.effect.focus();
  }

  async #send(actionType) {
    if (this.bar.getAttribute("aria-busy")) return;
    const { robots, skipped } = this.#names();
    this.bar.setAttribute("aria-busy", "true");
    if (this.asked.contains(document.activeElement)) this.resume.focus();
    this.asked.hidden = true;
    this.result.dataset.level = "wait";
    setText(this.result, t("command.sent"));
    const answers = await Promise.allSettled(robots.map((robot) => command(["vehicles", robot.vehicle.name, "instantActions"], { actionType })));
    this.bar.removeAttribute("aria-busy");
    const open = answers.flatMap((answer, at) => (answer.value?.status === "FINISHED" ? [] : [[robots[at].name, answer]]));
    const count = { count: number(robots.length - open.length), of: number(robots.length) };
    const running = open.every(([, { value }]) => value?.status === "PENDING");
    this.result.dataset.level = open.length ? (running ? "wait" : "bad") : "fine";
    this.result.replaceChildren(element("strong", {}, t(DONE[actionType], count)));
    const action = t(`command.${actionType}`);
    const rows = open.map(([name, answer]) => unfinished(name, action, answer));
    if (skipped.length) rows.push(element("li", {}, t("several.skipped", { names: skipped.join(", ") })));
    if (rows.length) this.result.append(element("ul", {}, ...rows));
  }
}

const DONE = { pause: "several.paused", resume: "several.resumed" };

// A robot that has not done it (yet), and why.
function unfinished(name, action, { reason, value }) {
  if (value) {
    const words = [value.reason, value.result].filter(Boolean).join(" – ");
    return element("li", {}, t(`command.${value.status}`, { name, action }), " ", foreign("span", words));
  }
  return element("li", {}, verbatim("span", name), ": ", reason.message ? foreign("span", reason.message) : t("command.unanswered"));
}

customElements.define("nena-fleet-commands", FleetCommands);
