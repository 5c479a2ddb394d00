// What can be drawn: where it is, its handles, and how it moves. Entries are those of a shape file.

const EDGE_M = 0.05; // least size of what is drawn
const NEW = { thickness: 0.1, radius: 0.3, side: 0.6, person: { radius: 0.25, speed: 1, repeat: "back_and_forth" } };
const rounded = (value) => Math.round(value * 1000) / 1000;
const point = (x, y) => [rounded(x), rounded(y)];

/** A new entry, drawn from one point to another. */
function drawn(kind, [x0, y0], [x1, y1]) {
  const far = Math.hypot(x1 - x0, y1 - y0) >= EDGE_M;
  if (kind === "walls") return { points: [point(x0, y0), far ? point(x1, y1) : point(x0 + 1, y0)], thickness: NEW.thickness };
  if (kind === "circles") return { centre: point(x0, y0), radius: rounded(far ? Math.hypot(x1 - x0, y1 - y0) : NEW.radius) };
  if (kind === "movers") return { ...NEW.person, path: far ? [point(x0, y0), point(x1, y1)] : [point(x0, y0)] };
  const size = [Math.abs(x1 - x0), Math.abs(y1 - y0)].map((side) => rounded(far ? Math.max(side, EDGE_M) : NEW.side));
  return { centre: far ? point((x0 + x1) / 2, (y0 + y1) / 2) : point(x0, y0), size, yaw_deg: 0 };
}

/** The entry, moved by (dx, dy). */
function movedBy(entry, dx, dy) {
  const move = ([x, y, ...rest]) => [...point(x + dx, y + dy), ...rest];
  const moved = { ...entry };
  for (const key of ["centre", "trigger"]) if (entry[key]) moved[key] = move(entry[key]);
  for (const key of ["points", "path"]) if (entry[key]) moved[key] = entry[key].map(move);
  return moved;
}

/** The middle of an entry. */
function middle(entry) {
  if (entry.centre) return entry.centre;
  const points = entry.points ?? entry.path;
  return [0, 1].map((axis) => points.reduce((sum, place) => sum + place[axis], 0) / points.length);
}

/** The entry, turned about its middle by an angle [deg]. */
function turnedBy(entry, degrees) {
  if (entry.size) return { ...entry, yaw_deg: rounded(((entry.yaw_deg ?? 0) + degrees) % 360) };
  const [cx, cy] = middle(entry);
  const [cos, sin] = [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
  const turn = ([x, y, ...rest]) => [...point(cx + cos * (x - cx) - sin * (y - cy), cy + sin * (x - cx) + cos * (y - cy)), ...rest];
  const turned = { ...entry };
  for (const key of ["points", "path"]) if (entry[key]) turned[key] = entry[key].map(turn);
  return turned;
}

/** Corners of a box. */
function cornersOf({ centre: [cx, cy], size: [wide, high], yaw_deg: yaw = 0 }) {
  const [cos, sin] = [Math.cos((yaw * Math.PI) / 180), Math.sin((yaw * Math.PI) / 180)];
  return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => {
    const [x, y] = [(a * wide) / 2, (b * high) / 2];
    return [cx + cos * x - sin * y, cy + sin * x + cos * y];
  });
}

/** Places to drag, each with what the entry becomes when it is dragged to a point. */
function handlesOf(kind, entry) {
  if (kind === "circles") {
    const [x, y] = entry.centre;
    return [{ at: [x + entry.radius, y], to: (place) => ({ ...entry, radius: rounded(Math.max(distance(place, entry.centre), EDGE_M)) }) }];
  }
  if (kind === "boxes") return boxHandles(entry);
  const key = entry.points ? "points" : "path";
  return entry[key].map((place, i) => ({
    at: place,
    to: ([x, y]) => ({ ...entry, [key]: entry[key].map((old, k) => (k === i ? [...point(x, y), ...old.slice(2)] : old)) }),
  }));
}

