//! The parts of a frame: what handles move that are far from each other is solved separately.
//!
//! Beyond its own Ω a part moves nothing, so that the field of a frame is that of all its parts together. Each has equations of its own,
//! which are solved in fewer iterations than all at once, and in a drag one whose vertices go where they went is not found again.

use std::ops::Deref;

use ivd_core::{Exec, FieldBricks, Frame, Lattice};
use nalgebra::Vector3;
use rayon::prelude::*;

use super::super::frame::moving_bricks;
use super::super::outcome::SolveFigures;
use super::super::region::{Region, least_margin};
use super::super::settle::Settle;
use super::nodes::Cells;
use super::step::Aim;
use super::{Biharmonic, Job, Known, Last, Made, Moved};
use crate::{BiharmonicParams, Error};

/// Nodes of other regions whose equations a drag keeps: some 8 kB each.
const KEPT: usize = 20_000;

/// What there is beside a part.
struct Beside {
    /// How many other parts in which something moves.
    others: usize,
    /// What moves in it.
    moved: Vec<Moved>,
}

impl<L: Deref<Target = Lattice> + Send + Sync> Biharmonic<L> {
    /// The field of a frame.
    ///
    /// - `whole`: what it is held against.
    /// - `parts`: those of its region.
    /// - `motions`: of vertices and inner points (mm).
    pub(super) fn in_parts(
        &self,
        kept: &mut Vec<Last>,
        (whole, parts): (&Settle<'_>, &[Region]),
        motions: &[Vector3<f64>],
        params: &BiharmonicParams,
        exec: &Exec,
    ) -> Result<Made, Error> {
        let grid = self.lattice.grid();
        let bricks = moving_bricks(grid, whole.region, whole.frame, exec)?;
        if parts.len() == 1 {
            return self.part(kept, (whole, motions, &bricks), None, params, exec);
        }
        let mut made = Vec::new();
        let all: Vec<_> = parts.iter().zip(self.moved_in(parts, motions)).collect();
        let moving = all.iter().filter(|(_, moved)| !moved.is_empty()).count();
        for (region, moved) in all.into_iter().filter(|(_, moved)| !moved.is_empty()) {
            exec.check_cancelled()?;
            // A drag begins at rest: what is told the same goes the same way.
            if self.keeps
                && exec.skip
                && let Some(known) = known(kept, region, &moved, params)
            {
                made.push(known);
                continue;
            }
            // What moves in other parts stands still for this one.
            let mut motions = vec![Vector3::zeros(); motions.len()];
            for (at, motion) in &moved {
                motions[*at as usize] = *motion;
            }
            let displacement: Vec<[f64; 3]> =
                motions[..self.lattice.keys().len()].iter().map(|u| (*u).into()).collect();
            let frame = Frame { time: whole.frame.time, displacement: displacement.into() };
            let bricks = moving_bricks(grid, region, &frame, exec)?;
            let settle = Settle { region, frame: &frame, ..*whole };
            let beside = Beside { others: moving - 1, moved };
            made.push(self.part(kept, (&settle, &motions, &bricks), Some(beside), params, exec)?);
        }
        let dims = grid.dims();
        Ok(Made {
            field: together(dims, &bricks, &made)?,
            repairs: made.iter().map(|part| part.repairs).sum(),
            solved: made.iter().filter_map(|part| part.solved).reduce(both),
        })
    }

    /// What moves in each part; what lies in none goes with the nearest.
    fn moved_in(&self, parts: &[Region], motions: &[Vector3<f64>]) -> Vec<Vec<Moved>> {
        let part_of = |(at, motion): (usize, &Vector3<f64>)| {
            let beyond = |part: &usize| parts[*part].beyond(self.positions[at]);
            let nearest = (0..parts.len()).min_by(|a, b| beyond(a).total_cmp(&beyond(b)));
            nearest.map(|part| (part, (at as u32, *motion)))
        };
        let moving = motions.par_iter().enumerate().filter(|(_, motion)| **motion != Vector3::zeros());
        let all: Vec<(usize, Moved)> = moving.filter_map(part_of).collect();
        let mut moved = vec![Vec::new(); parts.len()];
        for (part, one) in all {
            moved[part].push(one);
        }
        moved
    }

    /// The field of a part, or of a frame that is one.
    ///
    /// - `beside`: of a part, what there is beside it.
    fn part(
        &self,
        kept: &mut Vec<Last>,
        (settle, motions, bricks): (&Settle<'_>, &[Vector3<f64>], &[usize]),
        beside: Option<Beside>,
        params: &BiharmonicParams,
        exec: &Exec,
    ) -> Result<Made, Error> {
        let (region, band) = (settle.region, &params.band);
        let aim = Aim::new(&self.positions, motions, region);
        // Beyond its own region an affine part has nothing to take back.
        let shared = || region.shared(band, least_margin(self.lattice.grid()));
        let room = if aim.is_affine() { region.clone() } else { shared() };
        let job = Job {
            region,
            room: &room,
            frame: settle.frame,
            motions,
            aim: &aim,
            bricks,
            settle,
            edge: params.cell,
            tension: 0.0,
        };
        self.equations(kept, &job, beside.as_ref().map_or(0, |beside| beside.others), exec)?;
        kept[0].made = None;
        let made = self.follow(&job, &mut kept[0], exec)?;
        if let Some(beside) = beside.filter(|_| self.keeps && exec.memory_limit.is_none()) {
            let is_given = band.margin.is_some();
            let (region, moved) = (region.clone(), beside.moved);
            kept[0].made = Some(Known { region, is_given, moved, made: made.clone() });
        }
        Ok(made)
    }

    /// Brings the equations of a job's room before those of the last frames: the same ones where it had one of their rooms, else new ones that start from the last
    /// nodes.
    ///
    /// - `others`: of so many parts the equations stay, whatever else is kept.
    fn equations(
        &self,
        kept: &mut Vec<Last>,
        job: &Job<'_>,
        others: usize,
        exec: &Exec,
    ) -> Result<(), Error> {
        if let Some(at) = kept.iter().position(|last| last.region == *job.room && last.edge == job.edge) {
            kept[..=at].rotate_right(1);
            return Ok(());
        }
        let cells = Cells::new(self.lattice.grid(), job.room, job.edge);
        // Rows of the matrix and its levels, mostly of 60 entries; those of other parts stay beside them.
        let is_other = |last: &&Last| !last.region.has_balls_of(job.room);
        let beside = kept.iter().filter(is_other).take(others).map(Last::nodes).sum::<usize>();
        let nodes = (cells.nodes.free.len() + beside) as u64;
        exec.check_memory("the equations of the map", 3 * 60 * 12 * nodes)?;
        let mut before = kept.iter().take(1 + others);
        let before = before.find(|last| others == 0 || last.region.has_balls_of(job.room));
        let start = before.filter(|last| !last.nodes.is_empty() && last.system.cells.step == cells.step);
        let nodes = start.map_or_else(Vec::new, |last| {
            let value = |node: &[i32; 3]| last.system.cells.nodes.free.find(*node).map(|i| last.nodes[i]);
            cells.nodes.free.all().iter().map(|node| value(node).unwrap_or_default()).collect()
        });
        let system = self.system(cells, job.room, &self.voxels, 0.0);
        let (region, edge) = (job.room.clone(), job.edge);
        kept.insert(0, Last { region, edge, system, nodes, tense: Vec::new(), made: None });
        // Where memory is limited, it isn't spent on what may not be asked for again.
        let mut left = if self.keeps && exec.memory_limit.is_none() { KEPT } else { 0 };
        let mut spared = others;
        let old = kept.split_off(1);
        kept.extend(old.into_iter().filter(|last| {
            if spared > 0 && is_other(&last) {
                spared -= 1;
                return true;
            }
            let fits = last.nodes() <= left;
            // Once one is given up, so are those before it.
            left = if fits { left - last.nodes() } else { 0 };
            fits
        }));
        Ok(())
    }
}

impl Last {
    /// How many free nodes it has.
    fn nodes(&self) -> usize {
        self.system.cells.nodes.free.len()
    }
}

/// The field of a part that a drag has made before of the same motion; its equations come before the others.
fn known(kept: &mut [Last], region: &Region, moved: &[Moved], params: &BiharmonicParams) -> Option<Made> {
    let is_given = params.band.margin.is_some();
    let is_same =
        |known: &Known| known.is_given == is_given && known.region == *region && known.moved == moved;
    let at =
        kept.iter().position(|last| last.edge == params.cell && last.made.as_ref().is_some_and(is_same))?;
    kept[..=at].rotate_right(1);
    kept[0].made.as_ref().map(|known| known.made.clone())
}

/// How the equations of two parts were solved.
fn both(one: SolveFigures, other: SolveFigures) -> SolveFigures {
    SolveFigures {
        nodes: one.nodes + other.nodes,
        iterations: one.iterations + other.iterations,
        residual: one.residual.max(other.residual),
        increments: one.increments.max(other.increments),
    }
}

/// The fields of parts as one, in the bricks of their frame; no voxel moves in two of them.
fn together(dims: [usize; 3], bricks: &[usize], parts: &[Made]) -> Result<FieldBricks, Error> {
    let mut vectors = vec![[0.0; 3]; FieldBricks::VOXELS * bricks.len()];
    vectors.par_chunks_exact_mut(FieldBricks::VOXELS).zip(bricks).for_each(|(out, brick)| {
        for part in parts.iter().filter_map(|part| part.field.brick(*brick)) {
            for (out, vector) in out.iter_mut().zip(part).filter(|(_, vector)| **vector != [0.0; 3]) {
                *out = *vector;
            }
        }
    });
    Ok(FieldBricks::of_bricks(dims, bricks, vectors.into())?)
}

#[cfg(test)]
mod tests {
    use ivd_core::Grid;
    use ivd_field::fixtures::{middle, voxels};

    use super::*;
    use crate::tests::{both_ends_pushed as pushed, mapped_apart, scene};
    use crate::{Band, Outside};

    #[test]
    fn what_one_handle_moves_another_far_from_it_does_not_change_by_a_bit() {
        let exec = Exec::default();
        let params = BiharmonicParams::default();
        let [both, one, other] = mapped_apart(|lengths| pushed(lengths).smooth(&params, &exec).unwrap());
        let [both, one, other] = [both, one, other].map(|mapped| mapped.figures.solved.unwrap());
        assert_eq!(
            (both.nodes, both.iterations),
            (one.nodes + other.nodes, one.iterations + other.iterations)
        );
    }

    #[test]
    fn what_moves_as_a_whole_is_one_part_and_is_met_exactly() {
        let exec = Exec::default();
        let grid = Grid::with_spacing([72, 24, 24], [1.0; 3]).unwrap();
        let centre = middle(&grid);
        let ends = [-1.0, 1.0].map(|way| centre + Vector3::x() * (way * 24.0));
        let level = move |p: Vector3<f64>| {
            ends.map(|end| 6.0 - (p - end).norm()).into_iter().fold(f64::MIN, f64::max)
        };
        let shift = Vector3::new(0.25, -0.5, 1.0);
        let whole = scene(&grid, level, move |_| shift, &ends.map(|end| (end, 7.0)));
        let mapped = whole.smooth(&BiharmonicParams::default(), &exec).unwrap();
        let within = |v: &ivd_core::VoxelIndex| {
            let at = grid.linear_part() * ivd_core::VoxelCoord::from(*v).0;
            ends.iter().any(|end| (at - end).norm() < 6.9)
        };
        let moved: Vec<_> =
            voxels(&grid).filter(within).map(|v| mapped.displacement.forward().at(v)).collect();
        assert!(moved.len() > 1000 && moved.iter().all(|u| *u == [0.25, -0.5, 1.0]));
        assert_eq!(mapped.figures.solved.unwrap().iterations, 0);
    }

    #[test]
    fn what_was_mapped_between_drags_changes_none() {
        let exec = Exec::default();
        let params = BiharmonicParams::default();
        let scenes = [[0.7, 2.5], [0.7, 1.5], [0.5, 1.5]].map(pushed);
        let mut mixed = Biharmonic::new(&scenes[0].lattice, Outside::Band, &exec).unwrap();
        for scene in scenes.iter().chain([&scenes[1], &scenes[0]]) {
            // It starts from the nodes of the one before.
            mixed.map(&scene.motion, 0, &params, &exec).unwrap();
            mixed.map(&scenes[2].motion, 0, &params, &exec).unwrap();
            let moved = mixed.drag(&scene.motion, 0, &params, &exec).unwrap();
            assert!(moved.displacement == scene.smooth(&params, &exec).unwrap().displacement);
        }
    }

    #[test]
    fn a_drag_of_one_part_gives_what_each_motion_gives_alone_and_finds_the_other_once() {
        let exec = Exec::default();
        let params = BiharmonicParams::default();
        let rest = pushed([0.7, 0.0]);
        let mut dragged = Biharmonic::new(&rest.lattice, Outside::Band, &exec).unwrap();
        for lengths in [[0.7, 0.0], [0.7, 0.4], [0.7, 2.5], [0.9, 2.5], [0.7, -1.0], [0.7, 0.4]] {
            let scene = pushed(lengths);
            let moved = dragged.drag(&scene.motion, 0, &params, &exec).unwrap();
            let alone = scene.smooth(&params, &exec).unwrap();
            assert!(moved.displacement == alone.displacement, "{lengths:?}");
        }
        assert_eq!(dragged.kept.iter().filter(|last| last.made.is_some()).count(), dragged.kept.len());
        // A margin that is given reaches as far as one that followed the motion, but its nodes don't.
        let scene = pushed([1.5, 2.5]);
        let given =
            BiharmonicParams { band: Band { margin: Some(6.0), ..Band::default() }, ..params.clone() };
        for params in [&params, &given, &params] {
            let moved = dragged.drag(&scene.motion, 0, params, &exec).unwrap().displacement;
            assert!(moved == scene.smooth(params, &exec).unwrap().displacement);
        }
        // What is kept of a part that stands is given out, be it false; not where nothing is to be skipped.
        let spoil = |dragged: &mut Biharmonic<_>| {
            for last in &mut dragged.kept {
                if let Some(known) = &mut last.made {
                    known.made.field = FieldBricks::zero(known.made.field.dims());
                }
            }
        };
        let scene = pushed([0.7, 1.1]);
        let alone = scene.smooth(&params, &exec).unwrap().displacement;
        let top = ivd_core::VoxelIndex([11, 15, 21]);
        assert!(alone.forward().at(top)[2] < -0.3);
        spoil(&mut dragged);
        let moved = dragged.drag(&scene.motion, 0, &params, &exec).unwrap().displacement;
        assert_eq!(moved.forward().at(top), [0.0; 3]);
        let mut plain = Exec::default();
        plain.skip = false;
        spoil(&mut dragged);
        let moved = dragged.drag(&scene.motion, 0, &params, &plain).unwrap().displacement;
        assert!(voxels(scene.lattice.grid()).all(|v| moved.forward().at(v) == alone.forward().at(v)));
    }
}
