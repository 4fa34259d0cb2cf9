//! Segmentation: one stage for labels, one for the tree that labels can be cut from.

mod keys;
mod method;
mod metrics;

use std::sync::{Mutex, PoisonError};

use ivd_artefact::{Artefact, Kind};
use ivd_core::Exec;
use ivd_segment::TidyParams;
use serde_json::Value;

pub use method::{Method, Posteriors};

use crate::error::stage_error;
use crate::scene::{ClassOrder, SegmentMethod, SegmentSection};
use crate::{Error, Inputs, Product, Slot, Stage};

/// Finds a volume's structure.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// How.
    pub method: Method,
    /// What is done with the labels then.
    pub tidy: TidyParams,
}

impl Segment {
    /// The stage that a scene's section asks for.
    ///
    /// # Errors
    /// Keys that don't fit the method.
    pub fn from_section(section: &SegmentSection) -> Result<Self, Error> {
        Ok(Self { method: Method::from_section(section)?, tidy: tidy(section) })
    }

    /// The stage that cuts the tree of [`SegmentTree`] as a scene's section asks for.
    ///
    /// # Errors
    /// Keys that don't fit together.
    pub fn cut_of_section(section: &SegmentSection) -> Result<Self, Error> {
        Ok(Self { method: Method::Cut(method::cut(section)?), tidy: tidy(section) })
    }

    /// Whether it works from a tree.
    pub fn cuts(&self) -> bool {
        matches!(self.method, Method::Cut(_))
    }

    /// Whether it changes the labels after they are found, for which it needs the volume.
    pub fn tidies(&self) -> bool {
        self.tidy != TidyParams::default()
    }
}

fn tidy(section: &SegmentSection) -> TidyParams {
    let order = match section.order {
        ClassOrder::Mean => ivd_segment::Order::Mean,
        ClassOrder::Size => ivd_segment::Order::Size,
    };
    TidyParams { smallest: section.smallest, order }
}

impl Stage for Segment {
    fn name(&self) -> &'static str {
        "segment"
    }

    fn revision(&self) -> u32 {
        5
    }

    fn inputs(&self) -> &'static [Slot] {
        if self.cuts() {
            const { &[Slot::required("tree", &[Kind::Tree]), Slot::optional("volume", &[Kind::Volume])] }
        } else {
            const { &[Slot::required("volume", &[Kind::Volume]), Slot::optional("mask", &[Kind::Mask])] }
        }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Labels)
    }

    fn params(&self) -> Value {
        let mut params = self.method.params();
        params["tidy"] = super::json(&self.tidy);
        params
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        self.run_keeping(inputs, exec, None)
    }
}

impl Segment {
    /// Runs, and hands the posterior maps of `emvs` to `posteriors` where they are asked for.
    ///
    /// # Errors
    /// As [`Stage::run`].
    pub fn run_keeping(
        &self,
        inputs: &Inputs,
        exec: &Exec,
        posteriors: Option<&mut Posteriors>,
    ) -> Result<Product, Error> {
        let (mut found, own) = self.method.run(inputs, exec, posteriors)?;
        if self.tidies() {
            let volume = inputs.volume("volume").ok_or_else(|| {
                Error::usage(
                    "segment",
                    "smallest and order look at the voxels' values, and a tree has none; segment the volume instead",
                )
            })?;
            found = ivd_segment::tidy(volume, found, &self.tidy, exec).map_err(stage_error!("segment"))?;
        }
        let metrics = metrics::with(&found, own);
        Ok(Product { artefact: Artefact::Labels(found.labels), metrics })
    }
}

/// Builds the tree of a volume's regions, of which segmentations are cuts.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentTree {
    /// How regions come together.
    pub params: ivd_segment::HvsParams,
}

impl SegmentTree {
    /// The tree that a scene's section asks for; `None` where its method has none.
    pub fn from_section(section: &SegmentSection) -> Option<Self> {
        (section.method == SegmentMethod::Hvs).then(|| Self { params: method::hvs(section) })
    }
}

impl Stage for SegmentTree {
    fn name(&self) -> &'static str {
        "segment"
    }

    fn revision(&self) -> u32 {
        1
    }

    fn inputs(&self) -> &'static [Slot] {
        const { &[Slot::required("volume", &[Kind::Volume]), Slot::optional("mask", &[Kind::Mask])] }
    }

    fn output(&self) -> Option<Kind> {
        Some(Kind::Tree)
    }

    fn params(&self) -> Value {
        serde_json::json!({ "method": "hvs", "tree": super::json(&self.params) })
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let volume = inputs.volume("volume").expect("checked by the runner");
        let found = ivd_segment::hvs_tree(volume, inputs.mask("mask"), &self.params, exec)
            .map_err(stage_error!("segment"))?;
        let metrics = metrics::tree(&found);
        Ok(Product::new(Artefact::Tree(found.tree), metrics))
    }
}

/// A segmentation that keeps the posterior maps of `emvs`.
#[derive(Debug)]
pub struct KeepPosteriors {
    segment: Segment,
    maps: Mutex<Posteriors>,
}

impl KeepPosteriors {
    /// Around a segmentation by `emvs`.
    pub fn new(segment: Segment) -> Self {
        Self { segment, maps: Mutex::default() }
    }

    /// The maps of the last run, in the order of the components' means.
    pub fn into_maps(self) -> Posteriors {
        self.maps.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Stage for KeepPosteriors {
    fn name(&self) -> &'static str {
        self.segment.name()
    }

    fn revision(&self) -> u32 {
        self.segment.revision()
    }

    fn inputs(&self) -> &'static [Slot] {
        self.segment.inputs()
    }

    fn output(&self) -> Option<Kind> {
        self.segment.output()
    }

    fn params(&self) -> Value {
        self.segment.params()
    }

    fn run(&self, inputs: &Inputs, exec: &Exec) -> Result<Product, Error> {
        let mut maps = self.maps.lock().unwrap_or_else(PoisonError::into_inner);
        self.segment.run_keeping(inputs, exec, Some(&mut maps))
    }
}
