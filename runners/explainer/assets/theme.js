// Light and dark.

const NAMES = ["ink", "muted", "paper", "line", "edge", "accent", "seen", "truth", "chosen", "old", "other", "goal"];

/** The theme's colours as the canvas takes them. */
function themeColours() {
  const probe = document.createElement("span");
  document.body.append(probe);
  const found = {};
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    found[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return found;
}

/** Light or dark, whichever it is not now; kept where the browser keeps anything. */
function switchTheme() {
  const root = document.documentElement;
  root.dataset.theme = isDark() ? "light" : "dark";
  try {
    localStorage.setItem("lme-theme", root.dataset.theme);
  } catch {
    // A sandboxed frame keeps nothing.
  }
}

function isDark() {
  const { theme } = document.documentElement.dataset;
  return theme ? theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

/** Take the theme that was kept. */
function recallTheme() {
  try {
    const kept = localStorage.getItem("lme-theme");
    if (kept) document.documentElement.dataset.theme = kept;
  } catch {
    // As above.
  }
}

function whenThemeChanges(action) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", action);
  new MutationObserver(action).observe(document.documentElement, { attributeFilter: ["data-theme"] });
}
