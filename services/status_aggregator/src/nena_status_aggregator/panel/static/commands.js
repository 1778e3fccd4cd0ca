// Commands to the order service, which the aggregator passes on. Nothing is sent twice.

const BASE = "api/v1/control";

/** A command that was not carried out; `message` and `errors` are the words of the one who refused it. */
export class RefusedError extends Error {
  constructor(problem) {
    super(problem.detail || problem.title);
    this.errors = problem.errors ?? [];
  }
}

/** Nobody has answered; the command may have been carried out all the same. */
export class UnansweredError extends Error {}

/** Tell whether commands are possible at all. */
export async function commandsEnabled() {
  const answer = await fetch(BASE).catch(() => null);
  return answer?.ok ? (await answer.json()).enabled : false;
}

/** Ask the order service for something, e.g. `ask("transportOrders", name)`. */
export function ask(...path) {
  return request(path, { headers: { accept: "application/json" } });
}

/** Give a command; `body` is sent as JSON. */
export function command(path, body) {
  const headers = { "content-type": "application/json" };
  return request(path, { method: "POST", headers, body: JSON.stringify(body) });
}

/** Make a key by which a command that comes twice is known. */
export function newKey() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((each) => each.toString(16).padStart(2, "0")).join("");
}

async function request(path, options) {
  const url = [BASE, ...path.map(encodeURIComponent)].join("/");
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
