//! Two pictures as one: beside each other, or the one wiped over the other.

use ivd_core::{Exec, Image};

use crate::Error;

/// Pictures of a wipe, there and back.
const STEPS: usize = 32;
/// Level (of 255) of what parts two pictures.
const PARTING: u8 = 160;

/// Refuses pictures of which not every pixel has its like.
pub(crate) fn check(a: &Image, b: &Image) -> Result<(), Error> {
    let size = [a.width(), a.height()];
    if size != [b.width(), b.height()] {
        return Err(Error::SizeMismatch { a: size, b: [b.width(), b.height()] });
    }
    if a.frames() != b.frames() {
        return Err(Error::FramesMismatch { a: a.frames(), b: b.frames() });
    }
    Ok(())
}

/// Pixels that part two pictures of a width.
fn parting(width: usize) -> usize {
    (width / 256).max(1)
}

/// Two pictures of one size beside each other, the first to the left, frame by frame where they have several.
///
/// # Errors
/// [`Error::SizeMismatch`] where the sizes differ, [`Error::FramesMismatch`] where the numbers of frames do; memory that is short.
pub fn side_by_side(left: &Image, right: &Image, exec: &Exec) -> Result<Image, Error> {
    check(left, right)?;
    let (row, gap) = (4 * left.width(), 2 * parting(left.width()));
    let width = 2 * left.width() + gap;
    exec.check_memory("pictures", (4 * width * left.height() * left.frames()) as u64)?;
    let between = [PARTING, PARTING, PARTING, 255].repeat(gap);
    let rows = left.rgba().chunks_exact(row).zip(right.rgba().chunks_exact(row));
    let rgba = rows.flat_map(|(left, right)| [left, &between, right].concat()).collect();
    Ok(Image::of_frames([width, left.height()], left.frames(), rgba)?)
}

/// The second of two pictures wiped over the first from the left, and away again: the frames of an animation that begins and ends with the first alone. A line parts
/// them.
///
/// # Errors
/// As [`side_by_side`]; [`Error::FramesMismatch`] for more than one frame each, too.
pub fn wipe(first: &Image, second: &Image, exec: &Exec) -> Result<Image, Error> {
    check(first, second)?;
    if first.frames() > 1 {
        return Err(Error::FramesMismatch { a: first.frames(), b: 1 });
    }
    let (width, row) = (first.width(), 4 * first.width());
    exec.check_memory("pictures", (STEPS * first.rgba().len()) as u64)?;
    let mut rgba = Vec::with_capacity(STEPS * first.rgba().len());
    for step in 0..STEPS {
        let turn = step as f64 / STEPS as f64 * std::f64::consts::TAU;
        let wiped = (0.5 * (1.0 - turn.cos()) * width as f64).round() as usize;
        let line = if wiped == 0 || wiped == width { 0 } else { parting(width).min(width - wiped) };
        for (first, second) in first.rgba().chunks_exact(row).zip(second.rgba().chunks_exact(row)) {
            rgba.extend_from_slice(&second[..4 * wiped]);
            (0..line).for_each(|_| rgba.extend_from_slice(&[PARTING, PARTING, PARTING, 255]));
            rgba.extend_from_slice(&first[4 * (wiped + line)..]);
        }
    }
    Ok(Image::of_frames([width, first.height()], STEPS, rgba)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(level: u8, frames: usize) -> Image {
        Image::of_frames([40, 3], frames, vec![level; 480 * frames]).unwrap()
    }

    #[test]
    fn pictures_lie_beside_each_other_frame_by_frame() {
        let one = side_by_side(&plain(1, 2), &plain(2, 2), &Exec::default()).unwrap();
        assert_eq!((one.width(), one.height(), one.frames()), (82, 3, 2));
        for row in one.rgba().chunks_exact(4 * 82) {
            assert!(row[..160].iter().all(|c| *c == 1) && row[168..].iter().all(|c| *c == 2));
            assert_eq!(row[160..164], [PARTING, PARTING, PARTING, 255]);
        }
        assert!(side_by_side(&plain(1, 2), &plain(2, 1), &Exec::default()).is_err());
    }

    #[test]
    fn a_wipe_begins_with_the_first_and_shows_all_of_the_second_half_way() {
        let one = wipe(&plain(1, 1), &plain(2, 1), &Exec::default()).unwrap();
        assert_eq!((one.width(), one.frames()), (40, STEPS));
        assert_eq!(one.frame(0).unwrap(), plain(1, 1));
        assert_eq!(one.frame(STEPS / 2).unwrap(), plain(2, 1));
        for step in 1..STEPS {
            let frame = one.frame(step).unwrap();
            assert_eq!(frame, one.frame(STEPS - step).unwrap(), "it goes away as it came");
            let levels: Vec<u8> = frame.rgba()[..160].chunks(4).map(|pixel| pixel[0]).collect();
            let second = levels.iter().take_while(|level| **level == 2).count();
            let first = levels.iter().rev().take_while(|level| **level == 1).count();
            assert!(second + first + 1 >= 40, "{levels:?}");
        }
        assert!(wipe(&plain(1, 2), &plain(2, 2), &Exec::default()).is_err());
    }
}
