//! What is painted, on lavapipe.

use std::sync::Arc;

use super::common::{BALL, Here, scene};
use super::screen::screen;

#[test]
fn the_window_is_painted_without_a_fault() {
    let Some(screen) = screen() else {
        println!("skipped: IVD_EXPECT_ADAPTER names no adapter");
        return;
    };
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let source = scene(folder.path(), BALL);
    let mut here = Here::new(folder, Some(source), Some(Box::new(screen.clone())));
    here.settle();
    here.harness.step();
    let (width, height, pixels) = screen.paint(&here.harness);
    if let Some(file) = std::env::var_os("IVD_KEEP_PICTURE") {
        let image = ivd_core::Image::new(width, height, pixels.clone()).unwrap();
        std::fs::write(file, ivd_pipeline::png_bytes(&image).unwrap()).unwrap();
    }
    let grey = |name: &str, right: f32, down: f32| {
        let at = here.at(name, right, down);
        let pixel = &pixels[4 * (at.y as usize * width + at.x as usize)..][..3];
        pixel.iter().map(|&c| u32::from(c)).sum::<u32>() / 3
    };
    // The ball is seen in every pane, and nothing beside it in their corners.
    for pane in ["Volume", "Axial slice", "Coronal slice", "Sagittal slice"] {
        let (middle, corner) = (grey(pane, 0.47, 0.47), grey(pane, 0.02, 0.85));
        assert!(middle > corner + 40, "{pane}: {middle} in the middle, {corner} in a corner");
    }
}
