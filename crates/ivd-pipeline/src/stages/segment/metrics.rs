//! What segmentations tell of themselves.

use ivd_core::{Exec, Tree};
use ivd_segment::{Chain, CutParams, Emvs, Hvs, Msvs, Segmentation, SpatialKmvs};
use serde_json::{Value, json};

use crate::Metrics;

/// Longer lists of modes aren't read.
const MOST_MODES: usize = 64;
/// More leaves can't be drawn.
const MOST_LEAVES: usize = 32;

/// Figures that every method has.
fn common(found: &Segmentation) -> Metrics {
    let classes: Vec<Value> = found
        .labels
        .classes()
        .iter()
        .map(|c| {
            json!({ "id": c.id, "mean": c.mean, "sd": c.sd, "voxels": c.voxels, "lower": c.lower, "upper": c.upper })
        })
        .collect();
    Metrics::of(json!({
        "k": found.k,
        "iterations": found.iterations,
        "converged": found.converged,
        "objective": found.objective,
        "gap": found.gap,
        "classes": classes,
        "visited_fraction": found.visited_fraction,
    }))
}

/// Those, and what a method alone knows.
pub(super) fn with(found: &Segmentation, own: Metrics) -> Metrics {
    let mut figures = common(found).figures;
    figures.extend(own.figures);
    Metrics { figures, times: own.times }
}

/// k-means with positions.
pub(super) fn spatial(found: &SpatialKmvs) -> Metrics {
    Metrics::of(json!({ "centroids": found.centroids, "reseeded": found.reseeded, "ties": found.ties }))
}

/// A mixture, with the curve that its number of components was read from.
pub(super) fn mixture(found: &Emvs) -> Metrics {
    let curve: Vec<Value> =
        found.bic.iter().map(|p| json!({ "k": p.k, "objective": p.log_likelihood, "bic": p.bic })).collect();
    Metrics::of(json!({ "log_likelihood": found.log_likelihood, "mixture": found.mixture, "curve": curve }))
}

/// Modes of the density; the foremost of them.
pub(super) fn modes(found: &Msvs) -> Metrics {
    Metrics::of(json!({
        "k_proposed": found.k_proposed,
        "range_bandwidth": found.range_bandwidth,
        "spatial_bandwidth": found.spatial_bandwidth,
        "cells": found.cells,
        "modes": found.modes.iter().take(MOST_MODES).collect::<Vec<_>>(),
    }))
}

/// What was proposed and what was kept, with the times of either part.
pub(super) fn chain(found: &Chain) -> Metrics {
    let curve: Vec<Value> =
        found.curve.iter().map(|p| json!({ "k": p.k, "objective": p.objective, "bic": p.bic })).collect();
    let figures = Metrics::of(json!({
        "k_proposed": found.k_proposed,
        "k_kept": found.k_kept,
        "curve": curve,
        "range_bandwidth": found.range_bandwidth,
    }));
    figures.timed("msvs_s", found.times.msvs.as_secs_f64()).timed("kmvs_s", found.times.kmvs.as_secs_f64())
}

/// A tree.
pub(super) fn tree(found: &Hvs) -> Value {
    let heights = found.tree.height_range();
    json!({
        "nodes": found.tree.nodes(),
        "regions": found.regions,
        "excess": found.excess,
        "inversions": found.inversions,
        "heights": heights,
        "bytes": found.tree.bytes(),
    })
}

/// Of a cut: the regions that the tree has, and how the classes come together, as far as a picture can show it.
pub(super) fn cut(tree: &Tree, params: &CutParams, exec: &Exec) -> Metrics {
    let mut own = json!({ "regions": tree.leaf_count() });
    if let Ok(Some(found)) = ivd_segment::dendrogram(tree, params, MOST_LEAVES, exec) {
        own["dendrogram"] = json!(found);
    }
    Metrics::of(own)
}
