/** What can be done with a face: each gesture has its button. */
import { button, html, set } from "../dom.ts";
import type { IconName } from "../icons.ts";
import type { Texts } from "../i18n.ts";
import { drawSigmaScale, type FaceViewer, type Mode, sigmaLegend } from "../viewer/viewer.ts";

/** What shows a face. */
export interface Shows {
  readonly viewer: Pick<FaceViewer, "rotate" | "zoom" | "reset" | "blend" | "mode">;
}

/** Of one press of a button: a turn in degrees, and a factor. */
const STEP = 15;
const CLOSER = 1.25;

const MOVES: readonly (readonly [string, IconName, (face: Shows) => void])[] = [
  ["turn_left", "turnLeft", (face) => face.viewer.rotate(-STEP, 0)],
  ["turn_right", "turnRight", (face) => face.viewer.rotate(STEP, 0)],
  ["turn_up", "turnUp", (face) => face.viewer.rotate(0, -STEP)],
  ["turn_down", "turnDown", (face) => face.viewer.rotate(0, STEP)],
  ["closer", "plus", (face) => face.viewer.zoom(CLOSER)],
  ["farther", "minus", (face) => face.viewer.zoom(1 / CLOSER)],
  ["reset", "reset", (face) => face.viewer.reset()],
];

const KEYS: Readonly<Record<string, string>> = {
  ArrowLeft: "turn_left", ArrowRight: "turn_right", ArrowUp: "turn_up", ArrowDown: "turn_down",
  "+": "closer", "-": "farther", "0": "reset",
};

/** What a key does with the face; gives whether it did something. */
export function turnByKey(face: Shows, key: string): boolean {
  const move = MOVES.find(([name]) => name === KEYS[key]);
  move?.[2](face);
  return move !== undefined;
}

/** Turn, come closer, begin anew. */
export function moves(face: Shows, { t }: Texts): HTMLElement {
  return html("div", { class: "moves", role: "group", "aria-label": t("view.move"), dir: "ltr" },
    ...MOVES.map(([name, picture, move]) => button({
      action: name, label: t(`view.${name}`), icon: picture, look: "tool", repeats: true,
      press: () => move(face),
    })));
}

/** From what the sensor measured to the dense face: a slider with a button at each end. */
export function beforeAfter(face: Shows, { t }: Texts): HTMLElement {
  const slider = html("input", {
    type: "range", min: 0, max: 100, value: 100, "data-action": "blend",
    "aria-label": t("view.before_after"),
  });
  const blend = (percent: number): void => {
    slider.value = String(percent);
    set(slider, { "aria-valuetext": `${t("view.after")}: ${percent} %` });
    face.viewer.blend = percent / 100;
  };
  slider.addEventListener("input", () => blend(Number(slider.value)));
  blend(100);
  const end = (action: string, percent: number): HTMLButtonElement => button({
    action, label: t(`view.${action}`), look: "quiet", repeats: true, press: () => blend(percent),
  });
  // The line on the face goes with the slider, in every language.
  return html("div", { class: "blend", dir: "ltr" }, end("before", 0), slider, end("after", 100));
}

const MODES: readonly Mode[] = ["mesh", "points", "sigma"];

/** Mesh, points or confidence, and the legend of the last. */
export function modes(face: Shows, texts: Texts): HTMLElement {
  const { t } = texts;
  const legend = legendOf(texts);
  const buttons = MODES.map((mode) => button({
    action: mode, label: t(`view.${mode}`), look: "quiet", repeats: true, press: () => choose(mode),
  }));
  const choose = (chosen: Mode): void => {
    face.viewer.mode = chosen;
    buttons.forEach((each, i) => set(each, { "aria-pressed": String(MODES[i] === chosen) }));
    set(legend, { hidden: chosen !== "sigma" });
  };
  choose("mesh");
  return html("div", { class: "modes" },
    html("div", { class: "switch", role: "group", "aria-label": t("view.choose") }, ...buttons), legend);
}

/** How far off a point may be, by colour: the marks stand where they are on the scale. */
function legendOf(texts: Texts): HTMLElement {
  const ramp = html("canvas", { class: "ramp", width: 256, height: 1 });
  drawSigmaScale(ramp);
  const marks = sigmaLegend().map(({ mm, at }) => {
    const mark = html("span", { dir: "auto" }, texts.millimetres(mm, mm < 1 ? 1 : 0));
    mark.style.setProperty("--at", String(at));
    return mark;
  });
  return html("div", { class: "legend" }, html("p", {}, texts.t("view.legend")),
    html("div", { class: "scale", dir: "ltr" }, ramp, html("div", { class: "marks" }, ...marks)));
}
