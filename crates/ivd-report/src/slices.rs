//! Slices through a volume, as a radiologist looks at them: grey beside coloured by class, and before and after a motion.

use std::fmt::Write as _;

use ivd_core::{Displacement, Error, Grid, Image, Labels, NO_DATA, Volume, VoxelIndex};
use nalgebra::Vector3;

use crate::html::{css_colour, escape, number, png_url};
use crate::planes::{Plane, planes};

/// Longer side of a slice on the page (CSS pixels).
const SIDE: f64 = 330.0;
/// Share of the values of a slice that may be darker than black, or lighter than white.
const CLIPPED: f64 = 0.002;
/// What moves at least by this share of the largest motion is among what moves furthest.
const NEARLY: f64 = 0.9;

/// The middle slices of a labelling; `colour` is that of a class by its place in the list of the labels' classes.
///
/// # Errors
/// Those of a picture's constructor.
pub fn class_slices(labels: &Labels, colour: impl Fn(usize) -> [u8; 3]) -> Result<Vec<Image>, Error> {
    let dims = labels.grid().dims();
    planes(labels.grid())
        .iter()
        .map(|plane| coloured(labels, plane, dims[plane.cut()] / 2, &colour))
        .collect()
}

/// The middle slices of a volume, each beside the same of its labels; `png` makes a PNG file of a picture.
///
/// - `window`: values that are black and white; without it all but a few of a slice lie between.
/// - `lettered`: whether left and right are known.
///
/// # Errors
/// A picture that can't be shown.
pub fn slices<E: From<Error>>(
    (volume, window): (&Volume, Option<[f64; 2]>),
    coloured: &[Image],
    lettered: bool,
    png: impl Fn(&Image) -> Result<Vec<u8>, E>,
) -> Result<String, E> {
    let grid = volume.grid();
    let mut html = String::from("<div class='pictures'>");
    for (plane, classes) in planes(grid).iter().zip(coloured) {
        let at = grid.dims()[plane.cut()] / 2;
        let window = window.unwrap_or_else(|| bulk(&values(volume, plane, at)));
        let grey = grey(volume, plane, at, window)?;
        html += "<figure>";
        html += &view(plane, grid, lettered, "slice", &png(&grey)?);
        html += &view(plane, grid, lettered, "classes", &png(classes)?);
        let _ = write!(html, "<figcaption>{}</figcaption></figure>", caption(plane, at));
    }
    Ok(html + "</div>")
}

/// Labels whose borders are drawn over slices.
#[derive(Clone, Copy)]
pub struct Outlines<'a> {
    /// On the volume's grid, at rest.
    pub labels: &'a Labels,
    /// Colour of a class by its place in their list.
    pub colour: &'a dyn Fn(usize) -> [u8; 3],
}

/// The class of a voxel.
type Classes<'a> = &'a dyn Fn(Outlines<'_>, [usize; 3]) -> u16;

impl Outlines<'_> {
    /// The colour of a voxel where its class ends within a plane; `class` tells that of a voxel.
    fn line(&self, plane: &Plane, voxel: [usize; 3], class: impl Fn([usize; 3]) -> u16) -> Option<[u8; 4]> {
        let (own, dims) = (class(voxel), self.labels.grid().dims());
        let rank = self.labels.classes().iter().position(|known| known.id == own && own != NO_DATA)?;
        let ends = (0..3).filter(|axis| *axis != plane.cut()).any(|axis| {
            let differs = |to: usize| {
                let mut next = voxel;
                next[axis] = to;
                class(next) != own
            };
            let at = voxel[axis];
            (at > 0 && differs(at - 1)) || (at + 1 < dims[axis] && differs(at + 1))
        });
        ends.then(|| {
            let [r, g, b] = (self.colour)(rank);
            [r, g, b, 255]
        })
    }

    /// The class of a voxel at rest.
    fn at_rest(&self, voxel: [usize; 3]) -> u16 {
        self.labels.ids()[self.labels.grid().linear(VoxelIndex(voxel))]
    }

    /// The class that lies at a voxel after the motion: of the voxel nearest to where it comes from.
    fn moved(&self, motion: &Displacement, voxel: [usize; 3]) -> u16 {
        let grid = self.labels.grid();
        let Some(from) = origin(grid, motion, voxel) else { return NO_DATA };
        self.at_rest(std::array::from_fn(|a| (from[a].round().max(0.0) as usize).min(grid.dims()[a] - 1)))
    }
}

