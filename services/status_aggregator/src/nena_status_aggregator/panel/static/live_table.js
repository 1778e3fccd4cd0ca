// A live table that mounts only the rows in sight, so that it stays fast with a thousand of them.

import { button, element, emptyBox, icon, setAttribute, setText } from "./dom.js";
import { t } from "./i18n.js";
import { inNextFrame } from "./pace.js";
import { lists } from "./router.js";

const TICK = 1000;
const BEYOND = 600; // px above and below what is in sight
const HEIGHT = 40; // px of a row that was never mounted
const HIDDEN_ROWS = 20; // mounted while the table is hidden
const CHOSEN = "nena-columns-"; // key of the choice of columns, followed by the table's sort key

/**
 * A table of the views of one kind. Subclasses define `columns` (text keys; the part after the dot names the column), `extra` (names of columns that are hidden until they are chosen), `empty` (text key), `sortKey` (its value in the address), `comparators` (by column: a function of two views), `usual` (the order
 * without a choice), `first` (what stays on top in any order), `accept(view)` and `makeRow(id)`, which returns
 * `{row, update(view, now)}`.
 */
export class LiveTable extends HTMLElement {
  #rows = new Map();
  #heights = new Map();
  #shown = [];
  #pending = false;
  #pointed = false;
  extra = [];

  /** Views selected for a command. */
  marked = new Set();

