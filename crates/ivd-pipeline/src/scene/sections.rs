use std::path::{Path, PathBuf};

use ivd_core::VoxelType;
use ivd_volume::phantom;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[input]`: a file or folder, or a generated phantom.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputSection {
    /// Volume file or folder of slices, relative to the scene's folder.
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// Layout of a raw file or of raw slices.
    #[serde(default)]
    pub raw: Option<RawSection>,
    /// Frame of a 4-D file, from 0.
    #[serde(default)]
    pub frame: Option<usize>,
    /// DICOM series, where the folder holds several.
    #[serde(default)]
    pub series: Option<String>,
    /// Distance of voxel centres (mm), for formats that don't say it.
    #[serde(default)]
    pub spacing: Option<[f64; 3]>,
    /// A generated volume: head, sphere, torus, gyroid, spheres, shell or bars.
    #[serde(default)]
    #[schemars(with = "Option<String>")]
    pub phantom: Option<phantom::Shape>,
    /// Voxels along a phantom's edge.
    #[serde(default)]
    pub size: Option<usize>,
    /// Rician noise of a phantom, as a fraction of the value range.
    #[serde(default)]
    pub noise: Option<f64>,
    /// Stored type of a phantom: u8, u16 or f32.
    #[serde(default, rename = "type")]
    #[schemars(with = "Option<String>")]
    pub voxel_type: Option<VoxelType>,
    /// Seed of a phantom's noise.
    #[serde(default)]
    pub seed: Option<u64>,
}

/// Layout of raw voxels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSection {
    /// Voxels along x, y, z (x fastest).
    pub dims: [usize; 3],
    /// Stored type.
    #[serde(rename = "type")]
    #[schemars(with = "String")]
    pub voxel_type: VoxelType,
    /// Distance of voxel centres (mm).
    #[serde(default = "unit_spacing")]
    pub spacing: [f64; 3],
    /// Byte order: "little" or "big".
    #[serde(default)]
    #[schemars(with = "String")]
    pub order: ivd_volume::ByteOrder,
    /// Bytes before the voxels.
    #[serde(default)]
    pub skip: u64,
}

fn unit_spacing() -> [f64; 3] {
    [1.0; 3]
}

/// How structure is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SegmentMethod {
    /// k-means on intensity, globally optimal.
    #[default]
    Kmvs,
    /// Given thresholds.
    Threshold,
}

/// `[segment]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentSection {
    /// Method.
    pub method: SegmentMethod,
    /// Number of classes of `kmvs`.
    pub k: usize,
    /// Ascending thresholds of `threshold`, in real values.
    pub values: Vec<f64>,
}

impl Default for SegmentSection {
    fn default() -> Self {
        Self { method: SegmentMethod::Kmvs, k: 4, values: Vec::new() }
    }
}

/// A class of the segmentation: an id, "densest" or "largest".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ClassChoice {
    /// A class id.
    Id(u16),
    /// A word.
    Word(ClassWord),
}

/// A class by what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ClassWord {
    /// Highest mean.
    Densest,
    /// Most voxels, air apart.
    Largest,
}

impl std::str::FromStr for ClassChoice {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "densest" => Ok(Self::Word(ClassWord::Densest)),
            "largest" => Ok(Self::Word(ClassWord::Largest)),
            _ => text.parse().map(Self::Id).map_err(|_| format!("`{text}`: a class id, densest or largest")),
        }
    }
}

/// `[boundary]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BoundarySection {
    /// The class whose part is isolated.
    pub class: Option<ClassChoice>,
    /// A point in the part (mm), RAS; the largest part where it isn't given.
    pub seed: Option<[f64; 3]>,
    /// Whether holes inside the part belong to it.
    pub fill_holes: bool,
}

impl Default for BoundarySection {
    fn default() -> Self {
        Self { class: None, seed: None, fill_holes: true }
    }
}

/// Where the lattice is cut: a value, or the word "boundary".
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum IsoChoice {
    /// A real value; inside is above.
    Value(f64),
    /// The class's crossings with its neighbours in intensity.
    Word(IsoWord),
}

/// The word for [`IsoChoice`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum IsoWord {
    /// The class's crossings.
    Boundary,
}

