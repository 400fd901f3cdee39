// The blocks of a folder with several, each to be opened.

import { ask, element } from "./elements.js";

const main = document.getElementById("main");
// As on a block's page: the token is kept for this window, and taken out of what the window shows.
const [, page, given] = location.hash.split("/");
if (page === "token") {
  sessionStorage.setItem("token", given);
  history.replaceState(null, "", "./");
}
const token = sessionStorage.getItem("token");
try {
  const { blocks } = await ask("api/blocks");
  main.replaceChildren(
    element("h2", {}, `${blocks.length} blocks`),
    element("p", {}, "Each is corrected by itself; of a city that is cut, corrections of all go to one file."),
    element("ul", {}, ...blocks.map((name, number) => element("li", {}, element("a", { href: `blocks/${number}/${token ? `#/token/${token}` : ""}` }, name)))));
} catch (error) {
  main.replaceChildren(element("p", { class: "failed" }, error.message));
}
