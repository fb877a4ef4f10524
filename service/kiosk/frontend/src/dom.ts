/** Making elements: text is always text, never markup. */
import { type IconName, icon } from "./icons.ts";

/** Attributes by name; true writes an empty one, false and undefined none. */
export type Attributes = Readonly<Record<string, string | number | boolean | undefined>>;

/** Sets attributes, or removes those that are false or undefined. */
export function set<E extends Element>(element: E, attributes: Attributes): E {
  for (const [name, value] of Object.entries(attributes)) {
    const text = value === true ? "" : value === false || value === undefined ? null : String(value);
    if (text === null) element.removeAttribute(name);
    else if (element.getAttribute(name) !== text) element.setAttribute(name, text);
  }
  return element;
}

/** An HTML element. */
export function html<N extends keyof HTMLElementTagNameMap>(
  name: N, attributes: Attributes = {}, ...children: readonly (Node | string)[]
): HTMLElementTagNameMap[N] {
  const element = set(document.createElement(name), attributes);
  element.append(...children);
  return element;
}

/** An SVG element. */
export function svg<N extends keyof SVGElementTagNameMap>(
  name: N, attributes: Attributes = {}, ...children: readonly Node[]
): SVGElementTagNameMap[N] {
  const element = set(document.createElementNS("http://www.w3.org/2000/svg", name), attributes);
  element.append(...children);
  return element;
}

/** Sets a text, where it is another one: a live region says what is set. */
export function write(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** What a button is. */
export interface ButtonOptions {
  /** For style sheet and tests. */
  readonly action: string;
  readonly label: string;
  readonly icon?: IconName;
  /** `main` is the large one; `tool` has a picture alone, its label is read out. */
  readonly look?: "main" | "plain" | "quiet" | "tool";
  /** Whether each of quick taps counts; otherwise the second of a double tap is left out. */
  readonly repeats?: boolean;
  readonly press: () => void;
}

/** A button. One that is `aria-disabled` keeps the focus and does nothing. */
export function button(options: ButtonOptions): HTMLButtonElement {
  const look = options.look ?? "plain";
  const made = html("button", {
    type: "button", class: `button ${look}`, "data-action": options.action,
    "aria-label": look === "tool" ? options.label : undefined,
  });
  if (options.icon) made.append(icon(options.icon));
  if (look !== "tool") made.append(html("span", {}, options.label));
  made.addEventListener("click", (event) => {
    if (event.detail > 1 && !options.repeats) return;
    if (made.getAttribute("aria-disabled") !== "true") options.press();
  });
  return made;
}

/** A heading that takes the focus when its screen comes, so that it is read out. */
export function heading(text: string): HTMLHeadingElement {
  return html("h1", { tabindex: -1 }, text);
}