function boxHandles(entry) {
  const corners = cornersOf(entry);
  const [cx, cy] = entry.centre;
  const yaw = ((entry.yaw_deg ?? 0) * Math.PI) / 180;
  const reach = entry.size[0] / 2 + 0.35;
  const turning = {
    at: [cx + reach * Math.cos(yaw), cy + reach * Math.sin(yaw)],
    to: ([x, y]) => ({ ...entry, yaw_deg: Math.round((Math.atan2(y - cy, x - cx) * 180) / Math.PI) }),
    turns: true,
  };
  return [turning, ...corners.map((corner, i) => ({ at: corner, to: (place) => stretched(entry, corners[(i + 2) % 4], place) }))];
}

/** A box between a corner that stays and one that is dragged. */
function stretched(entry, [x0, y0], [x1, y1]) {
  const yaw = ((entry.yaw_deg ?? 0) * Math.PI) / 180;
  const [dx, dy] = [x1 - x0, y1 - y0];
  const along = Math.abs(Math.cos(yaw) * dx + Math.sin(yaw) * dy);
  const across = Math.abs(Math.cos(yaw) * dy - Math.sin(yaw) * dx);
  return { ...entry, centre: point((x0 + x1) / 2, (y0 + y1) / 2), size: [along, across].map((side) => rounded(Math.max(side, EDGE_M))) };
}

/** Distance from a point to a part of the world [m]; 0 inside. */
function away(kind, entry, place) {
  if (kind === "circles") return Math.max(distance(place, entry.centre) - entry.radius, 0);
  if (kind === "boxes" || kind === "polygons") {
    const corners = kind === "boxes" ? cornersOf(entry) : entry.points;
    return within(corners, place) ? 0 : toLine([...corners, corners[0]], place);
  }
  const points = entry.points ?? entry.path;
  return Math.max(toLine(points, place) - (entry.thickness ?? 2 * (entry.radius ?? 0)) / 2, 0);
}

function distance([x0, y0], [x1, y1]) {
  return Math.hypot(x1 - x0, y1 - y0);
}

/** Distance from a point to a line of several points. */
function toLine(points, place) {
  let nearest = distance(points[0], place);
  for (let i = 0; i + 1 < points.length; i++) {
    const [[x0, y0], [x1, y1]] = [points[i], points[i + 1]];
    const [dx, dy] = [x1 - x0, y1 - y0];
    const square = dx * dx + dy * dy;
    const part = square ? Math.min(Math.max(((place[0] - x0) * dx + (place[1] - y0) * dy) / square, 0), 1) : 0;
    nearest = Math.min(nearest, distance(place, [x0 + part * dx, y0 + part * dy]));
  }
  return nearest;
}

function within(corners, [x, y]) {
  let inside = false;
  corners.forEach(([x0, y0], i) => {
    const [x1, y1] = corners[(i + 1) % corners.length];
    if (y0 > y !== y1 > y && x < x0 + ((x1 - x0) * (y - y0)) / (y1 - y0)) inside = !inside;
  });
  return inside;
}

/** Add the outline of a part to the path of a canvas. @param {function} place - from metres to pixels */
function outlineInto(ctx, kind, entry, place, scale) {
  if (kind === "circles") {
    const [x, y] = place(...entry.centre);
    ctx.moveTo(x + entry.radius * scale, y);
    ctx.arc(x, y, entry.radius * scale, 0, 2 * Math.PI);
    return;
  }
  const closed = kind === "boxes" || kind === "polygons";
  const points = kind === "boxes" ? cornersOf(entry) : entry.points ?? entry.path;
  points.forEach((at, i) => (i ? ctx.lineTo(...place(at[0], at[1])) : ctx.moveTo(...place(at[0], at[1]))));
  if (closed) ctx.closePath();
  if (kind === "movers" && entry.radius) {
    const [x, y] = place(points[0][0], points[0][1]);
    ctx.moveTo(x + entry.radius * scale, y);
    ctx.arc(x, y, entry.radius * scale, 0, 2 * Math.PI);
  }
}
