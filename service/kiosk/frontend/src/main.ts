/** Starts the page. */
import { App } from "./app.ts";

const root = document.getElementById("kiosk");
if (root) {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  new App(root, `${scheme}//${location.host}/ws`).start();
}
