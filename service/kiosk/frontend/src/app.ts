/** The page: what the server says becomes a screen, what the visitor does is said to the server. */
import { html, write } from "./dom.ts";
import { FaceStage } from "./face_stage.ts";
import { fetchTexts, type Texts } from "./i18n.ts";
import { listen } from "./input.ts";
import type { Hello, Said, Screen, ScreenName } from "./messages.ts";
import { Mirror } from "./mirror.ts";
import { attract } from "./screens/attract.ts";
import { consent } from "./screens/consent.ts";
import { countdown } from "./screens/countdown.ts";
import { captured, reconstructing } from "./screens/developing.ts";
import { busy, deleting, failed, thanks } from "./screens/ends.ts";
import { Overlays } from "./screens/overlays.ts";
import { position } from "./screens/position.ts";
import { result } from "./screens/result.ts";
import type { Kiosk, MakeView, View } from "./screens/view.ts";
import { Socket } from "./socket.ts";
import { Sound } from "./sound.ts";
import { Speech } from "./speech.ts";

const VIEWS: Readonly<Record<ScreenName, MakeView>> = {
  attract, consent, position, countdown, captured, reconstructing, result, keep: result, deleting,
  failed, thanks, busy,
};

/** Screens in which the mirror moves. */
const MIRRORED: readonly ScreenName[] = ["position", "countdown"];
/** Screens in which the mirror's last picture stays, until there is a face. */
const LAST_PICTURE: readonly ScreenName[] = ["captured", "reconstructing", "result", "keep"];

/** After how long the first screen is in the first language again, ms. */
const FORGET_LANGUAGE_MS = 60_000;
/** Before texts that could not be had are asked for again, ms. */
const TEXTS_AGAIN_MS = 1000;

/** One page, from its start until it is closed. */
export class App {
  private readonly root: HTMLElement;
  private readonly content = html("main", { id: "content" });
  private readonly overlays = new Overlays();
  private readonly regions = {
    polite: html("div", { class: "visually-hidden", "aria-live": "polite" }),
    assertive: html("div", { class: "visually-hidden", "aria-live": "assertive" }),
  };
  private readonly mirror: Mirror;
  private readonly face: FaceStage;
  private readonly speech = new Speech();
  private readonly sound = new Sound();
  private readonly socket: Socket;
  private texts = new Map<string, Texts>();
  private language = "";
  private hello: Hello | undefined;
  private screen: Screen | undefined;
  private lost = false;
  private view: View | undefined;
  private viewed = "";
  private told: string | undefined;
  private forget: ReturnType<typeof setTimeout> | undefined;

  constructor(root: HTMLElement, url: string) {
    this.root = root;
    const picture = html("canvas", { class: "mirror", "aria-hidden": "true" });
    const canvas = html("canvas", { class: "face", "aria-hidden": "true" });
    root.append(canvas, picture, this.content, this.overlays.element, ...Object.values(this.regions));
    this.mirror = new Mirror(picture, () => this.say({ kind: "next" }));
    this.face = new FaceStage(canvas);
    this.face.onChange = () => {
      this.draw();
      this.tellDrawn();
    };
    this.socket = new Socket(url, {
      hello: (hello) => void this.greeted(hello),
      screen: (screen) => this.show(screen),
      mirror: (head, jpeg) => void this.mirror.take(head, jpeg),
      face: ({ capture_id }, grid) => void this.face.take(capture_id, grid),
      gone: () => this.gone(),
      outdated: () => location.reload(),
    });
    listen(document, {
      touch: () => this.touched(),
      press: () => this.say({ kind: "press" }),
      escape: () => {
        if (this.view?.escape?.() !== true) this.say({ kind: "cancel" });
      },
      key: (key) => this.view?.key?.(key) ?? false,
    });
  }

  /** Begins. */
  start(): void {
    this.socket.connect();
  }

  private say(said: Said): void {
    if (this.screen) this.socket.say({ ...said, visit: this.screen.visit });
  }

  private touched(): void {
    this.sound.wake();
    this.say({ kind: "touch" });
  }

