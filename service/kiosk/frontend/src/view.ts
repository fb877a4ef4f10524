/** The page of `denseface view`. */
import { ViewPage } from "./view/page.ts";

const root = document.getElementById("view");
if (root) await new ViewPage(root).start();
