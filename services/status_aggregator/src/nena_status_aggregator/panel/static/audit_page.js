// The audit trail: who changed what, newest first, with filters. The order service shows it to administrators.

import { fetchList } from "./api.js";
import { button, element, field, foreign, select, setText, verbatim } from "./dom.js";
import { dateAndTime, t } from "./i18n.js";
import { backLink, parameters, setParameters } from "./router.js";

const PAGE = 50;
const RESULTS = ["DONE", "REFUSED", "FAILED"];

/** Return whether a user may see the audit trail; without a login anyone may. */
export function mayAudit(session) {
  return !session?.role || session.role === "admin";
}

class AuditPage extends HTMLElement {
  #loads = 0; // outdated answers are ignored

  /** Attach to `fleet`; the page needs nothing of it. */
  show() {}

  /** Show the page; null hides it. */
  open(view) {
    this.#loads += 1;
    if (view === null) return this.replaceChildren();
    const results = RESULTS.map((each) => [each, t(`audit.${each}`)]);
    this.filters = {
      user: element("input", { type: "search", maxlength: 200 }),
      operation: element("input", { type: "search", maxlength: 200 }),
      object: element("input", { type: "search", maxlength: 200 }),
      result: select([["", t("audit.all")], ...results]),
    };
    for (const [name, control] of Object.entries(this.filters)) control.value = parameters().get(name) ?? "";
    this.list = element("ol", { class: "history" });
    this.note = element("p", { class: "hint", role: "status" });
    this.older = button(t("audit.older"), () => this.#load(this.next), { hidden: true });
    const heading = element("h2", { tabindex: -1 }, t("audit.title"));
    const fields = Object.entries(this.filters).map(([name, control]) => field(t(`audit.by.${name}`), control));
    const narrowing = element("div", { class: "fields" }, ...fields);
    narrowing.addEventListener("change", () => this.#load(null));
    const hint = element("p", { class: "hint" }, t("audit.hint"));
    const found = element("section", {}, narrowing, hint, this.list, this.note, this.older);
    this.replaceChildren(element("header", { class: "head" }, backLink(), heading), found);
    heading.focus({ preventScroll: true });
    return this.#load(null);
  }

  // Load the rows after `after`; null: the newest ones, which replace what is shown.
  async #load(after) {
    const load = (this.#loads += 1);
    const chosen = Object.fromEntries(Object.entries(this.filters).map(([name, control]) => [name, control.value.trim()]));
    setParameters(chosen);
    setText(this.note, t("audit.loading"));
    this.older.hidden = true;
    const answer = await fetchList("audit", { ...chosen, limit: PAGE, after }).catch((error) => error);
    if (load !== this.#loads) return;
    if (after === null) this.list.replaceChildren();
    if (answer instanceof Error) {
      this.note.replaceChildren(t("audit.failed"), " ", foreign("span", answer.message));
      return;
    }
    this.list.append(...answer.entries.map(row));
    this.next = answer.next;
    this.older.hidden = answer.next === null;
    setText(this.note, this.list.childElementCount ? "" : t("audit.none"));
  }
}

function row(entry) {
  const { user, operation, object, result, reason, before, after, request } = entry;
  const door = entry.client ? `${entry.interface}, ${entry.client}` : entry.interface;
  const what = element("div", {}, verbatim("strong", operation), " ", verbatim("span", object));
  const who = element("span", {}, t("audit.who", { user, door }), " · ", t(`audit.${result}`));
  const states = (before || after) && verbatim("code", `${before || "–"} → ${after || "–"}`);
  const more = [reason && foreign("q", reason), states, request && verbatim("code", request)];
  const details = more.filter(Boolean).map((each) => element("span", {}, each));
  const time = element("time", { datetime: entry.timestamp }, dateAndTime(entry.timestamp));
  return element("li", { "data-row": entry.sequence }, time, what, who, ...details);
}

customElements.define("nena-audit-page", AuditPage);
