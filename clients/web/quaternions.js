// Vectors [x, y, z] and unit quaternions [x, y, z, w].
export const add = (a, b) => a.map((x, i) => x + b[i]);
export const sub = (a, b) => a.map((x, i) => x - b[i]);
export const times = (s, a) => a.map((x) => s * x);
export const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
export const norm = (a) => Math.sqrt(dot(a, a));
export const unit = (a) => times(1 / Math.max(norm(a), 1e-12), a);
export const conjugate = ([x, y, z, w]) => [-x, -y, -z, w];

export function cross([ax, ay, az], [bx, by, bz]) {
  return [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
}

/** The rotation `b` followed by `a`. */
export function multiply([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

export function rotate(q, v) {
  const t = times(2, cross(q, v));
  return add(add(v, times(q[3], t)), cross(q, t));
}

/** The shortest rotation from one direction to another. */
export function fromTo(start, end) {
  const [a, b] = [unit(start), unit(end)];
  const w = 1 + dot(a, b);
  if (w < 1e-6) return unit([...cross(a, Math.abs(a[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0]), 0]);
  return unit([...cross(a, b), w]);
}

/** The rotation that brings points nearest to others (Horn's method). */
export function bestRotation(from, to) {
  const s = (i, j) => from.reduce((sum, point, k) => sum + point[i] * to[k][j], 0);
  const [xx, yy, zz] = [s(0, 0), s(1, 1), s(2, 2)];
  const [x, y, z] = [s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0)];
  const [xy, xz, yz] = [s(0, 1) + s(1, 0), s(0, 2) + s(2, 0), s(1, 2) + s(2, 1)];
  let m = [
    [xx - yy - zz, xy, xz, x],
    [xy, yy - xx - zz, yz, y],
    [xz, yz, zz - xx - yy, z],
    [x, y, z, xx + yy + zz],
  ];
  const shift = Math.max(...m.map((row) => row.reduce((sum, value) => sum + Math.abs(value), 0)));
  m = m.map((row, i) => row.map((value, j) => value + (i === j ? shift : 0)));
  for (let k = 0; k < 50; k++) {
    // squaring leaves the largest eigenvector alone
    const trace = m[0][0] + m[1][1] + m[2][2] + m[3][3];
    const scaled = m.map((row) => times(1 / trace, row));
    m = scaled.map((row) => [0, 1, 2, 3].map((j) => dot(row, scaled.map((each) => each[j]))));
  }
  return unit(m.reduce((best, row) => (norm(row) > norm(best) ? row : best)));
}
