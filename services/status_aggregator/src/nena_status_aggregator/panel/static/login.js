// The sign-in page.

import { logIn, singleSignOnUrl } from "./api.js";
import { setText } from "./dom.js";
import { chosenLanguage, t } from "./i18n.js";
import "./header.js";

document.documentElement.lang = chosenLanguage();
for (const node of document.querySelectorAll("[data-text]")) node.textContent = t(node.dataset.text);

const PROBLEMS = ["away", "expired", "refused", "role", "unfit"];

const form = document.querySelector("form");
const problem = document.getElementById("problem");

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const refusal = await logIn(form.elements.token.value.trim());
  if (refusal === null) return location.replace("./");
  setText(problem, t(refusal));
  form.elements.token.select();
});

const reported = new URLSearchParams(location.search).get("problem");
if (PROBLEMS.includes(reported)) setText(problem, t(`login.problem.${reported}`));

const start = await singleSignOnUrl();
if (start !== null) {
  const issuer = document.getElementById("issuer");
  issuer.href = start;
  issuer.hidden = false;
}
