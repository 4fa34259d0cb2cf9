use ivd_core::op::Amount;
use ivd_core::{Grid, Lattice, VoxelCoord, World};
use ivd_lattice::extract::{self, LatticeFigures};
use ivd_lattice::refine::{self, RefineFigures};
use ivd_motion::deform::{self, Asked, Figures, Handle};
use ivd_pipeline::scene::Scene;
use ivd_pipeline::stages::{IMPORT, ImportFigures};
use ivd_pipeline::{Error, PipelineReport, figures_of, list};
use ivd_render::RenderParams;
use nalgebra::Vector3;

/// The name of a rate: a stage with its variant, or `write` with the key of an output.
pub fn rate_name(stage: &str, variant: &str) -> String {
    // Pictures are alike, and so is all that goes along with a displacement.
    let goes_along =
        || list::place(&format!("{stage} {variant}")).is_some_and(|(_, place)| place.for_outputs);
    let variant = match variant {
        picture if picture.starts_with("image ") => "image",
        _ if goes_along() => "",
        other => other,
    };
    format!("{stage} {variant}").trim().to_owned()
}

/// An import that gave no volume.
fn no_volume() -> Error {
    Error::Figure { stage: IMPORT.to_owned(), problem: "it gave no volume".to_owned() }
}

/// How much there is to do in a scene; what isn't known yet is 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Amounts {
    /// Voxels of the volume.
    pub voxels: f64,
    /// Voxels along its edge: the cube root of their number.
    pub edge: f64,
    /// Triangles of the lattice as cut.
    pub triangles: f64,
    /// Triangles of the refined lattice.
    pub refined: f64,
    /// Vertices of the refined lattice that the handles reach.
    pub moved: f64,
    /// Voxels in the handles' reach and its margin.
    pub reach: f64,
    /// Pixels of a picture.
    pub pixels: f64,
    /// Rays of a picture.
    pub rays: f64,
}

impl Amounts {
    /// Those of a finished run; 0 where a stage wasn't needed.
    ///
    /// # Errors
    /// [`Error::Figure`] where a stage did its work and doesn't tell how much it was.
    pub fn of_report(scene: &Scene, report: &PipelineReport) -> Result<Self, Error> {
        let records = &report.stages;
        let import: ImportFigures = figures_of(records, IMPORT)?.ok_or_else(no_volume)?;
        let cut: Option<LatticeFigures> = figures_of(records, extract::STAGE.name)?;
        let refined: Option<RefineFigures> = figures_of(records, refine::STAGE.name)?;
        let deformed: Option<Figures> = figures_of(records, deform::STAGE.name)?;
        let grid = Grid::with_spacing(import.dims, [1.0; 3]).map_err(ivd_core::Error::from)?;
        Ok(Self {
            triangles: cut.map_or(0.0, |found| found.triangles as f64),
            refined: refined.map_or(0.0, |found| found.last.triangles as f64),
            moved: deformed.map_or(0.0, |found| found.vertices_moved as f64),
            ..Self::of_volume(scene, &grid)
        })
    }

    /// What the volume alone tells.
    pub fn of_volume(scene: &Scene, grid: &Grid) -> Self {
        let voxels = grid.len() as f64;
        let RenderParams { size, antialias, .. } = scene.common(&ivd_render::STAGE).unwrap_or_default();
        let pixels = (size[0] * size[1]) as f64;
        Self {
            voxels,
            edge: voxels.cbrt(),
            pixels,
            rays: pixels * (antialias * antialias) as f64,
            reach: scene.asked().map_or(0.0, |asked| reach_voxels(asked, grid)),
            ..Self::default()
        }
    }

    /// Adds what the lattice as cut tells, all of it kept.
    pub(crate) fn with_lattice(self, asked: Option<Asked<'_>>, lattice: &Lattice) -> Self {
        let triangles = lattice.triangles().len() as f64;
        let moved = asked.map_or(0, |asked| reached(asked, lattice)) as f64;
        Self { triangles, refined: triangles, moved, ..self }
    }

    /// Where refinement keeps a share of the lattice.
    pub(crate) fn refined(&self, share: f64) -> Self {
        Self { refined: share * self.refined, moved: share * self.moved, ..self.clone() }
    }

    /// The amount that a rate counts, with its name.
    pub fn of(&self, rate: &str) -> (&'static str, f64) {
        let amount = match rate.strip_prefix("write ") {
            None => list::place(rate).map_or(Amount::Voxels, |(_, place)| place.amount),
            Some("lattice_extracted") => Amount::TrianglesAsCut,
            Some("lattice" | "lattice_deformed") => Amount::Triangles,
            Some("image") => Amount::Pixels,
            Some(_) => Amount::Voxels,
        };
        match amount {
            Amount::Voxels => ("voxels", self.voxels),
            Amount::VoxelsInReach => ("voxels in reach", self.reach),
            Amount::TrianglesAsCut => ("triangles as cut", self.triangles),
            Amount::Triangles => ("triangles", self.refined),
            Amount::VerticesInReach => ("vertices in reach", self.moved),
            Amount::Samples => ("pixels × voxels along an edge", self.rays * self.edge),
            Amount::Pixels => ("pixels", self.pixels),
        }
    }
}

/// Voxels in the balls that handles, bones and shapes reach, widened by the default margin, as far as the volume goes. A handle that
/// names a vertex is taken to lie in the middle.
fn reach_voxels(asked: Asked<'_>, grid: &Grid) -> f64 {
    let dims = grid.dims().map(|n| n as f64);
    let middle = Vector3::from(dims.map(|n| 0.5 * n));
    let voxels = |(centre, radius, motion): (Option<[f64; 3]>, f64, f64)| {
        let radius = radius + 4.0 * motion;
        let centre = centre.map_or(middle, |p| grid.voxel(World(p.into())).0);
        let spacing = grid.spacing();
        let sides = (0..3).map(|a| {
            let half = radius / spacing[a];
            ((centre[a] + half).min(dims[a]) - (centre[a] - half).max(0.0)).max(0.0)
        });
        // A ball fills this part of its cube.
        sides.product::<f64>() * std::f64::consts::FRAC_PI_6
    };
    asked.balls().map(voxels).sum::<f64>().min(grid.len() as f64)
}

/// Vertices of a lattice nearer to a handle or a bone than its reach.
fn reached(asked: Asked<'_>, lattice: &Lattice) -> usize {
    let centre = |handle: &Handle| match (handle.pick, handle.vertex) {
        (Some(point), _) => lattice.grid().voxel(World(point.into())),
        (None, vertex) => {
            let vertex = vertex.map_or(0, |v| v as usize);
            if vertex < lattice.keys().len() { lattice.voxel(vertex) } else { VoxelCoord(Vector3::zeros()) }
        }
    };
    let linear = lattice.grid().linear_part();
    let bones = asked.bones.iter().filter_map(|b| {
        let (centre, radius) = b.ball();
        Some((linear * lattice.grid().voxel(World(centre?.into())).0, radius))
    });
    let balls: Vec<(Vector3<f64>, f64)> =
        asked.moves.handle.iter().map(|h| (linear * centre(h).0, h.radius)).chain(bones).collect();
    let near = |p: &Vector3<f64>| balls.iter().any(|(c, r)| (p - c).norm() < *r);
    lattice.local_positions().iter().filter(|p| near(p)).count()
}
