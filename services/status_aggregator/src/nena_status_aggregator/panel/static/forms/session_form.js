// Says where in the ROS graph a robot is: its namespace and its domain.

import { t } from "../catalogue.js";
import { command } from "../commands.js";
import { element } from "../dom.js";
import { commandForm, outcome } from "./command_form.js";
import { field, numberInput, numberOf } from "./fields.js";

export function sessionForm(vehicle, { namespace, domainId }) {
  const pattern = "/?([A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?"; // as ROS takes it
  const space = element("input", { type: "text", name: "namespace", required: true, pattern, maxlength: 200, spellcheck: "false" });
  space.value = namespace;
  const domain = numberInput({ name: "domainId", required: true, min: 0, max: 232, step: 1 });
  domain.value = domainId;
  const keep = element("input", { type: "checkbox", name: "keep" });
  return commandForm({
    label: t("session.title"),
    submit: t("session.send"),
    fields: [
      element("p", { class: "hint" }, t("session.hint")),
      field(t("session.namespace"), space),
      field(t("session.domain"), domain),
      field(t("session.keep"), keep),
    ],
    send: async () => {
      const values = { namespace: space.value, domainId: numberOf(domain), keep: keep.checked };
      const parameters = Object.entries(values).map(([key, value]) => ({ key, value }));
      const body = { actionType: "nena:configureRosSession", parameters };
      return outcome(await command(["vehicles", vehicle, "instantActions"], body));
    },
  });
}
