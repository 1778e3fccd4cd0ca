// Where every robot was, and how it was, at any time of a stretch of the history.

const GAP = 15_000;

/**
 * The history as something to look at by time. `entries` come as the API gives them, oldest first; `robots` are those
 * of now: one that has not moved within the stretch stands where it stands.
 */
export class Timeline {
  #robots;
  #tracks = new Map();
  #conditions = new Map();

  constructor(entries, robots) {
    this.#robots = robots;
    this.events = entries.filter((entry) => entry.code !== "position");
    for (const entry of entries) {
      const at = Date.parse(entry.time);
      if (entry.code === "position") append(this.#tracks, entry.robot, { at, ...entry.values });
      if (entry.code === "condition") append(this.#conditions, entry.robot, { at, ...entry.values });
    }
  }

  /** Give the robots as they were, with what the map needs of them. */
  robotsAt(time) {
    return this.#robots.map((robot) => this.#robotAt(robot, time)).filter((robot) => robot.position);
  }

  /** Give the place in `events` of the last one that had happened; -1: none had. */
  lastEvent(time) {
    return this.events.findLastIndex((entry) => Date.parse(entry.time) <= time);
  }

  #robotAt({ id, name, body, condition, position }, time) {
    const track = this.#tracks.get(id);
    const moved = track && placeAt(track, time);
    const changes = this.#conditions.get(id) ?? [];
    const last = changes.findLast((change) => change.at <= time);
    return {
      id,
      name,
      body,
      condition: last?.condition ?? changes[0]?.before ?? condition,
      position: moved ?? position,
    };
  }
}

function append(map, key, value) {
  if (!map.has(key)) map.set(key, []);
  map.get(key).push(value);
}

// Before the first place it was less than a track's step away from it; between two places it went straight.
function placeAt(track, time) {
  const at = track.findLastIndex((place) => place.at <= time);
  const [from, to] = [track[Math.max(at, 0)], track[at + 1]];
  const share = at >= 0 && to && to.at - from.at < GAP ? (time - from.at) / (to.at - from.at) : 0;
  const between = (name) => from[name] + share * ((to ?? from)[name] - from[name]);
  return { x: between("x"), y: between("y"), theta: from.theta, localized: true };
}
