//! The other ways to cluster, as one subject each: how they are asked, for a volume of whatever values and spacing.

use ivd_core::{Exec, Volume};
use ivd_segment::{
    ChainParams, Covariance, CutParams, EmvsParams, HvsParams, KmvsParams, Linkage, MsvsParams, Segmentation,
};

use super::backend::{Answer, Backend};
use super::case::{Case, Stage, TURNS};
use super::invariants::{Verdict, clusters};
use super::subject::{Subject, Values};

/// Most components of a mixture.
const MOST: usize = 256;

/// A method with its name.
pub(super) struct Cluster(
    Stage,
    &'static str,
    fn(&dyn Backend, &Volume, usize, &Exec) -> Answer<Segmentation>,
);

pub(super) static KMEANS: Cluster =
    Cluster(Stage::KmvsSpatial, "kmvs with positions", |on, volume, k, exec| {
        let params =
            KmvsParams { k, spatial_weight: weight(volume), max_iterations: 50, ..KmvsParams::default() };
        on.kmvs(volume, &params, exec)
    });

pub(super) static MIXTURE: Cluster = Cluster(Stage::Emvs, "emvs", |on, volume, k, exec| {
    on.emvs(volume, &EmvsParams { k: Some(k.min(MOST)), ..EmvsParams::default() }, exec)
});

pub(super) static SMOOTH: Cluster = Cluster(Stage::EmvsSmooth, "emvs, smoothing", |on, volume, k, exec| {
    let params =
        EmvsParams { k: Some(k.min(MOST)), smoothing: 0.5, max_iterations: 50, ..EmvsParams::default() };
    on.emvs(volume, &params, exec)
});

pub(super) static DIAGONAL: Cluster =
    Cluster(Stage::EmvsDiagonal, "emvs, diagonal", |on, volume, k, exec| {
        let covariance = Covariance::Diagonal;
        on.emvs(
            volume,
            &EmvsParams { k: Some(k.min(MOST)), covariance, max_iterations: 20, ..EmvsParams::default() },
            exec,
        )
    });

pub(super) static FULL: Cluster = Cluster(Stage::EmvsFull, "emvs, full", |on, volume, k, exec| {
    let covariance = Covariance::Full;
    on.emvs(
        volume,
        &EmvsParams { k: Some(k.min(MOST)), covariance, max_iterations: 20, ..EmvsParams::default() },
        exec,
    )
});

pub(super) static MODES: Cluster =
    Cluster(Stage::Msvs, "msvs", |on, volume, _, exec| on.msvs(volume, &MsvsParams::default(), exec));

pub(super) static JOINT: Cluster = Cluster(Stage::MsvsJoint, "msvs with positions", |on, volume, _, exec| {
    let extent = extent(volume);
    on.msvs(volume, &MsvsParams { spatial_bandwidth: 0.2 * extent, ..MsvsParams::default() }, exec)
});

pub(super) static CHAIN: Cluster = Cluster(Stage::MsvsKmvs, "msvs+kmvs", |on, volume, _, exec| {
    on.msvs_kmvs(volume, &ChainParams::default(), exec)
});

pub(super) static WARD: Cluster = Cluster(Stage::HvsWard, "hvs by ward", |on, volume, k, exec| {
    let cut = CutParams { k, ..CutParams::default() };
    on.hvs(volume, &HvsParams { max_regions: 2000, ..HvsParams::default() }, &cut, exec)
});

pub(super) static SINGLE: Cluster =
    Cluster(Stage::HvsSingle, "hvs by single linkage", |on, volume, k, exec| {
        let cut = CutParams { k, ..CutParams::default() };
        on.hvs(volume, &HvsParams { linkage: Linkage::Single, ..HvsParams::default() }, &cut, exec)
    });

/// Longest edge (mm).
fn extent(volume: &Volume) -> f64 {
    let grid = volume.grid();
    (0..3).map(|a| grid.dims()[a] as f64 * grid.spacing()[a]).fold(0.0, f64::max)
}

/// A weight that makes the longest edge count as half the range of the values.
fn weight(volume: &Volume) -> f64 {
    let width = volume.range().map_or(0.0, |[low, high]| high / 2.0 - low / 2.0);
    (width / extent(volume)).clamp(1e-6, 1e30)
}

impl Subject for Cluster {
    fn stage(&self) -> Stage {
        self.0
    }
    fn run(&self, on: &dyn Backend, case: &Case, values: &mut Values, exec: &Exec) -> Answer<bool> {
        if case.setup.turn.is_some_and(|turn| self.0 as usize % TURNS != turn) {
            return Ok(false);
        }
        let found = (self.2)(on, &case.volume, case.setup.k, exec)?;
        values.clusterings.insert(self.1, found);
        Ok(true)
    }
    fn check(&self, _: &dyn Backend, case: &Case, values: &Values, _: &Exec) -> Verdict {
        clusters::sound(&case.volume, &values.clusterings[self.1])
    }
}
