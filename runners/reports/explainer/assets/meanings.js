// Meanings of criteria and parameters, shown when a name is pointed at, tapped or focused.

const WORDS = /([\p{L}\p{N}_]+)/u;
const PARAMETERS = {
  S: "The score: the sum of the weighted terms.",
  d1: "Reached: an old subgoal nearer than this [m] is replaced.",
  d2: "Clearly better: a new subgoal that scores more than this higher replaces the old one.",
};

class Meanings {
  /**
   * @param {HTMLElement} bubble - shows the meaning of one name
   * @param {HTMLElement} list - gets all names with their meanings
   * @param {Object<string, string>} about - what each criterion means
   */
  constructor(bubble, list, about) {
    this.bubble = bubble;
    this.texts = { ...about, ...PARAMETERS };
    for (const [name, text] of Object.entries(this.texts)) {
      list.append(named("dt", name), Object.assign(named("dd", text), { id: `about-${name}` }));
    }
    document.addEventListener("pointerover", ({ target }) => {
      if (!bubble.contains(target)) this.#show(target.closest("[data-name]:not(input)") ?? focusedName());
    });
    document.addEventListener("focusin", () => focusedName() && this.#show(focusedName()));
    document.addEventListener("focusout", ({ target }) => target === this.shown && this.#show(null));
    document.addEventListener("keydown", ({ key }) => key === "Escape" && this.#show(null));
    document.addEventListener("scroll", () => this.#place(), { capture: true, passive: true });
  }

  /** Make an element explain a name, also to a screen reader. */
  explain(element, name) {
    element.dataset.name = name;
    element.setAttribute("aria-describedby", `about-${name}`);
    return element;
  }

  /** A name that can be pointed at, tapped and focused. */
  button(name) {
    return this.explain(Object.assign(named("button", name), { type: "button", className: "name" }), name);
  }

  /** Write a text with its names as buttons; keep the focus inside it. */
  write(place, text) {
    if (place.textContent === text) return;
    const hadFocus = place.contains(document.activeElement);
    const parts = text.split(WORDS).map((part) => (Object.hasOwn(this.texts, part) ? this.button(part) : part));
    place.replaceChildren(...parts);
    if (hadFocus) (place.querySelector("button") ?? place).focus();
    else this.#place();
  }

  #show(element) {
    this.shown = element;
    this.bubble.textContent = element ? this.texts[element.dataset.name] : "";
    this.#place();
  }

  /** Place the bubble below the name, or above it if there is no room. */
  #place() {
    this.bubble.hidden = !this.shown?.isConnected;
    if (this.bubble.hidden) return;
    const { left, top, bottom } = this.shown.getBoundingClientRect();
    const { width, height } = this.bubble.getBoundingClientRect();
    this.bubble.style.left = `${Math.max(0, Math.min(left, document.documentElement.clientWidth - width))}px`;
    this.bubble.style.top = `${bottom + height <= innerHeight ? bottom : top - height}px`;
  }
}

/** The name with the keyboard focus; null for none. */
function focusedName() {
  const { activeElement } = document;
  return activeElement?.matches("[data-name]:focus-visible") ? activeElement : null;
}

function named(tag, text) {
  return Object.assign(document.createElement(tag), { textContent: text });
}
