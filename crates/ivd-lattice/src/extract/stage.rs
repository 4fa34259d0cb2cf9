//! The stage as scenes and commands see it.

use std::collections::BTreeSet;

use ivd_core::op::{Failure, Memory, Method, Op, Place, Remark, Stage, Want, method};
use ivd_core::{
    BRICK, BrickIndex, Class, ClassChoice, ElementKey, Exec, Grid, Labels, Lattice, Mask, ParamError, Volume,
    slots,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::params::{ExtractParams, Iso};
use super::specks::SmallParts;
use super::{extract, specks};
use crate::Error;
use crate::figures::measure;

/// The stage: its one method, and where it stands in a scene.
pub const STAGE: Stage = Stage {
    name: "lattice",
    about: "Extracts a lattice by marching cubes.",
    selector: "",
    methods: METHODS,
    positional: &["volume"],
    places: &[Place::only("lattice")],
    quiet: false,
    memory: Memory { voxel: 20, reached: 0, triangle: 0 },
};
const METHODS: &[Method] = &[method::<LatticeParams>("")];

/// Where a lattice is cut: at a value, or where a class ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum IsoChoice {
    /// A real value; inside is above.
    Value(f64),
    /// A word.
    Word(IsoWord),
}

/// The word for [`IsoChoice`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum IsoWord {
    /// The class's crossings with its neighbours in intensity.
    Boundary,
}

/// The closed surface at a value, or at a class's crossings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct LatticeParams {
    /// Isovalue, or boundary: the class's crossings with its neighbours in intensity.
    #[schemars(extend("x-unit" = "value"))]
    pub iso: IsoChoice,
    /// The class whose crossings `boundary` uses: an id, densest or largest (except air). Without it the one that the mask was cut
    /// from, and without a mask the largest.
    #[schemars(extend("x-unit" = "1", "x-from" = "boundary.class"))]
    pub class: Option<ClassChoice>,
    /// Connected parts of the lattice that enclose less volume than this are left out. A cavity counts as a part; leaving it out fills it. 0 keeps all.
    #[schemars(range(min = 0.0), extend("x-unit" = "mm³"))]
    pub min_part: f64,
}

impl Default for LatticeParams {
    fn default() -> Self {
        Self { iso: IsoChoice::Word(IsoWord::Boundary), class: None, min_part: 0.0 }
    }
}

slots! {
    /// What a lattice is cut out of: the part in the mask, by the classes' crossings unless a value is given.
    pub struct Inputs<'a> { volume: &'a Volume, labels: Option<&'a Labels>, mask: Option<&'a Mask> }
}

/// What a lattice that was cut comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LatticeFigures {
    /// Vertices, used or not.
    #[schemars(extend("x-unit" = "1", "x-headline" = 1))]
    pub vertices: u64,
    /// Triangles, degenerate ones too.
    #[schemars(extend("x-unit" = "1", "x-headline" = 2))]
    pub triangles: u64,
    /// Edges with one triangle.
    #[schemars(extend("x-unit" = "1"))]
    pub boundary_edges: u64,
    /// Edges with more than two triangles.
    #[schemars(extend("x-unit" = "1"))]
    pub non_manifold_edges: u64,
    /// Triangles that name a vertex twice, or two of whose corners lie at one place.
    #[schemars(extend("x-unit" = "1"))]
    pub degenerate_triangles: u64,
    /// Euler characteristic: used vertices − edges + triangles.
    #[schemars(extend("x-unit" = "1"))]
    pub euler: i64,
    /// Parts that triangles connect.
    #[schemars(extend("x-unit" = "1"))]
    pub components: u64,
    /// Area.
    #[schemars(extend("x-unit" = "mm²"))]
    pub area_mm2: f64,
    /// Enclosed volume, of a closed lattice.
    #[schemars(extend("x-unit" = "mm³"))]
    pub volume_mm3: f64,
    /// Parts that `min_part` left out; not told where it is 0.
    #[schemars(extend("x-unit" = "1"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dropped_parts: Option<u64>,
    /// What they enclosed together, each without its sign.
    #[schemars(extend("x-unit" = "mm³"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dropped_mm3: Option<f64>,
    /// Parts left that enclose less than 1 % of what the largest does, cavities among them; of a lattice that was cut.
    #[schemars(extend("x-unit" = "1"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub small_parts: Option<u64>,
    /// What they enclose together, each without its sign.
    #[schemars(extend("x-unit" = "mm³"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub small_parts_mm3: Option<f64>,
    /// What the largest of them encloses.
    #[schemars(extend("x-unit" = "mm³"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_small_part_mm3: Option<f64>,
    /// Bricks (8³ voxels) that the surface passes through.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_active: u64,
    /// Bricks of the grid.
    #[schemars(extend("x-unit" = "1"))]
    pub bricks_total: u64,
    /// Vertices of the mesh that it was taken from, where it was.
    #[schemars(extend("x-unit" = "1"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices_in: Option<u64>,
}

