//! What can be typed.

mod combine;
mod output;
mod serve;
mod view;

use std::path::PathBuf;

use clap::builder::TypedValueParser as _;
use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use ivd_io::volume::VoxelAxes;
use ivd_pipeline::Depth;
use ivd_pipeline::scene::{Override, triple};

use crate::parse::{self, Frames};

pub(crate) use combine::{ClipArgs, CombineArgs};
pub(crate) use output::{Output, artefact_file, check_artefact_name};
pub(crate) use serve::ServeArgs;
pub(crate) use view::ViewArgs;

/// Interactive deformation of scanned volumes: from a CT, MRI or micro-CT volume to a deformed one.
///
/// Exit codes: 0 done, 2 wrong usage or scene, 3 input unreadable or hostile, 4 a limit was hit, 5 the result can't be
/// trusted, 6 a GPU was required and there is none, 7 reading or writing failed, 130 interrupted.
#[derive(Debug, Parser)]
#[command(name = "ivd", version, max_term_width = 110)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Flags of every command.
#[derive(Debug, Clone, ClapArgs)]
#[command(next_help_heading = "Global options")]
#[allow(clippy::struct_excessive_bools, reason = "flags, as they are typed")]
pub(crate) struct Global {
    /// Print exactly one JSON object on stdout.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Whether the CPU or the GPU does what a GPU can do (pictures, histograms, labels, lattices, warped volumes).
    #[arg(long, global = true, value_enum, default_value_t = BackendChoice::Auto)]
    pub(crate) backend: BackendChoice,
    /// Fail with exit code 6 unless a GPU does all the work that a GPU can do.
    #[arg(long, global = true)]
    pub(crate) require_gpu: bool,
    /// Disable all skipping: the same output, slower. For measuring what skipping saves.
    #[arg(long, global = true)]
    pub(crate) no_skip: bool,
    /// Worker threads. Default: one for each processor.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) threads: Option<u16>,
    /// Use only the processor's baseline instructions (no AVX2); the results are the same, and tests show it.
    #[arg(long, global = true, hide = true)]
    pub(crate) no_simd: bool,
    /// Most memory that the work may use, such as 4GiB, not counting mapped files; below 64MiB only large arrays count.
    #[arg(long, global = true, value_name = "SIZE", value_parser = parse::bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// Read a stage's parameters from a TOML file; the keys are those of its section in a scene.
    #[arg(long, global = true, value_name = "FILE.toml")]
    pub(crate) params: Option<PathBuf>,
    /// Cache folder, or `off`. Single stages use a cache only if this is given.
    #[arg(long, global = true, value_name = "DIR|off")]
    pub(crate) cache: Option<PathBuf>,
    /// Print errors only; results still go to standard output.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Print more; given twice, still more.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
    /// Progress on stderr.
    #[arg(long, global = true, value_enum, default_value_t = When::Auto)]
    pub(crate) progress: When,
}

/// What computes: CPU or GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BackendChoice {
    /// The CPU: opening a GPU costs more than it saves on the pictures of one command.
    Auto,
    /// The CPU.
    Cpu,
    /// The GPU, for what it can do; the CPU does the rest. The environment variable IVD_ADAPTER names one of several.
    Gpu,
}

