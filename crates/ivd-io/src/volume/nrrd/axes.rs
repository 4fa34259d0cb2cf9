//! Which axes are space, which one counts frames, and where they lie.

use std::path::Path;

use ivd_core::Grid;

use super::header::vectors;
use crate::volume::text_header::Header;
use crate::volume::{Error, bounded, orientation};

/// Sizes and places of the axes.
pub(super) struct Axes {
    pub(super) dims: [usize; 3],
    pub(super) frames: usize,
    pub(super) grid: Grid,
}

impl Axes {
    /// Those of a file with so many numbers a voxel, on its fastest axis where they are several.
    pub(super) fn of(path: &Path, header: &Header, components: usize) -> Result<Self, Error> {
        let rank = header.fields.need(path, "dimension")?;
        let rank =
            rank.parse::<usize>().ok().filter(|n| (1..=16).contains(n)).ok_or_else(|| {
                Error::field(path, "dimension", format!("`{rank}` is not a rank of 1 to 16"))
            })?;
        let sizes: Vec<i64> = header
            .fields
            .numbers(path, "sizes", rank)?
            .ok_or_else(|| Error::field(path, "sizes", "missing"))?;
        let sizes = sizes.iter().map(|&n| bounded::size(path, "sizes", n)).collect::<Result<Vec<_>, _>>()?;
        let directions = match header.fields.get("space directions") {
            Some(text) => vectors(path, "space directions", text)?,
            None => Vec::new(),
        };
        if !directions.is_empty() && directions.len() != rank {
            let problem = format!("{} vectors for {rank} axes", directions.len());
            return Err(Error::field(path, "space directions", problem));
        }
        let spatial = spatial(path, header, &sizes, &directions)?;
        let frames = if components == 1 {
            frames(path, &sizes, &spatial)?
        } else {
            check_components(path, &sizes, &spatial, components)?;
            1
        };
        let mut dims = [1; 3];
        for (a, &axis) in spatial.iter().enumerate() {
            dims[a] = sizes[axis];
        }
        bounded::voxel_count(path, "sizes", dims)?;
        let grid = grid(path, header, rank, dims, &spatial, &directions)?;
        Ok(Self { dims, frames, grid })
    }
}

/// Indices of the axes in space, at most three, in the order of the file.
fn spatial(
    path: &Path,
    header: &Header,
    sizes: &[usize],
    directions: &[Option<Vec<f64>>],
) -> Result<Vec<usize>, Error> {
    let rank = sizes.len();
    let kinds: Vec<&str> =
        header.fields.get("kinds").map(|k| k.split_whitespace().collect()).unwrap_or_default();
    if !kinds.is_empty() && kinds.len() != rank {
        return Err(Error::field(path, "kinds", format!("{} kinds for {rank} axes", kinds.len())));
    }
    let in_space = |axis: usize| match directions.get(axis) {
        Some(direction) => direction.is_some(),
        None => matches!(kinds.get(axis), None | Some(&("domain" | "space" | "???" | "none"))),
    };
    let mut spatial: Vec<usize> = (0..rank).filter(|&a| in_space(a)).collect();
    // Without word of space, what comes after the third axis counts frames.
    if directions.is_empty() {
        spatial.truncate(3);
    }
    match spatial.len() {
        0 => Err(Error::field(path, "kinds", "no axis lies in space")),
        1..=3 => Ok(spatial),
        n => Err(Error::unsupported(path, format!("a volume with {n} axes in space"), "split it")),
    }
}

/// The fastest axis holds the components, and every other one beside space has size 1.
fn check_components(path: &Path, sizes: &[usize], spatial: &[usize], components: usize) -> Result<(), Error> {
    let others = sizes.iter().enumerate().skip(1).filter(|(axis, _)| !spatial.contains(axis));
    if spatial.contains(&0) || sizes[0] != components || others.into_iter().any(|(_, size)| *size > 1) {
        let problem = format!("not a field of {components} numbers a voxel, on the fastest axis");
        return Err(Error::field(path, "sizes, kinds", problem));
    }
    Ok(())
}

/// Number of frames: the size of the slowest axis where it isn't spatial. Other axes beside space must have size 1.
fn frames(path: &Path, sizes: &[usize], spatial: &[usize]) -> Result<usize, Error> {
    let last = sizes.len() - 1;
    let mut frames = 1;
    for (axis, &size) in sizes.iter().enumerate().filter(|(axis, _)| !spatial.contains(axis)) {
        if axis == last {
            frames = size;
        } else if size > 1 {
            return Err(Error::unsupported(
                path,
                format!("a vector-valued image (axis {axis} holds {size} values a voxel)"),
                bounded::vectors_remedy(size),
            ));
        }
    }
    Ok(frames)
}

