//! Pushes, pulls and turns of real anatomies: what a person would see, counted. A line a case; heavy, for `just stress`.
//!
//! `IVD_ANATOMIES` names the cases to run, by parts of `scan method motion radius` (such as `mri_head octree`).
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use std::path::Path;
use std::time::Instant;

use ivd_core::{Exec, Lattice, Mask, Motion, Octree, Volume, VoxelCoord};
use ivd_field::shape::{Kind, Shape};
use ivd_field::warp;
use ivd_io::volume::{ByteOrder, RawLayout, ReadOptions, read};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::refine::{RefineParams, collapse};
use ivd_map::{BiharmonicParams, BodyParams, MapResult, OctreeParams};
use ivd_motion::elastic::{self, ElasticInputs, ElasticParams};
use ivd_motion::freeform;
use ivd_motion::handles::{Action, Anchor, Handle};
use ivd_motion::rigid::{BoneSpec, Drive, Region, RigidTransform};
use ivd_motion::ring::{self, RingParams};
use nalgebra::Vector3;

use crate::real_volumes::data;

/// A part that is moved, where it is taken hold of (mm), and the radii (mm).
struct Part {
    lattice: Lattice,
    octree: Octree,
    inside: Mask,
    pick: [f64; 3],
    radii: [f64; 2],
}

fn part(lattice: &Lattice, pick: [f64; 3], radii: [f64; 2], level: u8) -> Part {
    let exec = Exec::default();
    let params =
        RefineParams { target: ivd_lattice::refine::Target::Level(level).into(), ..RefineParams::default() };
    let lattice = collapse(lattice, &params, &exec).unwrap().lattice;
    let octree = ivd_octree::build(&lattice, &ivd_octree::Params::default(), &exec).unwrap();
    let inside = ivd_octree::inside(&lattice, &exec).unwrap();
    Part { lattice, octree, inside, pick, radii }
}

fn surface(volume: &Volume, iso: f64) -> Lattice {
    extract(volume, None, &ExtractParams { iso: Iso::Value(iso) }, &Exec::default()).unwrap().lattice
}

/// The part of the voxels that are chosen, and its point farthest along an axis.
fn labelled(volume: &Volume, chosen: impl Fn(f64) -> bool, axis: usize) -> (Lattice, [f64; 3]) {
    let inside: Vec<u8> =
        (0..volume.grid().len()).map(|i| u8::from(chosen(volume.real(volume.voxels().get(i))))).collect();
    let mask = Mask::new(volume.grid().clone(), inside.into()).unwrap();
    let lattice =
        extract(volume, Some(&mask), &ExtractParams { iso: Iso::Mask }, &Exec::default()).unwrap().lattice;
    let far = |v: &usize| lattice.world(*v).0[axis];
    let tip = (0..lattice.keys().len()).max_by(|a, b| far(a).total_cmp(&far(b))).unwrap();
    let pick = lattice.world(tip).0.into();
    (lattice, pick)
}

const NAMES: [&str; 7] = ["shell", "mri_head", "mni152", "ct_head", "mri_brain", "abdomen", "hippocampus"];

/// A part by name.
fn made(name: &'static str, folder: &Path) -> Part {
    let exec = Exec::default();
    let scan = |file: &str| read(&folder.join(file), &ReadOptions::default(), &exec).unwrap();
    let radii = [25.0, 80.0];
    match name {
        "shell" => {
            let params = ivd_phantom::Params {
                shape: ivd_phantom::Shape::Shell,
                size: 96,
                ..ivd_phantom::Params::default()
            };
            let volume = ivd_phantom::generate(&params, &exec).unwrap().volume;
            part(&surface(&volume, 80.0), [47.5, 82.0, 47.5], [30.0, 30.0], 1)
        }
        "mri_head" => {
            part(&surface(&scan("mri_head_seg3d/MR.nii.gz"), 60.0), [-306.0, 122.0, 478.0], radii, 2)
        }
        "mni152" => {
            let volume = scan("mni152/mni_icbm152_t1_tal_nlin_sym_09a_converted.nii.gz");
            part(&surface(&volume, 150.0), [68.0, -36.0, -5.0], radii, 2)
        }
        "ct_head" => {
            let raw = RawLayout {
                dims: [256, 256, 113],
                voxel_type: ivd_core::VoxelType::U16,
                spacing: [1.0, 1.0, 2.0],
                order: ByteOrder::Big,
                skip: 0,
            };
            let options = ReadOptions { raw: Some(raw), ..ReadOptions::default() };
            let volume = read(&folder.join("ct_head_unc"), &options, &exec).unwrap();
            part(&surface(&volume, 500.0), [-106.0, -8.0, 114.0], radii, 2)
        }
        "mri_brain" => part(&surface(&scan("mri_brain_dicom"), 900.0), [3.6, 178.8, -44.2], radii, 2),
        "abdomen" => {
            // The liver.
            let (lattice, pick) = labelled(&scan("ct_abdomen_ts/example_seg.nii.gz"), |v| v == 5.0, 1);
            part(&lattice, pick, radii, 0)
        }
        "hippocampus" => {
            let (lattice, pick) =
                labelled(&scan("hippocampus_msd/labels/hippocampus_001.nii.gz"), |v| v > 0.0, 0);
            part(&lattice, pick, [8.0, 16.0], 0)
        }
        _ => unreachable!("a name of the list"),
    }
}

