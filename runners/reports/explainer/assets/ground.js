// The world as seen so far and as it is, drawn in world metres.

/** Draw the cells that scans have touched up to a step, each larger by `hair`, so that no seams show. */
function drawSeen(ctx, trace, step, colour, hair) {
  const { arrays, starts, head } = trace;
  const [xs, ys, side] = [arrays["seen.x"], arrays["seen.y"], head.cell];
  const until = starts.seen[step + 1];
  ctx.fillStyle = colour;
  for (let i = 0; i < until; i++) ctx.fillRect(xs[i] * side, ys[i] * side, side + hair, side + hair);
}

/** Draw the true world, and its movers at a step. */
function drawTruth(ctx, trace, step, colour, width) {
  const { arrays } = trace;
  const world = trace.world(step);
  const moving = (name, size) => arrays[name].subarray(...trace.span(name, step).map((row) => row * size));
  ctx.fillStyle = ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  for (const discs of [world.circles, moving("discs", 3)]) fillDiscs(ctx, discs);
  ctx.beginPath();
  polygonsInto(ctx, world.corners, world.starts);
  ctx.fill();
  ctx.beginPath();
  for (const edges of [world.segments, moving("edges", 4)]) edgesInto(ctx, edges);
  ctx.stroke();
}

/** Fill discs, rows of x, y, radius. One by one, since one path of them all takes far longer to fill. */
function fillDiscs(ctx, discs) {
  for (let i = 0; i < discs.length; i += 3) {
    ctx.beginPath();
    ctx.arc(discs[i], discs[i + 1], discs[i + 2], 0, 2 * Math.PI);
    ctx.fill();
  }
}

/** Add edges to the path, rows of x0, y0, x1, y1. */
function edgesInto(ctx, edges) {
  for (let i = 0; i < edges.length; i += 4) {
    ctx.moveTo(edges[i], edges[i + 1]);
    ctx.lineTo(edges[i + 2], edges[i + 3]);
  }
}

/** Add polygons to the path. corners: of all; starts: first corner of each. */
function polygonsInto(ctx, corners, starts) {
  for (let k = 0; k + 1 < starts.length; k++) {
    for (let i = starts[k]; i < starts[k + 1]; i++) {
      if (i === starts[k]) ctx.moveTo(corners[2 * i], corners[2 * i + 1]);
      else ctx.lineTo(corners[2 * i], corners[2 * i + 1]);
    }
    ctx.closePath();
  }
}
