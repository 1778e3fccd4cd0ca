// The line to the event stream: comes back by itself, and notices when it is dead.

const SILENCE = 12_000; // the stream sends at least a heartbeat each 5 s
const PAUSES = [500, 1000, 2000, 4000];

/**
 * Feeds a store. Fires `state` when `connected` changes or a try has failed. Reconnecting is our own, not the
 * browser's, because that gives up after some answers.
 */
export class EventLink extends EventTarget {
  connected = false;
  everConnected = false;
  failed = false;
  lastNews = null;
  #store;
  #url;
  #source = null;
  #lastId = null;
  #failures = 0;
  #watchdog = null;

  constructor(store, url) {
    super();
    this.#store = store;
    this.#url = url;
  }

  start() {
    const after = this.#lastId ? `?after=${encodeURIComponent(this.#lastId)}` : "";
    const source = new EventSource(this.#url + after);
    this.#source = source;
    source.onopen = () => this.#heard();
    source.onerror = () => this.#lost();
    source.addEventListener("heartbeat", () => this.#heard());
    source.addEventListener("snapshot", (event) => this.#take(event, "takeSnapshot"));
    source.addEventListener("delta", (event) => this.#take(event, "takeDelta"));
    this.#watch();
  }

  #take(event, method) {
    this.#lastId = event.lastEventId;
    this.#store[method](JSON.parse(event.data));
    this.#heard();
  }

  #heard() {
    this.lastNews = this.#store.now();
    this.#failures = 0;
    this.#watch();
    if (this.connected) return;
    this.connected = true;
    this.everConnected = true;
    this.dispatchEvent(new Event("state"));
  }

  #watch() {
    clearTimeout(this.#watchdog);
    this.#watchdog = setTimeout(() => this.#lost(), SILENCE);
  }

  #lost() {
    clearTimeout(this.#watchdog);
    this.#source.close();
    this.connected = false;
    this.failed = true;
    const pause = PAUSES[Math.min(this.#failures++, PAUSES.length - 1)];
    setTimeout(() => this.start(), pause);
    this.dispatchEvent(new Event("state"));
  }
}
