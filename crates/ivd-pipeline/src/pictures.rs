//! Pictures as files: PNG, animated where there are several, GIF, and OpenEXR.

use std::io::Cursor;
use std::path::Path;

use ivd_core::{ErrorClass, Image, srgb};
use rayon::prelude::*;

use crate::{Error, ending};

/// A turn, or a motion, takes so long (s), unless its pictures would follow each other too soon, or so slowly that it doesn't look like one.
const TURN_S: f64 = 4.0;
/// Shortest and longest time that a picture is shown (s).
const SHOWN_S: [f64; 2] = [0.04, 0.5];

/// Formats that pictures are written in.
pub const PICTURE_ENDINGS: [&str; 4] = ["png", "apng", "gif", "exr"];
/// Those that hold several, shown one after another.
pub const ANIMATION_ENDINGS: [&str; 3] = ["gif", "apng", "png"];
/// Whether a file of this ending is one for all frames of a motion.
pub(crate) fn is_animation(path: &Path) -> bool {
    matches!(&*ending(path), "gif" | "apng")
}

/// Pictures of one size as the frames of one.
///
/// # Errors
/// Pictures of different sizes.
pub(crate) fn joined<'a>(pictures: impl Iterator<Item = &'a Image> + Clone) -> Result<Image, Error> {
    let Some(first) = pictures.clone().next() else {
        return Err(Error::usage("export", "there is no frame to show"));
    };
    let rgba = pictures.clone().flat_map(Image::rgba).copied().collect();
    Ok(Image::of_frames([first.width(), first.height()], pictures.count(), rgba)?)
}

/// Of these that which holds light, and one picture alone.
const LIGHT: &str = "exr";

/// Bits of a channel of a PNG.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Depth {
    /// 8: the picture.
    #[default]
    Eight,
    /// 16: the light that was kept of it.
    Sixteen,
}

/// A picture as a file's bytes, in the format of its ending.
///
/// # Errors
/// A usage error for other endings, and for what the format can't hold.
pub(crate) fn bytes(path: &Path, image: &Image, depth: Depth) -> Result<Vec<u8>, Error> {
    check_pictures(path, image.frames(), image.light().is_some())?;
    if depth == Depth::Sixteen && !matches!(&*ending(path), "png" | "apng") {
        let problem = format!(
            "{}: levels of 16 bits are those of a .png; write one, or leave the depth out",
            path.display()
        );
        return Err(Error::usage("export", problem));
    }
    if depth == Depth::Sixteen && image.light().is_none() {
        let problem = format!(
            "{}: levels of 16 bits are of light, and none was kept: render with --keep-light",
            path.display()
        );
        return Err(Error::usage("export", problem));
    }
    match &*ending(path) {
        "gif" => gif_bytes(image, &|_| hundredths(image)),
        LIGHT => exr_bytes(image),
        _ if depth == Depth::Sixteen => {
            encoded(image, depth, png::Compression::default(), &|_| hundredths(image))
        }
        _ => png_bytes(image),
    }
}

/// Whether a file of this ending can hold so many pictures, with or without the light that they are made of.
///
/// # Errors
/// A usage error, with the remedy, where it can't.
pub fn check_pictures(path: &Path, frames: usize, has_light: bool) -> Result<(), Error> {
    let ending = ending(path);
    let problem = if !PICTURE_ENDINGS.contains(&&*ending) {
        format!("pictures are written as .{}, not as .{ending}", PICTURE_ENDINGS.join(", ."))
    } else if ending != LIGHT {
        return Ok(());
    } else if frames > 1 {
        format!(
            "an .exr holds one picture, not {frames}: `ivd export IMAGE.ivd -o FILE.exr --frame all` writes one file for each"
        )
    } else if !has_light {
        "an .exr holds light, and none was kept: render with --keep-light, in a scene `render.keep_light = true`".to_owned()
    } else {
        return Ok(());
    };
    Err(Error::usage("export", format!("{}: {problem}", path.display())))
}

