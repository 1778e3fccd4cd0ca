// Loads the page again if a module could not be loaded: without it none of them runs, and the page would stay empty.

const PAUSE = 2000; // ms

addEventListener(
  "error",
  ({ target }) => {
    if (target instanceof HTMLScriptElement) setTimeout(() => location.reload(), PAUSE);
  },
  true, // such an error does not bubble
);
