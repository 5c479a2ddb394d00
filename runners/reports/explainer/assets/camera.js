// The part of the plane that the canvas shows.

const AROUND_M = 1.5; // shown around the drive
const ZOOM = [4, 800]; // pixels per metre

/** Shows the map, or the robot frame with the heading up. The user can pan and zoom. */
class Camera {
  constructor() {
    this.follow = false;
    this.touched = false; // moved by the user, so not fitted again automatically
    this.width = this.height = 1;
    Object.assign(this, { x: 0, y: 0, scale: 50, angle: 0 });
    this.aim({ x: 0, y: 0, yaw: 0 });
  }

  /** Set the robot's pose, which the view follows with the heading up. */
  aim(pose) {
    const turn = this.follow ? Math.PI / 2 - pose.yaw : this.angle;
    const [cos, sin] = [this.scale * Math.cos(turn), this.scale * Math.sin(turn)];
    this.m = [cos, -sin, -sin, -cos, 0, 0];
    const [x, y] = this.follow ? [pose.x, pose.y] : [this.x, this.y];
    const [dx, dy] = this.follow ? [this.x * this.scale, -this.y * this.scale] : [0, 0];
    this.m[4] = this.width / 2 - dx - (this.m[0] * x + this.m[2] * y);
    this.m[5] = this.height / 2 - dy - (this.m[1] * x + this.m[3] * y);
  }

  /** A point of the world on the canvas [px]. */
  place(x, y) {
    const m = this.m;
    return [m[0] * x + m[2] * y + m[4], m[1] * x + m[3] * y + m[5]];
  }

  /** The point of the world at a place on the canvas. */
  locate(px, py) {
    const m = this.m;
    const [dx, dy, scale] = [px - m[4], py - m[5], m[0] * m[3] - m[1] * m[2]];
    return [(m[3] * dx - m[2] * dy) / scale, (m[0] * dy - m[1] * dx) / scale];
  }

  /** Direction of a world heading on the canvas [rad], clockwise from rightwards. */
  direction(yaw) {
    return Math.atan2(this.m[1] * Math.cos(yaw) + this.m[3] * Math.sin(yaw),
      this.m[0] * Math.cos(yaw) + this.m[2] * Math.sin(yaw));
  }

  /** Move the view by pixels. */
  pan(dx, dy) {
    this.touched = true;
    const turn = this.follow ? 0 : this.angle;
    const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
    this.x -= (cos * dx - sin * dy) / this.scale;
    this.y -= (-sin * dx - cos * dy) / this.scale;
  }

  /** Zoom about the point (px, py), which stays in place. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const scale = Math.min(Math.max(this.scale * factor, ZOOM[0]), ZOOM[1]);
    const [dx, dy] = [px - this.width / 2, py - this.height / 2];
    this.pan(-dx, -dy);
    this.scale = scale;
    this.pan(dx, dy);
  }

  /** Show the whole drive, rotated if it then fills the canvas better; or the robot's surroundings. */
  fit(box, reach) {
    this.touched = false;
    if (this.follow) {
      Object.assign(this, { x: 0, y: 0, scale: Math.min(this.width, this.height) / (2.1 * reach) });
      return;
    }
    const [wide, high] = [box[2] - box[0], box[3] - box[1]];
    const upright = Math.min(this.width / wide, this.height / high);
    const turned = Math.min(this.width / high, this.height / wide);
    const turn = turned > 1.25 * upright;
    this.angle = turn ? -Math.PI / 2 : 0;
    this.scale = turn ? turned : upright;
    [this.x, this.y] = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
  }
}

/** The box of the map [x0, y0, x1, y1]: the drive and what was seen near it. */
function extent(trace) {
  const { pose } = trace.arrays;
  const { start, goal, goal_tolerance: tolerance } = trace.head;
  const busy = [start, ...[-1, 1].map((side) => goal.map((value) => value + side * tolerance))];
  for (let i = 0; i < pose.length; i += 3) busy.push([pose[i], pose[i + 1]]);
  const near = bounds(busy, AROUND_M);
  const seen = Array.from(trace.arrays["seen.x"], (x, i) => [x, trace.arrays["seen.y"][i]]);
  const solid = bounds([...seen.map(([x, y]) => [x * trace.head.cell, y * trace.head.cell])], 0.3);
  const least = bounds(busy, 0.6);
  return least.map((edge, i) => (i < 2 ? Math.min(edge, Math.max(near[i], solid[i]))
    : Math.max(edge, Math.min(near[i], solid[i]))));
}

/** The largest distance of a candidate; a default without candidates [m]. */
function reachOf(trace) {
  if (!trace.explained) return 4;
  const [xs, ys] = [trace.arrays["candidates.x"], trace.arrays["candidates.y"]];
  let far = 1000;
  for (let i = 0; i < xs.length; i++) far = Math.max(far, Math.hypot(xs[i], ys[i]));
  return far / 1000;
}

/** [x0, y0, x1, y1] of points, with a margin. */
function bounds(points, margin) {
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [x, y] of points) {
    box[0] = Math.min(box[0], x - margin);
    box[1] = Math.min(box[1], y - margin);
    box[2] = Math.max(box[2], x + margin);
    box[3] = Math.max(box[3], y + margin);
  }
  return box;
}
