// Tells a robot where it is.

import { t } from "../catalogue.js";
import { command } from "../commands.js";
import { element } from "../dom.js";
import { commandForm, outcome } from "./command_form.js";
import { PoseFields } from "./pose_fields.js";

export function positionForm(vehicle, position) {
  const pose = new PoseFields({ headingRequired: true });
  if (position) pose.pose = position;
  return commandForm({
    label: t("position.title"),
    submit: t("position.send"),
    fields: [element("p", { class: "hint" }, t("position.hint")), pose.element],
    send: async () => {
      const body = { actionType: "initializePosition", pose: pose.pose };
      return outcome(await command(["vehicles", vehicle, "instantActions"], body));
    },
  });
}
