// Ranked completions of a facade as thumbnails; choosing one is a step of the editor, undone and saved as others are.

import { element, visible } from "./elements.js";

export class Completions {
  // asked: completes boxes as `Editor.observations` has them, at the server.
  constructor(editor, asked) {
    Object.assign(this, { editor, asked, choices: [], known: new WeakMap() });
    this.button = element("button", { type: "button", id: "complete", onclick: () => this.ask() }, "Complete what is hidden");
    this.told = element("p", { role: "status", id: "completed" });
    this.list = element("div", { class: "completions" });
    this.part = element("fieldset", { class: "controls" }, element("legend", {}, "Completions"), this.button, this.told, this.list);
  }

  async ask() {
    const { editor } = this;
    const { boxes, elements } = editor;
    this.button.disabled = true;
    this.say("What is hidden is being completed…");
    try {
      const { kept, completions } = await this.asked(editor.observations());
      const stay = kept.map((number) => elements[number]);
      this.choices = completions.map(({ score, elements: added }) => {
        const boxes = added.map(([label, x0, y0, x1, y1]) => ({ label, x0, y0, x1, y1 }));
        boxes.forEach((box) => editor.found.add(box));
        return { score, added: boxes, elements: [...stay, ...boxes] };
      });
      this.known = new WeakMap([[boxes, null]]); // boxes -> the completion that they are
      this.list.replaceChildren(...this.choices.map((choice, number) => this.thumbnail(choice, number)));
      this.say("");
    } catch (error) {
      this.choices = [];
      this.list.replaceChildren();
      this.say(error.message, true);
    }
    this.button.disabled = false;
    this.changed();
  }

  say(text, failed = false) {
    this.told.textContent = visible(text);
    this.told.classList.toggle("failed", failed);
  }

  thumbnail(choice, number) {
    const { editor } = this;
    const [width, height] = editor.size;
    const rect = (box, added) => element("rect", {
      class: added ? "box added" : "box", x: box.x0, y: box.y0, width: box.x1 - box.x0, height: box.y1 - box.y0, stroke: editor.colour(box.label), fill: editor.colour(box.label),
    });
    const counts = {};
    for (const { label } of choice.added) counts[label] = (counts[label] ?? 0) + 1;
    const what = Object.entries(counts).map(([label, count]) => `${count} ${label}`).join(", ") || "nothing";
    const drawn = element("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" },
      element("image", { width, height, preserveAspectRatio: "none", href: editor.image.getAttribute("href") }),
      ...choice.elements.map((box) => rect(box, choice.added.includes(box))));
    choice.button = element("button", { type: "button", class: "completion", onclick: () => this.choose(choice) },
      drawn, element("span", {}, `${number + 1}: adds ${what}`), element("span", { class: "how" }, `score ${choice.score.toFixed(3)}`));
    return choice.button;
  }

  choose(choice) {
    this.editor.complete(choice.elements);
    this.known.set(this.editor.boxes, choice);
    this.changed();
  }

  // A completion replaces the boxes that it was made of, or another completion of them; after any other step they are completed again.
  changed() {
    const { boxes } = this.editor;
    if (!this.choices.length) return;
    for (const choice of this.choices) {
      choice.button.disabled = !this.known.has(boxes);
      choice.button.setAttribute("aria-pressed", String(this.known.get(boxes) === choice));
    }
    this.button.textContent = "Complete again";
    this.say(this.known.has(boxes) ? "What is seen, drawn or moved here stays; filled boxes are added." : "The boxes are others now: complete again.");
  }
}
