//! Slices through the middle of a volume, grey beside coloured by class.

use std::fmt::Write as _;

use ivd_core::{Error, Image, Labels, NO_DATA, Volume, VoxelIndex};

use crate::html::png_url;

/// Longer side of a slice on the page (CSS pixels).
const SIDE: f64 = 330.0;

/// The axes of a slice: to the right, upwards, and the one that is cut.
const SLICES: [([usize; 3], &str); 3] = [
    ([0, 1, 2], "x to the right, y up"),
    ([0, 2, 1], "x to the right, z up"),
    ([1, 2, 0], "y to the right, z up"),
];

/// The middle slices of a labelling; `colour` is that of a class by its place in the list of the labels' classes.
///
/// # Errors
/// Those of a picture's constructor.
pub fn class_slices(labels: &Labels, colour: impl Fn(usize) -> [u8; 3]) -> Result<Vec<Image>, Error> {
    let slice = |axes: [usize; 3]| coloured(labels, axes, labels.grid().dims()[axes[2]] / 2, &colour);
    SLICES.iter().map(|(axes, _)| slice(*axes)).collect()
}

/// The middle slices of a volume, each beside the same of its labels; `png` makes a PNG file of a picture.
///
/// # Errors
/// A picture that can't be shown.
pub fn slices<E: From<Error>>(
    volume: &Volume,
    coloured: &[Image],
    png: impl Fn(&Image) -> Result<Vec<u8>, E>,
) -> Result<String, E> {
    let grid = volume.grid();
    let mut html = String::from("<div class='pictures'>");
    for ((axes, caption), classes) in SLICES.into_iter().zip(coloured) {
        let [right, up, cut] = axes;
        let at = grid.dims()[cut] / 2;
        let extent = [right, up].map(|axis| grid.dims()[axis] as f64 * grid.spacing()[axis]);
        let scale = SIDE / extent[0].max(extent[1]);
        // However thin a slice is, it can be seen.
        let [width, height] = extent.map(|e| (e * scale).round().max(8.0));
        html += "<figure>";
        for image in [&grey(volume, axes, at)?, classes] {
            let url = png_url(&png(image)?);
            let _ = write!(
                html,
                "<img class='slice' width='{width}' height='{height}' src='{url}' alt='slice'> "
            );
        }
        let name = ["x", "y", "z"][cut];
        let _ = write!(html, "<figcaption>voxel {name} = {at}; {caption}</figcaption></figure>");
    }
    Ok(html + "</div>")
}

/// Pixels of a slice from the top, by the linear index of their voxel.
fn image(
    dims: [usize; 3],
    [right, up, cut]: [usize; 3],
    at: usize,
    pixel: impl Fn([usize; 3]) -> [u8; 4],
) -> Result<Image, Error> {
    let mut rgba = Vec::with_capacity(4 * dims[right] * dims[up]);
    for j in (0..dims[up]).rev() {
        for i in 0..dims[right] {
            let mut voxel = [0; 3];
            (voxel[right], voxel[up], voxel[cut]) = (i, j, at);
            rgba.extend(pixel(voxel));
        }
    }
    Image::new(dims[right], dims[up], rgba)
}

fn grey(volume: &Volume, axes: [usize; 3], at: usize) -> Result<Image, Error> {
    let [low, high] = volume.range().unwrap_or([0.0, 1.0]);
    let scale = if high > low { 255.0 / (high - low) } else { 0.0 };
    image(volume.grid().dims(), axes, at, |voxel| {
        let value = volume.value(VoxelIndex(voxel));
        let grey =
            if value.is_finite() { ((value - low) * scale).clamp(0.0, 255.0).round() as u8 } else { 0 };
        [grey, grey, grey, 255]
    })
}

fn coloured(
    labels: &Labels,
    axes: [usize; 3],
    at: usize,
    colour: &impl Fn(usize) -> [u8; 3],
) -> Result<Image, Error> {
    let rank = |id: u16| labels.classes().iter().position(|c| c.id == id);
    let colours: Vec<Option<[u8; 3]>> = (0..=labels.classes().iter().map(|c| c.id).max().unwrap_or(0))
        .map(|id| rank(id).map(colour))
        .collect();
    image(labels.grid().dims(), axes, at, |voxel| {
        let id = labels.ids()[labels.grid().linear(VoxelIndex(voxel))];
        match colours.get(usize::from(id)).copied().flatten().filter(|_| id != NO_DATA) {
            Some([r, g, b]) => [r, g, b, 255],
            None => [0, 0, 0, 0],
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_core::{Class, Grid, Voxels};

    fn rgb(rank: usize) -> [u8; 3] {
        [200, 100 * rank as u8, 0]
    }

    #[test]
    fn slices_lie_the_right_way_round() {
        let grid = Grid::with_spacing([2, 2, 2], [1.0; 3]).unwrap();
        let volume = Volume::new(grid.clone(), Voxels::from((0..8_u8).collect::<Vec<_>>())).unwrap();
        // The slice at z = 1 holds 4 5 below 6 7: the top row comes first.
        let found = grey(&volume, [0, 1, 2], 1).unwrap();
        let reds: Vec<u8> = found.rgba().iter().step_by(4).copied().collect();
        assert_eq!(reds, [6, 7, 4, 5].map(|v: u32| (v as f64 * 255.0 / 7.0).round() as u8));
        let class =
            |id| Class { id, name: None, mean: f64::from(id), sd: 0.0, voxels: 4, lower: None, upper: None };
        let ids: Vec<u16> = vec![1, 0, 1, 1, 2, 2, 2, 2];
        let labels = Labels::new(grid, ids.into(), vec![class(1), class(2)]).unwrap();
        let found = coloured(&labels, [1, 2, 0], 1, &rgb).unwrap();
        // x = 1: y to the right, z up; the top row is z = 1.
        let pixels: Vec<&[u8]> = found.rgba().chunks(4).collect();
        assert_eq!(pixels[0][..3], rgb(1));
        assert_eq!(pixels[2], [0, 0, 0, 0], "no data is clear");
        assert_eq!(pixels[3][..3], rgb(0));
        let classes = class_slices(&labels, rgb).unwrap();
        let png = |_: &Image| Ok::<_, Error>(Vec::new());
        assert!(slices(&volume, &classes, png).unwrap().matches("<img").count() == 6);
    }
}
