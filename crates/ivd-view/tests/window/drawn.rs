//! What is painted, on lavapipe.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

use super::common::{BALL, Here, scene};
use super::screen::screen;

/// A channel that differs by no more isn't seen to.
const FAINT: u8 = 24;
/// Of so many pixels one may differ.
const FEW: usize = 200;

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
    // The line at the bottom tells times, which differ.
    let rows = here.rect("Coronal slice").bottom() as usize;
    let painted = &pixels[..4 * rows * width];
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/window/ball.png");
    if std::env::var_os("IVD_SNAPSHOTS").is_some_and(|how| how == "write") {
        let image = ivd_core::Image::new(width, rows, painted.to_vec()).unwrap();
        std::fs::write(&file, ivd_pipeline::png_bytes(&image).unwrap()).unwrap();
    }
    let kept = png::Decoder::new(BufReader::new(File::open(&file).unwrap()));
    let mut kept = kept.read_info().unwrap();
    let mut before = vec![0; kept.output_buffer_size().unwrap()];
    let told = kept.next_frame(&mut before).unwrap();
    assert_eq!(
        [told.width as usize, told.height as usize],
        [width, rows],
        "IVD_SNAPSHOTS=write paints it anew"
    );
    let bytes = before.len() / (width * rows);
    let differs = |(a, b): &(&[u8], &[u8])| (0..3).any(|c| a[c].abs_diff(b[c]) > FAINT);
    let differing = painted.chunks(4).zip(before.chunks(bytes)).filter(differs).count();
    // Drivers round edges otherwise.
    assert!(
        differing * FEW < width * rows,
        "{differing} of {} pixels differ from {}; IVD_SNAPSHOTS=write paints it anew",
        width * rows,
        file.display()
    );
}
