// Light and dark theme.

const NAMES = ["ink", "muted", "paper", "line", "edge", "accent", "seen", "truth", "chosen", "old", "other", "goal"];

/** The theme's colours, for the canvas. */
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

/** Switch between light and dark; the browser remembers the theme if it can. */
function switchTheme() {
  const root = document.documentElement;
  root.dataset.theme = isDark() ? "light" : "dark";
  try {
    localStorage.setItem("lme-theme", root.dataset.theme);
  } catch {
    // A sandboxed frame has no storage.
  }
}

function isDark() {
  const { theme } = document.documentElement.dataset;
  return theme ? theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

/** Restore the remembered theme. */
function recallTheme() {
  try {
    const kept = localStorage.getItem("lme-theme");
    if (kept) document.documentElement.dataset.theme = kept;
  } catch {
    // No storage, as above.
  }
}

function whenThemeChanges(action) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", action);
  new MutationObserver(action).observe(document.documentElement, { attributeFilter: ["data-theme"] });
}
