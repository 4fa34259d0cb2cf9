//! Vectors at the corners of a cell, read between them.

/// The vectors at a cell's corners; corner `i` has x in bit 0, y in bit 1, z in bit 2.
pub(crate) type Corners = [[f32; 3]; 8];

/// Linear interpolation.
#[inline(always)]
pub(crate) fn mix(a: f32, b: f32, f: f32) -> f32 {
    a + (b - a) * f
}

/// The trilinear vector at a place in the cell (0…1).
#[inline(always)]
pub(crate) fn between(k: &Corners, [fx, fy, fz]: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|c| {
        let row = |i: usize| mix(k[i][c], k[i + 1][c], fx);
        mix(mix(row(0), row(2), fy), mix(row(4), row(6), fy), fz)
    })
}

/// Its derivatives along x, y and z.
#[inline(always)]
pub(crate) fn slopes(k: &Corners, [fx, fy, fz]: [f32; 3]) -> [[f32; 3]; 3] {
    let along = |from: [usize; 4], step: usize, [f, g]: [f32; 2]| -> [f32; 3] {
        std::array::from_fn(|c| {
            let rise = |i: usize| k[from[i] + step][c] - k[from[i]][c];
            mix(mix(rise(0), rise(1), f), mix(rise(2), rise(3), f), g)
        })
    };
    [along([0, 2, 4, 6], 1, [fy, fz]), along([0, 1, 4, 5], 2, [fx, fz]), along([0, 1, 2, 3], 4, [fx, fy])]
}

/// A vector turned by a matrix, given by its rows.
#[inline(always)]
pub(crate) fn turned(rows: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|r| rows[r][0] * v[0] + rows[r][1] * v[1] + rows[r][2] * v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trilinear_function_and_its_slopes_are_met_exactly() {
        // 1 + 2x + 3y + 5z + 7xy + 11xz + 13yz + 17xyz, and twice that, and x alone.
        let f = |[x, y, z]: [f32; 3]| {
            1.0 + 2.0 * x + 3.0 * y + 5.0 * z + 7.0 * x * y + 11.0 * x * z + 13.0 * y * z + 17.0 * x * y * z
        };
        let corners: Corners = std::array::from_fn(|i| {
            let at = [i & 1, i >> 1 & 1, i >> 2].map(|c| c as f32);
            [f(at), 2.0 * f(at), at[0]]
        });
        let at @ [x, y, z] = [0.25, 0.5, 0.75];
        assert_eq!(between(&corners, at), [f(at), 2.0 * f(at), x]);
        let wanted = [
            2.0 + 7.0 * y + 11.0 * z + 17.0 * y * z,
            3.0 + 7.0 * x + 13.0 * z + 17.0 * x * z,
            5.0 + 11.0 * x + 13.0 * y + 17.0 * x * y,
        ];
        let slopes = slopes(&corners, at);
        for (a, wanted) in wanted.into_iter().enumerate() {
            assert!((slopes[a][0] - wanted).abs() < 1e-5 && (slopes[a][1] - 2.0 * wanted).abs() < 2e-5);
            assert_eq!(slopes[a][2], if a == 0 { 1.0 } else { 0.0 });
        }
    }
}
