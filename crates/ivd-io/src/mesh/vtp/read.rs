//! Reads VTP: the points, polygons and strips of all pieces.

use nalgebra::Vector3;

use super::array::Count;
use super::document::{Array, Document, Section};
use crate::Space;
use crate::mesh::parse::{Budget, Failure, Fan, REPAIR, REWRITE, index, out_of_range};
use crate::mesh::{Mesh, MeshAddress};
use crate::number::Number;
use crate::vtk::Coding;

pub(in crate::mesh) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Mesh, Failure> {
    let document = Document::parse(bytes)?;
    // As ITK takes VTK's world, and 3D Slicer a file that doesn't say.
    let space = space(&document, budget)?.unwrap_or(Space::Lps);
    let mut mesh = Mesh::default();
    let mut addresses: Vec<MeshAddress> = Vec::new();
    let mut addressed = true;
    for i in 0..document.pieces.len() {
        let piece = Piece { document: &document, i };
        let first = mesh.positions.len();
        piece.points(space, &mut mesh, budget)?;
        let vertices = (mesh.positions.len() - first) as u64;
        if u32::try_from(mesh.positions.len()).is_err() {
            return Err(Failure::at(format!("piece {i}"), "more than 2³² points", "split the surface"));
        }
        let first = first as u32;
        piece.cells(Section::Polys, document.pieces[i].polys, first, vertices, &mut mesh, budget)?;
        piece.cells(Section::Strips, document.pieces[i].strips, first, vertices, &mut mesh, budget)?;
        addressed = addressed && (vertices == 0 || piece.addresses(vertices, &mut addresses, budget)?);
    }
    mesh.addresses = (addressed && addresses.len() == mesh.positions.len() && has_addresses(&document))
        .then_some(addresses);
    Ok(mesh)
}

fn has_addresses(document: &Document) -> bool {
    ["voxel", "element"]
        .iter()
        .all(|name| document.arrays.iter().any(|a| a.section == Section::PointData && a.name == *name))
}

/// What the field `SPACE` says, a text of character codes that ends in 0.
fn space(document: &Document, budget: &mut Budget) -> Result<Option<Space>, Failure> {
    let Some(array) = document.arrays.iter().find(|a| a.section == Section::Field && a.name == "SPACE")
    else {
        return Ok(None);
    };
    let mut text = Vec::new();
    array.integers(document.coding, Count::AtMost(16), budget, |_, code, _| {
        text.push(u8::try_from(code).unwrap_or(b'?'));
        Ok(())
    })?;
    let text = text.split(|&c| c == 0).next().unwrap_or_default();
    let named = Space::named(&String::from_utf8_lossy(text));
    named.map(Some).map_err(|problem| Failure::at("field SPACE", problem, "save it as LPS"))
}

struct Piece<'d, 'a> {
    document: &'d Document<'a>,
    i: usize,
}

impl<'d, 'a> Piece<'d, 'a> {
    fn coding(&self) -> Coding {
        self.document.coding
    }

    fn find(&self, section: Section, name: Option<&str>) -> Option<&'d Array<'a>> {
        let mut arrays = self.document.arrays.iter();
        arrays.find(|a| a.piece == self.i && a.section == section && name.is_none_or(|name| a.name == name))
    }

    fn expect(&self, section: Section, name: Option<&str>) -> Result<&'d Array<'a>, Failure> {
        self.find(section, name).ok_or_else(|| {
            let problem = format!("no DataArray {} in {section:?}", name.unwrap_or_default());
            Failure::at(format!("piece {}", self.i), problem, REWRITE)
        })
    }

    fn points(&self, space: Space, mesh: &mut Mesh, budget: &mut Budget) -> Result<(), Failure> {
        let count = self.document.pieces[self.i].points;
        if count == 0 {
            return Ok(());
        }
        let array = self.expect(Section::Points, None)?;
        if array.components != 3 {
            let problem = format!("points of {} components, 3 are needed", array.components);
            return Err(Failure::at(format!("piece {}", self.i), problem, REWRITE));
        }
        let numbers = count.checked_mul(3).ok_or_else(|| self.too_many("NumberOfPoints", count))?;
        let mut p = [0.0; 3];
        array.reals(self.coding(), Count::Exactly(numbers), budget, |i, value, budget| {
            p[(i % 3) as usize] = value;
            if i % 3 == 2 {
                budget.push("positions", &mut mesh.positions, Vector3::from(space.turn(p)))?;
            }
            Ok(())
        })
    }

