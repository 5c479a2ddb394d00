// Keys, unless the focused element uses them itself.

const STEP_M = 0.1;
const FINE_M = 0.01;
const TURN_DEG = 15;
const TOOL_KEYS = { v: "move", 1: "wall", 2: "disc", 3: "box", 4: "person", 5: "erase" };
const AHEAD_M = 1.5; // in front of the robot, where a key draws

/** Call what keys stand for. */
function listenToKeys(app) {
  document.addEventListener("keydown", (event) => {
    const { target, key } = event;
    if ((event.ctrlKey || event.metaKey) && key.toLowerCase() === "z" && !usesKey(target, key)) {
      app.connection.ask({ type: event.shiftKey ? "redo" : "undo" });
      event.preventDefault();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey || usesKey(target, key)) return;
    if (/^\S$/.test(key) && !byId("shortcuts").checked) return;
    if (pressed(app, key, event.shiftKey)) event.preventDefault();
  });
}

/** Do what a key stands for; false if it does nothing here. */
function pressed(app, key, shift) {
  if (app.selected && onSelected(app, key, shift)) return true;
  const stride = shift ? 10 : 1;
  const actions = {
    " ": () => app.play(),
    ArrowLeft: () => back(app, stride),
    ArrowRight: () => app.forward(stride),
    ArrowUp: () => app.thoughts.rank(-stride),
    ArrowDown: () => app.thoughts.rank(stride),
    Home: () => back(app, Infinity),
    End: () => app.go(app.last),
    Escape: () => app.select(null),
    r: () => app.reset(),
    t: () => selectNext(app),
    i: () => insert(app),
    l: () => app.look((app.looked ?? 0) + 1),
    "+": () => app.zoom(1.25),
    "=": () => app.zoom(1.25),
    "-": () => app.zoom(0.8),
    0: () => app.fit(),
    w: () => app.pan(0, 40),
    a: () => app.pan(40, 0),
    s: () => app.pan(0, -40),
    d: () => app.pan(-40, 0),
    f: () => byId("follow").click(),
    m: () => byId("layer-truth").click(),
    "?": () => byId("help").showModal(),
  };
  const action = key in TOOL_KEYS ? () => app.choose(TOOL_KEYS[key]) : actions[key];
  if (!action) return false;
  action();
  return true;
}

/** Keys that move, turn and erase what is selected; false for others. */
function onSelected(app, key, shift) {
  const stride = shift ? FINE_M : STEP_M;
  const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }; // on the screen
  const turns = { "[": TURN_DEG, "]": -TURN_DEG };
  const gesture = app.tools.gesture();
  const part = app.selectedPart;
  const pose = app.views[0].shownPose;
  if (key in moves) {
    const [dx, dy] = inWorld(app.views[0].scene.camera, moves[key], stride);
    if (part) app.put(part.name, part.kind, movedBy(part.entry, dx, dy), gesture);
    else if (app.selected === "goal") app.placeGoal([app.world.goal[0] + dx, app.world.goal[1] + dy], gesture);
    else if (app.selected === "robot") app.placeRobot([pose.x + dx, pose.y + dy, pose.yaw], gesture);
    return true;
  }
  if (key in turns) {
    if (part) app.put(part.name, part.kind, turnedBy(part.entry, turns[key]), gesture);
    else if (app.selected === "robot") app.placeRobot([pose.x, pose.y, pose.yaw + (turns[key] * Math.PI) / 180], gesture);
    return true;
  }
  if ((key === "Delete" || key === "Backspace") && part) {
    app.erase(part.name, gesture);
    return true;
  }
  return false;
}

/** A direction on the screen as one in the world, of a length [m]. */
function inWorld(camera, [sx, sy], length) {
  const [[x0, y0], [x1, y1]] = [camera.locate(0, 0), camera.locate(sx, sy)];
  const scale = length / Math.hypot(x1 - x0, y1 - y0);
  return [(x1 - x0) * scale, (y1 - y0) * scale];
}

function back(app, steps) {
  app.play(false);
  app.go(app.step - steps);
}

/** Select the robot, the goal, then one part of the world after the other. */
function selectNext(app) {
  const names = ["robot", "goal", ...app.world.parts.map(({ name }) => name)];
  app.select(names[(names.indexOf(app.selected) + 1) % names.length]);
}

/** Draw with the tool in front of the robot. */
function insert(app) {
  const kind = DRAWS[app.tool];
  if (!kind) return;
  const { x, y, yaw } = app.views[0].shownPose;
  const at = [x + AHEAD_M * Math.cos(yaw), y + AHEAD_M * Math.sin(yaw)];
  const name = app.newName();
  app.put(name, kind, drawn(kind, at, at), app.tools.gesture());
  app.choose("move");
  app.select(name);
}

/** Whether the focused element uses this key itself. */
function usesKey(element, key) {
  if (element.closest("dialog")) return true;
  if (element.matches("input[type=text], input[type=number], textarea, select")) return true;
  if (element.matches("input[type=range]")) return key.startsWith("Arrow") || key === "Home" || key === "End";
  return key === " " && element.matches("button, summary, input, a");
}