impl LatticeFigures {
    /// Measures a lattice. Its active bricks are those that hold a vertex, the border layer's among those next to it.
    pub fn of(lattice: &Lattice) -> Self {
        let dims = lattice.grid().dims();
        let brick = |key: &ElementKey| {
            let voxel = key.voxel(dims);
            let within: [usize; 3] = std::array::from_fn(|a| voxel[a].clamp(0, dims[a] as i64 - 1) as usize);
            within.map(|v| v / BRICK)
        };
        let active: BTreeSet<[usize; 3]> = lattice.keys().iter().map(brick).collect();
        let total = BrickIndex::dims_for(dims).map(|n| n as u64).iter().product();
        Self::with_bricks(lattice, active.len() as u64, total)
    }

    /// The same, told of small parts.
    fn with_small_parts(self, lattice: &Lattice) -> Self {
        // Most lattices are one part, which is the largest.
        let small = if self.components > 1 { SmallParts::of(lattice) } else { SmallParts::default() };
        Self {
            small_parts: Some(small.count),
            small_parts_mm3: Some(small.volume_mm3),
            largest_small_part_mm3: Some(small.largest_mm3),
            ..self
        }
    }

    /// What a person should know: that nothing was cut; or of parts that are small, where nothing was said of them and there are some.
    pub fn remark(&self) -> Option<String> {
        if self.vertices == 0 {
            let remedy = "choose an isovalue within the volume's range, or a class that has voxels: `ivd info` tells both";
            return Some(format!("the lattice is empty: nothing is cut; {remedy}"));
        }
        let small = SmallParts {
            count: self.small_parts?,
            volume_mm3: self.small_parts_mm3?,
            largest_mm3: self.largest_small_part_mm3?,
        };
        small.told().filter(|_| self.dropped_parts.is_none())
    }

    fn with_bricks(lattice: &Lattice, bricks_active: u64, bricks_total: u64) -> Self {
        let f = measure(lattice);
        Self {
            vertices: f.vertices,
            triangles: f.triangles,
            boundary_edges: f.boundary_edges,
            non_manifold_edges: f.non_manifold_edges,
            degenerate_triangles: f.degenerate_triangles,
            euler: f.euler,
            components: f.components,
            area_mm2: f.area_mm2,
            volume_mm3: f.volume_mm3,
            dropped_parts: None,
            dropped_mm3: None,
            small_parts: None,
            small_parts_mm3: None,
            largest_small_part_mm3: None,
            bricks_active,
            bricks_total,
            vertices_in: None,
        }
    }
}

impl Op for LatticeParams {
    const REVISION: u32 = 2;
    const REMARK: Option<Remark<LatticeFigures>> = Some(LatticeFigures::remark);
    type Inputs<'a> = Inputs<'a>;
    type Gives = (Lattice, LatticeFigures);

    fn wants(&self, slot: &str) -> Want {
        match (self.iso, slot) {
            (IsoChoice::Word(_), _) => Want::Yes,
            (IsoChoice::Value(_), "mask") => Want::IfWritten,
            (IsoChoice::Value(_), _) => Want::No,
        }
    }

