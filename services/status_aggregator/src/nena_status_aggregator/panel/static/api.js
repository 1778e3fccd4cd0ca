// Requests to the server: sign-in, and commands that the aggregator forwards to the order service.

const URL_OF_SESSION = "api/v1/session";
const UNKNOWN = 401;
const RETRY_MS = 2000;

/** Return the session, or null if the server is not reachable. Redirects to the sign-in page if needed. */
export async function getSession() {
  const answer = await fetch(URL_OF_SESSION).catch(() => null);
  if (answer?.status === UNKNOWN) location.replace("login.html");
  return answer?.ok ? answer.json() : null;
}

/** Sign in. Returns null on success, else the key of the text with the reason. */
export async function logIn(token) {
  const headers = { authorization: `Bearer ${token}` };
  const answer = await fetch(URL_OF_SESSION, { method: "POST", headers }).catch(() => null);
  if (answer?.ok) return null;
  return answer?.status === UNKNOWN ? "login.wrong" : "login.failed";
}

/** Return the URL of the single sign-on as soon as the server answers; null if it is not configured. */
export async function singleSignOnUrl() {
  for (;;) {
    const answer = await fetch(`${URL_OF_SESSION}/oidc`).catch(() => null);
    if (answer?.ok) return (await answer.json()).start;
    await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
  }
}

/** Sign out and show the sign-in page. */
export async function logOut() {
  await fetch(URL_OF_SESSION, { method: "DELETE" }).catch(() => null);
  location.assign("login.html");
}

const BASE = "api/v1/control";

/** The command was rejected; `message` and `errors` contain the reasons. */
export class RefusedError extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    Object.assign(this, { type: problem.type, status: problem.status, errors: problem.errors ?? [] });
  }
}

/** No answer was received; the command may have been executed. */
class UnansweredError extends Error {}

/** Return whether commands are enabled. */
export async function commandsEnabled() {
  const answer = await fetch(BASE).catch(() => null);
  return answer?.ok ? (await answer.json()).enabled : false;
}

const ASKED_WITHIN = 5000; // ms
const WAITED = 60_000; // ms
const FAILED = 500; // and above: the order service has not answered, or not yet

/** Fetch a resource of the order service, e.g. `ask("transportOrders", name)`; fails after 5 s without an answer. */
export function ask(...path) {
  return askWith(path, []);
}

/** Fetch a resource of the order service with parameters, e.g. `askWith(["paths"], [["locked", true]])`. */
export function askWith(path, parameters, within = ASKED_WITHIN) {
  const options = { headers: { accept: "application/json" }, signal: AbortSignal.timeout(within) };
  return request(path, options, parameters.length ? `?${new URLSearchParams(parameters)}` : "");
}

/** Fetch a resource again until there is an answer, however slow the server is; `wanted()`: whether it still is of use. */
export async function askUntil(wanted, path, parameters = []) {
  for (;;) {
    try {
      return await askWith(path, parameters, WAITED);
    } catch (error) {
      if (!wanted() || (error instanceof RefusedError && error.status < FAILED)) throw error;
    }
    await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
  }
}

/** Fetch a list of the order service with these filters, e.g. `fetchList("audit", { user })`; empty ones are left out. */
export function fetchList(name, filters) {
  return askWith([name], Object.entries(filters).filter(([, value]) => value));
}

/** Send a command once; `body` is sent as JSON. */
export function command(path, body, method = "POST") {
  const headers = { "content-type": "application/json" };
  return request(path, { method, headers, body: JSON.stringify(body) });
}

/** Create an idempotency key. */
export function newKey() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((each) => each.toString(16).padStart(2, "0")).join("");
}

/** Acknowledge a matter of the attention list; `by`: name of the person. */
export function acknowledge(id, by) {
  const headers = { "content-type": "application/json" };
  return request([id, "acknowledgement"], { method: "POST", headers, body: JSON.stringify({ by }) }, "", "api/v1/attention");
}

async function request(path, options, query = "", base = BASE) {
  const url = [base, ...path.map(encodeURIComponent)].join("/") + query;
  let answer, body;
  try {
    answer = await fetch(url, options);
    body = await answer.json();
  } catch {
    throw new UnansweredError();
  }
  if (!answer.ok) throw new RefusedError(body);
  return body;
}
