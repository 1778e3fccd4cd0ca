// The frame of the page: summary, connection banner, message health, language, theme and user menu.

import { logOut } from "./api.js";
import { button, element, foreign, icon, setText, verbatim } from "./dom.js";
import { filterOf } from "./explanations.js";
import { chooseLanguage, chosenLanguage, has, LANGUAGES, plural, t, timeOfDay } from "./i18n.js";
import { filterChip } from "./live_table.js";
import { lists } from "./router.js";

const SHOWN = ["URGENT", "ERROR", "BROKEN", "SILENT", "BLOCKED", "MANUAL", "WAITING", "BUSY", "CHARGING", "IDLE", "OUT", "OFFLINE"];

/** Chips that filter the robot list by condition. */
class FleetSummary extends HTMLElement {
  /** Attach to the store. */
  show(store) {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", t("summary.label"));
    this.total = element("span", { class: "total" });
    this.share = element("span", { class: "share" });
    this.chips = SHOWN.map((name) => [name, this.#chip(name)]);
    this.replaceChildren(this.total, this.share, ...this.chips.map(([, chip]) => chip));
    store.addEventListener("change", () => this.#update(store));
    lists.addEventListener("change", () => this.#update(store));
  }

  #chip(name) {
    const press = () => {
      const chosen = conditions();
      const wanted = chosen.includes(name) ? chosen.filter((each) => each !== name) : [...chosen, name];
      lists.set({ tab: "", condition: wanted.join(",") });
    };
    return filterChip("", press, name === "URGENT" ? { "data-urgent": "" } : { "data-condition": name });
  }

  #update(store) {
    const robots = [...store.robots.values()];
    setText(this.total, robots.length ? plural("summary.robots", robots.length) : t("summary.none"));
    const [number, of] = store.share.split("/");
    setText(this.share, of === "1" ? "" : t("summary.share", { number, of }));
    const chosen = conditions();
    for (const [name, chip] of this.chips) {
      const count = robots.filter((each) => filterOf(each) === name).length;
      chip.show(`${count} ${t(has(`condition.${name}.many`) && count !== 1 ? `condition.${name}.many` : `condition.${name}`)}`, count, chosen.includes(name));
    }
  }
}

function conditions() {
  return lists.get("condition").split(",").filter(Boolean);
}

customElements.define("nena-fleet-summary", FleetSummary);

class LinkBanner extends HTMLElement {
  show(store, link) {
    this.setAttribute("role", "status");
    this.setAttribute("aria-live", "assertive");
    const update = () => this.#update(store, link);
    link.addEventListener("state", update);
    store.addEventListener("change", (event) => (event.detail.parts.has("link") || event.detail.parts.has("orderService")) && update());
    update();
  }

  #update(store, link) {
    const [level, text] = judge(store, link);
    this.dataset.level = level;
    this.hidden = level === "fine";
    setText(this, text);
  }
}

function judge(store, link) {
  if (!link.everConnected) {
    return link.failed ? ["bad", t("link.never")] : ["wait", t("link.connecting")];
  }
  if (!link.connected) return ["bad", t("link.lost", { time: timeOfDay(link.lastNews) })];
  if (store.link.connected) return judgeOrderService(store.orderService);
  if (!store.link.since) return ["bad", t("link.broker.never")];
  return ["bad", t("link.broker", { time: timeOfDay(store.link.since) })];
}

function judgeOrderService({ up, lastSign, brokerLacks }) {
  if (up !== false) return brokerLacks.length ? ["wait", brokerLacks.map((lack) => t(`link.lack.${lack}`)).join(" ")] : ["fine", t("link.back")];
  return ["bad", lastSign ? t("link.orderService", { time: timeOfDay(lastSign) }) : t("link.orderService.never")];
}

customElements.define("nena-link-banner", LinkBanner);

class MessageHealth extends HTMLElement {
  show(store) {
    this.setAttribute("role", "status");
    store.addEventListener("change", (event) => {
      if (event.detail.parts.has("malformed")) this.#update(store.malformed);
    });
  }

  #update({ counts, lastTime, lastTopic, lastProblem }) {
    const total = Object.values(counts).reduce((sum, count) => sum + count, 0);
    this.classList.toggle("bad", total > 0);
    if (!total) {
      this.replaceChildren(t("messages.fine"));
      return;
    }
    const kinds = Object.entries(counts).map(([kind, count]) => t("messages.kind", { kind, count }));
    const text = plural("messages.malformed", total, { kinds: kinds.join(", ") });
    const last = t("messages.last", { time: timeOfDay(lastTime), topic: lastTopic });
    this.replaceChildren(element("strong", {}, text), ` ${last} `, foreign("span", lastProblem));
  }
}

customElements.define("nena-message-health", MessageHealth);

class LanguageSelect extends HTMLElement {
  connectedCallback() {
    const options = Object.entries(LANGUAGES).map(([tag, name]) =>
      element("option", { value: tag, lang: tag, translate: "no" }, name),
    );
    const choice = element("select", { "aria-label": t("language.label") }, ...options);
    choice.value = chosenLanguage();
    choice.addEventListener("change", () => chooseLanguage(choice.value));
    this.replaceChildren(choice);
  }
}

customElements.define("nena-language-select", LanguageSelect);

const THEMES = ["auto", "light", "dark"];
const KEY = "nena-theme";

class ThemeButton extends HTMLElement {
  connectedCallback() {
    this.button = element("button", { type: "button", class: "quiet" });
    this.button.addEventListener("click", () => this.#choose(this.#next()));
    this.append(this.button);
    const kept = localStorage.getItem(KEY);
    this.#choose(THEMES.includes(kept) ? kept : "auto");
  }

  #next() {
    return THEMES[(THEMES.indexOf(this.theme) + 1) % THEMES.length];
  }

  #choose(theme) {
    this.theme = theme;
    localStorage.setItem(KEY, theme);
    document.documentElement.dataset.theme = theme;
    this.button.replaceChildren(icon(theme));
    this.button.title = t(`theme.${theme}`);
    this.button.setAttribute("aria-label", t(`theme.${theme}`));
    document.dispatchEvent(new Event("themechange"));
  }
}

customElements.define("nena-theme-button", ThemeButton);

class UserMenu extends HTMLElement {
  show(session) {
    this.hidden = !session?.user;
    if (this.hidden) return;
    const role = t(`login.${session.role}`);
    const name = verbatim("span", session.user, { title: t("login.as", { user: session.user, role }) });
    this.replaceChildren(name, button(t("login.out"), logOut, { class: "quiet" }));
  }
}

customElements.define("nena-user-menu", UserMenu);