/// When to show progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum When {
    /// Bars on a terminal, else a line every 30 s; nothing with --quiet.
    Auto,
    /// With --quiet too.
    Always,
    /// Never.
    Never,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Runs the whole pipeline on a generated head and prints where the report is.
    Demo {
        /// Folder of the outputs.
        #[arg(long, value_name = "DIR", default_value = "out/demo")]
        out: PathBuf,
    },
    /// Runs a scene: computes what its outputs need, and no more.
    Pipeline(Pipeline),
    /// Reads a volume of any known format, or a transfer function, and writes an artefact.
    Import {
        /// File, or folder of slices; for a transfer function a .json file, ours or that of another program.
        source: PathBuf,
        /// Treat the values as labels and write a labels artefact.
        #[arg(long, conflicts_with = "mask")]
        labels: bool,
        /// Treat what isn't 0 as inside and write a mask artefact.
        #[arg(long)]
        mask: bool,
        /// Read a vector field (.nrrd, .nii, .mha) as a displacement in mm, certify it and write a displacement artefact:
        /// inverse, from the deformed to the rest, as ITK, ANTs and 3D Slicer resample, or forward. Files that `ivd export` wrote say it
        /// themselves.
        #[arg(long, value_name = "inverse|forward", num_args = 0..=1, require_equals = true,
            conflicts_with_all = ["labels", "mask", "raw_dims", "frame", "series", "resample_slices", "axes"])]
        #[allow(clippy::option_option, reason = "not given, alone, or with a word")]
        displacement: Option<Option<Direction>>,
        /// A volume, onto whose grid labels, a mask or a displacement are put, by their places in mm: labels and masks from the nearest
        /// voxel, 0 outside of the file; a displacement linear between its own voxels, beyond them as at their border. For files whose axes
        /// are flipped, or that are coarser than the scan.
        #[arg(long, value_name = "VOLUME")]
        like: Option<PathBuf>,
        /// A file with as many voxels along x, y and z, whose spacing, place and axes are taken as they are: for scans, labels and masks that
        /// lost them, or have them wrong. The voxels stay in their order.
        #[arg(long, value_name = "FILE", conflicts_with_all = ["like", "displacement", "axes", "raw_spacing"])]
        grid_of: Option<PathBuf>,
        #[command(flatten)]
        raw: Raw,
        #[command(flatten)]
        output: Output,
    },
    /// Generates a volume whose every voxel's class is known.
    Phantom {
        /// head, sphere, torus, gyroid, spheres, shell, bars, neck or bust.
        name: String,
        /// Voxels along its edge.
        #[arg(long, default_value_t = 128)]
        size: usize,
        /// File for its true labels (an artefact, or a volume file by its ending).
        #[arg(long, value_name = "FILE")]
        truth: Option<PathBuf>,
        /// Rician noise as a fraction of the value range; head 0.04, others 0.
        #[arg(long, value_name = "SD")]
        noise: Option<f64>,
        /// Stored type.
        #[arg(long = "type", value_name = "u8|u16|f32", default_value = "u8")]
        voxel_type: String,
        /// Seed of the noise.
        #[arg(long, default_value_t = 7)]
        seed: u64,
        /// Of the bust: what is bright, as in T1-weighted MR or as in CT.
        #[arg(long, value_name = "mr|ct", default_value = "mr")]
        contrast: String,
        #[command(flatten)]
        output: Output,
    },
    /// Combines volumes, labels or masks: union, intersection, difference.
    Combine(Box<CombineArgs>),
    /// Keeps a part of a volume, of labels or of a mask.
    Clip(Box<ClipArgs>),
    /// Writes an artefact in another format, by the file's ending.
    Export {
        /// Artefact.
        artefact: PathBuf,
        /// nii, nii.gz, nrrd, nhdr, mha, mhd, vti, tif, raw; ply, obj, stl, glb, vtp, and pvd with --lattice; png, apng, gif, exr; vp.json, paraview.json; json.
        #[arg(short, long)]
        output: PathBuf,
        /// Of a lattice with coarser levels beside it: which, 0 the lattice itself.
        #[arg(long, value_name = "N")]
        level: Option<usize>,
        /// Of a motion: the lattice that it moves (artefact). Written as glb with a morph target for every frame, as pvd with a vtp for
        /// every frame, else as the last frame has it.
        #[arg(long)]
        lattice: Option<PathBuf>,
        /// Of a motion with --lattice: frame N, counted from 0, or all, each in a file with its number (name_0000.ply …). A mesh as that
        /// frame has it; in nrrd, nii, nii.gz and mha the displacement of the voxels, mapped with its defaults and certified. Of an image of a turntable: the picture.
        #[arg(long, value_name = "N|all", value_parser = parse::frames)]
        frame: Option<Frames>,
        /// Of a displacement: forward (rest to deformed) or inverse (deformed to rest, what resamplers want; the default).
        #[arg(long, value_enum)]
        direction: Option<Direction>,
        /// Of a lattice or a motion: the axes of the file, which says them as 3D Slicer reads it. Default: ras; of vtp and pvd lps, as VTK
        /// has volumes. glb has its own, metres with y up.
        #[arg(long, value_enum)]
        space: Option<MeshSpace>,
        /// Of an image whose light was kept (render --keep-light): bits of a channel of a png. With 16 it holds the light in 65,536 levels, where an image has 256, without background, letters
        /// and outline, as exr does. Default: 8.
        #[arg(long, value_name = "8|16", value_parser = parse::depth)]
        depth: Option<Depth>,
    },
    /// Describes what a file holds.
    Info {
        /// Artefact; volume, mesh or displacement field of any program; or folder.
        file: PathBuf,
        /// Of a DICOM folder: the series that it holds, each with the value that `ivd import --series` takes for it; with one (--series=3), what
        /// that series holds.
        #[arg(long, value_name = "SERIES", num_args = 0..=1, require_equals = true, conflicts_with_all = ["vertex", "voxel"])]
        #[allow(clippy::option_option, reason = "not given, alone, or with a word")]
        series: Option<Option<String>>,
        /// Of a lattice: which voxel this vertex belongs to, and where it is.
        #[arg(long, value_name = "N")]
        vertex: Vec<u32>,
        /// Of a lattice: the vertices that belong to this voxel.
        #[arg(long, value_name = "X,Y,Z", value_parser = parse::voxel, allow_hyphen_values = true)]
        voxel: Vec<[i64; 3]>,
        /// Of a volume, labels or a mask: the voxel at this place (mm, RAS), its value or class.
        #[arg(long, value_name = "X,Y,Z", value_parser = parse::place, allow_hyphen_values = true, conflicts_with_all = ["vertex", "voxel"])]
        at: Vec<[f64; 3]>,
        /// With --at: labels on the same grid, whose class there is reported too. A mask artefact is treated as with --mask.
        #[arg(long, value_name = "FILE", requires = "at")]
        labels: Option<PathBuf>,
        /// With --at: a mask on the same grid; whether the place is inside is reported too.
        #[arg(long, value_name = "FILE", requires = "at")]
        mask: Option<PathBuf>,
    },
    /// Measures the error between two artefacts of one kind.
    ///
    /// Classes of labels are matched one to one, so that the sum of their Dice coefficients is largest. A file from another program is read
    /// as the same kind as the artefact that it is compared with: a volume, labels or a mask. Two such files are read as volumes, or as labels with --labels.
    Compare {
        /// First artefact, or volume file.
        a: PathBuf,
        /// Second artefact, or volume file.
        b: PathBuf,
        /// Read the values of volumes as labels: report the overlap of each label (Dice), not the difference of values.
        #[arg(long)]
        labels: bool,
    },
    /// Measures run time against error for every stage with an accuracy setting: bench.json, bench.csv and a page.
    Bench(Bench),
    /// Shows a scan in a browser on this machine, where it can be deformed interactively; prints the links to open.
    Serve(ServeArgs),
    /// Shows a scan in a window, where it can be deformed interactively.
    View(ViewArgs),
    /// Reports on this machine: threads, memory, SIMD, GPU; what is switched off, and why.
    Doctor,
    /// Prints the JSON Schema of a scene.
    Schema,
    /// Shows the cache's size and entries, prunes it, or clears it.
    Cache {
        /// What to do.
        #[command(subcommand)]
        action: Option<CacheAction>,
    },
    /// Prints a completion script for a shell.
    Completions {
        /// Shell.
        shell: clap_complete::Shell,
    },
}