/// Slices through a voxel that moves about furthest.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedSlices {
    /// That voxel, at rest: of all that move nearly as far as any, the one of the greatest value. Others may lie in air.
    pub at: [usize; 3],
    /// How far the voxel that moves furthest does (mm).
    pub largest: f64,
    /// In each of the three planes: at rest, deformed, and how far every voxel at rest moves.
    images: Vec<[Image; 3]>,
    is_outlined: bool,
}

impl MovedSlices {
    /// Of a volume and its motion, with the borders of labels at rest and as they go along; `None` where nothing moves. `window` as for [`slices`].
    ///
    /// # Errors
    /// Those of a picture's constructor.
    pub fn of(
        (volume, window): (&Volume, Option<[f64; 2]>),
        motion: &Displacement,
        outlines: Option<Outlines<'_>>,
    ) -> Result<Option<Self>, Error> {
        let Some((at, largest)) = furthest(volume, motion) else { return Ok(None) };
        let dims = volume.grid().dims();
        let all = planes(volume.grid());
        let images = all.iter().map(|plane| {
            let cut = at[plane.cut()];
            let window = window.unwrap_or_else(|| bulk(&values(volume, plane, cut)));
            let drawn = |class: Classes<'_>, value: &dyn Fn([usize; 3]) -> f64| {
                plane.slice(dims, cut, |voxel| {
                    let line = outlines.and_then(|all| all.line(plane, voxel, |voxel| class(all, voxel)));
                    line.unwrap_or_else(|| shade(value(voxel), window))
                })
            };
            let rest = drawn(&|all, voxel| all.at_rest(voxel), &|voxel| volume.value(VoxelIndex(voxel)))?;
            let after =
                drawn(&|all, voxel| all.moved(motion, voxel), &|voxel| deformed(volume, motion, voxel))?;
            let how_far = plane.slice(dims, cut, |voxel| {
                let far = length(motion.forward().at(VoxelIndex(voxel)));
                let [r, g, b] =
                    if far > 0.0 { motion_colour(far / largest) } else { unmoved(volume, voxel, window) };
                [r, g, b, 255]
            })?;
            Ok([rest, after, how_far])
        });
        let images = images.collect::<Result<_, Error>>()?;
        Ok(Some(Self { at, largest, images, is_outlined: outlines.is_some() }))
    }

    /// The slices as HTML; `png` makes a PNG file of a picture, `lettered` tells whether left and right are known.
    ///
    /// # Errors
    /// A picture that can't be shown.
    pub fn html<E: From<Error>>(
        &self,
        grid: &Grid,
        lettered: bool,
        png: impl Fn(&Image) -> Result<Vec<u8>, E>,
    ) -> Result<String, E> {
        let names = ["at rest", "deformed", "how far voxels move"];
        let mut html = rows(grid, self.at, (&self.images, names), lettered, png)?;
        let stops: Vec<String> = (0..=8).map(|i| css_colour(motion_colour(f64::from(i) / 8.0))).collect();
        let _ = write!(
            html,
            "<p class='scale'>0 <span style='background:linear-gradient(to right,{})'></span> {} mm; grey: doesn't move</p>",
            stops.join(","),
            number(self.largest)
        );
        if self.is_outlined {
            html += "<p class='scale'>Lines: where the labels' classes end, at rest and gone along.</p>";
        }
        Ok(html)
    }
}

