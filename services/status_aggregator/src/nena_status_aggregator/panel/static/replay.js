// The replay of a time range: where the robots were and how they looked, from the numbers that the server sends.

const TENTH = 100; // ms
const STEP = 150; // tenths of a second; a robot that has not moved for longer stood, and then drove for at most this time

/** Load the replay of a time range, until `signal` aborts it; null without a history. */
export async function loadReplay({ since, until }, signal) {
  const query = new URLSearchParams({ since: new Date(since).toISOString(), until: new Date(until).toISOString() });
  const answer = await fetch(`api/v1/replay?${query}`, { signal }).catch(() => null);
  const body = answer?.ok ? await answer.json().catch(() => null) : null; // null also if aborted
  return body && new Replay(body);
}

class Replay {
  #since;
  #stops;
  #tracks;

  constructor({ since, recordedSince, robots, stops }) {
    this.#stops = stops;
    this.#since = Date.parse(since);
    this.#tracks = new Map(robots.map((each) => [each.robot, trackOf(each)]));
    this.recordedSince = recordedSince && Date.parse(recordedSince);
  }

  get empty() {
    return !this.#tracks.size;
  }

  /** Return the robots at a time, as the map needs them. `known`: the present ones, by ID, with their names and bodies. */
  robotsAt(time, known) {
    const tenths = this.#tenths(time);
    return [...this.#tracks].map(([id, track]) => robotAt(id, track, tenths, known.get(id))).filter((robot) => robot?.position);
  }

  /** Return the areas that were stopped at a time. */
  areasAt(time) {
    const tenths = this.#tenths(time);
    return this.#stops.filter(({ begin, end }) => begin <= tenths && tenths < (end ?? Infinity)).map(({ area }) => area);
  }

  #tenths(time) {
    return (time - this.#since) / TENTH;
  }
}

function trackOf({ times, x, y, theta, looks }) {
  return { times: sums(times), x: sums(x), y: sums(y), theta, looks, lookTimes: looks.map(([time]) => time) };
}

function sums(differences) {
  let sum = 0;
  return differences.map((each) => (sum += each));
}

// A robot that did not move is at its present place; null: there was no such robot at this time.
function robotAt(id, track, time, known) {
  const [, condition, urgent, loads, jam] = track.looks[lastUpTo(track.lookTimes, time)] ?? [];
  if (!condition) return null;
  const position = track.times.length ? placeAt(track, time) : known?.position;
  return { id, name: known?.name ?? id, vehicle: { name: id }, body: known?.body, condition, urgent, loads: Array(loads), jam, position };
}

// Between two positions, a robot moves in a straight line.
function placeAt({ times, x, y, theta }, time) {
  const from = Math.max(lastUpTo(times, time), 0);
  const to = Math.min(from + 1, times.length - 1);
  const begin = Math.max(times[from], times[to] - STEP);
  const share = time > begin && to > from ? (time - begin) / (times[to] - begin) : 0;
  const between = (values) => (values[from] + share * (values[to] - values[from])) / 100;
  return { x: between(x), y: between(y), theta: theta[from] / 100, localized: true };
}

// The index of the last of these ascending numbers that is not above a limit; -1: none.
function lastUpTo(numbers, limit) {
  let [low, high] = [0, numbers.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (numbers[middle] <= limit) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}
