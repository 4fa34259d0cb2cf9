//! What is shown: the newest pictures, as textures, and what is told beside them.

use std::sync::Arc;

use egui::{ColorImage, Context, TextureHandle, TextureOptions};
use ivd_frames::{Figures, Frame, Hovered, Outline, Pane, Picture, Scan, Slice, VolumeAtRest};

/// The newest pictures and figures.
#[derive(Default)]
pub(crate) struct Shown {
    textures: [Option<(u64, usize, TextureHandle)>; 4],
    told: Told,
}

#[derive(Default)]
enum Told {
    #[default]
    Nothing,
    Scan(Arc<Scan>),
    Frame(Arc<Frame>),
}

impl Shown {
    /// Shows a scan that is opened.
    pub(crate) fn scan(&mut self, scan: Arc<Scan>, context: &Context) {
        scan.all_pictures().for_each(|picture| self.picture(picture, context));
        self.told = Told::Scan(scan);
    }

    /// Shows a frame.
    pub(crate) fn frame(&mut self, frame: Arc<Frame>, context: &Context) {
        if matches!(self.told, Told::Scan(_)) {
            // Their versions are others'.
            self.textures.iter_mut().for_each(|texture| *texture = None);
        }
        frame.pictures.iter().for_each(|picture| self.picture(picture, context));
        self.told = Told::Frame(frame);
    }

    fn picture(&mut self, picture: &Picture, context: &Context) {
        let is = (picture.version, picture.coarser);
        let texture = &mut self.textures[picture.pane.number()];
        if texture.as_ref().is_some_and(|(version, coarser, _)| (*version, *coarser) == is) {
            return;
        }
        let size = [picture.image.width(), picture.image.height()];
        let image = ColorImage::from_rgba_unmultiplied(size, picture.image.rgba());
        if let Some((version, coarser, handle)) = texture {
            (*version, *coarser) = is;
            handle.set(image, TextureOptions::LINEAR);
        } else {
            let handle = context.load_texture(format!("{:?}", picture.pane), image, TextureOptions::LINEAR);
            *texture = Some((is.0, is.1, handle));
        }
    }

    /// The picture of a pane.
    pub(crate) fn texture(&self, pane: Pane) -> Option<&TextureHandle> {
        self.textures[pane.number()].as_ref().map(|(.., handle)| handle)
    }

    /// The volume's picture, once there are frames.
    pub(crate) fn volume_picture(&self) -> Option<&Arc<Picture>> {
        match &self.told {
            Told::Frame(frame) => Some(&frame.pictures[0]),
            Told::Scan(_) | Told::Nothing => None,
        }
    }

    /// Whether the volume's picture is as fine as it gets.
    pub(crate) fn is_whole(&self) -> bool {
        self.textures[0].as_ref().is_some_and(|(_, coarser, _)| *coarser == 1)
    }

    /// What is told beside frames.
    pub(crate) fn figures(&self) -> Option<&Figures> {
        match &self.told {
            Told::Frame(frame) => Some(&frame.figures),
            Told::Scan(_) | Told::Nothing => None,
        }
    }

    /// Where a pane's slice cuts the surface that moves.
    pub(crate) fn outline(&self, pane: Pane) -> Option<&Outline> {
        match &self.told {
            Told::Frame(frame) => pane.number().checked_sub(1).map(|slice| &frame.outlines[slice]),
            Told::Scan(_) | Told::Nothing => None,
        }
    }

    /// The volume as it is shown before there are frames.
    pub(crate) fn at_rest(&self) -> Option<&VolumeAtRest> {
        match &self.told {
            Told::Scan(scan) => scan.volume.as_ref(),
            Told::Frame(_) | Told::Nothing => None,
        }
    }

    /// Azimuth and elevation of the volume's picture (degrees).
    pub(crate) fn angles(&self) -> Option<[f64; 2]> {
        let figures = self.figures().map(|figures| figures.angles);
        figures.or_else(|| self.at_rest().map(|volume| volume.angles))
    }

    /// What lies to the left, right, top and bottom of a pane.
    pub(crate) fn letters(&self, pane: Pane) -> Option<[&'static str; 4]> {
        match pane.number().checked_sub(1) {
            None => match self.figures() {
                Some(figures) => figures.letters,
                None => self.at_rest()?.letters,
            },
            Some(slice) => self.slices()?[slice].letters,
        }
    }

    /// The slices.
    pub(crate) fn slices(&self) -> Option<&[Slice; 3]> {
        match &self.told {
            Told::Frame(frame) => Some(&frame.figures.slices),
            Told::Scan(scan) => Some(&scan.slices),
            Told::Nothing => None,
        }
    }

    /// Where the panes show the place that the slices meet in.
    pub(crate) fn cross_at(&self) -> [Option<[f64; 2]>; 4] {
        match &self.told {
            Told::Frame(frame) => frame.figures.cross_at,
            Told::Scan(scan) => scan.cross_at,
            Told::Nothing => [None; 4],
        }
    }

    /// That place (mm, RAS), and the value there.
    pub(crate) fn cross(&self) -> Option<([f64; 3], Option<f64>)> {
        match &self.told {
            Told::Frame(frame) => Some((frame.figures.cross, frame.figures.cross_value)),
            Told::Scan(scan) => Some((scan.cross, scan.cross_value)),
            Told::Nothing => None,
        }
    }

    /// What lies under the pointer.
    pub(crate) fn hovered(&self) -> Option<&Hovered> {
        match &self.told {
            Told::Frame(frame) => frame.figures.hovered.as_ref(),
            Told::Scan(scan) => scan.hovered.as_ref(),
            Told::Nothing => None,
        }
    }

    /// Width over height of a pane's picture.
    pub(crate) fn ratio(&self, pane: Pane) -> Option<f32> {
        match pane.number().checked_sub(1) {
            None => {
                let size = self.figures().map(|figures| figures.size);
                let [width, height] = size.or_else(|| self.at_rest().map(|volume| volume.size))?;
                Some(width as f32 / height as f32)
            }
            Some(number) => {
                let [width, height] = self.slices()?[number].extent_mm;
                Some((width / height) as f32)
            }
        }
    }

    /// Width of a pane's picture (mm).
    pub(crate) fn width_mm(&self, pane: Pane) -> Option<f64> {
        match pane.number().checked_sub(1) {
            None => {
                let width = self.figures().map(|figures| figures.width_mm);
                width.or_else(|| self.at_rest().map(|volume| volume.width_mm))
            }
            Some(number) => Some(self.slices()?[number].extent_mm[0]),
        }
    }
}
