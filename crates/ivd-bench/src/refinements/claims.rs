//! What the thesis concludes from its tables, held against what was measured.

use ivd_report::html::number;

use super::results::{Claim, LatticeBench, Reach};
use super::rows::{RefinementRow, ended};

/// All of them, for one lattice.
pub(super) fn claims(bench: &LatticeBench) -> Vec<Claim> {
    vec![
        features_of_samples(bench),
        gaps_of_samples(bench),
        features(bench),
        further(bench),
        new_vertices(bench),
    ]
}

/// Coarser sampling against the default at the same share.
fn features_of_samples(bench: &LatticeBench) -> Claim {
    let pairs: Vec<_> = of(&bench.shares, "sample").zip(of(&bench.shares, "collapse")).collect();
    let worse = pairs.iter().filter(|(s, c)| s.max_mm > c.max_mm).count();
    let numbers = pairs.iter().map(|(s, c)| {
        format!(
            "{}: {} mm with {} triangles against {} mm with {}",
            s.asked,
            number(s.max_mm),
            s.triangles,
            number(c.max_mm),
            c.triangles
        )
    });
    Claim::new(
        "5.2.1, figure 5.6",
        "A decreased sampling rate loses features.",
        [worse, pairs.len()],
        format!("Largest distance, sampling against collapse: {}.", numbers.collect::<Vec<_>>().join("; ")),
    )
}

/// Whether coarser sampling tears surfaces.
fn gaps_of_samples(bench: &LatticeBench) -> Claim {
    let sampled: Vec<_> = of(&bench.shares, "sample").collect();
    let torn = sampled.iter().filter(|r| r.shape.genus.is_none()).count();
    let changed = sampled.iter().filter(|r| !r.shape.is_as(&bench.shape)).count();
    Claim::new(
        "5.2.1, figure 5.6",
        "A decreased sampling rate leaves gaps in the surface.",
        [torn, sampled.len()],
        format!(
            "{torn} of {0} results aren't closed manifolds; parts or handles are others than the lattice's in {changed} of {0}.",
            sampled.len()
        ),
    )
}

/// The rows of a method.
fn of<'a>(rows: &'a [RefinementRow], method: &'a str) -> impl Iterator<Item = &'a RefinementRow> {
    rows.iter().filter(move |r| r.method == method)
}

/// Decimation against the inverse subdivision at equal counts.
fn features(bench: &LatticeBench) -> Claim {
    let pairs: Vec<_> = of(&bench.same_counts, "decimate").zip(of(&bench.same_counts, "loop")).collect();
    // Where there are no creases, the whole surface tells.
    let creased = bench.crease_vertices > 0;
    let error = |r: &RefinementRow| if creased { r.crease_mm } else { r.mean_mm };
    let better = pairs.iter().filter(|(d, l)| error(d) < error(l)).count();
    let numbers = pairs.iter().map(|(d, l)| {
        format!(
            "{} vertices: {} against {} mm (largest distance {} against {})",
            l.vertices,
            number(error(d)),
            number(error(l)),
            number(d.max_mm),
            number(l.max_mm)
        )
    });
    Claim::new(
        "5.2.5, table 5.1",
        "Decimation keeps sharp features better than the subdivision scheme at the same number of vertices.",
        [better, pairs.len()],
        format!(
            "Mean distance of the {}, decimation against inverse subdivision: {}.",
            if creased { "creases' vertices" } else { "surfaces (there is no crease)" },
            numbers.collect::<Vec<_>>().join("; ")
        ),
    )
}

/// Where decimation ends, and where the inverse subdivision does.
fn further(bench: &LatticeBench) -> Claim {
    let of = |method: &str| bench.reach.iter().find(|r| r.method == method);
    let told = |r: &Reach| format!("{} {} (stopped by {})", r.method, r.least, words(r));
    let pair = of("decimate").zip(of("loop"));
    let holds = pair.map_or([0, 0], |(d, l)| [usize::from(l.least < d.least), 1]);
    let all: Vec<String> = bench.reach.iter().map(told).collect();
    Claim::new(
        "5.2.5, table 5.2",
        "Decimation, which may not change the topology, ends where the subdivision scheme goes on.",
        holds,
        format!("Fewest vertices: {}.", all.join("; ")),
    )
}

fn words(reach: &Reach) -> String {
    let name = ended(reach.stopped_by);
    if reach.same_topology { name } else { format!("{name}; not the lattice's parts and handles") }
}

fn new_vertices(bench: &LatticeBench) -> Claim {
    let merged: Vec<_> = of(&bench.shares, "merge").collect();
    let made = merged.iter().filter(|r| r.new_vertices > 0).count();
    let total: usize = bench.shares.iter().map(|r| r.new_vertices).sum();
    Claim::new(
        "5.2.4, figure 5.9",
        "Merging makes new vertices, which have no voxel.",
        [made, merged.len()],
        format!(
            "Of all results by all methods, {total} vertices aren't vertices of the lattice at their place."
        ),
    )
}