fn grid(
    path: &Path,
    header: &Header,
    rank: usize,
    dims: [usize; 3],
    spatial: &[usize],
    directions: &[Option<Vec<f64>>],
) -> Result<Grid, Error> {
    if directions.is_empty() {
        return spaced_grid(path, header, rank, dims, spatial);
    }
    let to_lps = signs(path, header)?;
    let mut axes = orientation::IDENTITY;
    for (a, &axis) in spatial.iter().enumerate() {
        let vector = directions[axis].as_ref().expect("an axis in space has a direction");
        axes[a] = padded(path, "space directions", vector)?;
    }
    let mut origin = [0.0; 3];
    if let Some(text) = header.fields.get("space origin") {
        match &vectors(path, "space origin", text)?[..] {
            [Some(vector)] => origin = padded(path, "space origin", vector)?,
            _ => return Err(Error::field(path, "space origin", format!("`{text}` is not one vector"))),
        }
    }
    let flipped = |v: [f64; 3]| std::array::from_fn(|i| v[i] * to_lps[i]);
    orientation::grid_from_lps(path, dims, axes.map(flipped), flipped(origin)).map_err(|error| match error {
        Error::Field { problem, .. } => Error::field(path, "space directions", problem),
        other => other,
    })
}

/// Spacing and axis minima, without directions: along LPS.
fn spaced_grid(
    path: &Path,
    header: &Header,
    rank: usize,
    dims: [usize; 3],
    spatial: &[usize],
) -> Result<Grid, Error> {
    if header.fields.get("space origin").is_some() {
        return Err(Error::field(path, "space origin", "given without `space directions`"));
    }
    let mut spacing = [1.0; 3];
    // An axis without a spacing says `nan`.
    let given = header.fields.numbers::<f64>(path, "spacings", rank)?;
    for (a, &axis) in spatial.iter().enumerate() {
        spacing[a] = given.as_ref().map_or(1.0, |s| if s[axis].is_nan() { 1.0 } else { s[axis] });
    }
    let mut origin = [0.0; 3];
    let mins = header.fields.numbers::<f64>(path, "axis mins", rank)?;
    if let Some(mins) = mins.filter(|mins| spatial.iter().all(|&axis| mins[axis].is_finite())) {
        let centers: Vec<&str> = header
            .fields
            .get("centers")
            .or_else(|| header.fields.get("centerings"))
            .map(|c| c.split_whitespace().collect())
            .unwrap_or_default();
        for (a, &axis) in spatial.iter().enumerate() {
            // The minimum of a cell is half a spacing before its centre; cells are what isn't said to be nodes.
            let half = if centers.get(axis) == Some(&"node") { 0.0 } else { 0.5 * spacing[a] };
            origin[a] = mins[axis] + half;
        }
    }
    orientation::grid_from_lps_parts(path, dims, spacing, origin, orientation::IDENTITY).map_err(|error| {
        match error {
            Error::Field { problem, .. } => Error::field(path, "spacings", problem),
            other => other,
        }
    })
}

/// Signs that turn the file's space into LPS. A space without anatomy is taken as LPS, as ITK takes it.
fn signs(path: &Path, header: &Header) -> Result<[f64; 3], Error> {
    let Some(name) = header.fields.get("space") else { return Ok([1.0; 3]) };
    match name.to_lowercase().as_str() {
        "right-anterior-superior" | "ras" => Ok([-1.0, -1.0, 1.0]),
        "left-anterior-superior" | "las" => Ok([1.0, -1.0, 1.0]),
        "left-posterior-superior" | "lps" | "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => {
            Ok([1.0; 3])
        }
        _ => Err(Error::unsupported(path, format!("space `{name}`"), "give it in left-posterior-superior")),
    }
}

/// A vector of a plane image lies in the plane z = 0.
fn padded(path: &Path, field: &str, vector: &[f64]) -> Result<[f64; 3], Error> {
    match *vector {
        [x, y, z] => Ok([x, y, z]),
        [x, y] => Ok([x, y, 0.0]),
        _ => Err(Error::field(path, field, format!("a vector of {} numbers", vector.len()))),
    }
}
