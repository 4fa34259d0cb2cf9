use ivd_artefact::{Artefact, Kind};
use ivd_core::{Class, Exec, Labels};
use ivd_lattice::extract::{ExtractParams, Iso, extract};
use ivd_lattice::figures;
use serde_json::{Value, json};

use crate::error::stage_error;
use crate::scene::{ClassChoice, ClassWord, IsoChoice};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Cuts a lattice.
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    /// A value, or the class's crossings.
    pub iso: IsoChoice,
    /// The class whose crossings are meant by "boundary".
    pub class: Option<ClassChoice>,
}

impl Stage for Lattice {
    fn name(&self) -> &'static str {
        "lattice"
    }

    fn revision(&self) -> u32 {
        2
    }

    fn inputs(&self) -> &'static [Slot] {
        const {
            &[
                Slot::required("volume", &[Kind::Volume]),
                Slot::optional("labels", &[Kind::Labels]),
                Slot::optional("mask", &[Kind::Mask]),
            ]
        }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Lattice)
    }

    fn params(&self) -> Value {
        json!({ "iso": super::json(&self.iso), "class": super::json(&self.class) })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let volume = inputs.volume("volume").expect("checked by the runner");
        let (labels, mask) = (inputs.labels("labels"), inputs.mask("mask"));
        if let Some(labels) = labels.filter(|l| !l.grid().matches(volume.grid())) {
            let (a_dims, b_dims) = (volume.grid().dims(), labels.grid().dims());
            return Err(ivd_core::Error::GridMismatch { a: "volume", a_dims, b: "labels", b_dims }.into());
        }
        if let Some(mask) = mask.filter(|m| !m.grid().matches(volume.grid())) {
            let (a_dims, b_dims) = (volume.grid().dims(), mask.grid().dims());
            return Err(ivd_core::Error::GridMismatch { a: "volume", a_dims, b: "mask", b_dims }.into());
        }
        let iso = match self.iso {
            IsoChoice::Value(value) => Iso::Value(value),
            IsoChoice::Word(_) => boundary_iso(labels, mask.map(ivd_core::Mask::inside), self.class)?,
        };
        let extracted =
            extract(volume, mask, &ExtractParams { iso }, exec).map_err(stage_error!("lattice"))?;
        exec.check_cancelled()?;
        let f = exec.run(|| figures::measure(&extracted.lattice));
        let metrics = metrics(&f, extracted.bricks_active, extracted.bricks_total);
        Ok(Product::new(Artefact::Lattice(extracted.lattice), metrics))
    }
}

/// What is told of a lattice that was cut.
pub(super) fn metrics(f: &figures::Figures, bricks_active: u64, bricks_total: u64) -> Value {
    json!({
        "vertices": f.vertices,
        "triangles": f.triangles,
        "boundary_edges": f.boundary_edges,
        "non_manifold_edges": f.non_manifold_edges,
        "degenerate_triangles": f.degenerate_triangles,
        "euler": f.euler,
        "components": f.components,
        "area_mm2": f.area_mm2,
        "volume_mm3": f.volume_mm3,
        "bricks_active": bricks_active,
        "bricks_total": bricks_total,
    })
}

/// The crossings of the class that is meant: the one named, else the one that the mask was cut from.
fn boundary_iso(
    labels: Option<&Labels>,
    mask: Option<&[u8]>,
    class: Option<ClassChoice>,
) -> Result<Iso, Error> {
    let Some(labels) = labels else {
        return match mask {
            Some(_) => Ok(Iso::Mask),
            None => {
                Err(Error::usage("lattice", "iso = boundary needs labels or a mask; give them, or a value"))
            }
        };
    };
    let chosen = match (class, mask) {
        (Some(choice), _) => choose(labels, choice)?,
        (None, Some(inside)) => majority(labels, inside)?,
        (None, None) => choose(labels, ClassChoice::Word(ClassWord::Largest))?,
    };
    Ok(match (chosen.lower, chosen.upper) {
        (None, None) => Iso::Mask,
        (lower, upper) => Iso::Interval { lower, upper },
    })
}

/// The class of a choice.
fn choose(labels: &Labels, choice: ClassChoice) -> Result<&Class, Error> {
    let choice = super::boundary::class_choice(choice);
    ivd_boundary::choose_class(labels, choice).map_err(stage_error!("lattice"))
}

/// The class that most voxels of a mask belong to (a filled hole belongs to others).
fn majority<'a>(labels: &'a Labels, inside: &[u8]) -> Result<&'a Class, Error> {
    let mut counts = vec![0_u64; usize::from(u16::MAX) + 1];
    for (id, _) in labels.ids().iter().zip(inside).filter(|(_, inside)| **inside == 1) {
        counts[usize::from(*id)] += 1;
    }
    labels
        .classes()
        .iter()
        .max_by_key(|c| (counts[usize::from(c.id)], std::cmp::Reverse(c.id)))
        .ok_or_else(|| Error::usage("lattice", "the labels have no class; segment a volume that holds data"))
}
