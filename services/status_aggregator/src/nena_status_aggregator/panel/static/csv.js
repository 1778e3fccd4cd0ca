// Files that the page makes itself.

const FORMULA_SIGNS = /^[=+\-@\t\r]/; // spreadsheets execute cells that start with these

/** Return rows as CSV (RFC 4180), below a row of titles; no spreadsheet executes a cell. */
export function csvOf(titles, rows) {
  return [titles, ...rows].map((cells) => `${cells.map(cellOf).join(",")}\r\n`).join("");
}

function cellOf(value) {
  const text = String(value ?? "");
  const harmless = typeof value === "string" && FORMULA_SIGNS.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(harmless) ? `"${harmless.replaceAll('"', '""')}"` : harmless;
}

/** Save a text as a file of this name. */
export function save(name, text, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