  private async greeted(hello: Hello): Promise<void> {
    this.hello = hello;
    this.lost = false;
    this.sound.allow(hello.sound);
    this.mirror.restart();
    if (hello.languages.some((language) => !this.texts.has(language))) {
      this.texts = await fetchTexts(hello.languages);
      if (this.texts.size === 0) {
        setTimeout(() => void this.greeted(hello), TEXTS_AGAIN_MS);
        return;
      }
    }
    if (!this.texts.has(this.language)) this.choose(this.firstLanguage());
    this.draw();
  }

  private gone(): void {
    this.lost = true;
    this.draw();
  }

  private firstLanguage(): string {
    return this.hello?.languages.find((each) => this.texts.has(each)) ?? "";
  }

  private choose(language: string): void {
    clearTimeout(this.forget);
    this.language = language;
    const texts = this.texts.get(language);
    if (!texts) return;
    document.documentElement.lang = language;
    document.documentElement.dir = texts.direction;
    document.title = texts.t("title");
    if (!this.speech.use(language)) this.announce(texts.t("speech.no_voice"), "polite");
    if (language !== this.firstLanguage()) {
      this.forget = setTimeout(() => {
        if (this.screen?.name === "attract") this.choose(this.firstLanguage());
      }, FORGET_LANGUAGE_MS);
    }
    this.draw();
  }

  private announce(text: string, urgency: "polite" | "assertive"): void {
    write(this.regions[urgency], text);
    this.speech.say(text);
  }

  private show(screen: Screen): void {
    const before = this.screen;
    this.screen = screen;
    if (MIRRORED.includes(screen.name)) this.mirror.start();
    else if (LAST_PICTURE.includes(screen.name)) this.mirror.stop();
    else {
      this.mirror.clear();
      this.face.forget();
    }
    if (screen.name === "attract" && before && before.name !== "attract") {
      // The next visitor begins as the first one did.
      this.speech.turn(false);
      this.choose(this.firstLanguage());
    }
    this.draw();
    this.tellDrawn();
  }

  /** Once for each face: that it can be seen. */
  private tellDrawn(): void {
    const id = this.screen?.result?.capture_id;
    if (id === undefined || id === this.told || !this.face.seen(id)) return;
    this.told = id;
    this.say({ kind: "drawn", capture_id: id });
  }

  private draw(): void {
    const { screen } = this;
    const texts = this.texts.get(this.language);
    if (!texts) return;
    const kiosk = this.kiosk(texts);
    if (screen) this.drawScreen(screen, kiosk);
    // Last, as a question over the screen takes the focus.
    this.overlays.update(screen, this.lost, kiosk);
  }

  private drawScreen(screen: Screen, kiosk: Kiosk): void {
    const { root } = this;
    root.dataset["screen"] = screen.name;
    root.dataset["visit"] = String(screen.visit);
    root.dataset["seen"] = String((screen.name === "attract" || screen.result !== null)
      && this.face.seen(screen.result?.capture_id));
    root.dataset["trouble"] = this.lost ? "page" : screen.trouble ?? "";
    // The links lie over the result: the same view.
    const name = screen.name === "keep" ? "result" : screen.name;
    const viewed = JSON.stringify([screen.visit, name, this.language, screen.consent, screen.result,
      screen.failed, screen.thanks]);
    if (viewed === this.viewed) {
      this.view?.update?.(screen);
      return;
    }
    this.viewed = viewed;
    this.view?.close?.();
    this.view = VIEWS[screen.name](screen, kiosk);
    this.content.replaceChildren(this.view.element);
    this.view.focus.focus({ preventScroll: true });
    this.speech.say(this.view.spoken);
  }

  private kiosk(texts: Texts): Kiosk {
    return {
      texts,
      languages: [...this.texts.values()],
      speech: this.speech,
      mayspeak: this.hello?.speech ?? false,
      sound: this.sound,
      face: this.face,
      say: (said) => this.say(said),
      choose: (language) => this.choose(language),
      announce: (text, urgency) => this.announce(text, urgency),
    };
  }
}