    fn run(&self, inputs: Inputs<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let Inputs { volume, labels, mask } = inputs;
        let params = ExtractParams { iso: self.crossings(volume.grid(), labels, mask)? };
        // A class without crossings is what has its label.
        let own = match (params.iso, labels, mask) {
            (Iso::Mask, Some(labels), None) => Some(exec.run(|| mask_of(labels, self.class_of(labels)?.id))?),
            _ => None,
        };
        let mask = mask.or(own.as_ref());
        let extracted = extract(volume, mask, &params, exec)?;
        exec.check_cancelled()?;
        let (active, total) = (extracted.bricks_active, extracted.bricks_total);
        if self.min_part == 0.0 {
            let lattice = extracted.lattice;
            let figures =
                exec.run(|| LatticeFigures::with_bricks(&lattice, active, total).with_small_parts(&lattice));
            return Ok((lattice, figures));
        }
        let (lattice, parts, volume) = specks::without(&extracted.lattice, self.min_part, exec)?;
        let figures = exec.run(|| match parts {
            0 => LatticeFigures::with_bricks(&lattice, active, total),
            _ => LatticeFigures::of(&lattice),
        });
        let figures = LatticeFigures { dropped_parts: Some(parts), dropped_mm3: Some(volume), ..figures };
        let figures = exec.run(|| figures.with_small_parts(&lattice));
        Ok((lattice, figures))
    }
}

impl LatticeParams {
    /// Whether a class is named by which the surface is cut.
    pub fn needs_class(&self) -> bool {
        self.class.is_some() && matches!(self.iso, IsoChoice::Word(_))
    }

    /// The class that is meant where nothing else tells.
    fn class_of<'a>(&self, labels: &'a Labels) -> Result<&'a Class, Error> {
        Ok(labels.choose(self.class.unwrap_or(ClassChoice::Largest))?)
    }

    /// Where the surface is: at the value, or at the crossings of the class that is meant, the one named, else the one that the mask was
    /// cut from, else the largest. Where no crossings are known, and for a mask with a level function, it is the mask's own surface.
    ///
    /// # Errors
    /// Neither labels nor a mask where a class is meant; labels or a mask on another grid; an unknown class.
    pub fn crossings(&self, grid: &Grid, labels: Option<&Labels>, mask: Option<&Mask>) -> Result<Iso, Error> {
        let others = [labels.map(|l| ("labels", l.grid())), mask.map(|m| ("mask", m.grid()))];
        others.into_iter().flatten().try_for_each(|(what, other)| grid.require(other, "volume", what))?;
        let class = match (self.iso, labels, mask) {
            (IsoChoice::Value(value), ..) => return Ok(Iso::Value(value)),
            (IsoChoice::Word(_), None, Some(_)) => return Ok(Iso::Mask),
            // A border that was found between the voxels is the part's, whatever classes there are.
            (IsoChoice::Word(_), Some(_), Some(mask)) if mask.level().is_some() && self.class.is_none() => {
                return Ok(Iso::Mask);
            }
            (IsoChoice::Word(_), None, None) => {
                return Err(Error::MissingInput {
                    asked: "iso = boundary",
                    needed: "labels or a mask",
                    remedy: "give them, or a value",
                });
            }
            (IsoChoice::Word(_), Some(labels), mask) => match (self.class, mask) {
                (Some(choice), _) => labels.choose(choice)?,
                (None, Some(mask)) => majority(labels, mask)?,
                (None, None) => self.class_of(labels)?,
            },
        };
        Ok(match (class.lower, class.upper) {
            (None, None) => Iso::Mask,
            (lower, upper) => Iso::Interval { lower, upper },
        })
    }
}

/// The voxels of a class.
fn mask_of(labels: &Labels, id: u16) -> Result<Mask, Error> {
    let inside: Vec<u8> = labels.ids().par_iter().map(|own| u8::from(*own == id)).collect();
    Ok(Mask::new(labels.grid().clone(), inside.into())?)
}

/// The class that most voxels of a mask belong to (a filled hole belongs to others).
fn majority<'a>(labels: &'a Labels, mask: &Mask) -> Result<&'a Class, Error> {
    /// Voxels beside each other that are skipped together where none of them is inside.
    const RUN: usize = 64;
    let mut counts = vec![0_u64; usize::from(u16::MAX) + 1];
    for (ids, inside) in labels.ids().chunks(RUN).zip(mask.inside().chunks(RUN)) {
        if inside.iter().fold(0, |any, v| any | v) == 0 {
            continue;
        }
        for (id, _) in ids.iter().zip(inside).filter(|(_, inside)| **inside == 1) {
            counts[usize::from(*id)] += 1;
        }
    }
    let most = labels.classes().iter().max_by_key(|c| (counts[usize::from(c.id)], std::cmp::Reverse(c.id)));
    most.ok_or_else(|| {
        ParamError::new("labels", "they list no class", "segment a volume that holds data").into()
    })
}
