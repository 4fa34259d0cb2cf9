//! Derivatives of trilinear functions at eight places of a cell at once: its Gauss points, or its corners.
//!
//! Plain loops, without closures: only these become as wide as the code that they are inlined in.

/// Forces or places at the corners.
pub type Corners = [[f64; 3]; 8];
/// A number at each of the eight places, x in bit 0, y in bit 1, z in bit 2.
pub(crate) type Lanes = [f64; 8];
/// `[component][edge]`: derivatives of a motion along the edges of a cell of size 1.
pub(crate) type Slopes = [[Lanes; 3]; 3];

pub(crate) const ZERO: Slopes = [[[0.0; 8]; 3]; 3];

/// Where the eight places are, as the weights of the nearer and the farther corner along each edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Places {
    near: f64,
    far: f64,
}

/// The Gauss points of the second order: `1/2 ± √3/6`.
pub(crate) const GAUSS: Places = Places { near: 0.788_675_134_594_812_9, far: 0.211_324_865_405_187_1 };
/// The corners.
pub(crate) const CORNERS: Places = Places { near: 1.0, far: 0.0 };

impl Places {
    /// The derivatives of what has these values at the corners.
    #[inline(always)]
    pub(crate) fn slopes(self, values: &Corners) -> Slopes {
        let mut out = ZERO;
        for (a, out) in out.iter_mut().enumerate() {
            let mut v = [0.0; 8];
            for (v, value) in v.iter_mut().zip(values) {
                *v = value[a];
            }
            *out = [self.along::<1, 2, 4>(&v), self.along::<2, 4, 1>(&v), self.along::<4, 1, 2>(&v)];
        }
        out
    }

    /// What the corners get of something at the places, as `slopes` turned over does it.
    #[inline(always)]
    pub(crate) fn gather(self, of: &Slopes) -> Corners {
        let mut out = [[0.0; 3]; 8];
        for a in 0..3 {
            let mut v = [0.0; 8];
            self.back::<1, 2, 4>(&of[a][0], &mut v);
            self.back::<2, 4, 1>(&of[a][1], &mut v);
            self.back::<4, 1, 2>(&of[a][2], &mut v);
            for (out, v) in out.iter_mut().zip(v) {
                out[a] = v;
            }
        }
        out
    }

    /// The derivatives along the edge of bit `X`: differences, interpolated across.
    #[inline(always)]
    fn along<const X: usize, const Y: usize, const Z: usize>(self, v: &Lanes) -> Lanes {
        let Self { near, far } = self;
        let d = [v[X] - v[0], v[X | Y] - v[Y], v[X | Z] - v[Z], v[X | Y | Z] - v[Y | Z]];
        let y = [
            near * d[0] + far * d[1],
            far * d[0] + near * d[1],
            near * d[2] + far * d[3],
            far * d[2] + near * d[3],
        ];
        let mut out = [0.0; 8];
        for x in [0, X] {
            out[x] = near * y[0] + far * y[2];
            out[x | Y] = near * y[1] + far * y[3];
            out[x | Z] = far * y[0] + near * y[2];
            out[x | Y | Z] = far * y[1] + near * y[3];
        }
        out
    }

    #[inline(always)]
    fn back<const X: usize, const Y: usize, const Z: usize>(self, of: &Lanes, out: &mut Lanes) {
        let Self { near, far } = self;
        let t = [of[0] + of[X], of[Y] + of[X | Y], of[Z] + of[X | Z], of[Y | Z] + of[X | Y | Z]];
        let z = [
            near * t[0] + far * t[2],
            near * t[1] + far * t[3],
            far * t[0] + near * t[2],
            far * t[1] + near * t[3],
        ];
        let d = [
            near * z[0] + far * z[1],
            far * z[0] + near * z[1],
            near * z[2] + far * z[3],
            far * z[2] + near * z[3],
        ];
        for (d, at) in d.into_iter().zip([0, Y, Z, Y | Z]) {
            out[X | at] += d;
            out[at] -= d;
        }
    }
}

/// `x m`: derivatives along other directions.
#[inline(always)]
pub(crate) fn turned(x: &Slopes, m: &[[f64; 3]; 3]) -> Slopes {
    let mut out = ZERO;
    for (x, out) in x.iter().zip(&mut out) {
        for (b, out) in out.iter_mut().enumerate() {
            for l in 0..8 {
                out[l] = x[0][l] * m[0][b] + x[1][l] * m[1][b] + x[2][l] * m[2][b];
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::weights;

    #[test]
    fn slopes_are_differences_of_what_trilinear_weights_give_and_gather_turns_them_over() {
        let values: Corners =
            std::array::from_fn(|c| std::array::from_fn(|a| ((7 * c + 5 * a + c * a) % 11) as f64 - 4.0));
        let at = |place: [f64; 3], a: usize| -> f64 {
            weights(place).iter().zip(&values).map(|(w, v)| w * v[a]).sum()
        };
        for (places, low) in [(GAUSS, 0.5 - 0.5 / 3.0_f64.sqrt()), (CORNERS, 0.0)] {
            let found = places.slopes(&values);
            let other: Slopes = std::array::from_fn(|a| {
                std::array::from_fn(|e| std::array::from_fn(|l| ((3 * l + e + 2 * a) % 7) as f64 - 3.0))
            });
            for a in 0..3 {
                for edge in 0..3 {
                    for lane in 0..8 {
                        let place: [f64; 3] =
                            std::array::from_fn(|b| if lane >> b & 1 == 1 { 1.0 - low } else { low });
                        let (mut up, mut down) = (place, place);
                        (up[edge], down[edge]) = (1.0, 0.0);
                        let wanted = at(up, a) - at(down, a);
                        assert!((found[a][edge][lane] - wanted).abs() < 1e-13, "{a} {edge} {lane}");
                    }
                }
            }
            let product = |x: &Slopes, y: &Slopes| -> f64 {
                x.iter().flatten().flatten().zip(y.iter().flatten().flatten()).map(|(x, y)| x * y).sum()
            };
            let back: f64 =
                places.gather(&other).iter().flatten().zip(values.iter().flatten()).map(|(f, v)| f * v).sum();
            assert!((back - product(&found, &other)).abs() < 1e-11);
        }
    }
}
