// Shapes on a canvas, in pixels.

/** Path of a five-pointed star. */
function starPath(ctx, x, y, radius) {
  ctx.beginPath();
  for (let i = 0; i < 10; i++) {
    const [r, angle] = [i % 2 ? radius * 0.42 : radius, (Math.PI * i) / 5 - Math.PI / 2];
    ctx.lineTo(x + r * Math.cos(angle), y + r * Math.sin(angle));
  }
  ctx.closePath();
}

/** Path of a square that stands on a corner. */
function diamondPath(ctx, x, y, radius) {
  ctx.beginPath();
  for (const [dx, dy] of [[0, -1], [1, 0], [0, 1], [-1, 0]]) ctx.lineTo(x + dx * radius, y + dy * radius);
  ctx.closePath();
}

/** Path of a circle. */
function circlePath(ctx, x, y, radius) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
}

/** Two short crossed strokes. */
function cross(ctx, x, y, radius, colour, width) {
  ctx.lineWidth = width;
  ctx.strokeStyle = colour;
  ctx.beginPath();
  for (const side of [-1, 1]) {
    ctx.moveTo(x - radius, y - side * radius);
    ctx.lineTo(x + radius, y + side * radius);
  }
  ctx.stroke();
}

/** A straight line, optionally dashed. */
function line(ctx, [x0, y0], [x1, y1], colour, width, dash = []) {
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.setLineDash(dash);
  ctx.beginPath();
  ctx.moveTo(x0, y0);
  ctx.lineTo(x1, y1);
  ctx.stroke();
  ctx.setLineDash([]);
}

/** Text with an outline in the background colour. */
function label(ctx, text, x, y, colour, ground) {
  ctx.font = "600 13px system-ui, sans-serif";
  ctx.textBaseline = "middle";
  ctx.lineJoin = "round";
  ctx.lineWidth = 4;
  ctx.strokeStyle = ground;
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour;
  ctx.fillText(text, x, y);
}

/** Fill and outline the current path. */
function paint(ctx, fill, rim, width = 1.5) {
  if (fill) {
    ctx.fillStyle = fill;
    ctx.fill();
  }
  ctx.strokeStyle = rim;
  ctx.lineWidth = width;
  ctx.stroke();
}