/// Outward direction at the vertex nearest to a place, and the vertex.
fn outward(lattice: &Lattice, pick: [f64; 3]) -> (Vector3<f64>, usize) {
    let at = |v: u32| lattice.world(v as usize).0;
    let far = |v: &u32| (at(*v) - Vector3::from(pick)).norm();
    let target = (0..lattice.keys().len() as u32).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap();
    // Of what is within ten millimetres on the same side: a vertex's own triangles say little on a scan.
    let mut sum = Vector3::zeros();
    for t in lattice.triangles() {
        let [a, b, c] = t.map(at);
        if (a - at(target)).norm() < 10.0 {
            sum += (b - a).cross(&(c - a));
        }
    }
    (sum.normalize(), target as usize)
}

/// How a part is moved: a handle along the normal, or a turn of all within a ball, of a body as a bone in its inner half.
fn moved(part: &Part, motion: f64, turn: bool, radius: f64, body: bool) -> Result<Motion, String> {
    let exec = Exec::default();
    let (normal, target) = outward(&part.lattice, part.pick);
    let inputs = ElasticInputs { lattice: &part.lattice, labels: None, volume: None };
    let solved = |handles: &[Handle], bones: &[BoneSpec]| {
        let solved = elastic::solve(inputs, handles, &[], bones, &ElasticParams::default(), &exec)
            .map_err(|error| error.to_string())?;
        eprint!("{} cells, {} iterations, {} parts: ", solved.cells, solved.iterations, solved.parts);
        Ok(solved.motion)
    };
    let centre: [f64; 3] = part.lattice.world(target).0.into();
    if turn && body {
        let turn = RigidTransform { pivot: centre, axis: normal.into(), angle: motion, by: [0.0; 3] };
        let bone = BoneSpec {
            name: "core".into(),
            parent: None,
            region: Some(Region::Ball { centre, radius: 0.5 * radius }),
            class: None,
            drive: Drive::Prescribed(turn),
            reach: 0.5 * radius,
        };
        return solved(&[], &[bone]);
    }
    if turn {
        let shape =
            Shape { kind: Kind::Rotate { angle: motion }, centre, axis: normal.into(), radius, core: 0.5 };
        return Ok(freeform::lattice(&part.lattice, None, &[shape], &exec).unwrap().motion);
    }
    let action = Action::Move((normal * motion * radius).into());
    let handle = Handle { at: Anchor::Vertex(target as u32), action, radius };
    if body {
        return solved(&[handle], &[]);
    }
    Ok(ring::solve(&part.lattice, &[handle], &[], &RingParams::default(), &exec).unwrap().motion)
}

