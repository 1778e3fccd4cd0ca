// The audit trail: who changed what, newest first, with filters. The order service shows it to administrators.

import { fetchList } from "./api.js";
import { csvOf, save } from "./csv.js";
import { button, element, field, foreign, select, setText, verbatim } from "./dom.js";
import { dateAndTime, fieldTime, has, number, plural, t } from "./i18n.js";
import { backLink, parameters, setParameters } from "./router.js";

const PAGE = 50;
const EXPORT_PAGE = 1000;
const EXPORT_PAGES = 50;
const TIMES = ["since", "until"];
const COLUMNS = ["sequence", "timestamp", "user", "interface", "client", "operation", "objectKind", "object", "result", "reason", "before", "after", "request", "hash"];
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
      since: element("input", { type: "datetime-local" }),
      until: element("input", { type: "datetime-local" }),
    };
    for (const [name, control] of Object.entries(this.filters)) control.value = linked(name);
    this.list = element("ol", { class: "history" });
    this.note = element("p", { class: "hint", role: "status" });
    this.older = button(t("audit.older"), () => this.#load(this.next), { hidden: true });
    const heading = element("h2", { tabindex: -1 }, t("audit.title"));
    const fields = Object.entries(this.filters).map(([name, control]) => field(t(`audit.by.${name}`), control));
    const narrowing = element("div", { class: "fields" }, ...fields);
    narrowing.addEventListener("change", () => this.#load(null));
    const hint = element("p", { class: "hint" }, t("audit.hint"));
    const csv = button(t("period.csv"), () => this.#export(csv));
    const found = element("section", {}, narrowing, hint, element("p", {}, csv), this.list, this.note, this.older);
    this.replaceChildren(element("header", { class: "head" }, backLink(), heading), found);
    heading.focus({ preventScroll: true });
    return this.#load(null);
  }

  // The filters as in the order service's API; empty ones are left out there.
  get #chosen() {
    const values = Object.entries(this.filters).map(([name, { value }]) => [name, value.trim()]);
    return Object.fromEntries(values.map(([name, value]) => [name, value && TIMES.includes(name) ? new Date(value).toISOString() : value]));
  }

  // Save all rows that the filters leave, newest first.
  async #export(csv) {
    const rows = [];
    csv.disabled = true;
    setText(this.note, t("audit.loading"));
    try {
      let after = null;
      for (let page = 0; page < EXPORT_PAGES && (page === 0 || after !== null); page += 1) {
        const answer = await fetchList("audit", { ...this.#chosen, limit: EXPORT_PAGE, after });
        rows.push(...answer.entries);
        after = answer.next;
      }
      save("nena-audit.csv", csvOf(COLUMNS, rows.map((entry) => COLUMNS.map((name) => entry[name]))), "text/csv;charset=utf-8");
      setText(this.note, after === null ? plural("audit.saved", rows.length) : t("audit.cut", { count: number(rows.length) }));
    } catch (error) {
      this.note.replaceChildren(t("audit.failed"), " ", foreign("span", error.message));
    } finally {
      csv.disabled = false;
    }
  }

  // Load the rows after `after`; null: the newest ones, which replace what is shown.
  async #load(after) {
    const load = (this.#loads += 1);
    const chosen = this.#chosen;
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

// The value of a filter in the address.
function linked(name) {
  const value = parameters().get(name) ?? "";
  if (!TIMES.includes(name)) return value;
  return Number.isNaN(Date.parse(value)) ? "" : fieldTime(Date.parse(value));
}

function row(entry) {
  const { user, operation, object, result, reason, before, after, request } = entry;
  const door = entry.client ? `${entry.interface}, ${entry.client}` : entry.interface;
  const what = element("div", {}, verbatim("strong", operation), " ", verbatim("span", object));
  const who = element("span", {}, t("audit.who", { user, door }), " · ", t(`audit.${result}`));
  const more = [reason && foreign("q", reason), changesOf(before, after), wordsOf(parsed(request))];
  const details = more.filter(Boolean).map((each) => element("span", {}, each));
  const time = element("time", { datetime: entry.timestamp }, dateAndTime(entry.timestamp));
  return element("li", { "data-row": entry.sequence }, time, what, who, ...details);
}

function parsed(text) {
  try {
    return JSON.parse(text || "null");
  } catch {
    return text; // cut off, because it was too long
  }
}

// Names of fields that the panel has words for; others are shown in the words of their English names.
const FIELDS = {
  by: "stops.by", deadline: "orders.deadline", destinations: "orders.destinations", heldBy: "state.HELD", integrationLevel: "integration.title", intendedVehicle: "orders.vehicle",
  locked: "plant.locked", priority: "orders.priority", reason: "stops.reason", state: "orders.state", type: "orders.type", vehicle: "orders.vehicle",
};

const nameOf = (field) => (Object.hasOwn(FIELDS, field) ? t(FIELDS[field]) : field.replace(/([a-z])([A-Z])/g, "$1 $2").toLowerCase());

function wordsOf(value) {
  if (value === null || value === undefined || value === "") return "";
  if (typeof value === "boolean") return t(value ? "form.yes" : "form.no");
  if (Array.isArray(value)) return value.map(wordsOf).join(", ") || t("none");
  if (value.locationName) return `${value.locationName}${value.operation ? `: ${wordsOf(value.operation)}` : ""}`;
  if (typeof value === "object") return Object.entries(value).filter(([, each]) => each !== null).map(([field, each]) => `${nameOf(field)}: ${wordsOf(each)}`).join(" · ");
  const known = ["integration", "state", "operation"].map((group) => `${group}.${value}`).find(has);
  return known ? t(known).split(":")[0] : /^\d{4}-\d\d-\d\dT/.test(value) ? dateAndTime(value) : String(value);
}

// The fields that a change has set, with their values before.
function changesOf(before, after) {
  const [old, now] = [parsed(before) ?? {}, parsed(after) ?? {}];
  const fields = [...new Set([...Object.keys(old), ...Object.keys(now)])].map((field) => [field, wordsOf(old[field]), wordsOf(now[field])]);
  const changed = fields.filter(([, from, to]) => from !== to);
  return changed.map(([field, from, to]) => `${nameOf(field)}: ${from ? `${from} → ` : ""}${to || t("none")}`).join(" · ");
}

customElements.define("nena-audit-page", AuditPage);