/// Pictures that are shown for as long as each says, as a file's bytes in the format of its ending.
///
/// - `shown`: how long each picture is shown (s/100), shape `[frames]`.
///
/// # Errors
/// A usage error for endings other than [`ANIMATION_ENDINGS`], and for other than one time for each picture; sizes that files don't have.
pub fn animation_bytes(path: &Path, image: &Image, shown: &[u16]) -> Result<Vec<u8>, Error> {
    let ending = ending(path);
    if !ANIMATION_ENDINGS.contains(&&*ending) {
        let all = ANIMATION_ENDINGS.join(", .");
        let problem = format!("{}: moving pictures are written as .{all}, not as .{ending}", path.display());
        return Err(Error::usage("export", problem));
    }
    if shown.len() != image.frames() {
        let problem = format!("{} times for {} pictures", shown.len(), image.frames());
        return Err(Error::usage("export", problem));
    }
    let shown = |frame: usize| shown[frame];
    if ending == "gif" {
        gif_bytes(image, &shown)
    } else {
        encoded(image, Depth::Eight, png::Compression::default(), &shown)
    }
}

/// A picture as a PNG file's bytes; several as an animated one.
///
/// # Errors
/// A size that PNG files don't have.
pub fn png_bytes(image: &Image) -> Result<Vec<u8>, Error> {
    encoded(image, Depth::Eight, png::Compression::default(), &|_| hundredths(image))
}

/// The same, soon made rather than small: for pictures that are looked at once.
///
/// # Errors
/// As [`png_bytes`].
pub fn quick_png_bytes(image: &Image) -> Result<Vec<u8>, Error> {
    encoded(image, Depth::Eight, png::Compression::Fastest, &|_| hundredths(image))
}

/// How long a frame is shown (s/100).
type Shown<'a> = &'a (dyn Fn(usize) -> u16 + Sync);

