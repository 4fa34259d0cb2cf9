//! The affine motion that explains a lattice's motion as a whole.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Share of the motion that an affine part may leave unexplained (root mean square). A bump of a surface leaves most of
/// its motion, a bent or twisted part a half; at a quarter what is left decays within the part, so that the affine part
/// need not be taken back by the rest.
const UNEXPLAINED: f64 = 0.25;

/// `x ↦ c + t + F (x − c)` as a motion, with a part of it for every weight: `F = R S` turns by a part of its angle.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Affine {
    centre: Vector3<f64>,
    shift: Vector3<f64>,
    /// `F − I`.
    whole: Matrix3<f64>,
    /// Axis of `R` times its angle.
    turn: Vector3<f64>,
    /// `S − I`.
    stretch: Matrix3<f64>,
}

impl Affine {
    /// The affine motion of least squares, where it explains the motion: a rigid one (Kabsch 1976) where that leaves no more
    /// than twice as much. A translation is met exactly.
    ///
    /// - `places`, `motions`: of every vertex (mm).
    pub(super) fn fit(places: &[Vector3<f64>], motions: &[Vector3<f64>]) -> Option<Self> {
        let (first, n) = (*motions.first()?, places.len() as f64);
        let square = motions.iter().map(Vector3::norm_squared).sum::<f64>() / n;
        let centre = places.iter().map(|p| p - places[0]).sum::<Vector3<f64>>() / n + places[0];
        let shift = first + motions.iter().map(|u| u - first).sum::<Vector3<f64>>() / n;
        if !(square > 0.0 && square.is_finite()) {
            return None;
        }
        let mut spread = Matrix3::zeros();
        let mut moved = Matrix3::zeros();
        for (p, u) in places.iter().zip(motions) {
            spread += (p - centre) * (p - centre).transpose() / n;
            moved += (u - shift) * (p - centre).transpose() / n;
        }
        if moved == Matrix3::zeros() {
            return Some(Self::of(centre, shift, moved));
        }
        let general = Self::of(centre, shift, moved * inverse(&spread));
        let rigid = Self::of(centre, shift, turned(&(spread + moved)) - Matrix3::identity());
        let left = |fit: &Self| {
            let rest = |(p, u): (&Vector3<f64>, &Vector3<f64>)| (u - fit.at(*p, 1.0)).norm_squared();
            (places.iter().zip(motions).map(rest).sum::<f64>() / n / square).sqrt()
        };
        let (of_general, of_rigid) = (left(&general), left(&rigid));
        let is_rigid = of_rigid <= (2.0 * of_general).max(1e-9) && of_rigid <= UNEXPLAINED;
        let (fit, left) = if is_rigid { (rigid, of_rigid) } else { (general, of_general) };
        let explains = left <= UNEXPLAINED && (fit.whole + Matrix3::identity()).determinant() > 0.0;
        explains.then_some(fit)
    }

    fn of(centre: Vector3<f64>, shift: Vector3<f64>, whole: Matrix3<f64>) -> Self {
        if whole == Matrix3::zeros() {
            return Self { centre, shift, whole, turn: Vector3::zeros(), stretch: whole };
        }
        let map = whole + Matrix3::identity();
        let turn = turned(&map);
        let stretch = turn.transpose() * map - Matrix3::identity();
        Self {
            centre,
            shift,
            whole,
            turn: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn)).scaled_axis(),
            stretch,
        }
    }

    /// Motion (mm) at a place, of weight 0 … 1: `c + wt + R^w (I + w (S − I)) (x − c) − x`.
    pub(super) fn at(&self, place: Vector3<f64>, weight: f64) -> Vector3<f64> {
        let arm = place - self.centre;
        if weight == 1.0 {
            return self.shift + self.whole * arm;
        }
        let stretched = arm + self.stretch * arm * weight;
        self.shift * weight + (Rotation3::new(self.turn * weight) * stretched - arm)
    }
}

/// The rotation nearest to a matrix.
fn turned(m: &Matrix3<f64>) -> Matrix3<f64> {
    let size = m.amax();
    if size == 0.0 {
        return Matrix3::identity();
    }
    let svd = (m / size).svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else { return Matrix3::identity() };
    let mut sign = Vector3::repeat(1.0);
    sign[svd.singular_values.imin()] = (u * v).determinant().signum();
    u * Matrix3::from_diagonal(&sign) * v
}

