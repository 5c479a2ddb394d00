// Numbers as text.

const MINUS = "\u2212";
const DASH = "\u2013";

/** A score or a term: about four digits. */
function number(value) {
  if (value === Infinity) return "∞";
  if (!Number.isFinite(value)) return DASH;
  const digits = Math.abs(value) >= 100 ? 1 : 2;
  return signed(value.toFixed(digits));
}

/** A parameter, exact and as short as possible. */
function parameter(value) {
  return value === Infinity ? "∞" : String(value);
}

/** Metres, to the centimetre. */
function metres(value) {
  return `${signed(value.toFixed(2))} m`;
}

/** Position of a point in the robot frame: "2.31 m away, 14° to the left". */
function whereabouts([x, y]) {
  const bearing = Math.round((Math.atan2(y, x) * 180) / Math.PI);
  const side = bearing === 0 ? "straight ahead" : `${Math.abs(bearing)}° to the ${bearing > 0 ? "left" : "right"}`;
  return `${metres(Math.hypot(x, y))} away, ${side}`;
}

function signed(text) {
  return /^-[0.]*$/.test(text) ? text.slice(1) : text.replace("-", MINUS);
}
