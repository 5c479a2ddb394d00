// Colours: viridis for values (https://bids.github.io/colormap/), Okabe and Ito's for sectors and marks.

const VIRIDIS = [
  "440154", "482475", "414487", "355f8d", "2a788e", "21918c", "22a884", "44bf70", "7ad151", "bddf26", "fde725",
].map((hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16)));

const SECTORS = ["#e69f00", "#56b4e9", "#d55e00", "#cc79a7"];
const PERSON = "#cc79a7";
const CLIP = [0.05, 0.95]; // as in the paper's figures: a few extremes would use up the scale

/** Colour of a value between 0 and 1. */
function viridis(share) {
  const place = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1);
  const below = Math.min(Math.floor(place), VIRIDIS.length - 2);
  const part = place - below;
  const mix = VIRIDIS[below].map((value, i) => Math.round(value + part * (VIRIDIS[below + 1][i] - value)));
  return `rgb(${mix.join(",")})`;
}

const SHADES = Array.from({ length: 256 }, (_, i) => viridis(i / 255));

/**
 * The ends of the scale, and whether any value shown lies below or above them.
 * @param {ArrayLike<number>} counted - values that set the ends
 * @param {ArrayLike<number>} shown - values that are coloured
 * @returns {{low: number, high: number, below: boolean, above: boolean}}
 */
function scaleOf(counted, shown) {
  const sorted = Float64Array.from(counted).sort();
  const [low, high] = CLIP.map((share) => percentile(sorted, share));
  return { low, high, below: shown.some((value) => value < low), above: shown.some((value) => value > high) };
}

/** Colour of a value on a scale; the middle colour if the scale has no width. */
function shade(value, { low, high }) {
  const share = high > low ? (value - low) / (high - low) : 0.5;
  return SHADES[Math.round(Math.min(Math.max(share, 0), 1) * 255)];
}

/** Colour of sector k of `count` around the robot. Neighbours differ; the last is a neighbour of the first. */
function sectorColour(k, count) {
  const turn = k % SECTORS.length;
  const meetsItself = k === count - 1 && count > 1 && turn === 0;
  return SECTORS[meetsItself ? 2 : turn];
}