/// The inverse of a symmetric matrix ≥ 0, 0 along the axes of a flat one.
fn inverse(m: &Matrix3<f64>) -> Matrix3<f64> {
    let size = m.amax();
    if size == 0.0 {
        return Matrix3::zeros();
    }
    let eigen = (m / size).symmetric_eigen();
    let values = eigen.eigenvalues.map(|v| if v > 1e-12 { 1.0 / v } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&values) * eigen.eigenvectors.transpose() / size
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places() -> Vec<Vector3<f64>> {
        (0..200)
            .map(f64::from)
            .map(|i| Vector3::new(i.sin(), (2.3 * i).cos(), (0.7 * i).sin()) * 9.0)
            .collect()
    }

    #[test]
    fn rigid_and_affine_motions_are_found_and_a_translation_exactly() {
        let places = places();
        let turn = *Rotation3::new(Vector3::new(0.3, -1.9, 0.4)).matrix();
        let shear = Matrix3::new(1.1, 0.3, 0.0, 0.0, 0.9, -0.2, 0.05, 0.0, 1.3);
        for (map, shift) in
            [(turn, [1.0, 2.0, 0.1]), (shear, [0.0, -1.0, 0.3]), (Matrix3::identity(), [0.1, 0.7, -3.3])]
        {
            let shift = Vector3::from(shift);
            let moved = |p: &Vector3<f64>| map * p - p + shift;
            let fit = Affine::fit(&places, &places.iter().map(moved).collect::<Vec<_>>()).unwrap();
            for p in &places {
                assert!((fit.at(*p, 1.0) - moved(p)).norm() < 1e-12);
                assert!((fit.at(*p, 1.0 - 1e-13) - moved(p)).norm() < 1e-11, "no jump at the end");
                assert_eq!(fit.at(*p, 0.0).map(|c| (c * 1e12).round()), Vector3::zeros());
            }
        }
        let fit = Affine::fit(&places, &vec![Vector3::new(0.1, 0.7, -3.3); places.len()]).unwrap();
        assert!(places.iter().all(|p| fit.at(*p, 1.0) == Vector3::new(0.1, 0.7, -3.3)));
    }

    #[test]
    fn half_a_turn_is_half_the_angle() {
        let places = places();
        let turn = Rotation3::new(Vector3::new(0.0, 0.0, 2.0));
        let fit = Affine::fit(&places, &places.iter().map(|p| turn * p - p).collect::<Vec<_>>()).unwrap();
        let half = Rotation3::new(Vector3::new(0.0, 0.0, 1.0));
        // The turn's axis passes anywhere along itself; the middle of the vertices doesn't lie on it.
        let centre = fit.centre + fit.shift / 2.0;
        for p in &places {
            assert!((fit.at(*p, 0.5) - (half * (p - fit.centre) + centre - p)).norm() < 1e-12);
        }
    }

    #[test]
    fn a_bump_is_no_affine_motion_and_degenerate_lattices_do_no_harm() {
        let places = places();
        let bump = |p: &Vector3<f64>| Vector3::new(0.0, 0.0, (-(p - places[3]).norm_squared() / 4.0).exp());
        assert_eq!(Affine::fit(&places, &places.iter().map(bump).collect::<Vec<_>>()), None);
        assert_eq!(Affine::fit(&[], &[]), None);
        assert_eq!(Affine::fit(&places, &vec![Vector3::zeros(); places.len()]), None);
        let one = Affine::fit(&places[..1], &[Vector3::new(1.0, 0.0, 0.0)]).unwrap();
        assert_eq!(one.at(Vector3::repeat(5.0), 1.0), Vector3::new(1.0, 0.0, 0.0));
        let flat: Vec<Vector3<f64>> = places.iter().map(|p| Vector3::new(p.x, p.y, 0.0)).collect();
        let turn = Rotation3::new(Vector3::new(0.0, 0.5, 0.0));
        let fit = Affine::fit(&flat, &flat.iter().map(|p| turn * p - p).collect::<Vec<_>>()).unwrap();
        let off = Vector3::new(1.0, 2.0, 3.0);
        assert!((fit.at(off, 1.0) - (turn * off - off)).norm() < 1e-12, "rigid also off its plane");
    }
}
