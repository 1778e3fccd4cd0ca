// What the forms for commands have in common: they send once, and say what came of it.

import { t } from "../catalogue.js";
import { RefusedError } from "../commands.js";
import { element, foreign } from "../dom.js";

/**
 * Make a form around `fields`. `send()` gives a promise; what it gives, `[key, values, words]` (a text of the catalogue
 * and words of another program), is shown. A second click while the first is under way does nothing.
 */
export function commandForm({ label, submit, send, fields = [], more = [] }) {
  const result = element("output", { class: "result", role: "status" });
  const button = element("button", { class: "primary" }, submit);
  const actions = element("div", { class: "actions" }, button, ...more);
  const form = element("form", { class: "command", "aria-label": label }, ...fields, actions, result);
  form.addEventListener("input", () => result.replaceChildren());
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    run(button, result, send);
  });
  return form;
}

/** Send a command from a button, and say in `result` what came of it. */
export async function run(button, result, send) {
  if (button.getAttribute("aria-busy") === "true") return;
  button.setAttribute("aria-busy", "true");
  show(result, "wait", t("command.sent"));
  try {
    const [key, values, words] = await send();
    show(result, "fine", t(key, values), words);
    document.dispatchEvent(new CustomEvent("poseshow", { detail: null }));
  } catch (error) {
    if (error instanceof RefusedError) show(result, "bad", t("command.refused"), error.message, error.errors);
    else show(result, "bad", t("command.unanswered"));
  } finally {
    button.removeAttribute("aria-busy");
  }
}

function show(result, level, text, words = "", errors = []) {
  result.dataset.level = level;
  result.replaceChildren(element("strong", {}, text));
  if (words) result.append(" ", foreign("span", words));
  if (errors.length) result.append(element("ul", {}, ...errors.map((each) => foreign("li", each))));
}

/** Say what came of an instant action, as {@link commandForm} wants it. */
export function outcome(answer) {
  const reason = answer.status === "FINISHED" ? "" : answer.reason; // that it is done is said already
  return [`command.${answer.status}`, {}, [reason, answer.result].filter(Boolean).join(" – ")];
}
