/** The operator's page: `/operator`. */
import { chooseTexts } from "./operator/languages.ts";
import { OperatorPage } from "./operator/page.ts";

const place = document.getElementById("operator");
if (place) {
  const page = new OperatorPage(place, await chooseTexts());
  await page.start();
}
