// The chain of causes as a list.

import { element, foreign, refill } from "../dom.js";

/** `show(causes)` with the list that causes.js gives. */
class WhyList extends HTMLElement {
  show(causes) {
    refill(this, causes, () => [element("ol", { class: "causes" }, ...causes.map(item))]);
  }
}

function item({ text, advice, foreign: words, link }) {
  const said = link ? element("a", { href: link }, text) : text;
  const made = element("li", {}, said);
  if (words) made.append(" ", foreign("q", words));
  if (advice) made.append(element("p", { class: "advice" }, advice));
  return made;
}

customElements.define("nena-why-list", WhyList);
