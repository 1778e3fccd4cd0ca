// Saves a draft by itself after each change, and hears of others who edit it.

import { askUntil, askWith, command, newKey } from "../api.js";

const SOON = 600; // ms after a change
const AGAIN = 2000; // ms after a save without an answer
const EVERY = 4000; // ms

// This page is one session, also after a reload; a duplicated tab is another one.
const KEY = "nena.session";
const session = sessionStorage.getItem(KEY) ?? newKey();
sessionStorage.removeItem(KEY);
addEventListener("pagehide", () => sessionStorage.setItem(KEY, session));

/**
 * Keeps a draft on the server. Fires `state` (`saved`, `saving`, `unsaved`, `conflict`, `refused` or `gone`; `error` says why),
 * `findings`, `editors`, and `theirs` with the model that somebody else has saved. `busy()`: nothing may be taken over now.
 */
export class DraftSaver extends EventTarget {
  version = 0;
  findings = [];
  editors = [];
  state = "saved";
  #wanted = null; // the model that is not saved yet
  #sending = null;
  #running = null;
  #timer = null;

  constructor(name, busy) {
    super();
    this.name = name;
    this.busy = busy;
  }

  /** Load the draft, while it is `wanted()`; returns its model. */
  async open(wanted) {
    const draft = await askUntil(wanted, ["plantDrafts", this.name]);
    this.#take(draft);
    this.poll = setInterval(() => document.hidden || this.#look(), EVERY);
    this.#look();
    return draft.model;
  }

  /** Save a model soon. */
  save(model) {
    this.#wanted = model;
    if (this.state === "conflict" || this.state === "gone") return;
    this.#show("unsaved");
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.flush(), SOON);
  }

  /** Save now what is not saved; returns whether all is. */
  async flush() {
    clearTimeout(this.#timer);
    await this.#running;
    if (this.state === "conflict" || this.state === "gone") return false;
    if (!this.#wanted && !this.#sending) return true;
    this.#running = this.#send();
    await this.#running;
    return this.state === "saved";
  }

  close() {
    clearInterval(this.poll);
    return this.flush();
  }

  // A save without an answer may have been made: it is sent again unchanged, which the order service knows as the same.
  async #send() {
    this.#sending ??= this.#wanted;
    if (this.#wanted === this.#sending) this.#wanted = null;
    this.#show("saving");
    try {
      const saved = await command(["plantDrafts", this.name], { version: this.version, model: this.#sending }, "PUT");
      this.#sending = null;
      this.#take(saved);
      if (this.#wanted) this.save(this.#wanted);
      else this.#show("saved");
    } catch (error) {
      this.#failed(error);
    }
  }

  #failed(error) {
    if (error.type?.endsWith("/plant-draft-changed")) return this.#show("conflict", error);
    if (error.type?.endsWith("/unknown-plant-draft")) return this.#show("gone", error);
    if (error.status >= 400 && error.status < 500) {
      this.#sending = null; // the next change may be accepted
      return this.#show("refused", error);
    }
    this.#show("unsaved", error);
    this.#timer = setTimeout(() => this.flush(), AGAIN);
  }

  async #look() {
    const parameters = [["session", session], ["known", this.version]];
    const draft = await askWith(["plantDrafts", this.name], parameters).catch(() => null);
    if (!draft) return;
    this.editors = draft.editors;
    this.dispatchEvent(new Event("editors"));
    if (draft.version <= this.version || this.#wanted || this.#sending || this.busy()) return;
    this.#take(draft);
    this.dispatchEvent(new CustomEvent("theirs", { detail: draft.model }));
  }

  #take({ version, findings }) {
    this.version = version;
    this.findings = findings;
    this.dispatchEvent(new Event("findings"));
  }

  #show(state, error = null) {
    this.state = state;
    this.error = error;
    this.dispatchEvent(new Event("state"));
  }
}
