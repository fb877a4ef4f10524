/** The page: logged in or not, in a language, fetched anew every few seconds. */
import { html, set, write } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import { API, type Overview, Refused, ask } from "./api.ts";
import { Captures } from "./captures.ts";
import { DeadLetters } from "./dead.ts";
import { confirm, show } from "./dialogs.ts";
import { Health } from "./health.ts";
import { type Chosen, keepLanguage } from "./languages.ts";
import { login } from "./login.ts";
import { type Desk, action, section, words } from "./parts.ts";
import { Facts, Waiting, settingFacts, visitFacts } from "./statistics.ts";

const AGAIN_MS = 2000;
const SAID_MS = 6000;

/** The sections of one who has logged in. */
interface Sections {
  readonly health: Health;
  readonly waiting: Waiting;
  readonly visits: Facts;
  readonly settings: Facts;
  readonly captures: Captures;
  readonly dead: DeadLetters;
  readonly noConsent: HTMLElement;
}

/** The operator's page. */
export class OperatorPage {
  private readonly place: HTMLElement;
  private readonly all: ReadonlyMap<string, Texts>;
  private texts: Texts;
  private sections: Sections | undefined;
  private readonly said = html("p", { class: "said", role: "status" });
  private unsaid = 0;
  private again = 0;
  /** What is being fetched. */
  private asking: Promise<void> = Promise.resolve();

  constructor(place: HTMLElement, { texts, all }: Chosen) {
    this.place = place;
    this.texts = texts;
    this.all = all;
  }

  /** Shows the page, or the way in. */
  async start(): Promise<void> {
    document.documentElement.lang = this.texts.language;
    document.documentElement.dir = this.texts.direction;
    document.title = this.texts.t("operator.login.title");
    try {
      const { session } = await ask<{ session: boolean }>("session");
      if (!session) return this.enter();
      const now = await ask<Overview>("overview");
      this.build();
      this.show(now);
      await this.refresh();
    } catch (error) {
      this.enter(words(this.texts, error));
    }
  }

  private enter(said = ""): void {
    window.clearTimeout(this.again);
    this.sections = undefined;
    this.place.replaceChildren(html("main", {}, login(this.texts, () => void this.start(), said)));
  }

  private build(): void {
    const { texts } = this;
    const { t } = texts;
    const desk: Desk = {
      texts, act: (work, done) => this.act(work, done),
      confirm: (question) => confirm(texts, question),
      show: (title, text) => show(texts, title, text),
    };
    const sections = this.sections = {
      health: new Health(desk), waiting: new Waiting(texts),
      visits: new Facts("visits", t("operator.visits")),
      settings: new Facts("settings", t("operator.settings")),
      captures: new Captures(desk), dead: new DeadLetters(desk),
      noConsent: html("p", { class: "alarm", role: "alert", hidden: true },
        t("operator.consent.off")),
    };
    const log = section("log", t("operator.log"), html("p", { class: "about" }, t("operator.log.about")),
      html("a", { class: "button", href: `${API}/log.txt`, download: "denseface.log" },
        t("operator.log.download")));
    this.place.replaceChildren(
      html("header", {}, html("h1", {}, t("operator.title")), this.languages(),
        action("logout", t("operator.logout"), () => void this.leave())),
      html("main", {}, sections.noConsent, sections.health.element,
        sections.captures.element,
        html("div", { class: "beside" }, sections.waiting.element, sections.visits.element),
        sections.dead.element,
        html("div", { class: "beside" }, sections.settings.element, log)),
      this.said);
  }

  private languages(): HTMLElement {
    const chosen = html("select", { "aria-label": this.texts.t("operator.language") },
      ...[...this.all].map(([name, texts]) => html("option", { value: name, lang: name,
        selected: name === this.texts.language }, texts.name)));
    chosen.addEventListener("change", () => {
      this.texts = this.all.get(chosen.value) ?? this.texts;
      keepLanguage(chosen.value);
      void this.start();
    });
    return chosen;
  }

  private show(now: Overview): void {
    const { sections } = this;
    if (!sections) return;
    sections.health.show(now);
    sections.waiting.show(now.statistics);
    sections.visits.show(visitFacts(this.texts, now.statistics));
    sections.settings.show(settingFacts(this.texts, now.kiosk, now.status));
    if (sections.noConsent.hidden !== now.kiosk.consent) {
      set(sections.noConsent, { hidden: now.kiosk.consent });
    }
  }

  /** Fetches all anew, and again a little later. */
  private refresh(): Promise<void> {
    window.clearTimeout(this.again);
    this.asking = this.asking.then(() => this.fetch());
    return this.asking;
  }

  private async fetch(): Promise<void> {
    const { sections } = this;
    if (!sections) return;
    try {
      const now = await ask<Overview>("overview");
      this.show(now);
      if (now.status) await Promise.all([sections.captures.fetch(), sections.dead.fetch()]);
      this.place.classList.remove("stale");
    } catch (error) {
      if (error instanceof Refused && error.reason === "login") {
        this.enter(words(this.texts, error));
        return;
      }
      this.place.classList.add("stale");
      this.say(words(this.texts, error));
    }
    if (this.sections === sections) {
      window.clearTimeout(this.again);
      this.again = window.setTimeout(() => void this.refresh(), AGAIN_MS);
    }
  }

  private async act(work: () => Promise<unknown>, done: string): Promise<void> {
    try {
      await work();
      if (done) this.say(done);
    } catch (error) {
      if (error instanceof Refused && error.reason === "login") {
        this.enter(words(this.texts, error));
        return;
      }
      this.say(words(this.texts, error));
    }
    await this.refresh();
  }

  private say(text: string): void {
    window.clearTimeout(this.unsaid);
    write(this.said, text);
    this.unsaid = window.setTimeout(() => write(this.said, ""), SAID_MS);
  }

  private async leave(): Promise<void> {
    window.clearTimeout(this.again);
    this.sections = undefined;
    await this.asking;
    // Pictures on their way would be refused.
    for (const picture of this.place.querySelectorAll("img")) picture.removeAttribute("src");
    try {
      await ask("logout", "POST");
      this.enter();
    } catch (error) {
      this.enter(words(this.texts, error));
    }
  }
}
