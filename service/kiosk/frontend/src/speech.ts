/** Reading aloud: off until it is asked for. */

/** Speaks by the browser's voices. */
export class Speech {
  private language = "en";
  private isOn = false;

  constructor() {
    // A browser loads its voices when they are first asked for.
    this.voice();
  }

  get on(): boolean {
    return this.isOn;
  }

  /** Turned on or off; gives false where there is no voice of the language: it stays off. */
  turn(on: boolean): boolean {
    if (!on) globalThis.speechSynthesis?.cancel();
    this.isOn = on && this.voice() !== undefined;
    return this.isOn === on;
  }

  /** The language from now on; silent where it has no voice, which `turn` tells of. */
  use(language: string): boolean {
    this.language = language;
    return !this.isOn || this.turn(true);
  }

  /** Says a text, instead of what is being said. */
  say(text: string): void {
    const voice = this.voice();
    if (!this.isOn || !voice || text === "") return;
    speechSynthesis.cancel();
    const said = new SpeechSynthesisUtterance(text);
    said.voice = voice;
    said.lang = voice.lang;
    speechSynthesis.speak(said);
  }

  private voice(): SpeechSynthesisVoice | undefined {
    const voices = globalThis.speechSynthesis?.getVoices() ?? [];
    const fitting = voices.filter((voice) =>
      voice.lang.toLowerCase().replace("_", "-").split("-")[0] === this.language.split("-")[0]);
    // One that works with no internet first.
    return fitting.find((voice) => voice.localService) ?? fitting[0];
  }
}