fn encoded(
    image: &Image,
    depth: Depth,
    compression: png::Compression,
    shown: Shown<'_>,
) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.width() as u32, image.height() as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(match depth {
        Depth::Eight => png::BitDepth::Eight,
        Depth::Sixteen => png::BitDepth::Sixteen,
    });
    encoder.set_compression(compression);
    if image.frames() > 1 {
        encoder.set_animated(image.frames() as u32, 0).map_err(failed)?;
    }
    let mut writer = encoder.write_header().map_err(failed)?;
    let length = 4 * image.width() * image.height();
    for frame in 0..image.frames() {
        if image.frames() > 1 {
            writer.set_frame_delay(shown(frame), 100).map_err(failed)?;
        }
        let part = frame * length..(frame + 1) * length;
        match (depth, image.light()) {
            (Depth::Sixteen, Some(light)) => writer.write_image_data(&in_words(&light[part])),
            _ => writer.write_image_data(&image.rgba()[part]),
        }
        .map_err(failed)?;
    }
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// Straight sRGB with opacity in big-endian words of 16 bits, as PNG has them, of premultiplied linear light.
fn in_words(light: &[f32]) -> Vec<u8> {
    let word = |share: f64| (share.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
    let pixel = |pixel: &[f32]| {
        let opacity = f64::from(pixel[3]);
        let straight = if opacity > 0.0 { 1.0 / opacity } else { 0.0 };
        let colour = |c: usize| word(srgb::encoded((f64::from(pixel[c]) * straight).clamp(0.0, 1.0)));
        [colour(0), colour(1), colour(2), word(opacity)].map(u16::to_be_bytes).into_iter().flatten()
    };
    light.chunks_exact(4).flat_map(pixel).collect()
}

/// How long a picture of a turn is shown (s/100).
fn hundredths(image: &Image) -> u16 {
    let [shortest, longest] = SHOWN_S;
    (100.0 * (TURN_S / image.frames() as f64).clamp(shortest, longest)).round() as u16
}

/// Pictures as a GIF file's bytes, each with 256 colours of its own, that begin anew after the last.
fn gif_bytes(image: &Image, shown: Shown<'_>) -> Result<Vec<u8>, Error> {
    /// Of every tenth pixel colours are chosen.
    const SPEED: i32 = 10;
    /// Frames that are held in both forms.
    const AT_ONCE: usize = 16;
    let side = |length: usize| {
        let told = || {
            format!("{length} pixels: a .gif has at most {} a side; render it smaller, or as .png", u16::MAX)
        };
        u16::try_from(length).map_err(|_| Error::usage("export", told()))
    };
    let (width, height) = (side(image.width())?, side(image.height())?);
    let encoded = |(number, pixels): (usize, &[u8])| {
        // A pixel is seen or it isn't: half of it decides.
        let mut pixels = pixels.to_vec();
        for pixel in pixels.chunks_exact_mut(4) {
            pixel[3] = if pixel[3] < 128 { 0 } else { 255 };
        }
        let mut frame = gif::Frame::from_rgba_speed(width, height, &mut pixels, SPEED);
        frame.delay = shown(number);
        frame.dispose = gif::DisposalMethod::Background;
        frame
    };
    let mut bytes = Vec::new();
    let mut encoder = gif::Encoder::new(&mut bytes, width, height, &[]).map_err(failed)?;
    if image.frames() > 1 {
        encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
    }
    let length = 4 * image.width() * image.height();
    for (first, some) in (0..).step_by(AT_ONCE).zip(image.rgba().chunks(length * AT_ONCE)) {
        let numbered = some.par_chunks_exact(length).enumerate().map(|(i, pixels)| (first + i, pixels));
        for frame in numbered.map(encoded).collect::<Vec<_>>() {
            encoder.write_frame(&frame).map_err(failed)?;
        }
    }
    drop(encoder);
    Ok(bytes)
}

/// The light of a picture that kept it as an OpenEXR file's bytes: premultiplied linear RGBA, 32 bit a channel, as it is.
fn exr_bytes(image: &Image) -> Result<Vec<u8>, Error> {
    use exr::prelude::{
        Encoding, Image as Exr, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage as _,
    };
    let light = image.light().unwrap_or_default();
    let pixel = |Vec2(x, y): Vec2<usize>| {
        let at = 4 * (x + image.width() * y);
        (light[at], light[at + 1], light[at + 2], light[at + 3])
    };
    let attributes = LayerAttributes { software_name: Some("ivd".into()), ..LayerAttributes::default() };
    let channels = SpecificChannels::rgba(pixel);
    let layer =
        Layer::new((image.width(), image.height()), attributes, Encoding::SMALL_FAST_LOSSLESS, channels);
    let mut bytes = Cursor::new(Vec::new());
    Exr::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(failed)?;
    Ok(bytes.into_inner())
}

fn failed(error: impl std::error::Error + Send + Sync + 'static) -> Error {
    Error::Stage { stage: "export", source: Box::new(error), class: ErrorClass::Io }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three pictures of one colour each.
    fn turn() -> Image {
        let rgba: Vec<u8> = [[200, 30, 30, 255], [30, 200, 30, 255], [30, 30, 200, 255]].concat();
        let rgba = rgba.chunks(4).flat_map(|colour| colour.repeat(12)).collect();
        Image::of_frames([4, 3], 3, rgba).unwrap()
    }

    #[test]
    fn an_animated_png_has_all_frames() {
        let bytes = png_bytes(&turn()).unwrap();
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
        let control = *reader.info().animation_control().unwrap();
        assert_eq!((control.num_frames, control.num_plays), (3, 0));
        for frame in 0..3 {
            let mut pixels = vec![0; 48];
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, turn().frame(frame).unwrap().rgba());
            let shown = reader.info().frame_control().unwrap();
            assert_eq!((shown.delay_num, shown.delay_den), (50, 100));
        }
    }

    #[test]
    fn a_gif_has_all_frames_in_their_colours() {
        let bytes = bytes(Path::new("turn.gif"), &turn(), Depth::Eight).unwrap();
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(Cursor::new(bytes)).unwrap();
        for frame in 0..3 {
            let read = decoder.read_next_frame().unwrap().unwrap();
            assert_eq!((&*read.buffer, read.delay), (turn().frame(frame).unwrap().rgba(), 50));
        }
        assert!(decoder.read_next_frame().unwrap().is_none());
        assert_eq!(decoder.repeat(), gif::Repeat::Infinite);
    }

    #[test]
    fn what_is_recorded_has_its_own_times() {
        let shown = [7, 200, 2];
        let png = animation_bytes(Path::new("a.apng"), &turn(), &shown).unwrap();
        let mut reader = png::Decoder::new(Cursor::new(png)).read_info().unwrap();
        let gif = animation_bytes(Path::new("a.gif"), &turn(), &shown).unwrap();
        let mut decoder = gif::DecodeOptions::new().read_info(Cursor::new(gif)).unwrap();
        for delay in shown {
            let mut pixels = vec![0; 48];
            reader.next_frame(&mut pixels).unwrap();
            let control = reader.info().frame_control().unwrap();
            assert_eq!((control.delay_num, control.delay_den), (delay, 100));
            assert_eq!(decoder.read_next_frame().unwrap().unwrap().delay, delay);
        }
        for (path, shown) in [("a.gif", &shown[..2]), ("a.exr", &shown), ("a", &shown)] {
            assert!(animation_bytes(Path::new(path), &turn(), shown).is_err(), "{path}");
        }
    }

    #[test]
    fn an_exr_gives_the_light_back_as_it_was() {
        use exr::prelude::*;
        let light: Vec<f32> = (0..48).map(|i| 0.1 * i as f32 - 1.0).collect();
        let image = turn().frame(0).unwrap().with_light(light.clone()).unwrap();
        let read = read()
            .no_deep_data()
            .largest_resolution_level()
            .rgba_channels(
                |size, _| (size.width(), vec![0.0_f32; 4 * size.area()]),
                |(width, all), at, (r, g, b, a): (f32, f32, f32, f32)| {
                    let at = 4 * (at.x() + *width * at.y());
                    all[at..at + 4].copy_from_slice(&[r, g, b, a]);
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(exr_bytes(&image).unwrap()))
            .unwrap();
        assert_eq!(read.layer_data.channel_data.pixels.1, light);
    }

    #[test]
    fn a_png_of_16_bits_tells_levels_of_light_apart_that_8_bits_do_not() {
        // Half covered, from a little less than half of white on.
        let light: Vec<f32> = (0..12).flat_map(|i| [0.1 + 1e-5 * i as f32, 0.25, 0.5, 0.5]).collect();
        let image = turn().frame(0).unwrap().with_light(light.clone()).unwrap();
        let bytes = bytes(Path::new("a.png"), &image, Depth::Sixteen).unwrap();
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
        assert_eq!(reader.info().bit_depth, png::BitDepth::Sixteen);
        let mut pixels = vec![0; 96];
        reader.next_frame(&mut pixels).unwrap();
        let words: Vec<u16> = pixels.chunks(2).map(|word| u16::from_be_bytes([word[0], word[1]])).collect();
        for (pixel, light) in words.chunks(4).zip(light.chunks(4)) {
            let back = |c: usize| 0.5 * srgb::linear(f64::from(pixel[c]) / 65535.0);
            (0..3).for_each(|c| assert!((back(c) - f64::from(light[c])).abs() < 1e-5, "{pixel:?} {light:?}"));
            assert_eq!(pixel[3], 32768);
        }
        assert!(words[0] < words[44], "12 levels within one of 8 bits");
        let without = turn().frame(0).unwrap();
        let refused = super::bytes(Path::new("a.png"), &without, Depth::Sixteen).unwrap_err();
        assert!(refused.to_string().contains("--keep-light"));
    }

    #[test]
    fn what_a_format_does_not_hold_is_refused_with_a_remedy() {
        let problem =
            |path: &str, image: &Image| bytes(Path::new(path), image, Depth::Eight).unwrap_err().to_string();
        assert!(problem("a.exr", &turn()).contains("--frame all"));
        assert!(problem("a.exr", &turn().frame(0).unwrap()).contains("--keep-light"));
        assert!(problem("a.jpg", &turn()).contains(".apng"));
    }
}