  /** Show the views of `kind` in the store, and follow their changes. */
  follow(store, kind) {
    this.store = store;
    this.views = () => store[kind];
    this.body = element("tbody");
    this.spaces = [space(), space()];
    this.shownColumns = this.#readColumns();
    this.heads = new Map(this.columns.map((key) => [nameOf(key), this.#head(key)]));
    const titles = element("tr", {}, ...this.heads.values());
    titles.firstChild.append(this.#chooser());
    this.titles = titles;
    this.#showColumns(titles);
    this.table = element("table", {}, element("thead", {}, titles), this.body);
    this.body.append(...this.spaces);
    this.note = emptyBox(t(`${this.empty}.title`), t(`${this.empty}.text`));
    const all = button(t("lists.all"), () => lists.set({ q: "", condition: "", state: "", automatic: "" }));
    this.unmatched = element("div", { class: "empty" }, element("strong", {}, t("lists.none")), element("p", {}, all));
    this.replaceChildren(this.table, this.note, this.unmatched);
    store.addEventListener("change", (event) => event.detail[kind].size && this.#later());
    lists.addEventListener("change", () => this.refresh());
    document.addEventListener("scroll", () => this.#mount(), { capture: true, passive: true });
    addEventListener("resize", () => this.#heights.clear());
    this.#watchHand();
    setInterval(() => this.update(), TICK);
    this.refresh();
  }

  /** Select or deselect views. Fires `marked`. */
  mark(ids, on) {
    for (const id of ids) {
      if (on) this.marked.add(id);
      else this.marked.delete(id);
    }
    this.update();
    this.dispatchEvent(new Event("marked"));
  }

  /** Create the box that selects a view; hidden where no command is possible. */
  makeBox(id) {
    const box = element("input", { type: "checkbox", class: "mark" });
    box.hidden = !this.commanded;
    box.addEventListener("change", () => this.mark([id], box.checked));
    return box;
  }

  /** Show in its row whether a view is selected. */
  showMark(row, box, { id, name }) {
    box.checked = this.marked.has(id);
    row.classList.toggle("selected", box.checked);
    setAttribute(box, "aria-label", t("lists.mark", { name }));
  }

  /** Return how many views are shown, in sight or not. */
  get count() {
    return this.#shown.length;
  }

  /** Return the ids of the views that are shown, in sight or not. */
  get ids() {
    return this.#shown.map((view) => view.id);
  }

  /** Return whether there are any views, shown or not. */
  get loaded() {
    return this.views().size > 0;
  }

  /** Return whether any view is accepted, also before the list is refreshed. */
  get matching() {
    return [...this.views().values()].some((view) => this.accept(view));
  }

  /** Filter, sort and show all views; `kept`: rows that are shown stay in their order. Fires `count`. */
  refresh(kept = false) {
    const views = [...this.views().values()];
    const compare = kept ? this.#compareAsShown() : this.#compare();
    this.#shown = views.filter((view) => this.accept(view)).sort(compare);
    for (const id of this.#heights.keys()) if (!this.views().has(id)) this.#heights.delete(id);
    this.table.hidden = this.#shown.length === 0;
    this.note.hidden = views.length > 0;
    this.unmatched.hidden = views.length === 0 || this.#shown.length > 0;
    setAttribute(this.table, "aria-rowcount", this.#shown.length + 1);
    this.#markHeads();
    this.#mount();
    this.update();
    this.dispatchEvent(new Event("count"));
  }

  // Once a frame, whatever has changed.
  #later() {
    if (this.#pending) return;
    this.#pending = true;
    inNextFrame(() => {
      this.#pending = false;
      this.refresh(this.#inHand);
    });
  }

  // Rows do not change places while the pointer is over them or the focus is in them: a click would hit another one.
  get #inHand() {
    return this.#pointed || this.body.contains(document.activeElement);
  }

  #watchHand() {
    this.body.addEventListener("pointerenter", (event) => (this.#pointed = event.pointerType === "mouse"));
    this.body.addEventListener("pointerleave", () => {
      this.#pointed = false;
      this.#later();
    });
    this.body.addEventListener("focusout", () => this.#later());
  }

  #head(key) {
    const name = nameOf(key);
    return element("th", { scope: "col" }, name in this.comparators ? button(t(key), () => this.#sortBy(name), { class: "sort" }) : t(key));
  }

  // The first column is always shown.
  #readColumns() {
    const stored = (localStorage.getItem(CHOSEN + this.sortKey) ?? "").split(" ");
    const names = this.columns.map(nameOf);
    return new Set(names.filter((name, at) => at === 0 || (this.extra.includes(name) ? stored.includes(`+${name}`) : !stored.includes(`-${name}`))));
  }

  // What differs from the usual columns, so that new ones of a later release appear.
  #chooseColumn(name, shown) {
    if (shown) this.shownColumns.add(name);
    else this.shownColumns.delete(name);
    const changed = this.columns.map(nameOf).filter((each) => this.extra.includes(each) === this.shownColumns.has(each));
    localStorage.setItem(CHOSEN + this.sortKey, changed.map((each) => (this.extra.includes(each) ? `+${each}` : `-${each}`)).join(" "));
    for (const row of [this.titles, ...[...this.#rows.values()].map((each) => each.row)]) this.#showColumns(row);
    this.#heights.clear();
    this.refresh();
  }

  #showColumns(row) {
    this.columns.forEach((key, at) => (row.children[at].hidden = !this.shownColumns.has(nameOf(key))));
  }

  #chooser() {
    const title = t("lists.columns");
    const boxes = this.columns.slice(1).map((key) => {
      const box = element("input", { type: "checkbox", name: nameOf(key) });
      box.checked = this.shownColumns.has(nameOf(key));
      box.addEventListener("change", () => this.#chooseColumn(nameOf(key), box.checked));
      return element("label", {}, box, t(key));
    });
    const summary = element("summary", { title, "aria-label": title }, icon("columns"));
    return element("details", { class: "columns" }, summary, element("fieldset", {}, element("legend", {}, title), ...boxes));
  }

  // Ascending, descending, and back to the usual order.
  #sortBy(name) {
    const next = new Map([[name, `-${name}`], [`-${name}`, ""]]);
    lists.set({ [this.sortKey]: next.get(this.#sorting) ?? name });
  }

  // The column to sort by, with `-` descending; empty for the usual order.
  get #sorting() {
    const chosen = lists.get(this.sortKey);
    return Object.hasOwn(this.comparators, chosen.replace(/^-/, "")) ? chosen : "";
  }

  #compare() {
    const chosen = this.#sorting;
    const order = this.comparators[chosen.replace(/^-/, "")];
    const sign = chosen.startsWith("-") ? -1 : 1;
    return (a, b) => this.first(a, b) || (order ? sign * order(a, b) : 0) || this.usual(a, b);
  }

  #compareAsShown() {
    const at = new Map(this.#shown.map((view, index) => [view.id, index]));
    const place = (view) => at.get(view.id) ?? at.size;
    const compare = this.#compare();
    return (a, b) => place(a) - place(b) || compare(a, b);
  }

  #markHeads() {
    const chosen = this.#sorting;
    for (const [name, head] of this.heads) {
      const sorted = { [name]: "ascending", [`-${name}`]: "descending" }[chosen];
      setAttribute(head, "aria-sort", sorted);
    }
  }

  /** Update the rows in sight. */
  update() {
    const now = this.store.now();
    const views = this.views();
    for (const [id, { update }] of this.#rows) if (views.has(id)) update(views.get(id), now);
  }

  // Mount the rows in sight and the one with the focus; the others are two empty rows of their height.
  #mount() {
    const [from, to] = this.#inSight();
    const focused = document.activeElement;
    const wanted = this.#shown.map((view, at) => [view, at]).filter(([{ id }, at]) => (at >= from && at < to) || this.#rows.get(id)?.row.contains(focused));
    const ids = new Set(wanted.map(([view]) => view.id));
    const now = this.store.now();
    for (const [id, { row }] of this.#rows) {
      if (ids.has(id)) continue;
      row.remove();
      this.#rows.delete(id);
    }
    let last = this.spaces[0];
    for (const [view, at] of wanted) {
      if (!this.#rows.has(view.id)) {
        this.#rows.set(view.id, this.makeRow(view.id));
        this.#showColumns(this.#rows.get(view.id).row);
        this.#rows.get(view.id).update(view, now);
      }
      const { row } = this.#rows.get(view.id);
      setAttribute(row, "aria-rowindex", at + 2);
      if (last.nextSibling !== row) last.after(row);
      last = row;
    }
    if (focused !== document.activeElement && this.body.contains(focused)) focused.focus({ preventScroll: true }); // its row was moved
    this.#stretch(from, to, ids);
  }

  #stretch(from, to, mounted) {
    for (const [id, { row }] of this.#rows) if (row.offsetHeight) this.#heights.set(id, row.offsetHeight);
    const height = (views) => views.filter(({ id }) => !mounted.has(id)).reduce((sum, view) => sum + this.#heightOf(view), 0);
    const heights = [height(this.#shown.slice(0, from)), height(this.#shown.slice(to))];
    this.spaces.forEach((each, at) => {
      each.hidden = !heights[at];
      each.firstChild.colSpan = this.shownColumns.size; // more would take room from the others
      each.firstChild.style.height = `${heights[at]}px`;
    });
  }

  #heightOf(view) {
    return this.#heights.get(view.id) ?? HEIGHT;
  }

  // The rows to mount, `[from, to]`.
  #inSight() {
    const box = this.body.getBoundingClientRect();
    if (!this.offsetHeight) return [0, HIDDEN_ROWS];
    const frame = this.closest(".scrolls").getBoundingClientRect();
    const top = Math.max(0, frame.top) - BEYOND - box.top;
    const bottom = Math.min(innerHeight, frame.bottom) + BEYOND - box.top;
    let [at, y] = [0, 0];
    for (; at < this.#shown.length && y + this.#heightOf(this.#shown[at]) < top; at += 1) y += this.#heightOf(this.#shown[at]);
    const from = at;
    for (; at < this.#shown.length && y < bottom; at += 1) y += this.#heightOf(this.#shown[at]);
    return [from, at];
  }
}

function nameOf(key) {
  return key.split(".")[1];
}

function space() {
  return element("tr", { class: "space", "aria-hidden": "true" }, element("td"));
}

/** Create a cell with its column's title, for narrow screens. */
export function cell(key, ...children) {
  return element("td", { "data-title": t(key) }, ...children);
}

/** A chip that filters a list: pressed while it does; hidden with a count of 0, unless it is pressed. */
export function filterChip(text, press, attributes = {}) {
  const chip = button(text, press, { class: "chip filter-chip", ...attributes });
  chip.show = (words, count, pressed) => {
    setText(chip, words);
    setAttribute(chip, "aria-pressed", String(pressed));
    chip.hidden = !count && !pressed;
  };
  return chip;
}

/** Return whether one of the words contains what is searched. */
export function matches(searched, words) {
  const wanted = searched.trim().toLowerCase();
  return !wanted || words.some((each) => each?.toLowerCase().includes(wanted));
}
