// Keys, unless the focused element uses them itself.

/** Do what a key stands for. shift: whether it is held. False if the key does nothing here. */
function pressed(app, key, shift) {
  const { playback } = app;
  const stride = shift ? 10 : 1;
  const actions = {
    ArrowLeft: () => playback.go(playback.step - stride),
    ArrowRight: () => playback.go(playback.step + stride),
    Home: () => playback.go(0),
    End: () => playback.go(playback.last),
    ArrowUp: () => app.rank(-stride),
    ArrowDown: () => app.rank(stride),
    " ": () => playback.toggle(),
    Escape: () => app.pick(null),
    n: () => app.jump(1),
    p: () => app.jump(-1),
    "+": () => app.zoom(1.25),
    "=": () => app.zoom(1.25),
    "-": () => app.zoom(0.8),
    0: () => app.fit(),
    w: () => app.pan(0, 40),
    a: () => app.pan(40, 0),
    s: () => app.pan(0, -40),
    d: () => app.pan(-40, 0),
    f: () => app.click("follow"),
    m: () => app.click("truth"),
    "?": () => app.click("help-open"),
  };
  if (!(key in actions)) return false;
  return actions[key]() !== false;
}

/** Whether the focused element uses this key itself. */
function usesKey(element, key) {
  if (element.closest("dialog")) return true;
  if (element.matches("input[type=text], select")) return true;
  if (element.matches("input[type=range]")) return key.startsWith("Arrow") || key === "Home" || key === "End";
  return key === " " && element.matches("button, summary, input, a");
}

/** Call `pressed` for keys. */
function listenToKeys(app) {
  document.addEventListener("keydown", (event) => {
    const { target, key } = event;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (/^\S$/.test(key) && !app.shortcuts) return;
    if (target.matches("#step") && event.shiftKey && key.startsWith("Arrow")) {
      const forward = key === "ArrowRight" || key === "ArrowUp";
      app.playback.go(app.playback.step + (forward ? 10 : -10));
      event.preventDefault();
    } else if (!usesKey(target, key) && pressed(app, key, event.shiftKey)) event.preventDefault();
  });
}
