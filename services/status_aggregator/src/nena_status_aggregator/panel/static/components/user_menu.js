// Says who is logged in, and logs out; empty where nobody has to log in.

import { t } from "../catalogue.js";
import { button, verbatim } from "../dom.js";
import { logOut } from "../session.js";

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
