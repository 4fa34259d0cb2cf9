//! Small parts of a lattice: what noise leaves beside the part that is meant.

use ivd_core::{Exec, Lattice};

use crate::Error;
use crate::refine::repair::{RepairParams, enclosed_volumes, repair};

/// Share of the largest part's volume below which a part is small.
const SMALL: f64 = 0.01;
/// Fewer small parts than this aren't told of.
const TOLD_FROM: u64 = 3;

/// Parts that triangles connect which enclose less than a hundredth of what the largest does, cavities among them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct SmallParts {
    /// How many there are.
    pub(super) count: u64,
    /// What they enclose together [mm³].
    pub(super) volume_mm3: f64,
    /// What the largest of them encloses [mm³].
    pub(super) largest_mm3: f64,
}

impl SmallParts {
    /// Those of a closed lattice.
    pub(super) fn of(lattice: &Lattice) -> Self {
        let volumes = enclosed_volumes(lattice);
        let limit = SMALL * volumes.iter().copied().fold(0.0, f64::max);
        volumes.into_iter().filter(|&volume| volume < limit).fold(Self::default(), |sum, volume| Self {
            count: sum.count + 1,
            volume_mm3: sum.volume_mm3 + volume,
            largest_mm3: sum.largest_mm3.max(volume),
        })
    }

    /// What a person should know of them, where there are enough.
    pub(super) fn told(&self) -> Option<String> {
        (self.count >= TOLD_FROM).then(|| {
            let Self { count, volume_mm3, largest_mm3 } = self;
            format!(
                "{count} small parts, each below 1 % of the largest, enclose {} mm³ together, the largest of them {} mm³; \
                 lattice.min_part = {least} leaves them out (`ivd lattice --min-part {least}`)",
                rounded_up(*volume_mm3),
                rounded_up(*largest_mm3),
                least = rounded_up(1.000_001 * largest_mm3),
            )
        })
    }
}

/// The next number of two digits.
fn rounded_up(value: f64) -> f64 {
    if value <= 0.0 {
        return 0.0;
    }
    let digits = 1 - value.log10().floor() as i32;
    // By a whole power of ten, so that what is shown has no more digits than it says.
    let power = 10_f64.powi(digits.abs());
    if digits >= 0 { (value * power).ceil() / power } else { (value / power).ceil() * power }
}

/// A lattice without the parts that enclose less than `min_part` [mm³], how many those were and what they enclosed [mm³]. Vertices
/// of the others keep their keys and places.
pub(super) fn without(lattice: &Lattice, min_part: f64, exec: &Exec) -> Result<(Lattice, u64, f64), Error> {
    let params = RepairParams { min_volume_mm3: min_part, ..RepairParams::default() };
    let repaired = repair(lattice, &params, exec)?;
    Ok((repaired.lattice, repaired.done.components_removed, repaired.done.volume_removed_mm3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_up_to_two_digits() {
        for (value, wanted) in
            [(1.0, 1.0), (1.01, 1.1), (0.001_234, 0.001_3), (987.0, 990.0), (12_345.0, 13_000.0), (0.0, 0.0)]
        {
            let found = rounded_up(value);
            assert!((found - wanted).abs() <= 1e-12 * wanted, "{found} for {wanted}");
            assert!(found >= value);
        }
    }
}
