//! Which springs a lattice has.

use nalgebra::Vector3;

/// Least sum of the angles at the two vertices opposite an edge (cosine of it), for the edge to be a quadrilateral's
/// diagonal: 150°, halfway between equilateral triangles (120°) and a halved square (180°).
const DIAGONAL: f64 = -0.866_025_403_784_438_6;
/// Area of its triangles over its length squared, at least and at most: slivers neither fall apart nor are rods.
const ASPECTS: [f64; 2] = [0.01, 100.0];

/// What a spring is for (Provot 1995).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// An edge of a triangle.
    Structural,
    /// The other diagonal of a quadrilateral that an edge halves.
    Shear,
    /// Between the vertices opposite any other edge: it resists bending.
    Flexion,
}

/// A spring between two vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Vertices, ascending.
    pub ends: [u32; 2],
    /// What it is for.
    pub kind: Kind,
    /// Area of the triangles beside it over its length squared: what a Young's modulus is multiplied with.
    pub aspect: f64,
}

/// The springs of the triangles for which `near` is true of a corner, ascending by their ends, no pair twice.
///
/// Edges that other than two triangles share have no shear or flexion spring, and neither has a pair that is an edge itself.
pub fn links(triangles: &[[u32; 3]], rest: &[Vector3<f64>], near: impl Fn(u32) -> bool) -> Vec<Link> {
    // Every side of a triangle, with the corner opposite it.
    let mut sides: Vec<([u32; 2], u32)> = triangles
        .iter()
        .filter(|t| t.iter().any(|&v| near(v)))
        .flat_map(|&[a, b, c]| [([a, b], c), ([b, c], a), ([c, a], b)])
        .filter(|([a, b], _)| a != b)
        .map(|([a, b], c)| ([a.min(b), a.max(b)], c))
        .collect();
    sides.sort_unstable();
    let at = |v: u32| rest[v as usize];
    let area = |[a, b]: [u32; 2], c: u32| (at(b) - at(a)).cross(&(at(c) - at(a))).norm() / 2.0;
    let aspect = |area: f64, [a, b]: [u32; 2]| {
        let squared = (at(b) - at(a)).norm_squared();
        if squared > 0.0 { (area / squared).clamp(ASPECTS[0], ASPECTS[1]) } else { ASPECTS[1] }
    };
    let groups = || sides.chunk_by(|a, b| a.0 == b.0);
    let edge = |group: &[([u32; 2], u32)]| {
        let ends = group[0].0;
        let beside = group.iter().map(|&(ends, c)| area(ends, c)).sum();
        Link { ends, kind: Kind::Structural, aspect: aspect(beside, ends) }
    };
    let mut all: Vec<Link> = groups().map(edge).collect();
    let mut crossing: Vec<Link> = Vec::with_capacity(all.len());
    for group in groups() {
        let &[(edge, c), (_, d)] = group else { continue };
        let ends = [c.min(d), c.max(d)];
        let is_edge = all.binary_search_by_key(&ends, |link| link.ends).is_ok();
        if c == d || is_edge || edge.contains(&c) || edge.contains(&d) {
            continue;
        }
        let [a, b] = edge.map(at);
        let kind = if diagonal(a, b, at(c), at(d)) { Kind::Shear } else { Kind::Flexion };
        crossing.push(Link { ends, kind, aspect: aspect(area(edge, c) + area(edge, d), ends) });
    }
    // A pair opposite several edges is one spring, of the first kind.
    crossing.sort_by_key(|link| (link.ends, link.kind));
    crossing.dedup_by_key(|link| link.ends);
    all.append(&mut crossing);
    all.sort_by_key(|link| link.ends);
    all
}

/// Whether the angles at `c` and `d`, which see the edge from `a` to `b`, are so wide that it halves a quadrilateral.
fn diagonal(a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>, d: Vector3<f64>) -> bool {
    let seen = |from: Vector3<f64>| {
        let [p, q] = [a - from, b - from];
        p.cross(&q).norm().atan2(p.dot(&q))
    };
    (seen(c) + seen(d)).cos() <= DIAGONAL
}
