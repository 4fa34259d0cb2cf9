//! The body of a bare scan: all of it but the background, so that its surface is the skin that is drawn. The stages' own choice is one class, which may be no
//! more than a layer of the body; it stays where values don't tell the background from the rest.

use ivd_core::op::Stage;
use ivd_core::{ClassRole, TransferFunction};
use ivd_pipeline::scene::Scene;

/// Whether a scene says something under a stage's key.
pub(crate) fn says(scene: &Scene, stage: &Stage, key: &str) -> bool {
    scene.section(stage).and_then(|section| section.written()).is_some_and(|keys| keys.contains_key(key))
}

/// Whether a scene leaves open which part of the scan is deformed. Where a person gives labels, the part is one of theirs.
pub(crate) fn leaves_part_open(scene: &Scene) -> bool {
    let is_chosen =
        ["method", "class", "seed", "above"].iter().any(|key| says(scene, &ivd_boundary::STAGE, key));
    !is_chosen && !says(scene, &ivd_lattice::extract::STAGE, "iso") && scene.input.labels.is_none()
}

/// The value from which on there is no background, and below which no material; `None` where values don't tell them apart.
pub(crate) fn above_background(transfer: &TransferFunction) -> Option<f64> {
    let of = |role| transfer.entries().iter().filter(move |entry| entry.role == role);
    let top = of(ClassRole::Background).map(|entry| entry.upper).reduce(f64::max)?;
    let bottom = of(ClassRole::Material).map(|entry| entry.lower).reduce(f64::min)?;
    (bottom >= top && top.is_finite()).then_some(top)
}
