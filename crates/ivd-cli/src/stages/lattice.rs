//! What `ivd lattice` does beside its stage: several lattices at once, and meshes of other programs.

use std::path::PathBuf;

use clap::{Arg, ArgAction, ArgMatches};
use ivd_core::op::{fields, schema_of};
use ivd_lattice::extract::LatticeParams;
use ivd_lattice::import::ImportParams;
use ivd_pipeline::stages::ImportedLattice;

use super::parts;
use crate::context::Context;
use crate::files::{filled, finish};

/// Its flags that are no keys.
pub(crate) fn flags() -> [Arg; 4] {
    let path = || clap::value_parser!(PathBuf);
    // What the stage's own way of making a lattice is told is nothing to these.
    let keys = || fields(schema_of::<LatticeParams>()).map(|field| field.name).chain(["mask"]);
    [
        Arg::new("parts")
            .long("parts")
            .value_name("ID,ID…|all")
            .conflicts_with_all(keys())
            .requires("labels")
            .help("Several labels at once, whose lattices meet without gaps: ids by priority, or `all`; the output is a folder"),
        Arg::new("mesh")
            .long("mesh")
            .value_name("FILE")
            .value_parser(path())
            .conflicts_with_all(keys().chain(["labels", "parts"]))
            .help("A closed mesh from another program (.ply, .obj, .stl, .glb, .vtp) to use as the lattice"),
        Arg::new("weld")
            .long("weld")
            .value_name("MM")
            .value_parser(clap::value_parser!(f64))
            .allow_hyphen_values(true)
            .requires("mesh")
            .help("Merge vertices of the mesh that are no further apart than this"),
        Arg::new("allow_open")
            .long("allow-open")
            .action(ArgAction::SetTrue)
            .requires("mesh")
            .help("Take a mesh that isn't closed; its inside has no meaning then"),
    ]
}

/// Does what those flags ask for; tells whether they were given.
pub(crate) fn run(matches: &ArgMatches, context: &Context) -> anyhow::Result<bool> {
    let path = |name: &str| matches.get_one::<PathBuf>(name);
    let (Some(volume), Some(output)) = (path("volume"), path("output")) else { return Ok(false) };
    if let (Some(ids), Some(labels)) = (matches.get_one::<String>("parts"), path("labels")) {
        parts::run(volume, labels, ids, output, context)?;
        return Ok(true);
    }
    let Some(mesh) = path("mesh") else { return Ok(false) };
    let weld = matches.get_one::<f64>("weld").copied().unwrap_or(ImportParams::default().weld);
    let params = ImportParams { weld, allow_open: matches.get_flag("allow_open") };
    let cache = context.stage_cache()?;
    let inputs =
        filled(&[("volume", Some(volume.as_path()))], |_| &[ivd_core::Kind::Volume], &cache, context)?;
    let stage = ImportedLattice { path: mesh.clone(), params };
    let done = context.run(&cache, &stage, &inputs)?;
    finish(&stage, done, output, context)?;
    Ok(true)
}
