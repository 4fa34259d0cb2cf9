//! The figures of a model.

use ivd_core::VoxelCoord;
use ivd_field::lies::Lies;
use ivd_session::{MapChoice, Physics};

use super::Model;
use crate::figures::{Clipped, Figures, letters, value_at};

impl Figures {
    /// What there is to tell of a model.
    pub(super) fn of(model: &Model) -> Self {
        let (session, panes, last) = (&model.session, &model.panes, model.session.last());
        let (settings, volume) = (session.settings(), session.deformed());
        let grid = volume.grid();
        let lettered = grid.in_patient();
        let cross: [f64; 3] = grid.world(VoxelCoord(panes.planes.cross.into())).0.into();
        let pulls = model.spots.iter().any(|one| one.with.is_some());
        let (solver, stiffness, stiffness_counts) = match &settings.physics {
            Physics::Ring(params) => ("ring", params.stiffness, params.literal || pulls),
            Physics::Springs(params) => ("springs", params.springs.stiffness, true),
        };
        let map = match &settings.map {
            MapChoice::Octree(_) => "octree",
            MapChoice::Biharmonic(_) => "biharmonic",
            MapChoice::Fem(_) => "fem",
        };
        Self {
            size: panes.size,
            angles: panes.view.angles,
            roll: panes.view.roll,
            zoom: panes.view.zoom,
            middle: model.lens.middle(),
            width_mm: panes.width_mm(&model.lens),
            letters: lettered.then(|| letters(&model.lens)),
            handles: model.spots.clone(),
            pins: model.pins.clone(),
            bones: model.told_bones(),
            space: settings.space.iter().map(|one| one.id).collect(),
            incision: model.incision(),
            rulers: model.told_rulers(),
            clips: settings.clip.parts.iter().map(|one| Clipped { id: one.id, part: one.what }).collect(),
            clip_space: settings.clip.rule.space.unwrap_or(Lies::Deformed),
            extent: grid.extent(),
            held: model.drag.map(|drag| drag.handle),
            compare: model.compared(),
            cut: panes.cut,
            cross,
            cross_value: value_at(model.told(), cross),
            cross_times: model.times_at(cross),
            cross_at: panes.shares(grid, &model.lens, cross),
            hovered: model.hovered.clone(),
            slices: model.told_slices(),
            classes: model.classes(),
            transitions: model.transitions(),
            unsaved: model.is_unsaved(),
            overlay: model.overlay,
            window: [model.window.low, model.window.high],
            undo: model.undo_name(),
            redo: model.redo_name(),
            radius: model.radius,
            level: settings.level,
            vertices: session.lattice().keys().len(),
            solver,
            stiffness,
            stiffness_counts,
            matter: model.matter(),
            knows_classes: model.subject.labels.is_some(),
            shown_by: model.subject.shown_by,
            map,
            depth: model.depth(),
            largest_mm: last.largest_mm,
            min_det_j: last.min_det_j,
            behind: last.misfit,
            left_mm: last.left_mm,
            cut_off_mm: model.cut_off_mm,
            times: [last.times.solve, last.times.map, last.times.warp],
            draw_s: 0.0,
            refused: model.refused.clone(),
            missed: model.missed.clone(),
            made: model.subject.made.clone(),
            said: model.subject.said.clone(),
        }
    }
}