impl std::str::FromStr for IsoChoice {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "boundary" => Ok(Self::Word(IsoWord::Boundary)),
            _ => text.parse().map(Self::Value).map_err(|_| format!("`{text}`: a value, or `boundary`")),
        }
    }
}

/// `[lattice]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LatticeSection {
    /// Isovalue, or "boundary".
    pub iso: IsoChoice,
}

impl Default for LatticeSection {
    fn default() -> Self {
        Self { iso: IsoChoice::Word(IsoWord::Boundary) }
    }
}

/// How a lattice is simplified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RefineMethod {
    /// Half-edge collapse by quadrics.
    #[default]
    Collapse,
}

/// `[refine]`: one of level, ratio or max_error.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RefineSection {
    /// Method.
    pub method: RefineMethod,
    /// Keep about 4⁻ᴸ of the vertices; 2 where nothing is said.
    pub level: Option<u8>,
    /// Keep this share of the triangles.
    pub ratio: Option<f64>,
    /// Keep the surface within this distance (mm).
    pub max_error: Option<f64>,
}

/// How the lattice moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// The thesis's rings.
    #[default]
    Ring,
}

/// `[deform]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DeformSection {
    /// Solver.
    pub solver: Solver,
    /// Stiffness of a spring (N/m).
    pub stiffness: f64,
    /// Time of the motion (s).
    pub duration: f64,
    /// Time step (s); chosen where it isn't given.
    pub dt: Option<f64>,
    /// What moves.
    pub handle: Vec<HandleSection>,
    /// What stays.
    pub fix: Vec<FixSection>,
}

impl Default for DeformSection {
    fn default() -> Self {
        Self {
            solver: Solver::Ring,
            stiffness: 50.0,
            duration: 0.2,
            dt: None,
            handle: Vec::new(),
            fix: Vec::new(),
        }
    }
}

/// `[[deform.handle]]`: pick or vertex, move or force, radius.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandleSection {
    /// A point (mm), RAS; the nearest vertex is taken.
    #[serde(default)]
    pub pick: Option<[f64; 3]>,
    /// A vertex of the lattice that deform reads.
    #[serde(default)]
    pub vertex: Option<u32>,
    /// Where the vertex goes (mm), relative.
    #[serde(default, rename = "move")]
    pub displace: Option<[f64; 3]>,
    /// The force on it (mN).
    #[serde(default)]
    pub force: Option<[f64; 3]>,
    /// Reach in rest space (mm).
    pub radius: f64,
}

impl HandleSection {
    /// Checks that exactly one place and one action are given, and that they are finite.
    ///
    /// # Errors
    /// A sentence with the key and the remedy.
    pub fn check(&self) -> Result<(), String> {
        if self.pick.is_some() == self.vertex.is_some() {
            return Err("give pick = [x, y, z] (mm) or vertex = N, one of them".into());
        }
        if self.displace.is_some() == self.force.is_some() {
            return Err("give move = [x, y, z] (mm) or force = [x, y, z] (mN), one of them".into());
        }
        if !(self.radius.is_finite() && self.radius > 0.0) {
            return Err(format!("radius = {}: must be a positive length in mm", self.radius));
        }
        let vectors = [("pick", self.pick), ("move", self.displace), ("force", self.force)];
        for (key, vector) in vectors {
            if vector.is_some_and(|v| !v.iter().all(|c| c.is_finite())) {
                return Err(format!("{key}: not a finite vector"));
            }
        }
        Ok(())
    }
}

/// `[[deform.fix]]`: vertices that stay.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FixSection {
    /// Centre (mm), RAS.
    pub pick: [f64; 3],
    /// Radius (mm).
    pub radius: f64,
}

/// How motion is carried to voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MapMethod {
    /// Through the octree, weighted by depth.
    #[default]
    Octree,
}

/// What happens outside the lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Outside {
    /// The surroundings follow within a band.
    #[default]
    Band,
    /// The part moves alone; what it leaves becomes background.
    Free,
}

/// How displacement fades with depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DepthWeight {
    /// Straight to zero.
    Linear,
    /// Smooth to zero.
    #[default]
    Smooth,
    /// Exponential.
    Exponential,
    /// No fading: the inside moves as its surface.
    One,
}

