// Chooses the language of the page. The choice is kept.

import { LANGUAGES, chooseLanguage, chosenLanguage, t } from "../catalogue.js";
import { element } from "../dom.js";

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