/// Voxels of the part that hardly move in the inner half of a ball, in pieces (26 neighbours) that don't reach out of it: the largest.
fn hole(part: &Part, mapped: &MapResult, centre: Vector3<f64>, radius: f64) -> usize {
    let grid = part.lattice.grid();
    let field = mapped.displacement.forward();
    let length = |i: usize| Vector3::from(field.at(grid.index(i)).map(f64::from)).norm();
    let near = |i: usize| (grid.world(VoxelCoord::from(grid.index(i))).0 - centre).norm();
    let most = (0..grid.len()).map(length).fold(0.0, f64::max);
    let still: Vec<bool> = (0..grid.len())
        .map(|i| part.inside.inside()[i] != 0 && near(i) < radius && length(i) < 0.1 * most)
        .collect();
    let (mut seen, mut largest) = (vec![false; grid.len()], 0);
    for start in (0..grid.len()).filter(|&i| still[i] && near(i) < 0.5 * radius) {
        if seen[start] {
            continue;
        }
        let (mut stack, mut count, mut leaves) = (vec![start], 0, false);
        seen[start] = true;
        while let Some(i) = stack.pop() {
            count += 1;
            leaves |= near(i) >= 0.5 * radius;
            let at = grid.index(i).0;
            for n in 0..27_usize {
                let to: [i64; 3] =
                    std::array::from_fn(|a| at[a] as i64 + (n / 3_usize.pow(a as u32) % 3) as i64 - 1);
                if (0..3).any(|a| to[a] < 0 || to[a] >= grid.dims()[a] as i64) {
                    continue;
                }
                let j = grid.linear(ivd_core::VoxelIndex(to.map(|c| c as usize)));
                if still[j] && !seen[j] {
                    seen[j] = true;
                    stack.push(j);
                }
            }
        }
        if !leaves {
            largest = largest.max(count);
        }
    }
    largest
}

#[test]
#[ignore = "minutes: just stress"]
fn anatomies_follow_and_nothing_stays_behind() {
    let Some(folder) = data() else { return };
    let wanted = std::env::var("IVD_ANATOMIES").unwrap_or_default();
    let exec = Exec::default();
    let mut failed = 0;
    for name in NAMES {
        let mut kept = None;
        for (method, motion, turn, size) in cases() {
            let case = format!("{name} {method} {}{motion} {size}", if turn { "turn " } else { "" });
            if !wanted.split(' ').all(|word| case.contains(word)) {
                continue;
            }
            let part = kept.get_or_insert_with(|| made(name, &folder));
            let radius = part.radii[size];
            let begin = Instant::now();
            let solved = match moved(part, motion, turn, radius, method == "body") {
                Ok(solved) => solved,
                Err(problem) => {
                    failed += 1;
                    eprintln!("{case} r {radius}: {:.2} s, {problem}", begin.elapsed().as_secs_f64());
                    continue;
                }
            };
            let begin = if method == "body" { begin } else { Instant::now() };
            let mapped = match method {
                "octree" => {
                    ivd_map::octree(&part.lattice, &part.octree, &solved, 0, &OctreeParams::default(), &exec)
                }
                "body" => ivd_map::body(&part.lattice, &solved, 0, &BodyParams::default(), &exec),
                _ => ivd_map::biharmonic(&part.lattice, &solved, 0, &BiharmonicParams::default(), &exec),
            };
            let spent = begin.elapsed().as_secs_f64();
            let centre = Vector3::from(solved.reach()[0].centre);
            match mapped {
                Err(error) => {
                    failed += 1;
                    eprintln!("{case} r {radius}: {spent:.2} s, {error}");
                }
                Ok(mapped) => {
                    let fit = &mapped.figures.followed;
                    let vectors = mapped.displacement.forward().vectors();
                    let most =
                        vectors.iter().map(|u| Vector3::from(u.map(f64::from)).norm()).fold(0.0, f64::max);
                    let asked = solved.max_displacement();
                    let hole = hole(part, &mapped, centre, radius);
                    let fine = fit.misfit_p95_voxel <= 0.25
                        && fit.misfit_p999_voxel <= 1.0
                        && hole <= 27
                        && (most <= 1.02 * asked || method == "body");
                    failed += usize::from(!fine);
                    eprintln!(
                        "{case} r {radius}: {spent:.2} s, driven {} held {} carried {}, conflicts {}, misfit {:.3} p95 {:.3} p99.9 {:.3} max {:.2} mm, \
                         largest {:.3} of what is asked, hole {hole}, det {:.3}, rounds {}{}",
                        fit.vertices_driven,
                        fit.vertices_held,
                        fit.vertices_carried,
                        fit.conflicts,
                        fit.misfit,
                        fit.misfit_p95_voxel,
                        fit.misfit_p999_voxel,
                        fit.misfit_max_mm,
                        most / asked,
                        mapped.figures.min_det_j,
                        mapped.figures.relaxations,
                        if fine { "" } else { "  <<<" },
                    );
                }
            }
        }
    }
    assert_eq!(failed, 0, "cases beyond the limits");
}