/// `[map]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapSection {
    /// Method.
    pub method: MapMethod,
    /// How displacement fades with depth.
    pub weight: DepthWeight,
    /// Depth at which it has faded (mm); from the handles where it isn't given.
    pub depth: Option<f64>,
    /// Width of the band beyond the handles' reach (mm).
    pub margin: Option<f64>,
    /// Outside of the lattice.
    pub outside: Outside,
    /// How far lattice points may be left behind to keep the map free of folds, as a fraction of their motion, 0…1.
    pub tolerance: Option<f64>,
}

/// Interpolation of a warp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WarpOrder {
    /// The nearest voxel.
    Nearest,
    /// Trilinear.
    #[default]
    Linear,
    /// Tricubic.
    Cubic,
}

/// `[warp]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WarpSection {
    /// Interpolation.
    pub order: WarpOrder,
    /// Real value of what comes from outside the volume.
    pub background: Option<f64>,
}

/// `[atf]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AtfSection {
    /// Samples of a row of the table.
    pub resolution: usize,
    /// Largest opacity of a class, 0…1.
    pub max_opacity: f32,
}

impl Default for AtfSection {
    fn default() -> Self {
        let params = ivd_atf::Params::default();
        Self { resolution: params.resolution, max_opacity: params.max_opacity }
    }
}

/// What a picture shows of the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RenderMode {
    /// Direct volume rendering.
    #[default]
    Dvr,
    /// Maximum intensity projection.
    Mip,
    /// First-hit isosurface.
    Iso,
}

/// `[render]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RenderSection {
    /// What is shown.
    pub mode: RenderMode,
    /// Isovalue of mode "iso".
    pub iso: Option<f64>,
    /// Width and height (pixels).
    pub size: [usize; 2],
    /// Azimuth and elevation (degrees); 0, 0 looks from the front.
    pub view: [f64; 2],
    /// Enlargement; 1 fits the volume.
    pub zoom: f64,
    /// Sample distance as a fraction of the smallest spacing.
    pub step: f64,
    /// Whether surfaces are shaded.
    pub shading: bool,
    /// Whether orientation letters and a scale bar are drawn.
    pub annotate: bool,
}

impl Default for RenderSection {
    fn default() -> Self {
        Self {
            mode: RenderMode::Dvr,
            iso: None,
            size: [512, 512],
            view: [30.0, 15.0],
            zoom: 1.0,
            step: 0.5,
            shading: true,
            annotate: true,
        }
    }
}

/// A picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Picture {
    /// The volume at rest.
    Before,
    /// The deformed volume.
    After,
    /// Where the two differ.
    Difference,
}

impl Picture {
    /// Its name in scenes and file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Before => "before",
            Self::After => "after",
            Self::Difference => "difference",
        }
    }
}

/// `[output]`: names of files in the output folder. Nothing that isn't named is computed.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutputSection {
    /// Pictures, written as `before.png`, `after.png`, `difference.png`.
    pub images: Vec<Picture>,
    /// The deformed volume.
    pub volume: Option<PathBuf>,
    /// The lattice that was deformed, at rest.
    pub lattice: Option<PathBuf>,
    /// The lattice as it was cut, before refinement.
    pub lattice_extracted: Option<PathBuf>,
    /// The deformed lattice.
    pub lattice_deformed: Option<PathBuf>,
    /// The displacement field from deformed to rest space, as a vector image.
    pub displacement: Option<PathBuf>,
    /// The labels.
    pub labels: Option<PathBuf>,
    /// The isolated part.
    pub mask: Option<PathBuf>,
    /// The report, `report.html`, with its pictures.
    pub report: bool,
}

impl OutputSection {
    /// The files that are named, with their keys.
    pub fn files(&self) -> Vec<(&'static str, &Path)> {
        [
            ("volume", &self.volume),
            ("lattice", &self.lattice),
            ("lattice_extracted", &self.lattice_extracted),
            ("lattice_deformed", &self.lattice_deformed),
            ("displacement", &self.displacement),
            ("labels", &self.labels),
            ("mask", &self.mask),
        ]
        .into_iter()
        .filter_map(|(key, path)| path.as_deref().map(|p| (key, p)))
        .collect()
    }
}
