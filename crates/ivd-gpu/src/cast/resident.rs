use ivd_core::{Displacement, NO_BRICK};
use ivd_render::plan::{Plan, PlanLook, PlanVoxels};

use crate::buffers::{Room, bind};
use crate::kept::Kept;
use crate::{Error, Gpu};

/// What lies on the device from picture to picture, beside the volume.
#[derive(Default)]
pub(crate) struct Resident {
    labels: Option<Kept>,
    vectors: Option<Kept>,
    vacated: Option<Kept>,
    /// Of the prepared scene of this number: bricks, and colours.
    scene: Option<(u64, Room, Option<Room>)>,
}

impl Resident {
    /// Brings what a plan reads to the device, where it isn't there yet.
    pub(super) fn bring(&mut self, plan: &Plan<'_>, gpu: &Gpu) -> Result<(), Error> {
        match plan.labels {
            Some(labels) => {
                let data = labels.buffer().as_bytes();
                Kept::bring(&mut self.labels, gpu, "the labels", (data, || labels.buffer().clone()), data)?;
            }
            None => self.labels = None,
        }
        if let Some(moved) = plan.moved {
            self.bring_vectors(gpu, moved.displacement)?;
            let data = moved.displacement.vacated();
            let owner = || moved.displacement.clone();
            Kept::bring(&mut self.vacated, gpu, "what is left behind", (data, owner), data)?;
        } else {
            (self.vectors, self.vacated) = (None, None);
        }
        if !matches!(&self.scene, Some((scene, ..)) if *scene == plan.scene) {
            self.scene = None;
            let bricks = gpu.upload("the bricks", bytemuck::cast_slice(&bricks(plan)))?;
            let upload = |colours: Vec<[f32; 4]>| gpu.upload("the colours", bytemuck::cast_slice(&colours));
            let colours = colours(plan).map(upload).transpose()?;
            self.scene = Some((plan.scene, bricks, colours));
        }
        Ok(())
    }

    /// Brings the vectors of an inverse field.
    pub(crate) fn bring_vectors(&mut self, gpu: &Gpu, displacement: &Displacement) -> Result<(), Error> {
        let vectors = displacement.inverse().buffer();
        let data = vectors.as_bytes();
        Kept::bring(&mut self.vectors, gpu, "the displacement", (data, || vectors.clone()), data)
    }

    /// Those vectors.
    pub(crate) fn vectors(&self) -> Option<&Room> {
        self.vectors.as_ref().map(|kept| &kept.room)
    }

    /// Binds it, with what a part of a picture has of its own.
    pub(super) fn bind(
        &self,
        gpu: &Gpu,
        (cast, volume): (&wgpu::ComputePipeline, Option<&Kept>),
        params: &Room,
        rays: &Room,
        picture: &Room,
    ) -> Result<wgpu::BindGroup, Error> {
        let (bricks, colours) = match &self.scene {
            Some((_, bricks, colours)) => (Some(bricks), colours.as_ref()),
            None => (None, None),
        };
        let all = [
            Some(params),
            volume.map(|kept| &kept.room),
            bricks,
            colours,
            Some(rays),
            Some(picture),
            self.labels.as_ref().map(|kept| &kept.room),
            self.vectors.as_ref().map(|kept| &kept.room),
            self.vacated.as_ref().map(|kept| &kept.room),
        ];
        bind(gpu, cast, all.into_iter().enumerate().filter_map(|(i, room)| Some((i, room?))))
    }
}

/// The voxels as they are sampled.
pub(super) fn sampled<'a>(plan: &Plan<'a>) -> &'a [u8] {
    match plan.voxels {
        PlanVoxels::U8(voxels) => voxels,
        PlanVoxels::U16(voxels) => bytemuck::cast_slice(voxels),
        PlanVoxels::I16(voxels) => bytemuck::cast_slice(voxels),
        PlanVoxels::F32(voxels) => bytemuck::cast_slice(voxels),
    }
}

/// Two words a brick: how far to leap and whether it moves, and the slot of its displacements; then the bounds of a maximum, or where the
/// labels' rows start.
fn bricks(plan: &Plan<'_>) -> Vec<u32> {
    let leaps = plan.leaps.iter().map(|leap| u32::from(*leap));
    let mut words: Vec<u32> = match plan.moved {
        Some(moved) => {
            let slots = moved.displacement.inverse().table();
            let moves = moved.moves.iter().map(|moves| u32::from(*moves) << 8);
            leaps.zip(moves).zip(slots).flat_map(|((leap, moves), slot)| [leap | moves, *slot]).collect()
        }
        None => leaps.flat_map(|leap| [leap, NO_BRICK]).collect(),
    };
    match plan.look {
        // A shader may take it that numbers are finite.
        PlanLook::Maximum { bounds, .. } => words.extend(bounds.iter().map(|b| b.max(f32::MIN).to_bits())),
        PlanLook::Classified { row_starts, .. } => words.extend(row_starts),
        PlanLook::Surface { .. } => {}
    }
    words
}

/// The table of the values, then that by gradient.
fn colours(plan: &Plan<'_>) -> Option<Vec<[f32; 4]>> {
    let PlanLook::Classified { table, steep, .. } = plan.look else { return None };
    Some(table.iter().chain(steep.map_or(&[][..], |steep| steep.table)).copied().collect())
}
