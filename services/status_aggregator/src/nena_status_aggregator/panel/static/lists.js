// Beside the map: tabs of robots, orders and devices, and one search for robots, orders and places.

import { button, element, refill, setAttribute, setText } from "./dom.js";
import { byName, number, t } from "./i18n.js";
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