/// What the volume's format doesn't say.
#[allow(clippy::struct_field_names, reason = "the fields are the flags, word for word")]
#[derive(Debug, Clone, Default, ClapArgs)]
pub(crate) struct Raw {
    /// Voxels along x, y, z of a raw file or of raw slices.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::dims, requires = "raw_type")]
    pub(crate) raw_dims: Option<[usize; 3]>,
    /// Stored type.
    #[arg(long, value_name = "TYPE", requires = "raw_dims")]
    pub(crate) raw_type: Option<String>,
    /// Distance between voxel centres (mm). Default: 1,1,1.
    #[arg(long, value_name = "a,b,c", value_parser = triple, allow_hyphen_values = true)]
    pub(crate) raw_spacing: Option<[f64; 3]>,
    /// Byte order: little or big.
    #[arg(long, value_name = "little|big")]
    pub(crate) raw_order: Option<String>,
    /// Bytes before the voxels.
    #[arg(long, value_name = "BYTES", default_value_t = 0)]
    pub(crate) raw_skip: u64,
    /// Frame of a 4-D file, from 0.
    #[arg(long)]
    pub(crate) frame: Option<usize>,
    /// DICOM series, where a folder holds several: its number, its UID or the start of that; `ivd info FOLDER --series` lists them.
    #[arg(long)]
    pub(crate) series: Option<String>,
    /// Puts slices of a DICOM series that aren't evenly spaced onto even spacing, by linear interpolation. Without it such a series is
    /// refused.
    #[arg(long)]
    pub(crate) resample_slices: bool,
    /// Where x, y and z of the voxels lead: a letter each, right or left, anterior or posterior, superior or inferior. LPS: x grows to the
    /// patient's left, y to the back, z to the head. Default: what the file says; LPS, and no letters in pictures, where it says nothing.
    #[arg(long, value_name = "LPS|RAI|…", value_parser = parse::axes)]
    pub(crate) axes: Option<VoxelAxes>,
}

