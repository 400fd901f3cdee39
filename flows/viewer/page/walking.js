// What a walker stands on and runs into: triangles of the models that are loaded, found by cells of a grid seen from above.

export const EYE_M = 1.7;
// How near a wall lets a walker come; heights over the ground at which it is met; the highest step up, and the deepest down.
const RADIUS_M = 0.45;
const MET_AT_M = [0.7, 1.5];
const STEP_UP_M = 0.6;
const STEP_DOWN_M = 4;
const CELL_M = 4;
const FAR = 1 << 15;

const key = (x, z) => (Math.floor(x / CELL_M) + FAR) * 2 * FAR + Math.floor(z / CELL_M) + FAR;

export class Surroundings {
  constructor() {
    this.models = new Map(); // key -> {corners: nine numbers a triangle, cells: cell -> triangles}
  }

  // Triangles of a model's parts, moved by `at` [x, y, z].
  add(name, parts, at) {
    const corners = new Float32Array(3 * parts.reduce((sum, { triangles }) => sum + triangles.length, 0));
    const cells = new Map();
    let end = 0;
    for (const { position, triangles } of parts) {
      for (let t = 0; t < triangles.length; t += 3) {
        for (let k = 0; k < 9; k++) corners[end + k] = position[3 * triangles[t + Math.floor(k / 3)] + (k % 3)] + at[k % 3];
        const side = (pick, axis) => pick(corners[end + axis], corners[end + 3 + axis], corners[end + 6 + axis]);
        const [west, east, north, south] = [side(Math.min, 0), side(Math.max, 0), side(Math.min, 2), side(Math.max, 2)];
        for (let x = west - RADIUS_M; x < east + RADIUS_M + CELL_M; x += CELL_M) {
          for (let z = north - RADIUS_M; z < south + RADIUS_M + CELL_M; z += CELL_M) {
            const cell = key(x, z);
            if (!cells.has(cell)) cells.set(cell, []);
            cells.get(cell).push(end);
          }
        }
        end += 9;
      }
    }
    this.models.set(name, { corners, cells });
  }

  remove(name) {
    this.models.delete(name);
  }

  // Corners of the triangles in the cell of a place.
  *near(x, z) {
    const cell = key(x, z);
    for (const { corners, cells } of this.models.values()) {
      for (const start of cells.get(cell) || []) yield corners.subarray(start, start + 9);
    }
  }

  // Height of the highest surface below `from` at a place; null where there is none.
  ground(x, z, from = Infinity) {
    let found = null;
    for (const t of this.near(x, z)) {
      const [ax, az, bx, bz] = [t[3] - t[0], t[5] - t[2], t[6] - t[0], t[8] - t[2]];
      const area = ax * bz - az * bx;
      if (Math.abs(area) < 1e-6) continue;
      const u = ((x - t[0]) * bz - (z - t[2]) * bx) / area;
      const v = (ax * (z - t[2]) - az * (x - t[0])) / area;
      if (u < -1e-4 || v < -1e-4 || u + v > 1.0002) continue;
      const height = t[1] + u * (t[4] - t[1]) + v * (t[7] - t[1]);
      if (height <= from && (found === null || height > found)) found = height;
    }
    return found;
  }

  // Where a walker with feet at [x, y, z] comes to who wants to go by (dx, dz): along walls, and no farther than there is ground.
  walk([x, y, z], dx, dz) {
    const steps = Math.max(1, Math.ceil(Math.hypot(dx, dz) / (0.5 * RADIUS_M)));
    for (let step = 0; step < steps; step++) {
      const [toX, toZ] = this.pushed(x + dx / steps, y, z + dz / steps);
      const under = this.ground(toX, toZ, y + STEP_UP_M);
      if (under === null || under < y - STEP_DOWN_M || this.touched(toX, under, toZ)) break;
      [x, y, z] = [toX, under, toZ];
    }
    return [x, y, z];
  }

  // A place moved out of the reach of walls.
  pushed(x, y, z) {
    for (let again = 0; again < 3; again++) {
      const wall = this.nearest(x, y, z);
      if (!wall || wall.away >= RADIUS_M) break;
      const far = wall.away || 1e-6;
      x += ((x - wall.x) / far) * (RADIUS_M - wall.away + 1e-3);
      z += ((z - wall.z) / far) * (RADIUS_M - wall.away + 1e-3);
    }
    return [x, z];
  }

  touched(x, y, z) {
    const wall = this.nearest(x, y, z);
    return wall !== null && wall.away < RADIUS_M - 0.05;
  }

  // The nearest place of a wall at the heights at which it is met.
  nearest(x, y, z) {
    let best = null;
    for (const t of this.near(x, z)) {
      for (const height of MET_AT_M) {
        const cut = crossing(t, y + height);
        if (!cut) continue;
        const [ax, az, bx, bz] = cut;
        const length = (bx - ax) ** 2 + (bz - az) ** 2;
        const share = length ? Math.min(1, Math.max(0, ((x - ax) * (bx - ax) + (z - az) * (bz - az)) / length)) : 0;
        const [px, pz] = [ax + share * (bx - ax), az + share * (bz - az)];
        const away = Math.hypot(x - px, z - pz);
        if (best === null || away < best.away) best = { x: px, z: pz, away };
      }
    }
    return best;
  }
}

// Where a triangle crosses a height: the ends of a line, [x, z, x, z], or null.
function crossing(t, height) {
  const ends = [];
  for (let i = 0; i < 3; i++) {
    const [a, b] = [3 * i, (3 * i + 3) % 9];
    if (t[a + 1] > height !== t[b + 1] > height) {
      const share = (height - t[a + 1]) / (t[b + 1] - t[a + 1]);
      ends.push(t[a] + share * (t[b] - t[a]), t[a + 2] + share * (t[b + 2] - t[a + 2]));
    }
  }
  return ends.length === 4 ? ends : null;
}