/// Slices of a volume beside the same of what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultSlices {
    at: [usize; 3],
    /// In each of the three planes: before and after, in one window.
    images: Vec<[Image; 2]>,
}

impl ResultSlices {
    /// Of a volume and another on its grid, through a voxel, the middle where none is given. `window` as for [`slices`].
    ///
    /// # Errors
    /// Those of a picture's constructor.
    pub fn of(
        (before, window): (&Volume, Option<[f64; 2]>),
        after: &Volume,
        at: Option<[usize; 3]>,
    ) -> Result<Self, Error> {
        let at = at.unwrap_or(before.grid().dims().map(|n| n / 2));
        let all = planes(before.grid());
        let images = all.iter().map(|plane| {
            let cut = at[plane.cut()];
            let window = window.unwrap_or_else(|| bulk(&values(before, plane, cut)));
            Ok([grey(before, plane, cut, window)?, grey(after, plane, cut, window)?])
        });
        Ok(Self { at, images: images.collect::<Result<_, Error>>()? })
    }

    /// The slices as HTML, as [`MovedSlices::html`].
    ///
    /// # Errors
    /// A picture that can't be shown.
    pub fn html<E: From<Error>>(
        &self,
        grid: &Grid,
        lettered: bool,
        png: impl Fn(&Image) -> Result<Vec<u8>, E>,
    ) -> Result<String, E> {
        rows(grid, self.at, (&self.images, ["before", "what came of it"]), lettered, png)
    }
}

/// A row for each of the three planes, with a caption: slices through a voxel, each under its name.
fn rows<const N: usize, E: From<Error>>(
    grid: &Grid,
    at: [usize; 3],
    (images, names): (&[[Image; N]], [&str; N]),
    lettered: bool,
    png: impl Fn(&Image) -> Result<Vec<u8>, E>,
) -> Result<String, E> {
    let mut html = String::new();
    for (plane, images) in planes(grid).iter().zip(images) {
        html += "<div class='pictures'>";
        for (image, what) in images.iter().zip(names) {
            let shown = view(plane, grid, lettered, what, &png(image)?);
            let _ = write!(html, "<figure>{shown}<figcaption>{what}</figcaption></figure>");
        }
        let _ = write!(html, "</div><p class='caption'>{}</p>", caption(plane, at[plane.cut()]));
    }
    Ok(html)
}

/// A voxel that moves about furthest, and how far the one does that moves furthest (mm); `None` where nothing moves.
fn furthest(volume: &Volume, motion: &Displacement) -> Option<([usize; 3], f64)> {
    let (field, dims) = (motion.forward(), motion.grid().dims());
    let bricks = field.brick_dims();
    let far = || {
        let stored =
            field.table().iter().enumerate().filter_map(|(brick, _)| Some((brick, field.brick(brick)?)));
        let far = stored.flat_map(|(brick, vectors)| {
            let corner = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / bricks[0] / bricks[1]];
            vectors.iter().enumerate().map(move |(i, &vector)| {
                let within = [i % 8, i / 8 % 8, i / 64];
                (std::array::from_fn(|a| 8 * corner[a] + within[a]), length(vector))
            })
        });
        far.filter(|(voxel, _): &([usize; 3], f64)| (0..3).all(|a| voxel[a] < dims[a]))
    };
    let largest = far().map(|(_, far)| far).fold(0.0, f64::max);
    let value = |voxel: [usize; 3]| {
        let value = volume.value(VoxelIndex(voxel));
        if value.is_finite() { value } else { f64::NEG_INFINITY }
    };
    let near = far().filter(|(_, far)| *far > 0.0 && *far >= NEARLY * largest);
    let near = near.map(|(voxel, _)| (voxel, value(voxel)));
    near.reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(voxel, _)| (voxel, largest))
}

fn length(vector: [f32; 3]) -> f64 {
    Vector3::from(vector.map(f64::from)).norm()
}

