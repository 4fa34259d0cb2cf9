//! What the volume's pane shows, recorded as moving pictures.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use egui::{Context, Ui};
use ivd_core::{Image, counted};
use ivd_frames::Picture;
use ivd_pipeline::animation_bytes;

use crate::bar::item;
use crate::files::{Keeps, write};
use crate::keys::RECORD;
use crate::system::Purpose;
use crate::window::Window;
use crate::writing::write_beside;

/// A recording has so many pictures at most, ...
const MOST: usize = 1000;
/// ... and no more than all take in this (bytes), each as large as the largest.
const BYTES: usize = 256 << 20;
/// A picture is shown for no shorter and no longer (s), however long it was seen.
const SHOWN: [f64; 2] = [0.02, 2.0];

/// Pictures in their order, each with when it came (s).
#[derive(Clone)]
pub(crate) struct Recording {
    pictures: Vec<(f64, Arc<Picture>)>,
    /// Width and height of the largest.
    size: [usize; 2],
    began: Instant,
    /// When it was stopped (s).
    ended: Option<f64>,
    /// What all may take (bytes).
    room: usize,
}

impl Recording {
    fn begin(first: &Arc<Picture>) -> Self {
        let mut recording =
            Self { pictures: Vec::new(), size: [0; 2], began: Instant::now(), ended: None, room: BYTES };
        recording.take(first, 0.0);
        recording
    }

    /// Takes a picture that came so long after it began (s), unless that is there already; whether there is room for more.
    fn take(&mut self, picture: &Arc<Picture>, at: f64) -> bool {
        if self.pictures.last().is_some_and(|(_, last)| Arc::ptr_eq(last, picture)) {
            return true;
        }
        let size = [picture.image.width(), picture.image.height()];
        let size = if size[0] * size[1] > self.size[0] * self.size[1] { size } else { self.size };
        let count = self.pictures.len() + 1;
        if count > MOST || (count > 1 && 4 * count * size[0] * size[1] > self.room) {
            return false;
        }
        self.size = size;
        self.pictures.push((at, picture.clone()));
        true
    }

    /// How long each picture is shown (s/100).
    fn shown(&self) -> Vec<u16> {
        let ends = self.pictures.iter().skip(1).map(|(at, _)| *at);
        let last = self.pictures.last().map_or(0.0, |(at, _)| *at);
        let ends = ends.chain([self.ended.unwrap_or(last)]);
        let long = self.pictures.iter().zip(ends).map(|((at, _), end)| end - at);
        long.map(|long| (100.0 * long.clamp(SHOWN[0], SHOWN[1])).round() as u16).collect()
    }

    /// The pictures, in one size.
    fn frames(&self) -> Result<Image, String> {
        let rgba = self.pictures.iter().flat_map(|(_, picture)| fitted(&picture.image, self.size)).collect();
        Image::of_frames(self.size, self.pictures.len(), rgba).map_err(|error| error.to_string())
    }

    /// Writes it.
    fn write(&self, path: &Path) -> Result<(), String> {
        let bytes =
            animation_bytes(path, &self.frames()?, &self.shown()).map_err(|error| error.to_string())?;
        write(path, &bytes)
    }

    pub(crate) fn goes_on(&self) -> bool {
        self.ended.is_none()
    }

    fn stop(&mut self) {
        self.ended.get_or_insert(self.began.elapsed().as_secs_f64());
    }
}

/// The pixels of a picture as large as fits into a size, in its middle.
fn fitted(image: &Image, [width, height]: [usize; 2]) -> Vec<u8> {
    let own = [image.width(), image.height()];
    if own == [width, height] {
        return image.rgba().to_vec();
    }
    let scale = (width as f64 / own[0] as f64).min(height as f64 / own[1] as f64);
    // The pixel of the picture that is seen at one of the frame, along an axis.
    let from = |at: usize, side: usize, own: usize| {
        let place = (at as f64 + 0.5 - side as f64 / 2.0) / scale + own as f64 / 2.0;
        (place >= 0.0 && place < own as f64).then_some(place as usize)
    };
    let columns: Vec<Option<usize>> = (0..width).map(|x| from(x, width, own[0])).collect();
    let mut rgba = Vec::with_capacity(4 * width * height);
    for y in 0..height {
        let row = from(y, height, own[1]);
        for column in &columns {
            let pixel = row.zip(*column).map(|(y, x)| 4 * (x + own[0] * y));
            rgba.extend(pixel.map_or(&[0, 0, 0, 255][..], |at| &image.rgba()[at..at + 4]));
        }
    }
    rgba
}

impl Window {
    /// Begins to record, or stops and asks where it is to be kept; what was stopped before is asked about again.
    pub(crate) fn record(&mut self, context: &Context) {
        match &mut self.recording {
            Some(recording) => {
                recording.stop();
                self.ask_for(Purpose::Keep(Keeps::Recording), context);
            }
            None => self.recording = self.shown.volume_picture().map(Recording::begin),
        }
    }

