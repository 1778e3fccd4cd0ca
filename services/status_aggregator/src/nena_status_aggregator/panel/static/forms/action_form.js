// Any instant action that a robot's factsheet lists, with fields for its parameters.

import { t } from "../catalogue.js";
import { command } from "../commands.js";
import { element, foreign } from "../dom.js";
import { commandForm, outcome } from "./command_form.js";
import { field, numberInput, select } from "./fields.js";

/** Actions that every robot knows, for robots whose factsheet has not come. */
const STANDARD = ["factsheetRequest", "stateRequest", "startPause", "stopPause", "cancelOrder"];
/** It needs a pose, and has a form of its own. */
const ELSEWHERE = "initializePosition";

export async function actionForm(vehicle, robot) {
  const known = await knownActions(robot);
  const actions = instantActions(known ?? []);
  const kind = select(actions.map((each) => [each.actionType, each.actionType]), { name: "action", translate: "no" });
  const details = element("div", { class: "fields" });
  let inputs = [];
  const choose = () => {
    const action = actions.find((each) => each.actionType === kind.value);
    inputs = (action.actionParameters ?? []).map(parameter);
    const words = action.description ? [foreign("p", action.description, { class: "hint" })] : [];
    details.replaceChildren(...words, ...inputs.map((each) => each.element));
  };
  kind.addEventListener("change", choose);
  choose();
  return commandForm({
    label: t("action.title"),
    submit: t("action.send"),
    fields: [
      element("p", { class: "hint" }, t(known ? "action.hint" : "action.noFactsheet")),
      field(t("action.type"), kind),
      details,
    ],
    send: async () => {
      const parameters = inputs.map((each) => each.read()).filter(Boolean);
      return outcome(await command(["vehicles", vehicle, "instantActions"], { actionType: kind.value, parameters }));
    },
  });
}

async function knownActions(robot) {
  const path = [robot.manufacturer, robot.serialNumber, "actions"].map(encodeURIComponent).join("/");
  if (!robot.body) return null; // no factsheet has come
  const answer = await fetch(`api/v1/robots/${path}`);
  return answer.ok ? answer.json() : null;
}

function instantActions(known) {
  const listed = known.filter(
    (each) => each.actionScopes.includes("INSTANT") && each.actionType !== ELSEWHERE,
  );
  const missing = STANDARD.filter((name) => !listed.some((each) => each.actionType === name));
  return [...listed, ...missing.map((actionType) => ({ actionType }))];
}

// A field for one parameter: `read()` gives it as it is sent, or null where it is left out.
function parameter({ key, valueDataType, description, isOptional }) {
  const control = controlFor(valueDataType, isOptional);
  const label = t(isOptional ? "action.optional" : "action.parameter", { key });
  const words = description ? [foreign("span", description, { class: "hint" })] : [];
  const made = element("div", {}, field(label, control), ...words);
  control.addEventListener("input", () => control.setCustomValidity(""));
  return { element: made, read: () => (control.value === "" ? null : { key, value: valueOf(control, valueDataType) }) };
}

function controlFor(type, optional) {
  const required = !optional;
  const choice = [["", t("form.choose")], ["true", t("form.yes")], ["false", t("form.no")]];
  if (type === "BOOL") return select(choice, { required });
  if (type === "INTEGER") return numberInput({ step: 1, required });
  if (type === "NUMBER") return numberInput({ required });
  if (type === "STRING") return element("input", { type: "text", required });
  const hint = type === "ARRAY" ? "[ ]" : "{ }";
  const area = element("textarea", { rows: 3, required, placeholder: hint, spellcheck: "false" });
  area.addEventListener("change", () => area.setCustomValidity(fits(area.value) ? "" : t("form.json")));
  return area;
}

function fits(text) {
  try {
    JSON.parse(text || "null");
    return true;
  } catch {
    return false;
  }
}

function valueOf(control, type) {
  return type === "STRING" ? control.value : JSON.parse(control.value);
}