/// Where what lies at a voxel after the motion comes from (voxels); `None` where nothing does.
fn origin(grid: &Grid, motion: &Displacement, voxel: [usize; 3]) -> Option<Vector3<f64>> {
    if motion.vacated().get(grid.linear(VoxelIndex(voxel))).is_some_and(|left| *left != 0) {
        return None;
    }
    let back = motion.inverse().at(VoxelIndex(voxel));
    let still = Vector3::from(voxel.map(|v| v as f64));
    Some(if back == [0.0; 3] {
        still
    } else {
        still + grid.inverse_linear_part() * Vector3::from(back.map(f64::from))
    })
}

/// What lies at a voxel after the motion, linear between voxels; NaN where nothing does.
fn deformed(volume: &Volume, motion: &Displacement, voxel: [usize; 3]) -> f64 {
    let grid = volume.grid();
    let Some(from) = origin(grid, motion, voxel) else { return f64::NAN };
    let dims = grid.dims();
    let base: [usize; 3] =
        std::array::from_fn(|a| (from[a].max(0.0) as usize).min(dims[a].saturating_sub(2)));
    let part: [f64; 3] = std::array::from_fn(|a| (from[a] - base[a] as f64).clamp(0.0, 1.0));
    (0..8_usize)
        .map(|corner| {
            let offset = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 = (0..3).map(|a| if offset[a] == 1 { part[a] } else { 1.0 - part[a] }).product();
            let at = std::array::from_fn(|a| (base[a] + offset[a]).min(dims[a] - 1));
            if weight == 0.0 { 0.0 } else { weight * volume.value(VoxelIndex(at)) }
        })
        .sum()
}

/// Black, violet, red, orange and pale yellow from 0 to 1: ever lighter, so that order is seen without colour too.
fn motion_colour(t: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 5] = [
        [20.0, 10.0, 40.0],
        [95.0, 20.0, 120.0],
        [195.0, 55.0, 85.0],
        [250.0, 150.0, 40.0],
        [255.0, 250.0, 190.0],
    ];
    let at = t.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let low = (at as usize).min(STOPS.len() - 2);
    let part = at - low as f64;
    std::array::from_fn(|c| (STOPS[low][c] + part * (STOPS[low + 1][c] - STOPS[low][c])).round() as u8)
}

/// A voxel that stays: its grey, in the darker half.
fn unmoved(volume: &Volume, voxel: [usize; 3], window: [f64; 2]) -> [u8; 3] {
    let [grey, ..] = shade(volume.value(VoxelIndex(voxel)), window);
    [grey / 2 + 40; 3]
}

/// A picture of a plane, with letters at its sides where they are known.
fn view(plane: &Plane, grid: &Grid, lettered: bool, what: &str, png: &[u8]) -> String {
    let extent = plane.extent(grid);
    let scale = SIDE / extent[0].max(extent[1]);
    // However thin a slice is, it can be seen.
    let [width, height] = extent.map(|e| (e * scale).round().max(8.0));
    let mut letters = String::new();
    for (place, letter) in ["left", "right", "top", "bottom"].iter().zip(plane.letters).filter(|_| lettered) {
        let _ = write!(letters, "<span class='{place}'>{letter}</span>");
    }
    format!(
        "<span class='view'><img class='slice' width='{width}' height='{height}' src='{}' alt='{}, {}'>{letters}</span> ",
        png_url(png),
        plane.name,
        escape(what)
    )
}

fn caption(plane: &Plane, at: usize) -> String {
    format!("{}, voxel {} = {at}", plane.name, ["x", "y", "z"][plane.cut()])
}

/// Values of a slice that are data.
fn values(volume: &Volume, plane: &Plane, at: usize) -> Vec<f64> {
    let dims = volume.grid().dims();
    let axes: Vec<usize> = (0..3).filter(|a| *a != plane.cut()).collect();
    let voxels = (0..dims[axes[1]]).flat_map(|j| (0..dims[axes[0]]).map(move |i| (i, j)));
    let value = |(i, j)| {
        let mut voxel = [at; 3];
        (voxel[axes[0]], voxel[axes[1]]) = (i, j);
        volume.value(VoxelIndex(voxel))
    };
    voxels.map(value).filter(|value| value.is_finite()).collect()
}

