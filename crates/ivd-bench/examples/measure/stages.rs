//! Wall and processor time of single stages on one volume, warm, in one process: one request a line on stdin, one JSON
//! object a line on stdout, so that a script can take turns with other programs.
//!
//! ```text
//! measure stages VOLUME < requests
//! kmvs 4          classes of least inertia
//! extract 84.5    marching cubes at a value (the brick index is built anew each time)
//! refine 0.1      half-edge collapse of the last lattice to a share of its triangles
//! render T.ivd 512 0.5 90,15    a picture of a new scene with a transfer function: side, step, view; not shaded
//! scene T.ivd 512 0.5 [shaded|mip|iso=V]    makes a scene ready for many views; without a word not shaded
//! view 90,15                    a picture of it
//! ```

use std::io::BufRead;
use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_artefact::Artefact;
use ivd_core::{Exec, Volume};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::refine::{RefineParams, Target, collapse};
use ivd_render::{Fit, Mode, Prepared, RenderParams, Rendered, Scene, View, render};
use serde_json::json;

use crate::anything::Anything;

pub(crate) const USAGE: &str = "VOLUME < REQUESTS";

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let [path] = words else { return Err(USAGE.into()) };
    let exec = Exec::default();
    let volume = ivd_io::volume::read(path.as_ref(), &ivd_io::volume::ReadOptions::default(), &exec)?;
    let mut lattice = None;
    let mut prepared: Option<Prepared<'_>> = None;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        // A volume of its own for each request: the brick index belongs to the work.
        let fresh = Volume::with_scale(
            volume.grid().clone(),
            volume.voxels().clone(),
            volume.slope(),
            volume.intercept(),
        )?;
        let transfer = match words[..] {
            ["render" | "scene", file, ..] => match ivd_artefact::read(file)?.artefact {
                Artefact::Transfer(transfer) => Some(transfer),
                _ => return Err(format!("{file} holds no transfer function").into()),
            },
            _ => None,
        };
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        let figures = match words[..] {
            ["kmvs", k] => {
                let found = ivd_segment::kmvs(
                    &fresh,
                    None,
                    &ivd_segment::KmvsParams { k: k.parse()?, ..Default::default() },
                    &exec,
                )?;
                json!({ "objective": found.objective, "means": found.labels.classes().iter().map(|c| c.mean).collect::<Vec<_>>() })
            }
            ["extract", iso] => {
                let found =
                    extract(&fresh, None, &ExtractParams { iso: Iso::Value(iso.parse()?) }, &exec)?.lattice;
                let figures = json!({ "vertices": found.keys().len(), "triangles": found.triangles().len() });
                lattice = Some(found);
                figures
            }
            ["refine", ratio] => {
                let params =
                    RefineParams { target: Target::Ratio(ratio.parse()?).into(), ..RefineParams::default() };
                let found = collapse(lattice.as_ref().ok_or("extract first")?, &params, &exec)?;
                json!({ "triangles": found.lattice.triangles().len(), "max_error_mm": found.max_error_mm })
            }
            ["render", _, side, step, angles] => {
                let transfer = transfer.ok_or("no transfer function")?;
                let scene = Scene { transfer: Some(&transfer), ..Scene::new(&fresh) };
                figures_of(&render(&scene, &params_of(side, step, view_of(angles)?)?, &exec)?)
            }
            ["scene", _, side, step, ref mode @ ..] => {
                // Lives as long as the process: views of it may come at any time.
                let transfer = Box::leak(Box::new(transfer.ok_or("no transfer function")?));
                let scene = Scene { transfer: Some(transfer), ..Scene::new(Box::leak(Box::new(fresh))) };
                let params = in_mode(params_of(side, step, View::FRONT)?, mode)?;
                prepared = Some(Prepared::new(&scene, &params, &exec)?);
                json!({})
            }
            ["view", angles] => {
                let prepared = prepared.as_ref().ok_or("scene first")?;
                figures_of(&prepared.render(view_of(angles)?, &exec)?)
            }
            _ => return Err(format!("unknown request `{line}`").into()),
        };
        let (wall, cpu) = (wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
        println!("{}", json!({ "request": line, "wall_s": wall, "cpu_s": cpu, "figures": figures }));
    }
    Ok(())
}

/// A square picture of the whole grid, without light and lettering.
fn params_of(side: &str, step: &str, view: View) -> Anything<RenderParams> {
    let side = side.parse()?;
    let plain =
        RenderParams { shading: false, annotate: false, fit: Fit::Volume, view, ..RenderParams::default() };
    Ok(RenderParams { size: [side; 2], step: step.parse()?, ..plain })
}

/// The same picture by another mode.
fn in_mode(params: RenderParams, mode: &[&str]) -> Anything<RenderParams> {
    Ok(match mode {
        [] => params,
        ["shaded"] => RenderParams { shading: true, ..params },
        ["mip"] => RenderParams { mode: Mode::Mip, ..params },
        ["minip"] => RenderParams { mode: Mode::Minip, ..params },
        ["mean"] => RenderParams { mode: Mode::Mean, ..params },
        ["lmip"] => RenderParams { mode: Mode::Lmip { threshold: None }, ..params },
        ["attenuated-mip"] => RenderParams { mode: Mode::AttenuatedMip { attenuation: 10.0 }, ..params },
        [iso] => {
            let value = iso
                .strip_prefix("iso=")
                .ok_or("a mode: shaded, mip, minip, mean, lmip, attenuated-mip or iso=VALUE")?
                .parse()?;
            RenderParams { mode: Mode::Iso { value }, shading: true, ..params }
        }
        _ => return Err("one mode".into()),
    })
}

/// A view by azimuth and elevation (degrees).
fn view_of(angles: &str) -> Anything<View> {
    let (azimuth, elevation) = angles.split_once(',').ok_or("view: azimuth,elevation")?;
    Ok(View { angles: [azimuth.parse()?, elevation.parse()?], ..View::FRONT })
}

fn figures_of(found: &Rendered) -> serde_json::Value {
    json!({ "samples_per_pixel": found.samples_per_pixel, "skipped_fraction": found.skipped_fraction })
}
