// A button that turns through the themes: as the system has it, light, dark. The choice is kept.

import { t } from "../catalogue.js";
import { element } from "../dom.js";
import { icon } from "../icons.js";

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