/// Values that are shown black and white: all but a few lie between.
fn bulk(values: &[f64]) -> [f64; 2] {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let out = (CLIPPED * sorted.len() as f64) as usize;
    match (sorted.get(out), sorted.len().checked_sub(out + 1).and_then(|i| sorted.get(i))) {
        (Some(&low), Some(&high)) if high > low => [low, high],
        _ => sorted.first().zip(sorted.last()).map_or([0.0, 1.0], |(&low, &high)| [low, high]),
    }
}

fn shade(value: f64, [low, high]: [f64; 2]) -> [u8; 4] {
    let scale = if high > low { 255.0 / (high - low) } else { 0.0 };
    let grey = if value.is_finite() { ((value - low) * scale).clamp(0.0, 255.0).round() as u8 } else { 0 };
    [grey, grey, grey, 255]
}

fn grey(volume: &Volume, plane: &Plane, at: usize, window: [f64; 2]) -> Result<Image, Error> {
    plane.slice(volume.grid().dims(), at, |voxel| shade(volume.value(VoxelIndex(voxel)), window))
}

fn coloured(
    labels: &Labels,
    plane: &Plane,
    at: usize,
    colour: &impl Fn(usize) -> [u8; 3],
) -> Result<Image, Error> {
    let rank = |id: u16| labels.classes().iter().position(|c| c.id == id);
    let colours: Vec<Option<[u8; 3]>> = (0..=labels.classes().iter().map(|c| c.id).max().unwrap_or(0))
        .map(|id| rank(id).map(colour))
        .collect();
    plane.slice(labels.grid().dims(), at, |voxel| {
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
    use ivd_core::{Class, FieldBricks, Voxels};

    fn rgb(rank: usize) -> [u8; 3] {
        [200, 100 * rank as u8, 0]
    }

    #[test]
    fn slices_lie_the_right_way_round() {
        let grid = Grid::with_spacing([2, 2, 2], [1.0; 3]).unwrap();
        let volume = Volume::new(grid.clone(), Voxels::from((0..8_u8).collect::<Vec<_>>())).unwrap();
        // The axial slice at z = 1 holds 4 5 behind 6 7: the front row comes first, and the patient's left lies to the right.
        let [axial, _, sagittal] = planes(&grid);
        let found = grey(&volume, &axial, 1, [0.0, 7.0]).unwrap();
        let reds: Vec<u8> = found.rgba().iter().step_by(4).copied().collect();
        assert_eq!(reds, [7, 6, 5, 4].map(|v: u32| (f64::from(v) * 255.0 / 7.0).round() as u8));
        let class =
            |id| Class { id, name: None, mean: f64::from(id), sd: 0.0, voxels: 4, lower: None, upper: None };
        let ids: Vec<u16> = vec![1, 0, 1, 1, 2, 2, 2, 2];
        let labels = Labels::new(grid, ids.into(), vec![class(1), class(2)]).unwrap();
        let found = coloured(&labels, &sagittal, 1, &rgb).unwrap();
        // x = 1: the front to the left, z up; the top row is z = 1, and below it y = 1 comes before y = 0.
        let pixels: Vec<&[u8]> = found.rgba().chunks(4).collect();
        assert_eq!(pixels[0][..3], rgb(1));
        assert_eq!(pixels[2][..3], rgb(0));
        assert_eq!(pixels[3], [0, 0, 0, 0], "no data is clear");
        let classes = class_slices(&labels, rgb).unwrap();
        let png = |_: &Image| Ok::<_, Error>(Vec::new());
        let html = slices((&volume, None), &classes, true, png).unwrap();
        assert_eq!((html.matches("<img").count(), html.matches(">R<").count()), (6, 4));
        assert_eq!(slices((&volume, None), &classes, false, png).unwrap().matches(">R<").count(), 0);
    }

    #[test]
    fn a_motion_is_shown_where_it_is_largest() {
        let grid = Grid::with_spacing([16, 16, 16], [1.0, 1.0, 2.0]).unwrap();
        let ramp = (0..grid.len()).map(|i| (i / 256) as f32).collect::<Vec<_>>();
        let volume = Volume::new(grid.clone(), Voxels::from(ramp)).unwrap();
        // In one brick voxels go up by 2 mm, a voxel, and one of them by 4.
        let mut up = vec![[0.0, 0.0, 2.0_f32]; 512];
        up[3 + 8 * (4 + 8 * 5)] = [0.0, 0.0, 4.0];
        let down = vec![[0.0, 0.0, -2.0_f32]; 512];
        let field = |vectors: Vec<[f32; 3]>| FieldBricks::of_bricks([16; 3], &[7], vectors.into()).unwrap();
        let motion = Displacement::new(grid.clone(), field(up), field(down)).unwrap();
        let moved = MovedSlices::of((&volume, None), &motion, None).unwrap().unwrap();
        assert_eq!((moved.at, moved.largest), ([11, 12, 13], 4.0));
        // Of those that move nearly as far it is the brightest, as others may lie in air.
        let mut nearly = motion.forward().vectors().to_vec();
        nearly[3 + 8 * (4 + 8 * 7)] = [0.0, 0.0, 3.8];
        let back = motion.inverse().clone();
        let nearly = Displacement::new(grid.clone(), field(nearly), back).unwrap();
        let shown = MovedSlices::of((&volume, None), &nearly, None).unwrap().unwrap();
        assert_eq!((shown.at, shown.largest), ([11, 12, 15], 4.0));
        // Deformed, what was at z − 1 lies at z; elsewhere nothing changes.
        assert_eq!(deformed(&volume, &motion, [9, 9, 10]), 9.0);
        assert_eq!(deformed(&volume, &motion, [2, 9, 10]), 10.0);
        let html = moved.html(&grid, true, |_| Ok::<_, Error>(Vec::new())).unwrap();
        assert!(html.matches("<img").count() == 9 && html.contains("4 mm"), "{html}");
        assert!(!html.contains("Lines:"));
        // Labels of three layers go along by one; their borders are lines within their own voxels.
        let class = Class { id: 1, name: None, mean: 1.0, sd: 0.0, voxels: 768, lower: None, upper: None };
        let ids: Vec<u16> = (0..grid.len()).map(|i| u16::from((9..12).contains(&(i / 256)))).collect();
        let labels = Labels::new(grid.clone(), ids.into(), vec![class]).unwrap();
        let outlines = Outlines { labels: &labels, colour: &rgb };
        let [axial, coronal, _] = planes(&grid);
        let rest = |plane: &Plane, z: usize| outlines.line(plane, [9, 9, z], |at| outlines.at_rest(at));
        let after = |z: usize| outlines.line(&coronal, [9, 9, z], |at| outlines.moved(&motion, at));
        let drawn = |line: &dyn Fn(usize) -> Option<[u8; 4]>| -> Vec<usize> {
            (0..16).filter(|z| line(*z).is_some()).collect()
        };
        assert_eq!(drawn(&|z| rest(&coronal, z)), [9, 11]);
        assert_eq!(drawn(&|z| rest(&axial, z)), [0_usize; 0], "within a layer none ends");
        assert_eq!((drawn(&after), after(10)), (vec![10, 12], Some([200, 0, 0, 255])));
        let moved = MovedSlices::of((&volume, None), &motion, Some(outlines)).unwrap().unwrap();
        let html = moved.html(&grid, true, |_| Ok::<_, Error>(Vec::new())).unwrap();
        assert!(html.contains("Lines: where the labels' classes end"), "{html}");
        assert!(MovedSlices::of((&volume, None), &Displacement::identity(grid), None).unwrap().is_none());
    }
}
