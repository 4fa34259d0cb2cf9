//! Wavefront's object files: the vertices and faces of their polygons.

use std::io::{self, Write};

use nalgebra::Vector3;

use super::Mesh;
use super::parse::{
    Budget, Failure, Fan, REPAIR, REWRITE, Words, index, no_number, out_of_range, parsed, shown,
};
use super::placed::Placed;
use crate::Space;

/// Text; each coordinate with the fewest digits that give the same f64 back. Indices count from 1.
pub(super) fn write(file: &mut dyn Write, mesh: &Placed) -> io::Result<()> {
    writeln!(file, "# SPACE={}\n# positions in mm", mesh.space.name())?;
    for p in &mesh.positions {
        writeln!(file, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for [a, b, c] in mesh.lattice.triangles() {
        writeln!(file, "f {} {} {}", u64::from(*a) + 1, u64::from(*b) + 1, u64::from(*c) + 1)?;
    }
    Ok(())
}

/// Takes `v` and `f`; texture, normals, groups, materials, points, lines and free forms are passed over.
///
/// Vertices are counted first: a face may name one that comes later, and is told at once if there is none.
pub(super) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Mesh, Failure> {
    let mut space = Space::Ras;
    let mut vertices = 0_u64;
    for (_, line) in Lines::new(bytes) {
        match line.trim_ascii_start() {
            [b'v', next, ..] if next.is_ascii_whitespace() => vertices += 1,
            comment @ [b'#', ..] => space = Space::of(comment).unwrap_or(space),
            _ => {}
        }
    }
    let mut mesh = Mesh { positions: budget.list("positions", vertices)?, ..Mesh::default() };
    for (number, line) in Lines::new(bytes) {
        let mut words = Words::new(line, 0, number);
        match words.next() {
            Some(b"v") => mesh.positions.push(vertex(number, &mut words, space)?),
            Some(b"f") => face(number, words, vertices, &mut mesh, budget)?,
            Some(word) if !is_statement(word) => {
                let problem = format!("`{}` is no statement of an OBJ file", shown(word));
                return Err(Failure::line(
                    number,
                    problem,
                    "give the file its right ending, or write it again",
                ));
            }
            _ => {}
        }
    }
    Ok(mesh)
}

/// Whether a word may begin a line that is passed over.
fn is_statement(word: &[u8]) -> bool {
    word[0] == b'#' || word.iter().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-'))
}

fn vertex(line: u64, words: &mut Words, space: Space) -> Result<Vector3<f64>, Failure> {
    let mut position = [0.0_f64; 3];
    for (axis, c) in position.iter_mut().enumerate() {
        let Some(word) = next(words) else {
            return Err(Failure::line(line, format!("a vertex of {axis} coordinates, 3 are needed"), REPAIR));
        };
        *c = parsed(word).ok_or_else(|| no_number(line, "a coordinate", word))?;
    }
    if !position.iter().all(|c| c.is_finite()) {
        return Err(Failure::line(line, format!("a vertex at {position:?}, not finite"), REPAIR));
    }
    Ok(space.turn(position).into())
}

/// Corners are `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative numbers count back from the vertex that came last.
fn face(
    line: u64,
    mut words: Words,
    vertices: u64,
    mesh: &mut Mesh,
    budget: &mut Budget,
) -> Result<(), Failure> {
    let mut fan = Fan::default();
    while let Some(word) = next(&mut words) {
        if word[0] == b'#' {
            break;
        }
        let digits = word.split(|&b| b == b'/').next().unwrap_or(word);
        let value: i64 = parsed(digits).ok_or_else(|| no_number(line, "a corner of a face", word))?;
        let zero_based = if value < 0 {
            i64::try_from(mesh.positions.len()).unwrap_or(i64::MAX).saturating_add(value)
        } else {
            value - 1
        };
        let v = index(zero_based, vertices)
            .ok_or_else(|| Failure::line(line, out_of_range(value, vertices), REPAIR))?;
        fan.corner(v, &mut mesh.triangles, budget)?;
    }
    if fan.corners() < 3 {
        return Err(Failure::line(line, format!("a face of {} corners", fan.corners()), REWRITE));
    }
    Ok(())
}

/// The next word of a statement that may go on in the next line.
fn next<'a>(words: &mut Words<'a>) -> Option<&'a [u8]> {
    words.find(|word| *word != b"\\")
}

/// Statements with the numbers of their lines; a backslash at its end joins a line to the next.
struct Lines<'a> {
    rest: &'a [u8],
    line: u64,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, line: 1 }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (u64, &'a [u8]);

    fn next(&mut self) -> Option<(u64, &'a [u8])> {
        if self.rest.is_empty() {
            return None;
        }
        let (number, mut end) = (self.line, 0);
        loop {
            let step = self.rest[end..].iter().position(|&b| b == b'\n');
            let stop = step.map_or(self.rest.len(), |s| end + s);
            let joined = step.is_some() && self.rest[end..stop].trim_ascii_end().ends_with(b" \\");
            self.line += 1;
            if !joined {
                let line = &self.rest[..stop];
                self.rest = self.rest.get(stop + 1..).unwrap_or_default();
                return Some((number, line));
            }
            end = stop + 1;
        }
    }
}
