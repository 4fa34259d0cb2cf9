//! Times one way to cluster, to cut a lattice or to refine one, on raw voxels: for comparisons with other programs and for
//! plots of growth.
//!
//! `measure method METHOD FILE TYPE NX,NY,NZ PARAMS [REPEATS [LABELS]]`: METHOD is kmvs, emvs, msvs, msvs+kmvs, hvs, lattice,
//! lattice-again, lattice-slider, lattice-slider-again or refine; the file holds little-endian voxels of TYPE (u8, u16, f32), 1 mm apart; PARAMS is the JSON of the method's
//! parameters (kmvs weighs places where they say so; hvs takes `classes` beside them, refine the `iso` of the lattice that it
//! is given). Each run is a call on what lies in memory, with two threads. `lattice` finds the range of values of each brick
//! in every run, as for a volume seen for the first time; `lattice-again` finds it there; `lattice-slider` and
//! `lattice-slider-again` are the same with memory that is used again. Prints JSON: wall and processor time of each run
//! (s), peak memory (MiB) and that before the first run; for clusterings the method's own figure, K, iterations; for
//! lattices what there is of vertices and triangles. LABELS gets the labels as u16.

use std::cell::RefCell;
use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_core::{Exec, Lattice, Volume};
use ivd_lattice::extract::{ExtractParams, Extractor, extract};
use ivd_lattice::refine::{RefineParams, collapse};
use ivd_segment::{
    CutParams, HvsParams, KmvsParams, Segmentation, cut, emvs, kmvs, kmvs_spatial, msvs, msvs_kmvs,
    region_tree,
};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::anything::Anything;
use crate::raw;

pub(crate) const USAGE: &str = "METHOD FILE TYPE NX,NY,NZ PARAMS [REPEATS [LABELS]]";

type Method<'a> = Box<dyn Fn(&Exec) -> Anything<Found> + 'a>;

/// What a run found.
enum Found {
    Classes(Box<Segmentation>),
    Surface { vertices: usize, triangles: usize, max_error_mm: f64 },
}

impl Found {
    fn classes(found: Segmentation) -> Self {
        Self::Classes(Box::new(found))
    }

    fn surface(lattice: &Lattice) -> Self {
        Self::Surface {
            vertices: lattice.keys().len(),
            triangles: lattice.triangles().len(),
            max_error_mm: lattice.max_error_mm(),
        }
    }

    /// Its figures, beside the times.
    fn figures(&self) -> Value {
        match self {
            Self::Classes(found) => json!({
                "objective": found.objective, "k": found.k, "iterations": found.iterations,
                "visited_fraction": found.visited_fraction,
            }),
            Self::Surface { vertices, triangles, max_error_mm } => {
                json!({"vertices": vertices, "triangles": triangles, "max_error_mm": max_error_mm})
            }
        }
    }
}

fn params<P: DeserializeOwned>(text: &str) -> Anything<P> {
    Ok(serde_json::from_str(text)?)
}

/// The method as something to run again and again.
fn method<'a>(name: &str, text: &str, volume: &'a Volume) -> Anything<Method<'a>> {
    Ok(match name {
        "kmvs" => {
            let params: KmvsParams = params(text)?;
            Box::new(move |exec| {
                Ok(Found::classes(if params.spatial_weight > 0.0 {
                    kmvs_spatial(volume, None, &params, exec)?.segmentation
                } else {
                    kmvs(volume, None, &params, exec)?
                }))
            })
        }
        "emvs" => {
            let params = params(text)?;
            Box::new(move |exec| Ok(Found::classes(emvs(volume, None, &params, exec)?.segmentation)))
        }
        "msvs" => {
            let params = params(text)?;
            Box::new(move |exec| Ok(Found::classes(msvs(volume, None, &params, exec)?.segmentation)))
        }
        "msvs+kmvs" => {
            let params = params(text)?;
            Box::new(move |exec| Ok(Found::classes(msvs_kmvs(volume, None, &params, exec)?.segmentation)))
        }
        "hvs" => {
            let mut value: Value = serde_json::from_str(text)?;
            let classes = value.as_object_mut().and_then(|o| o.remove("classes")).unwrap_or(4.into());
            let classes = classes.as_u64().ok_or("classes: a whole number is expected")?;
            let params: HvsParams = serde_json::from_value(value)?;
            let classes = CutParams { k: classes as usize, ..CutParams::default() };
            Box::new(move |exec| {
                Ok(Found::classes(cut(&region_tree(volume, None, &params, exec)?.tree, &classes, exec)?))
            })
        }
        "lattice" | "lattice-again" | "lattice-slider" | "lattice-slider-again" => {
            let params: ExtractParams = params(text)?;
            let (again, slider) = (name.ends_with("again"), name.contains("slider"));
            let extractor = RefCell::new(Extractor::default());
            if again {
                volume.bricks();
            }
            Box::new(move |exec| {
                // The voxels are shared, what was found out about them is not.
                let unseen = Volume::new(volume.grid().clone(), volume.voxels().clone())?;
                let volume = if again { volume } else { &unseen };
                if !slider {
                    return Ok(Found::surface(&extract(volume, None, &params, exec)?.lattice));
                }
                let mut extractor = extractor.borrow_mut();
                let lattice = extractor.extract(volume, None, &params, exec)?.lattice;
                let found = Found::surface(&lattice);
                extractor.reuse(lattice);
                Ok(found)
            })
        }
        "refine" => {
            let mut value: Value = serde_json::from_str(text)?;
            let iso = value.as_object_mut().and_then(|o| o.remove("iso")).ok_or("iso: it is missing")?;
            let iso = ExtractParams { iso: serde_json::from_value(iso)? };
            let params: RefineParams = serde_json::from_value(value)?;
            let lattice = extract(volume, None, &iso, &Exec::default().with_threads(2))?.lattice;
            Box::new(move |exec| Ok(Found::surface(&collapse(&lattice, &params, exec)?.lattice)))
        }
        _ => return Err(format!("{name}: it is none of the methods").into()),
    })
}

pub(crate) fn run(arguments: &[String]) -> Anything<()> {
    let [name, file, kind, dims, text, rest @ ..] = arguments else { return Err(USAGE.into()) };
    let volume = raw::volume(file, kind, raw::three(dims)?, [1.0; 3])?;
    let run = method(name, text, &volume)?;
    let exec = Exec::default().with_threads(2);
    let before = raw::peak_mib();
    let (mut times, mut found) = (Vec::new(), None::<Found>);
    for _ in 0..rest.first().map_or(Ok(1), |n| n.parse())? {
        drop(found.take());
        let (wall, processor) = (Instant::now(), ProcessTime::now());
        found = Some(run(&exec)?);
        times.push([wall.elapsed().as_secs_f64(), processor.elapsed().as_secs_f64()]);
    }
    let found = found.ok_or("at least one repeat")?;
    let mut printed = json!({"times": times, "peak_mib": raw::peak_mib(), "volume_mib": before});
    if let (Some(printed), Value::Object(figures)) = (printed.as_object_mut(), found.figures()) {
        printed.extend(figures);
    }
    println!("{printed}");
    if let (Some(path), Found::Classes(found)) = (rest.get(1), &found) {
        raw::write_labels(path, found.labels.ids())?;
    }
    Ok(())
}
