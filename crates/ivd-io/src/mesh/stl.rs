//! Stereolithography files: triangles without shared vertices, binary or as text.

use std::io::{self, Write};

use nalgebra::Vector3;

use super::Mesh;
use super::parse::{Budget, Cursor, Failure, REPAIR, REWRITE, Words, shown};
use super::placed::{Placed, f32_rounding, put};
use crate::Space;
use crate::mesh::Error;
use crate::number::Number;
use crate::order::ByteOrder;

/// Bytes before the first triangle, and of a triangle.
const HEAD: usize = 84;
const TRIANGLE: usize = 50;

/// STL counts triangles in 32 bits. Returns what f32 rounds away (mm).
pub(super) fn check(mesh: &Placed) -> Result<f64, Error> {
    let triangles = mesh.lattice.triangles().len();
    if u32::try_from(triangles).is_err() {
        return Err(Error::Unwritable {
            format: "STL",
            problem: format!("it counts triangles in 32 bits, and there are {triangles}"),
        });
    }
    Ok(f32_rounding(mesh.positions.iter()))
}

/// Binary: 80 bytes of comment, which never begin with the `solid` of a text, then each triangle's normal and corners as f32.
pub(super) fn write(file: &mut dyn Write, mesh: &Placed) -> io::Result<()> {
    let mut head = [b' '; 80];
    let comment = format!("SPACE={}, positions in mm", mesh.space.name());
    head[..comment.len()].copy_from_slice(comment.as_bytes());
    file.write_all(&head)?;
    file.write_all(&(mesh.lattice.triangles().len() as u32).to_le_bytes())?;
    for triangle in mesh.lattice.triangles() {
        let corners = triangle.map(|v| mesh.positions[v as usize]);
        for vector in [normal(corners), corners[0], corners[1], corners[2]] {
            put(file, vector.into(), |c: f64| (c as f32).to_le_bytes())?;
        }
        file.write_all(&[0, 0])?;
    }
    Ok(())
}

/// Unit normal; 0 for a triangle without area, as readers expect.
fn normal([a, b, c]: [Vector3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default()
}

/// Binary where the size is that of the number of triangles told, else text: binary files too may begin with `solid`.
pub(super) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Mesh, Failure> {
    let told = bytes.get(80..HEAD).map(|count| Number::U32.integer(count, ByteOrder::Little) as u64);
    let needed = told.map(|n| HEAD as u64 + n * TRIANGLE as u64);
    if needed == Some(bytes.len() as u64) {
        return binary(bytes, budget);
    }
    if bytes.trim_ascii_start().get(..5).is_some_and(|b| b.eq_ignore_ascii_case(b"solid")) {
        return ascii(bytes, budget);
    }
    let problem = match told.zip(needed) {
        Some((n, needed)) => format!("{n} triangles need {needed} bytes, the file has {}", bytes.len()),
        None => format!("{} bytes, and no text that begins with `solid`", bytes.len()),
    };
    Err(Failure::byte(80.min(bytes.len()), problem, REWRITE))
}

fn binary(bytes: &[u8], budget: &mut Budget) -> Result<Mesh, Failure> {
    let space = Space::of(&bytes[..80]).unwrap_or(Space::Ras);
    let count = ((bytes.len() - HEAD) / TRIANGLE) as u64;
    let mut mesh = Mesh {
        positions: budget.list("positions", 3 * count)?,
        triangles: budget.list("triangles", count)?,
        addresses: None,
    };
    let mut cursor = Cursor::new(bytes, HEAD);
    for triangle in 0..count {
        let at = cursor.at();
        let data = cursor.take("a triangle", TRIANGLE)?;
        // Its normal comes first; the corners tell it better.
        for corner in data[12..48].chunks_exact(12) {
            let p: [f64; 3] =
                std::array::from_fn(|a| Number::F32.real(&corner[4 * a..4 * a + 4], ByteOrder::Little));
            finite(p)
                .map_err(|problem| Failure::byte(at, format!("triangle {triangle} has {problem}"), REPAIR))?;
            mesh.positions.push(space.turn(p).into());
        }
        let first = index_of(mesh.positions.len() - 3)?;
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    Ok(mesh)
}

fn finite(p: [f64; 3]) -> Result<(), String> {
    if p.iter().all(|c| c.is_finite()) { Ok(()) } else { Err(format!("a corner at {p:?}, not finite")) }
}

/// The index of a triangle's first corner.
fn index_of(vertex: usize) -> Result<u32, Failure> {
    u32::try_from(vertex).ok().filter(|&v| v < u32::MAX - 2).ok_or_else(|| {
        Failure::at("size", "more than 2³² corners", "write the mesh in a format with shared vertices")
    })
}

/// Which lines may come next.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Outside,
    Solid,
    Facet,
    /// With the corners so far.
    Loop(usize),
    /// After `endloop`.
    Closed,
}

fn ascii(bytes: &[u8], budget: &mut Budget) -> Result<Mesh, Failure> {
    let mut mesh = Mesh::default();
    let (mut state, mut space, mut last) = (State::Outside, Space::Ras, 0);
    for (number, line) in (1..).zip(bytes.split(|&b| b == b'\n')) {
        let mut words = Words::new(line, 0, number);
        let Some(word) = words.next() else { continue };
        last = number;
        state = match (state, word.to_ascii_lowercase().as_slice()) {
            (State::Outside, b"solid") => {
                space = Space::of(line).unwrap_or(space);
                State::Solid
            }
            (State::Solid, b"endsolid") => State::Outside,
            (State::Solid, b"facet") => State::Facet,
            (State::Facet, b"outer") => State::Loop(0),
            (State::Loop(corners @ 0..3), b"vertex") => {
                let mut p = [0.0; 3];
                for c in &mut p {
                    *c = words.real("a coordinate")?;
                }
                finite(p).map_err(|problem| Failure::line(number, problem, REPAIR))?;
                budget.push("positions", &mut mesh.positions, space.turn(p).into())?;
                State::Loop(corners + 1)
            }
            (State::Loop(3), b"endloop") => {
                let first = index_of(mesh.positions.len() - 3)?;
                budget.push("triangles", &mut mesh.triangles, [first, first + 1, first + 2])?;
                State::Closed
            }
            (State::Closed, b"endfacet") => State::Solid,
            (_, word) => {
                let problem = format!(
                    "`{}` doesn't belong here: a facet is `facet normal`, `outer loop`, three times `vertex`, `endloop`, `endfacet`",
                    shown(word)
                );
                return Err(Failure::line(number, problem, REWRITE));
            }
        };
    }
    if state != State::Outside {
        return Err(Failure::line(last, "the text ends before `endsolid`", REWRITE));
    }
    Ok(mesh)
}
