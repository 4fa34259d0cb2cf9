//! What is written beside the window, on a thread of its own.

use std::path::PathBuf;

use egui::{Color32, ColorImage, Context, ScreenshotCallback, ViewportCommand};
use ivd_core::Image;

use crate::files::{Keeps, write};
use crate::inbox::Shared;

/// Asks for a picture of the whole window, to be written there.
pub(crate) fn screenshot(context: &Context, shared: Shared, path: PathBuf) {
    let callback = ScreenshotCallback::new(move |image| {
        // Made and written beside the window.
        let written = move || {
            let kept = png(&image).and_then(|bytes| write(&path, &bytes));
            kept.map(|()| path.display().to_string())
        };
        write_beside(shared.clone(), Keeps::Window, written);
    });
    context.send_viewport_cmd(ViewportCommand::Screenshot(callback));
}

/// Writes on a thread of its own; `write` gives where it was written.
pub(crate) fn write_beside(
    shared: Shared,
    what: Keeps,
    write: impl FnOnce() -> Result<String, String> + Send + 'static,
) {
    let work = move || {
        let kept = write();
        shared.locked().kept.push_back((what, kept));
        shared.context.request_repaint();
    };
    let _ = std::thread::Builder::new().name("writing".to_owned()).spawn(work);
}

fn png(image: &ColorImage) -> Result<Vec<u8>, String> {
    let rgba = image.pixels.iter().flat_map(Color32::to_array).collect();
    let image = Image::new(image.width(), image.height(), rgba).map_err(|error| error.to_string())?;
    ivd_pipeline::png_bytes(&image).map_err(|error| error.to_string())
}