/// Thinnest wall of a shell along the columns (y) near its top, where it has been pushed (voxels).
fn thinnest(shell: &Volume, radius: f64) -> f64 {
    let [nx, ny, nz] = shell.grid().dims();
    let middle = (nx as f64 - 1.0) / 2.0;
    let mut thinnest = f64::INFINITY;
    for (x, z) in (0..nz).flat_map(|z| (0..nx).map(move |x| (x, z))) {
        if (x as f64 - middle).hypot(z as f64 - middle) > 0.5 * radius {
            continue;
        }
        let value = |y: usize| shell.value(ivd_core::VoxelIndex([x, y, z])) - 80.0;
        // From the top down: into the wall, and out of it.
        let mut crossings = (ny / 2..ny - 1).rev().filter(|&y| (value(y) >= 0.0) != (value(y + 1) >= 0.0));
        let mut next = || {
            let y = crossings.next().expect("the wall is there, and its inside");
            y as f64 + value(y) / (value(y) - value(y + 1))
        };
        let top = next();
        thinnest = f64::min(thinnest, top - next());
    }
    thinnest
}

#[test]
fn a_wall_that_is_pushed_keeps_its_thickness() {
    let exec = Exec::default();
    let params =
        ivd_phantom::Params { shape: ivd_phantom::Shape::Shell, size: 96, ..ivd_phantom::Params::default() };
    let volume = ivd_phantom::generate(&params, &exec).unwrap().volume;
    let shell = made("shell", Path::new(""));
    let rest = thinnest(&volume, 30.0);
    let action = Action::Move([0.0, -8.0, 0.0]);
    let handle = Handle { at: Anchor::NearestTo(shell.pick), action, radius: 30.0 };
    let solved = ring::solve(&shell.lattice, &[handle], &[], &RingParams::default(), &exec).unwrap().motion;
    let octree = ivd_map::octree(&shell.lattice, &shell.octree, &solved, 0, &OctreeParams::default(), &exec);
    let biharmonic = ivd_map::biharmonic(&shell.lattice, &solved, 0, &BiharmonicParams::default(), &exec);
    let inputs = ElasticInputs { lattice: &shell.lattice, labels: None, volume: None };
    let matter = elastic::solve(inputs, &[handle], &[], &[], &ElasticParams::default(), &exec).unwrap();
    let body = ivd_map::body(&shell.lattice, &matter.motion, 0, &BodyParams::default(), &exec);
    for (method, mapped) in [("octree", octree), ("biharmonic", biharmonic), ("body", body)] {
        let mapped = mapped.unwrap();
        let warped =
            warp::volume(&volume, &mapped.displacement, &warp::WarpParams::default(), &exec).unwrap();
        let wall = thinnest(&warped.output, 30.0);
        eprintln!("{method}: {rest:.2} voxels at rest, {wall:.2} pushed");
        assert!((4.0..=6.0).contains(&wall), "{method}: {wall} voxels of {rest}");
        // What is hardly compressible gives way to the side, further than it is pushed.
        let most = if method == "body" { 1.2 } else { 1.02 };
        assert!(mapped.figures.largest_mm <= most * 8.0, "{method}: {}", mapped.figures.largest_mm);
        // At the rim of a grip matter is stretched more than surfaces that follow a taper are.
        let conflicts = if method == "body" { 2 } else { 0 };
        assert!(mapped.figures.followed.conflicts <= conflicts, "{method}");
    }
}

/// Method, motion (of radii, or degrees), whether it is a turn, and which radius.
fn cases() -> impl Iterator<Item = (&'static str, f64, bool, usize)> {
    let pushes = [-0.06, -0.2, -0.3, 0.06, 0.2, 0.3].map(|m| (m, false));
    let all = pushes.into_iter().chain([(15.0, true), (45.0, true)]);
    all.flat_map(|(motion, turn)| {
        ["octree", "biharmonic", "body"]
            .into_iter()
            .flat_map(move |method| [0, 1].map(|size| (method, motion, turn, size)))
    })
}
