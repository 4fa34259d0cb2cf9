//! Times k-means on place and value on a raw volume, and holds it against the plain twin.
//!
//! `measure kmvs-spatial FILE TYPE NX NY NZ SX SY SZ START WEIGHT ITERATIONS REPEATS THREADS [plain] [every]`: `START` is a text file with
//! one centroid a line (x y z in mm, value), or a number of classes for k-means++. `plain` compares with the twin; `every` looks
//! at every voxel one by one.

use std::time::Instant;

use cpu_time::ProcessTime;
use ivd_core::Exec;
use ivd_segment::{KmvsParams, kmvs_spatial};

use crate::anything::Anything;
use crate::raw;

#[path = "../../../ivd-segment/tests/plain/kmvs_spatial.rs"]
mod plain;

pub(crate) const USAGE: &str =
    "FILE TYPE NX NY NZ SX SY SZ START WEIGHT ITERATIONS REPEATS THREADS [plain] [every]";

pub(crate) fn run(arguments: &[String]) -> Anything<()> {
    if arguments.len() < 13 {
        return Err(USAGE.into());
    }
    let number = |i: usize| arguments[i].parse::<f64>();
    let dims = [number(2)? as usize, number(3)? as usize, number(4)? as usize];
    let volume = raw::volume(&arguments[0], &arguments[1], dims, [number(5)?, number(6)?, number(7)?])?;
    let start: Option<Vec<[f64; 4]>> = match arguments[8].parse::<usize>() {
        Ok(_) => None,
        Err(_) => Some(
            std::fs::read_to_string(&arguments[8])?
                .lines()
                .map(|line| {
                    let numbers: Vec<f64> =
                        line.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
                    Ok([numbers[0], numbers[1], numbers[2], numbers[3]])
                })
                .collect::<Anything<_>>()?,
        ),
    };
    let k = start.as_ref().map_or_else(|| arguments[8].parse(), |s| Ok(s.len()))?;
    let (weight, max_iterations) = (number(9)?, number(10)? as u64);
    let params = KmvsParams { k, spatial_weight: weight, max_iterations, start, ..KmvsParams::default() };
    let has = |word: &str| arguments.iter().any(|a| a == word);
    let mut exec = Exec::default().with_threads(number(12)? as usize);
    exec.skip = !has("every");
    let repeats = number(11)?;
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let mut found = kmvs_spatial(&volume, None, &params, &exec)?;
    for _ in 1..repeats as u64 {
        found = kmvs_spatial(&volume, None, &params, &exec)?;
    }
    let (wall, cpu) = (wall.elapsed().as_secs_f64() / repeats, cpu.elapsed().as_secs_f64() / repeats);
    let of = &found.segmentation;
    println!(
        "wall {wall:.4} cpu {cpu:.3} iterations {} converged {} inertia {:.8e} visited {:.4} ties {} reseeded {} peak_mib {:.0}",
        of.iterations,
        of.converged,
        of.objective,
        of.visited_fraction,
        found.ties,
        found.reseeded,
        raw::peak_mib()
    );
    println!("centroids {:?}", found.centroids);
    if has("plain") {
        let start = params.start.as_deref().ok_or("the twin needs a start")?;
        let plain = plain::lloyd(&volume, None, weight, start, max_iterations);
        let class = |id: u16| found.centroids.iter().position(|c| *c == plain.centroids[usize::from(id) - 1]);
        let classes: Vec<u16> = (1..=plain.centroids.len() as u16)
            .map(|id| class(id).map_or(u16::MAX, |class| class as u16 + 1))
            .collect();
        let differ = plain.ids.iter().zip(of.labels.ids());
        let differ = differ.filter(|(a, b)| classes[usize::from(**a) - 1] != **b).count();
        println!("plain: {differ} of {} voxels differ", plain.ids.len());
    }
    Ok(())
}