/// How a scene is run.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct Pipeline {
    /// Scene file.
    pub(crate) scene: PathBuf,
    /// Use this volume instead of the scene's.
    #[arg(long, value_name = "FILE")]
    pub(crate) input: Option<PathBuf>,
    /// Folder for the outputs. Default: `out/<scene>`.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Override a key of the scene.
    #[arg(long = "set", value_name = "stage.key=value")]
    pub(crate) overrides: Vec<Override>,
    /// Stop after this stage; outputs aren't written.
    #[arg(long, value_name = "STAGE")]
    pub(crate) until: Option<String>,
    /// Run a stage even where the cache has its result.
    #[arg(long, value_name = "STAGE")]
    pub(crate) force: Vec<String>,
    /// Say for every stage whether it ran, came from the cache or wasn't needed, and why.
    #[arg(long)]
    pub(crate) explain: bool,
    /// Say what would run, and do nothing.
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Time limit for the run (s, wall clock). Coarser settings are chosen if it would be missed; at the deadline the run ends with code 4.
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub(crate) max_time: Option<f64>,
    /// Error limit for the result (mm), against the unrefined lattice. Settings are chosen, measured and made finer until it
    /// holds; if none does, the run ends with code 4.
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pub(crate) max_error: Option<f64>,
}

/// What to do with the cache.
#[derive(Debug, Clone, Copy, Subcommand)]
pub(crate) enum CacheAction {
    /// Size and entries.
    Show,
    /// Drop the least recently used entries, until the cache is no larger than a given size.
    Prune {
        /// Size to keep, such as 2GiB.
        #[arg(long, value_name = "SIZE", value_parser = parse::bytes, default_value = "2GiB")]
        keep: u64,
    },
    /// Drop everything.
    Clear,
}

/// `ivd bench`.
#[derive(Debug, Clone, ClapArgs)]
pub(crate) struct Bench {
    /// segment, atf, lattice, refine, deform, map, warp, render, or scenes: whole scenes, what they skip and how they grow.
    /// All of them where none is named. On request alone: segment-kmvs, segment-emvs, segment-msvs, segment-hvs,
    /// refine-methods; solvers: masses on springs, the energy that each comes down to; map-methods and deformation: every map, and level, solver and map together, against finite elements;
    /// refinements: the same lattices by every method, with pictures; and interactive: a handle that is dragged.
    #[arg(value_name = "STAGE")]
    pub(crate) stages: Vec<String>,
    /// Small inputs and few repeats: under two minutes.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Folder of the outputs.
    #[arg(long, value_name = "DIR", default_value = "out/bench")]
    pub(crate) out: PathBuf,
    /// An older bench.json of this machine: what changed beyond the noise.
    #[arg(long, value_name = "OLD.json")]
    pub(crate) compare: Option<PathBuf>,
    /// A volume in place of the generated inputs: the stages whose truth is a finer result on the same volume.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["size", "record"])]
    pub(crate) input: Option<PathBuf>,
    /// Where refinements and interactive cut the given volume; the densest part's own value without it.
    #[arg(long, value_name = "VALUE", requires = "input", allow_negative_numbers = true)]
    pub(crate) iso: Option<f64>,
    /// Voxels along the edge of the generated inputs; 128, with --quick 64.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(16..=512).map(usize::from))]
    pub(crate) size: Option<usize>,
    /// Times that every setting is timed; 5, with --quick 3.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..).map(usize::from))]
    pub(crate) repeats: Option<usize>,
    /// Keeps the fronts for the checks of the defaults and for budgets: a file a stage, and stages.json with the times of a
    /// plain scene where every stage is swept.
    #[arg(long, value_name = "DIR")]
    pub(crate) record: Option<PathBuf>,
    /// A fault for --compare to find; for tests.
    #[arg(long, value_enum, hide = true)]
    pub(crate) plant: Option<Planted>,
}

/// A fault put in on purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Planted {
    /// Everything is done twice.
    Slow,
    /// Every error is half as large again.
    Inexact,
}

/// Which way the axes of a mesh run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MeshSpace {
    /// To the patient's right, front and head.
    Ras,
    /// To the patient's left, back and head.
    Lps,
}

/// Which way a displacement field leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Direction {
    /// Rest to deformed.
    Forward,
    /// Deformed to rest.
    Inverse,
}
