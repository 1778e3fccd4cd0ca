// The frame of the page: summary, connection banner, message health, language, theme and user menu.

import { logOut } from "./api.js";
import { button, element, foreign, icon, refill, setText, verbatim } from "./dom.js";
import { adviceFor, conditionText, filterOf, reasonOf } from "./explanations.js";
import { byName, chooseLanguage, chosenLanguage, has, LANGUAGES, plural, t, timeOfDay } from "./i18n.js";
import { filterChip } from "./live_table.js";
import { address, lists } from "./router.js";

export const CONDITIONS = [
  "ERROR",
  "BROKEN",
  "SILENT",
  "BLOCKED",
  "MANUAL",
  "WAITING",
  "BUSY",
  "CHARGING",
  "IDLE",
  "OFFLINE",
];

const NAMED = 5;

/** Chips that filter the robot list: robots that need attention by name, jams, and all others by condition. */
class FleetSummary extends HTMLElement {
  /** Attach to the store. */
  show(store) {
    this.setAttribute("role", "group");
    this.setAttribute("aria-label", t("summary.label"));
    this.total = element("span", { class: "total" });
    this.share = element("span", { class: "share" });
    this.named = element("span", { class: "named" });
    this.chips = ["URGENT", ...CONDITIONS].map((name) => [name, this.#chip(name)]);
    this.replaceChildren(this.total, this.share, this.named, ...this.chips.map(([, chip]) => chip));
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
    const urgent = robots.filter((each) => each.urgent).sort((a, b) => byName(a.name, b.name));
    const named = urgent.slice(0, NAMED).map((each) => [each.id, t("summary.urgent", { name: each.name, why: conditionText(each) })]);
    const jams = store.jams.map((jam) => [jamAddress(jam, store), jamText(jam)]);
    setText(this.total, robots.length ? plural("summary.robots", robots.length) : t("summary.none"));
    const [number, of] = store.share.split("/");
    setText(this.share, of === "1" ? "" : t("summary.share", { number, of }));
    refill(this.named, [named, jams], () => [
      ...named.map(([id, text]) => element("a", { class: "chip", "data-urgent": "", href: address("robots", id) }, text)),
      ...jams.map(([href, text]) => element("a", { class: "chip jam", "data-condition": "WAITING", href }, text)),
    ]);
    const chosen = conditions();
    for (const [name, chip] of this.chips) {
      const count = robots.filter((each) => filterOf(each) === name).length;
      const shown = name === "URGENT" && count <= NAMED ? 0 : count; // up to NAMED robots are named instead
      chip.show(`${count} ${t(has(`condition.${name}.many`) && shown !== 1 ? `condition.${name}.many` : `condition.${name}`)}`, shown, chosen.includes(name));
    }
  }
}

function conditions() {
  return lists.get("condition").split(",").filter(Boolean);
}

function jamText({ head, circle, robots }) {
  return head ? t("summary.jam", { count: robots, head }) : t("summary.circle", { count: robots, names: circle.join(", ") });
}

function jamAddress({ head, circle }, store) {
  if (head && store.isLockedPath(head)) return address("places", head);
  const robot = store.robotOfVehicle(head ?? circle[0]);
  return robot ? address("robots", robot.id) : "#/";
}

customElements.define("nena-fleet-summary", FleetSummary);

const STUCK = ["ERROR", "BROKEN", "SILENT", "BLOCKED"];
const LISTED = 8;

/** On a phone: the robots that need attention, before everything else. */
class Attention extends HTMLElement {
  /** Attach to the store. */
  show(store) {
    store.addEventListener("change", () => this.#update(store));
  }

  #update(store) {
    this.hidden = !store.robots.size; // without robots, "none needs attention" would be misleading
    const stuck = [...store.robots.values()].filter((each) => each.urgent || STUCK.includes(each.condition));
    stuck.sort((a, b) => b.urgent - a.urgent || byName(a.name, b.name));
    const shown = stuck.slice(0, LISTED).map((each) => [each.id, each.name, each.urgent, each.condition, conditionText(each), reasonOf(each), adviceFor(each)]);
    refill(this, [shown, stuck.length], () => [
      element("h2", { id: "attention-title" }, t(stuck.length ? "attention.title" : "attention.none")),
      element("ul", { class: "entries" }, ...shown.map(attentionItem)),
      stuck.length > LISTED ? element("p", { class: "hint" }, t("summary.more", { count: stuck.length - LISTED })) : "",
    ]);
  }
}

function attentionItem([id, name, urgent, condition, text, reason, advice]) {
  const chip = element("span", { class: "chip", "data-condition": condition }, text);
  if (urgent) chip.dataset.urgent = "";
  const link = verbatim("a", name, { class: "name", href: address("robots", id) });
  return element("li", {}, link, " ", chip, element("p", {}, reason), advice ? element("p", { class: "advice" }, advice) : "");
}

customElements.define("nena-attention", Attention);

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
