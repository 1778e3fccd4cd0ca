// Loads a stretch of the history, the latest part of it if there is too much.

const PAGE = 1000;
const PAGES = 20;
const CODES = [
  "position", "condition", "connection", "operatingMode", "orderTaken", "orderEnded", "actionEnded", "errorRaised",
  "errorCleared", "charging", "loads", "map", "transportOrder", "link", "historyGap",
];

/** Give `{entries, complete}`, oldest first; null: there is no history. */
export async function loadHistory(since) {
  const entries = [];
  let before = null;
  for (let page = 0; page < PAGES; page += 1) {
    const answer = await fetch(`api/v1/history?${queryOf(since, { limit: PAGE, before })}`).catch(() => null);
    if (!answer?.ok) return null;
    const part = await answer.json();
    entries.push(...part.entries);
    before = part.next;
    if (before === null) break;
  }
  return { entries: entries.reverse(), complete: before === null };
}

/** Give the address of the same stretch as a file, `csv` or `jsonl`. */
export function exportAddress(since, form) {
  return `api/v1/history.${form}?${queryOf(since, {})}`;
}

function queryOf(since, more) {
  const query = new URLSearchParams({ since: new Date(since).toISOString() });
  for (const code of CODES) query.append("code", code);
  for (const [name, value] of Object.entries(more)) if (value !== null) query.set(name, value);
  return query;
}
