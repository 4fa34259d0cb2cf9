//! Symmetric matrices as products of triangles, without a pivot below its floor.

use super::mixture::AXES;

/// Share of its floor below which a variance counts as none. Ten times less, and products with the inverse lose the digits that
/// a likelihood needs; ten times more, and voxels one in ten thousand are overlooked.
const VANISHING: f64 = 1e-6;

/// `L` and `d` of `L diag(d) Lᵀ`, `L` a lower triangle of ones; no `d` below its floor.
pub(super) fn factor(
    matrix: &[[f64; AXES]; AXES],
    floor: &[f64; AXES],
) -> ([[f64; AXES]; AXES], [f64; AXES]) {
    let mut lower = [[0.0; AXES]; AXES];
    let mut pivots = [0.0; AXES];
    // The pivots before their floors: what lies below them is regressed on what was seen, not on what was lifted.
    let mut seen = [0.0; AXES];
    for j in 0..AXES {
        lower[j][j] = 1.0;
        let mut rest = matrix[j][j];
        for i in 0..j {
            rest -= lower[j][i] * lower[j][i] * seen[i];
        }
        // Next to nothing is left of the axis once those before it are known: it explains nothing of those after. Without
        // this a pivot of rounding would be divided by.
        let vanishes = rest <= (1e-13 * matrix[j][j].abs()).max(VANISHING * floor[j]);
        seen[j] = if vanishes { 0.0 } else { rest };
        pivots[j] = seen[j].max(floor[j]).max(f64::MIN_POSITIVE);
        for row in j + 1..AXES {
            let mut rest = matrix[row][j];
            for i in 0..j {
                rest -= lower[row][i] * lower[j][i] * seen[i];
            }
            lower[row][j] = if vanishes { 0.0 } else { rest / seen[j] };
        }
    }
    (lower, pivots)
}

/// `L diag(d) Lᵀ`.
pub(super) fn product(lower: &[[f64; AXES]; AXES], pivots: &[f64; AXES]) -> [[f64; AXES]; AXES] {
    let mut matrix = [[0.0; AXES]; AXES];
    for a in 0..AXES {
        for b in 0..AXES {
            matrix[a][b] = (0..=a.min(b)).map(|i| lower[a][i] * lower[b][i] * pivots[i]).sum();
        }
    }
    matrix
}
