/** Touches and keys of the whole page. */

/** Shortest time between two touches that the server is told of, ms. */
const TOUCH_EVERY_MS = 500;

/** What is done with them. */
export interface Input {
  /** Somebody is there. */
  touch(): void;
  /** Enter or Space where no button has the focus: as a button beneath the screen sends them. */
  press(): void;
  escape(): void;
  /** Another key; gives whether it did something. */
  key(key: string): boolean;
}

/** Whether an element does something with Enter, Space or arrow keys itself. */
function acts(target: EventTarget | null): boolean {
  return target instanceof Element && target.closest("button, input, a, select") !== null;
}

/** Listens to a page for as long as it lives. */
export function listen(page: Document, input: Input): void {
  let last = -Infinity;
  const touched = (event: Event): void => {
    if (event.timeStamp - last < TOUCH_EVERY_MS) return;
    last = event.timeStamp;
    input.touch();
  };
  const by = (device: "keys" | "touch"): void => {
    page.documentElement.dataset["input"] = device;
  };
  page.addEventListener("pointerdown", () => by("touch"), { capture: true });
  for (const kind of ["pointerdown", "pointermove", "wheel", "input"]) {
    page.addEventListener(kind, touched, { passive: true, capture: true });
  }
  page.addEventListener("keydown", (event) => {
    const { key, target } = event;
    const arrow = key.startsWith("Arrow");
    // A held key is one key; arrows alone go on.
    if (event.repeat && !arrow && key !== "Tab") {
      event.preventDefault();
      return;
    }
    touched(event);
    by("keys");
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (key === "Escape") input.escape();
    else if (key === "Enter" || key === " ") {
      if (acts(target)) return;
      input.press();
    } else if ((arrow && target instanceof HTMLInputElement) || !input.key(key)) return;
    event.preventDefault();
  });
  for (const kind of ["contextmenu", "dragstart", "selectstart", "gesturestart"]) {
    page.addEventListener(kind, (event) => event.preventDefault());
  }
}