    /// The items of the menu.
    pub(crate) fn record_menu(&mut self, ui: &mut Ui) {
        let goes_on = self.recording.as_ref().map(Recording::goes_on);
        let words = match goes_on {
            None => "Record the volume's picture",
            Some(true) => "Stop recording …",
            Some(false) => "Keep the recording …",
        };
        if item(ui, goes_on.is_some() || self.shown.figures().is_some(), words, Some(&RECORD)) {
            self.record(ui.ctx());
        }
        if goes_on == Some(false) && item(ui, true, "Throw the recording away", None) {
            self.recording = None;
        }
    }

    /// A frame has come.
    pub(crate) fn recorded(&mut self, picture: &Arc<Picture>) {
        let Some(recording) = self.recording.as_mut().filter(|recording| recording.goes_on()) else { return };
        if !recording.take(picture, recording.began.elapsed().as_secs_f64()) {
            recording.stop();
            let count = counted(recording.pictures.len() as u64, "picture", "pictures");
            self.say(format!(
                "Recording has stopped: {count} are as many as it holds. File, Keep the recording."
            ));
        }
    }

    /// That something is recorded, in a word.
    pub(crate) fn records(&self) -> Option<String> {
        let recording = self.recording.as_ref()?;
        let count = counted(recording.pictures.len() as u64, "picture", "pictures");
        Some(if recording.goes_on() {
            format!("recording: {count}")
        } else {
            format!("recorded: {count}, not kept")
        })
    }

    /// Writes what was recorded, beside the window; until that is done it stays.
    pub(crate) fn keep_recording(&mut self, path: PathBuf, context: &Context) {
        let Some(recording) = &self.recording else { return };
        self.layout.kept = path.parent().filter(|folder| folder.is_dir()).map(Path::to_owned);
        let shared = self.work.as_ref().map(|work| work.shared.clone());
        let recording = recording.clone();
        let write = move || recording.write(&path).map(|()| path.display().to_string());
        if let Some(shared) = shared {
            write_beside(shared, Keeps::Recording, write);
        } else {
            let kept = write();
            self.kept(Keeps::Recording, kept, context);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_frames::Pane;

    fn picture(width: usize, height: usize, grey: u8) -> Arc<Picture> {
        let image = Image::new(width, height, vec![grey; 4 * width * height]).unwrap();
        Arc::new(Picture::new(Pane::Volume, 1, 1, image))
    }

    #[test]
    fn pictures_are_shown_as_long_as_they_were_seen_within_bounds() {
        let mut recording = Recording::begin(&picture(4, 4, 0));
        for (at, grey) in [(0.5, 1), (0.51, 2), (0.7, 3), (60.0, 4)] {
            assert!(recording.take(&picture(4, 4, grey), at));
        }
        let last = recording.pictures.last().unwrap().1.clone();
        assert!(recording.take(&last, 61.0), "what is there already isn't taken twice");
        recording.ended = Some(60.25);
        assert_eq!(recording.shown(), [50, 2, 19, 200, 25]);
        let frames = recording.frames().unwrap();
        assert_eq!((frames.frames(), frames.frame(3).unwrap().rgba()), (5, &[3; 64][..]));
    }

    #[test]
    fn it_ends_where_there_is_no_more_room() {
        let mut recording = Recording::begin(&picture(2, 2, 0));
        recording.room = 4 * 4 * 5;
        assert!((1..5).all(|grey| recording.take(&picture(2, 2, grey), f64::from(grey))));
        assert!(!recording.take(&picture(2, 2, 9), 5.0) && recording.pictures.len() == 5);
        // Larger ones make all of them larger.
        let mut recording = Recording::begin(&picture(2, 2, 0));
        recording.room = 4 * 16 * 2;
        assert!(recording.take(&picture(4, 4, 1), 1.0) && !recording.take(&picture(2, 2, 2), 2.0));
        let mut recording = Recording::begin(&picture(1, 1, 0));
        assert!((1..MOST).all(|_| recording.take(&picture(1, 1, 1), 1.0)));
        assert!(!recording.take(&picture(1, 1, 1), 1.0));
    }

    #[test]
    fn coarse_pictures_are_as_large_as_whole_ones_and_others_keep_their_shape() {
        let coarse = Image::new(2, 1, vec![10, 10, 10, 255, 20, 20, 20, 255]).unwrap();
        let reds = |size| fitted(&coarse, size).chunks(4).map(|pixel| pixel[0]).collect::<Vec<_>>();
        assert_eq!(reds([4, 2]), [10, 10, 20, 20, 10, 10, 20, 20]);
        assert_eq!(reds([2, 3]), [0, 0, 10, 20, 0, 0]);
    }
}
