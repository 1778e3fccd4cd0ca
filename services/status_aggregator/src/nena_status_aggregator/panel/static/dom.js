// Small helpers that make and change elements, and touch the page only where something differs.

/** Make an element with attributes and children (elements or texts). */
export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) setAttribute(made, key, value);
  made.append(...children);
  return made;
}

export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Set an attribute; null, undefined and false take it away. */
export function setAttribute(node, name, value) {
  if (value === null || value === undefined || value === false) node.removeAttribute(name);
  else if (node.getAttribute(name) !== String(value)) node.setAttribute(name, value);
}

/** Fill an element anew if `content` (anything that JSON can hold) is another than at the last time. */
export function refill(node, content, make) {
  const key = JSON.stringify(content) ?? "";
  if (node.shown === key) return;
  node.shown = key;
  node.replaceChildren(...make(content));
}

/** Make an element with words of another program, which are English whatever the language of the page. */
export function foreign(name, text, attributes = {}) {
  return element(name, { lang: "en", translate: "no", ...attributes }, text ?? "");
}

/** Make an element with names and values, which are the same in all languages. */
export function verbatim(name, text, attributes = {}) {
  return element(name, { translate: "no", ...attributes }, text ?? "");
}

/** Make a button with words. */
export function button(text, action, attributes = {}) {
  const made = element("button", { type: "button", ...attributes }, text);
  made.addEventListener("click", action);
  return made;
}

/** Make a bar for 0 to 100 with its value in words. */
export function progressBar() {
  const bar = element("progress", { max: 100, value: 0 });
  const value = element("span", { class: "number" });
  return { bar, value, box: element("span", { class: "progress" }, bar, value) };
}

/** Make the box that stands where there is nothing to show: what is missing, and what to do. */
export function emptyBox(title, text) {
  return element("div", { class: "empty" }, element("strong", {}, title), element("p", {}, text));
}
