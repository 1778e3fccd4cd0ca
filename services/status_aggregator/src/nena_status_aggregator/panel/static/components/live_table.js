// What the tables have in common: rows by id, changed in place, ages that go on by themselves.

import { t } from "../catalogue.js";
import { element, emptyBox } from "../dom.js";

const TICK = 1000;

/**
 * A table over the views of one kind. Subclasses give `columns` (keys of the catalogue), `empty` (key), `compare`,
 * and `makeRow(id)`, which gives `{row, update(view, now)}`; and `accept(view)` where not all are shown.
 */
export class LiveTable extends HTMLElement {
  #rows = new Map();
  /** Tells whether a view is to be shown. */
  accept = () => true;

  /** Show what `views()` gives, and follow the changes of `kind` in the store. */
  follow(store, kind) {
    this.store = store;
    this.views = () => store[kind];
    this.body = element("tbody");
    this.table = element("table", {}, this.#head(), this.body);
    this.note = emptyBox(t(`${this.empty}.title`), t(`${this.empty}.text`));
    this.replaceChildren(this.table, this.note);
    store.addEventListener("change", (event) => this.#change(event.detail[kind]));
    setInterval(() => this.refresh(), TICK);
    this.#change(new Set());
  }

  /** Give the row of one view. */
  rowOf(id) {
    return this.#rows.get(id)?.row;
  }

  /** Look again which rows are to be shown. */
  refresh() {
    this.#updateRows(this.views().keys());
  }

  #head() {
    const cells = this.columns.map((key) => element("th", { scope: "col" }, t(key)));
    return element("thead", {}, element("tr", {}, ...cells));
  }

  #change(ids) {
    const views = this.views();
    for (const id of ids) {
      if (!views.has(id)) {
        this.#rows.get(id)?.row.remove();
        this.#rows.delete(id);
      } else if (!this.#rows.has(id)) {
        this.#rows.set(id, this.makeRow(id));
      }
    }
    this.#updateRows([...ids].filter((id) => views.has(id)));
    this.#order();
    this.table.hidden = views.size === 0;
    this.note.hidden = views.size > 0;
  }

  #updateRows(ids) {
    const now = this.store.now();
    for (const id of ids) {
      const shown = this.#rows.get(id);
      if (!shown) continue;
      shown.row.hidden = !this.accept(this.views().get(id));
      shown.update(this.views().get(id), now);
    }
  }

  #order() {
    const wanted = [...this.views().values()].sort(this.compare).map((view) => this.#rows.get(view.id).row);
    wanted.forEach((row, at) => {
      if (this.body.children[at] !== row) this.body.insertBefore(row, this.body.children[at] ?? null);
    });
  }
}

/** Make a cell that knows its column's title, for narrow screens. */
export function cell(key, ...children) {
  return element("td", { "data-title": t(key) }, ...children);
}
