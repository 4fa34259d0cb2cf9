//! Good files with bytes changed, cut out and cut off: a mesh that keeps its promises, or an error, never a panic.

use std::time::Instant;

use ivd_core::Exec;
use ivd_io::mesh::Format;
use ivd_lattice::import::{ImportParams, lattice};

use crate::meshes::solids::hash;
use crate::meshes::{file, grids, read, solids};

/// Random numbers, the same every time.
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 += 1;
        (hash(self.0) % end.max(1) as u64) as usize
    }
}

/// Changes a few bytes or bits, or copies, cuts or truncates.
fn mutate(bytes: &mut Vec<u8>, dice: &mut Dice) {
    for _ in 0..=dice.below(3) {
        if bytes.is_empty() {
            return;
        }
        // Half of the changes go to the head, where more depends on them.
        let reach = if dice.below(2) == 0 { bytes.len().min(700) } else { bytes.len() };
        let at = dice.below(reach);
        match dice.below(8) {
            0 => bytes.truncate(at),
            1 => bytes[at] ^= 1 << dice.below(8),
            2 => bytes[at] = [0, 255, b'9', b'-', b' ', b'\n', b'"', b'<'][dice.below(8)],
            3 => {
                let end = bytes.len().min(at + dice.below(64));
                bytes.drain(at..end);
            }
            4 => {
                let end = bytes.len().min(at + dice.below(64));
                let copy = bytes[at..end].to_vec();
                let to = dice.below(bytes.len());
                bytes.splice(to..to, copy);
            }
            5 => {
                let end = bytes.len().min(at + 4);
                bytes[at..end].fill(255);
            }
            6 if bytes[at].is_ascii_digit() => bytes[at] = b'0' + dice.below(10) as u8,
            _ => bytes[at] = dice.below(256) as u8,
        }
    }
}

#[test]
fn thousands_of_damaged_files_give_a_mesh_or_an_error() {
    let start = Instant::now();
    let grid = &grids()[0];
    let cut = solids::cut(grid, |p| 0.5 + 1.6 - (p - nalgebra::Vector3::new(2.9, 2.6, 2.2)).norm());
    let ascii: &[u8] = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    let ply: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n";
    let vtp: &[u8] = b"<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">JAAAAAAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAA==</DataArray></Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\">0 1 2</DataArray><DataArray type=\"Int32\" Name=\"offsets\">3</DataArray></Polys></Piece></PolyData></VTKFile>";
    let mut good: Vec<(Format, Vec<u8>)> = Format::ALL.map(|format| (format, file(format, &cut).0)).into();
    good.extend([(Format::Stl, ascii.to_vec()), (Format::Ply, ply.to_vec()), (Format::Vtp, vtp.to_vec())]);
    let exec = Exec::default().with_threads(1);
    let params = ImportParams { allow_open: true, ..ImportParams::default() };
    let (mut dice, mut whole, mut refused) = (Dice(7), 0, 0);
    for (format, bytes) in &good {
        assert!(read(*format, bytes).is_ok());
        for _ in 0..1500 {
            let mut damaged = bytes.clone();
            mutate(&mut damaged, &mut dice);
            match read(*format, &damaged) {
                Ok(mesh) => {
                    whole += 1;
                    assert!(mesh.positions.iter().all(|p| p.iter().all(|c| c.is_finite())));
                    let n = mesh.positions.len();
                    assert!(mesh.triangles.as_flattened().iter().all(|v| (*v as usize) < n));
                    assert!(mesh.addresses.as_ref().is_none_or(|a| a.len() == n));
                    let _ = lattice(&mesh, grid, &params, &exec);
                }
                Err(error) => {
                    refused += 1;
                    assert!(!error.to_string().is_empty());
                }
            }
        }
        // Every length that it could have been cut to, at most a few hundred.
        for end in (0..bytes.len()).step_by(bytes.len() / 300 + 1) {
            let _ = read(*format, &bytes[..end]);
        }
    }
    assert!(whole > 500 && refused > 4000, "{whole} were read, {refused} refused");
    assert!(start.elapsed().as_secs() < 60, "a damaged file took long");
}
