use std::path::PathBuf;

use clap::Args as ClapArgs;
use ivd_pipeline::scene::StepSection;

use super::Output;

/// `ivd space`.
#[derive(Debug, ClapArgs)]
pub(crate) struct SpaceArgs {
    /// Volume artefact or file, labels artefact, or mask artefact: the voxels that are displaced.
    pub(crate) volume: PathBuf,
    /// 'kind=…;centre=x,y,z;…': a step, after those before it. Deflectors, as --shape of deform has them, with radius=r (mm):
    /// translate, rotate, scale, stretch, squeeze, twist, taper, bend. curve: a spatial transfer function, radius=r
    /// over=along|across|distance way=shift|turn|swell|grow knots=coordinate:value,… and axis=x,y,z. chain: chain mail, grip=r by=x,y,z
    /// and shrink, stretch, shear, as links of a class material.N=shrink:s,stretch:s,shear:s. cut: an incision that opens, radius=r
    /// normal=x,y,z open=w (mm).
    #[arg(long)]
    pub(crate) step: Vec<StepSection>,
    /// Displacement artefact to go on from.
    #[arg(long)]
    pub(crate) after: Option<PathBuf>,
    /// Labels artefact: links of chain mail by class.
    #[arg(long)]
    pub(crate) labels: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) output: Output,
}
