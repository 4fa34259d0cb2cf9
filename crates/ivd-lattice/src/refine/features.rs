//! Feature edges: creases that vertices may be removed along, and the corners where these end or meet.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::shared::{NONE, Word};

/// Stands in both words of a corner.
const CORNER: u32 = NONE - 1;

/// What feature edges make of a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// No feature edge ends here.
    Smooth,
    /// Two do; these are their other ends.
    Crease([u32; 2]),
    /// One does, or more than two.
    Corner,
}

/// The feature edges of a surface, from the vertices that lie between two of them.
///
/// Edges between two corners aren't listed: what would double one is told by the edge being there.
#[derive(Debug, Default)]
pub(super) struct Features {
    /// Two neighbours along the crease, or [`NONE`] twice, or [`CORNER`] twice; empty where there are no features.
    ends: Vec<[Word; 2]>,
}

impl Features {
    /// Features of a surface of `positions.len()` vertices: edges of two triangles whose normals differ by more than
    /// `degrees`. A triangle without area has no normal and makes no feature.
    pub(super) fn new(positions: &[Vector3<f64>], corners: &[[u32; 3]], degrees: Option<f64>) -> Self {
        let Some(degrees) = degrees else { return Self::default() };
        let normals: Vec<_> = corners
            .par_iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| positions[v as usize]);
                (b - a).cross(&(c - a)).try_normalize(0.0)
            })
            .collect();
        let mut sides: Vec<([u32; 2], u32)> = corners
            .par_iter()
            .enumerate()
            .flat_map_iter(|(t, &[a, b, c])| {
                [(a, b), (b, c), (c, a)].map(|(a, b)| ([a.min(b), a.max(b)], t as u32))
            })
            .collect();
        sides.par_sort_unstable();
        let cosine = degrees.to_radians().cos();
        let mut found = vec![[NONE; 2]; positions.len()];
        for edge in sides.chunk_by(|a, b| a.0 == b.0) {
            let &[([a, b], one), (_, other)] = edge else { continue };
            if let (Some(n), Some(m)) = (normals[one as usize], normals[other as usize])
                && n.dot(&m) < cosine
            {
                note(&mut found[a as usize], b);
                note(&mut found[b as usize], a);
            }
        }
        let whole = |[a, b]: [u32; 2]| if a != NONE && b == NONE { [CORNER; 2] } else { [a, b] };
        Self { ends: found.into_iter().map(|ends| whole(ends).map(Word::new)).collect() }
    }

    /// What a vertex is.
    #[inline]
    pub(super) fn kind(&self, v: u32) -> Kind {
        let Some([a, b]) = self.ends.get(v as usize) else { return Kind::Smooth };
        match [a.get(), b.get()] {
            [NONE, _] => Kind::Smooth,
            [CORNER, _] => Kind::Corner,
            ends => Kind::Crease(ends),
        }
    }

    /// Whether a vertex may be pulled towards a neighbour: from a crease only along it.
    #[inline]
    pub(super) fn allow(&self, v: u32, neighbour: u32) -> bool {
        match self.kind(v) {
            Kind::Smooth => true,
            Kind::Crease(ends) => ends.contains(&neighbour),
            Kind::Corner => false,
        }
    }

    /// Whether a crease between `a` and `b` may take the place of one through a vertex between them: there is none yet.
    ///
    /// - `adjacent`: whether an edge joins `a` and `b`.
    pub(super) fn may_join(&self, [a, b]: [u32; 2], adjacent: bool) -> bool {
        match (self.kind(a), self.kind(b)) {
            (Kind::Crease(ends), _) => !ends.contains(&b),
            (_, Kind::Crease(ends)) => !ends.contains(&a),
            _ => !adjacent,
        }
    }

    /// Notes that a vertex is gone: the ends of its crease follow each other.
    pub(super) fn join(&self, v: u32) {
        let Kind::Crease([a, b]) = self.kind(v) else { return };
        for (from, to) in [(a, b), (b, a)] {
            if matches!(self.kind(from), Kind::Crease(_))
                && let Some(end) = self.ends[from as usize].iter().find(|end| end.get() == v)
            {
                end.set(to);
            }
        }
    }
}

fn note(ends: &mut [u32; 2], other: u32) {
    *ends = match *ends {
        [NONE, _] => [other, NONE],
        [a, NONE] => [a, other],
        _ => [CORNER; 2],
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_roof_has_a_crease_that_is_shortened_and_never_doubled() {
        // A ridge 0 1 2 3 with a vertex on either side.
        let place = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
        let positions = [
            place(0.0, 0.0, 1.0),
            place(1.0, 0.0, 1.0),
            place(2.0, 0.0, 1.0),
            place(3.0, 0.0, 1.0),
            place(1.5, 2.0, 0.0),
            place(1.5, -2.0, 0.0),
        ];
        let corners = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5]];
        assert_eq!(Features::new(&positions, &corners, Some(60.0)).kind(1), Kind::Smooth);
        assert_eq!(Features::new(&positions, &corners, None).kind(1), Kind::Smooth);
        let features = Features::new(&positions, &corners, Some(40.0));
        assert_eq!(
            [0, 1, 2, 4].map(|v| features.kind(v)),
            [Kind::Corner, Kind::Crease([0, 2]), Kind::Crease([1, 3]), Kind::Smooth]
        );
        assert!(
            features.allow(1, 2) && !features.allow(1, 4) && features.allow(4, 1) && !features.allow(0, 1)
        );
        assert!(features.may_join([0, 2], false));
        features.join(1);
        assert_eq!(features.kind(2), Kind::Crease([0, 3]));
        assert!(features.may_join([0, 3], false) && !features.may_join([0, 3], true));
        assert!(!features.may_join([0, 2], true), "it is there already");
    }
}
