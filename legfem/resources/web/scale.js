// What the page's pictures share: packed numbers, and a scale of colours.
"use strict";
const unpacked = (text, Kind) =>
  new Kind(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const between = (a, b, part) => a + (b - a) * part;
// ColorBrewer's YlGnBu: also a scale of greys, light to dark.
const SCALE = [[255, 255, 217], [199, 233, 180], [127, 205, 187], [65, 182, 196],
  [29, 145, 192], [34, 94, 168], [8, 29, 88]];
const scaled = (share, light = 1) => {
  const at = Math.min(Math.max(share, 0), 1) * (SCALE.length - 1);
  const k = Math.min(Math.floor(at), SCALE.length - 2);
  return `rgb(${SCALE[k].map((v, c) => Math.round(light * between(v, SCALE[k + 1][c], at - k)))})`;
};