    fn too_many(&self, what: &str, count: u64) -> Failure {
        Failure::at(format!("piece {}", self.i), format!("{what} is {count}"), REWRITE)
    }

    /// Triangles of polygons or strips; `first` is the index of the piece's first point.
    fn cells(
        &self,
        section: Section,
        count: u64,
        first: u32,
        vertices: u64,
        mesh: &mut Mesh,
        budget: &mut Budget,
    ) -> Result<(), Failure> {
        if count == 0 {
            return Ok(());
        }
        let name = if section == Section::Strips { "strip" } else { "polygon" };
        let place = |cell: usize| format!("piece {}, {name} {cell}", self.i);
        let mut ends: Vec<u64> = Vec::new();
        let array = self.expect(section, Some("offsets"))?;
        array.integers(self.coding(), Count::Exactly(count), budget, |_, end, budget| {
            let start = ends.last().copied().unwrap_or(0);
            let corners = u64::try_from(end).ok().and_then(|end| end.checked_sub(start)).unwrap_or(0);
            if corners < 3 {
                let problem = format!("its corners {start} to {end} are less than 3");
                return Err(Failure::at(place(ends.len()), problem, REPAIR));
            }
            budget.push("offsets", &mut ends, end as u64)
        })?;
        let total = ends.last().copied().unwrap_or(0);
        let mut cell = 0;
        let (mut fan, mut strip) = (Fan::default(), [0; 2]);
        let array = self.expect(section, Some("connectivity"))?;
        array.integers(self.coding(), Count::Exactly(total), budget, |i, value, budget| {
            let v = index(value, vertices)
                .ok_or_else(|| Failure::at(place(cell), out_of_range(value, vertices), REPAIR))?
                + first;
            if section == Section::Polys {
                fan.corner(v, &mut mesh.triangles, budget)?;
            } else {
                let corner = i - cell.checked_sub(1).map_or(0, |before| ends[before]);
                if corner >= 2 {
                    let [a, b] = if corner % 2 == 0 { strip } else { [strip[1], strip[0]] };
                    budget.push("triangles", &mut mesh.triangles, [a, b, v])?;
                }
                strip = [strip[1], v];
            }
            if i + 1 == ends[cell] {
                cell += 1;
                fan = Fan::default();
            }
            Ok(())
        })?;
        budget.give((ends.capacity() * size_of::<u64>()) as u64);
        Ok(())
    }

    /// Appends the addresses that our files carry; whether there are any.
    fn addresses(
        &self,
        vertices: u64,
        list: &mut Vec<MeshAddress>,
        budget: &mut Budget,
    ) -> Result<bool, Failure> {
        let find = |name| {
            self.find(Section::PointData, Some(name)).filter(|a| a.number.is_some_and(Number::is_integer))
        };
        let (Some(voxel), Some(element)) = (find("voxel"), find("element")) else { return Ok(false) };
        if (voxel.components, element.components) != (3, 1) {
            return Ok(false);
        }
        let first = list.len();
        let mut p = [0; 3];
        voxel.integers(self.coding(), Count::Exactly(3 * vertices), budget, |i, value, budget| {
            p[(i % 3) as usize] = value;
            if i % 3 == 2 { budget.push("addresses", list, (p, 0)) } else { Ok(()) }
        })?;
        element.integers(self.coding(), Count::Exactly(vertices), budget, |i, value, _| {
            let known = u8::try_from(value).ok().filter(|e| *e < 8);
            list[first + i as usize].1 = known.ok_or_else(|| {
                Failure::at(
                    "DataArray \"element\"",
                    format!("point {i}: {value} isn't one of 0 to 7"),
                    REPAIR,
                )
            })?;
            Ok(())
        })?;
        Ok(true)
    }
}
