/** What can be done with a face: each gesture has its button. */
import { button, html, set, write } from "../dom.ts";
import type { FaceStage, Mode } from "../face_stage.ts";
import type { IconName } from "../icons.ts";
import type { Texts } from "../i18n.ts";

/** Of one press of a button: a turn in radians, and a factor. */
const STEP = Math.PI / 12;
const CLOSER = 1.25;

const MOVES: readonly (readonly [string, IconName, (face: FaceStage) => void])[] = [
  ["turn_left", "turnLeft", (face) => face.viewer?.rotate(-STEP, 0)],
  ["turn_right", "turnRight", (face) => face.viewer?.rotate(STEP, 0)],
  ["turn_up", "turnUp", (face) => face.viewer?.rotate(0, -STEP)],
  ["turn_down", "turnDown", (face) => face.viewer?.rotate(0, STEP)],
  ["closer", "plus", (face) => face.viewer?.zoom(CLOSER)],
  ["farther", "minus", (face) => face.viewer?.zoom(1 / CLOSER)],
  ["reset", "reset", (face) => face.viewer?.reset()],
];

const KEYS: Readonly<Record<string, string>> = {
  ArrowLeft: "turn_left", ArrowRight: "turn_right", ArrowUp: "turn_up", ArrowDown: "turn_down",
  "+": "closer", "-": "farther", "0": "reset",
};

/** What a key does with the face; gives whether it did something. */
export function turnByKey(face: FaceStage, key: string): boolean {
  const move = MOVES.find(([name]) => name === KEYS[key]);
  move?.[2](face);
  return move !== undefined;
}

/** Turn, come closer, begin anew. */
export function moves(face: FaceStage, { t }: Texts): HTMLElement {
  return html("div", { class: "moves", role: "group", "aria-label": t("view.move"), dir: "ltr" },
    ...MOVES.map(([name, picture, move]) => button({
      action: name, label: t(`view.${name}`), icon: picture, look: "tool", repeats: true,
      press: () => move(face),
    })));
}

/** From what the sensor measured to the dense face: a slider with a button at each end. */
export function beforeAfter(face: FaceStage, { t }: Texts): HTMLElement {
  const slider = html("input", {
    type: "range", min: 0, max: 100, value: 100, "data-action": "blend",
    "aria-label": t("view.before_after"),
  });
  const blend = (percent: number): void => {
    slider.value = String(percent);
    set(slider, { "aria-valuetext": `${t("view.after")}: ${percent} %` });
    if (face.viewer) face.viewer.blend = percent / 100;
  };
  slider.addEventListener("input", () => blend(Number(slider.value)));
  blend(100);
  const end = (action: string, percent: number): HTMLButtonElement => button({
    action, label: t(`view.${action}`), look: "quiet", repeats: true, press: () => blend(percent),
  });
  return html("div", { class: "blend" }, end("before", 0), slider, end("after", 100));
}

const MODES: readonly Mode[] = ["mesh", "points", "sigma"];

/** Mesh, points or confidence, and the legend of the last. */
export function modes(face: FaceStage, texts: Texts): HTMLElement {
  const { t } = texts;
  const legend = html("div", { class: "legend", hidden: true });
  const buttons = MODES.map((mode) => button({
    action: mode, label: t(`view.${mode}`), look: "quiet", repeats: true, press: () => choose(mode),
  }));
  const choose = (chosen: Mode): void => {
    if (face.viewer) face.viewer.mode = chosen;
    buttons.forEach((each, i) => set(each, { "aria-pressed": String(MODES[i] === chosen) }));
    set(legend, { hidden: chosen !== "sigma" });
    if (chosen === "sigma") fillLegend(legend, face, texts);
  };
  choose("mesh");
  return html("div", { class: "modes" },
    html("div", { class: "switch", role: "group", "aria-label": t("view.choose") }, ...buttons), legend);
}

function fillLegend(legend: HTMLElement, face: FaceStage, texts: Texts): void {
  const [low, high] = face.viewer?.sigmaRange ?? [0, 0];
  const end = (mm: number): HTMLElement => html("span", { dir: "auto" }, texts.millimetres(mm, 2));
  const words = html("p", {});
  write(words, texts.t("view.legend"));
  legend.replaceChildren(words,
    html("div", { class: "scale", dir: "ltr" }, end(low), html("i", { class: "ramp" }), end(high)));
}
