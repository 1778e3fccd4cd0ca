// The events of the history in words.

import { element, foreign, verbatim } from "./dom.js";
import { conditionText, errorText, nameOf, reasonOf } from "./explanations.js";
import { shownState } from "./fleet.js";
import { chosenLanguage, fillable, plural, t } from "./i18n.js";
import { worded } from "./reasons.js";

/** Create the text of an event. Events of earlier releases may lack the values for it, and show the English sentence instead. */
export function details({ code, text, values }) {
  const parts = PARTS[code]?.(values) ?? { words: text };
  const shown = [
    parts.name && verbatim("span", parts.name),
    parts.text,
    parts.words && foreign("span", parts.words),
  ].filter(Boolean);
  return element("span", {}, ...shown.flatMap((part, at) => (at ? [": ", part] : [part])));
}

// By code: `name` is the same in all languages, `text` is in the panel's, `words` are English ones of another program.
const PARTS = {
  actionEnded: ({ actionType, actionId, status, result }) => ({ name: actionType ?? actionId, text: t(`action.${status}`), words: result }),
  charging: ({ charging }) => ({ text: t(charging ? "eventLog.charging.started" : "eventLog.charging.stopped") }),
  condition,
  connection: ({ state }) => ({ text: t(`connection.${state ?? "NONE"}`) }),
  errorCleared: ({ errorType }) => ({ text: errorText(errorType) }),
  errorRaised: ({ errorType, description }) => ({ text: errorText(errorType), words: description }),
  historyGap: ({ dropped }) => ({ text: plural("eventLog.historyGap", dropped) }),
  jam: ({ robots }) => ({ text: robots ? plural("queue.title", robots) : t("eventLog.jam.over") }),
  link: ({ connected }) => ({ text: t(connected ? "link.back" : "eventLog.link.lost") }),
  loads: ({ loads }) => ({ text: loads ? plural("robots.loads", loads) : t("fact.noLoads") }),
  map: ({ mapId }) => ({ name: mapId }),
  operatingMode: ({ mode }) => ({ text: t(`mode.${mode}`) }),
  orderEnded: ({ orderId, outcome }) => ({ name: nameOf(orderId), text: t(`eventLog.orderEnded.${outcome}`) }),
  orderTaken: ({ orderId }) => ({ name: nameOf(orderId) }),
  stop: ({ active, by, reason }) => ({ name: `${by} (${reason})`, text: t(active ? "done.stop" : "done.stopEnded") }),
  transportOrder: (values) => (values.reason === undefined ? null : withReason(t(`state.${shownState(values)}`), values)),
};

function condition(values) {
  const reasonCode = values.reason;
  const complete = reasonCode === "emergency_stop" ? "how" in values : fillable(`reason.${reasonCode}`, values);
  if (!complete) return null;
  const text = conditionText({ condition: values.condition });
  const { codedReason } = values;
  if (reasonCode === "idle_why") return withReason(text, { reason: values.why, codedReason });
  const reason = reasonOf({ reasonCode, reasonValues: values, codedReason });
  const words = reasonCode === "waits_other" && !codedReason && chosenLanguage() !== "en" ? values.why : undefined;
  return { text: `${text}: ${reason}`, words };
}

function withReason(text, explained) {
  const { text: reason, foreign: words } = worded(explained);
  return reason ? { text: `${text}: ${reason}` } : { text, words };
}
