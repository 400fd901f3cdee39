// Boxes and distances on the plane of the map.

export const boxOf = (points) => {
  const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
};
export const unite = (boxes) => [0, 1, 2, 3].map((side) => (side < 2 ? Math.min : Math.max)(...boxes.map((box) => box[side])));

// Distance from a place to a line of two points.
export function distance([x, y], [[x1, y1], [x2, y2]]) {
  const length = (x2 - x1) ** 2 + (y2 - y1) ** 2;
  const share = length ? Math.min(1, Math.max(0, ((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / length)) : 0;
  return Math.hypot(x - x1 - share * (x2 - x1), y - y1 - share * (y2 - y1));
}

// Where the middle of a line of two points is at a street: metres along it, beyond its nearest part's ends too, and on which side.
export function placeAt(street, [from, to]) {
  const [x, y] = [0, 1].map((axis) => (from[axis] + to[axis]) / 2);
  let [best, before] = [{ away: Infinity, along: 0, beyond: 0, left: false }, 0];
  street.slice(1).forEach(([x1, y1], index) => {
    const [[x0, y0], away] = [street[index], distance([x, y], street.slice(index, index + 2))];
    const length = Math.hypot(x1 - x0, y1 - y0);
    const beyond = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length;
    if (length && away < best.away) best = { away, along: before + Math.min(length, Math.max(0, beyond)), beyond, left: (x1 - x0) * (y - y0) > (y1 - y0) * (x - x0) };
    before += length;
  });
  return best;
}
