use ivd_core::{Displacement, Labels, Lattice, TransferFunction, Volume};

use crate::Error;

/// What is to be seen. Everything lies on the volume's grid.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The scanned volume, undeformed.
    pub volume: &'a Volume,
    /// Colours and opacities; mode `dvr` needs it.
    pub transfer: Option<&'a TransferFunction>,
    /// Chooses the transfer function's row at each voxel; label 0 is clear. Without labels row 0 holds.
    pub labels: Option<&'a Labels>,
    /// Whether row 0 holds at label 0 too: nothing is clear for want of a label.
    pub unlabelled: bool,
    /// Shows the volume (and the labels) deformed, through the inverse displacement.
    pub displacement: Option<&'a Displacement>,
    /// A displacement that the picture leaves room for without showing it: with that of another picture both are seen by one camera. Where nothing
    /// but what is seen decides what the picture holds ([`crate::Fit`]) it has a use.
    pub framing: Option<&'a Displacement>,
    /// A volume whose picture, displaced by `framing`, decides camera and window instead of what is shown: of several pictures that are
    /// made from one volume all are then seen alike.
    pub whole: Option<&'a Volume>,
    /// A lattice whose outline is drawn over the picture, undeformed.
    pub lattice: Option<&'a Lattice>,
}

impl<'a> Scene<'a> {
    /// A scene of a volume alone.
    pub fn new(volume: &'a Volume) -> Self {
        Self {
            volume,
            transfer: None,
            labels: None,
            unlabelled: false,
            displacement: None,
            framing: None,
            whole: None,
            lattice: None,
        }
    }

    /// The volume whose range is a projection's window.
    pub(crate) fn windowed(&self) -> &'a Volume {
        self.whole.unwrap_or(self.volume)
    }

    /// What decides what the picture holds, where that isn't what is shown.
    pub(crate) fn held(&self) -> Option<Self> {
        let volume = self.whole?;
        Some(Self { volume, displacement: self.framing, framing: None, whole: None, ..*self })
    }

    /// Checks that everything lies on the volume's grid.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let grid = self.volume.grid();
        if let Some(whole) = self.whole {
            grid.require(whole.grid(), "volume", "whole")?;
        }
        if let Some(labels) = self.labels {
            grid.require(labels.grid(), "volume", "labels")?;
        }
        for (displacement, what) in [(self.displacement, "displacement"), (self.framing, "framing")] {
            if let Some(displacement) = displacement {
                grid.require(displacement.grid(), "volume", what)?;
            }
        }
        Ok(())
    }
}
