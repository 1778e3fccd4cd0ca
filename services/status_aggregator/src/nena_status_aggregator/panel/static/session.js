// Who uses the page: asked of the server, which alone decides what somebody may do.

const URL_OF_SESSION = "api/v1/session";
const UNKNOWN = 401;

/** Give who is logged in, null while the server does not tell; who has to log in first is shown where. */
export async function whoIsIt() {
  const answer = await fetch(URL_OF_SESSION).catch(() => null);
  if (answer?.status === UNKNOWN) location.replace("login.html");
  return answer?.ok ? answer.json() : null;
}

/** Log in; gives null when it is done, else the key of the text that says why not. */
export async function logIn(token) {
  const headers = { authorization: `Bearer ${token}` };
  const answer = await fetch(URL_OF_SESSION, { method: "POST", headers }).catch(() => null);
  if (answer?.ok) return null;
  return answer?.status === UNKNOWN ? "login.wrong" : "login.failed";
}

/** Give where to sign in by the site's issuer; null where there is none. */
export async function startAtIssuer() {
  const answer = await fetch(`${URL_OF_SESSION}/oidc`).catch(() => null);
  return answer?.ok ? (await answer.json()).start : null;
}

/** Log out, and show the page for logging in. */
export async function logOut() {
  await fetch(URL_OF_SESSION, { method: "DELETE" }).catch(() => null);
  location.assign("login.html");
}
