//! Reads PLY in its three encodings; properties in any order and of any type.

use nalgebra::Vector3;

use super::header::{Element, Encoding, Header};
use crate::Space;
use crate::mesh::parse::{Budget, Cursor, Failure, Fan, REPAIR, REWRITE, Words, index, out_of_range};
use crate::mesh::{Mesh, MeshAddress};
use crate::number::Number;
use crate::order::ByteOrder;

/// What a property of a vertex is for.
#[derive(Clone, Copy)]
enum Role {
    Position(usize),
    Voxel(usize),
    Element,
    Other,
}

pub(in crate::mesh) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Mesh, Failure> {
    let header = Header::parse(bytes)?;
    match header.encoding {
        Encoding::Ascii => body(&header, &mut Words::new(bytes, header.body, header.line), budget),
        Encoding::Binary(order) => body(&header, &mut Binary(Cursor::new(bytes, header.body), order), budget),
    }
}

/// The numbers of a body, one after the other.
trait Values {
    fn real(&mut self, number: Number, what: &str) -> Result<f64, Failure>;
    fn integer(&mut self, number: Number, what: &str) -> Result<i64, Failure>;
    /// Where the last number was.
    fn place(&self) -> String;
    /// Least bytes of a number.
    fn least(number: Number) -> u64;
    /// Bytes that are left.
    fn left(&self) -> u64;
}

struct Binary<'a>(Cursor<'a>, ByteOrder);

impl Values for Binary<'_> {
    #[inline]
    fn real(&mut self, number: Number, what: &str) -> Result<f64, Failure> {
        self.0.take(what, number.bytes()).map(|b| number.real(b, self.1))
    }
    #[inline]
    fn integer(&mut self, number: Number, what: &str) -> Result<i64, Failure> {
        self.0.take(what, number.bytes()).map(|b| number.integer(b, self.1))
    }
    fn place(&self) -> String {
        format!("the number before byte {}", self.0.at())
    }
    fn least(number: Number) -> u64 {
        number.bytes() as u64
    }
    fn left(&self) -> u64 {
        self.0.left() as u64
    }
}

impl Values for Words<'_> {
    #[inline]
    fn real(&mut self, _: Number, what: &str) -> Result<f64, Failure> {
        Words::real(self, what)
    }
    #[inline]
    fn integer(&mut self, _: Number, what: &str) -> Result<i64, Failure> {
        Words::integer(self, what)
    }
    fn place(&self) -> String {
        format!("line {}", self.line)
    }
    /// A digit; the white space after it may be missing at the end alone.
    fn least(_: Number) -> u64 {
        2
    }
    fn left(&self) -> u64 {
        Words::left(self) as u64 + 1
    }
}

fn body<V: Values>(header: &Header, values: &mut V, budget: &mut Budget) -> Result<Mesh, Failure> {
    let only = |name: &'static str| {
        let mut found = header.elements.iter().filter(|e| e.name == name);
        match (found.next(), found.next()) {
            (Some(element), None) => Ok(element),
            (None, _) => Err(Failure::at(
                "head",
                format!("there is no element `{name}`"),
                "write a surface with faces",
            )),
            _ => Err(Failure::at("head", format!("there are several elements `{name}`"), REWRITE)),
        }
    };
    let (vertex, _) = (only("vertex")?, only("face")?);
    let mut mesh = Mesh::default();
    for element in &header.elements {
        fits(element, values)?;
        match element.name.as_str() {
            "vertex" => vertices(element, header.space, values, budget, &mut mesh)?,
            "face" => faces(element, vertex.count, values, budget, &mut mesh)?,
            _ => pass_over(element, values)?,
        }
    }
    Ok(mesh)
}

/// Refuses an element of which there are more than the rest of the file has room for.
fn fits<V: Values>(element: &Element, values: &V) -> Result<(), Failure> {
    let least: u64 = element.properties.iter().map(|p| V::least(p.length.unwrap_or(p.number))).sum();
    if least == 0 && element.count > 0 {
        return Err(Failure::at("head", format!("element `{}` has no properties", element.name), REWRITE));
    }
    if element.count.saturating_mul(least) > values.left() {
        let problem = format!(
            "{} times `{}` need {} bytes or more, {} are left",
            element.count,
            element.name,
            element.count.saturating_mul(least),
            values.left()
        );
        return Err(Failure::at("head", problem, REWRITE));
    }
    Ok(())
}

fn roles(element: &Element) -> Result<Vec<Role>, Failure> {
    let roles: Vec<Role> = element
        .properties
        .iter()
        .map(|p| match (p.name.as_str(), p.length) {
            (_, Some(_)) => Role::Other,
            ("x", None) => Role::Position(0),
            ("y", None) => Role::Position(1),
            ("z", None) => Role::Position(2),
            ("voxel_x", None) if p.number.is_integer() => Role::Voxel(0),
            ("voxel_y", None) if p.number.is_integer() => Role::Voxel(1),
            ("voxel_z", None) if p.number.is_integer() => Role::Voxel(2),
            ("element", None) if p.number.is_integer() => Role::Element,
            _ => Role::Other,
        })
        .collect();
    for axis in 0..3 {
        if roles.iter().filter(|r| matches!(r, Role::Position(a) if *a == axis)).count() != 1 {
            let problem = format!("element `vertex` needs one property `{}`", ["x", "y", "z"][axis]);
            return Err(Failure::at("head", problem, REWRITE));
        }
    }
    Ok(roles)
}

fn vertices<V: Values>(
    element: &Element,
    space: Space,
    values: &mut V,
    budget: &mut Budget,
    mesh: &mut Mesh,
) -> Result<(), Failure> {
    let roles = roles(element)?;
    let has = |wanted: usize| roles.iter().any(|r| matches!(r, Role::Voxel(a) if *a == wanted));
    let addressed = (0..3).all(has) && roles.iter().any(|r| matches!(r, Role::Element));
    mesh.positions = budget.list("positions", element.count)?;
    let mut addresses: Vec<MeshAddress> =
        budget.list("addresses", if addressed { element.count } else { 0 })?;
    for i in 0..element.count {
        let (mut position, mut address) = ([0.0; 3], ([0; 3], 0));
        for (property, role) in element.properties.iter().zip(&roles) {
            let number = property.number;
            match *role {
                Role::Position(axis) => position[axis] = values.real(number, "a coordinate")?,
                Role::Voxel(axis) => address.0[axis] = values.integer(number, "a voxel")?,
                Role::Element => {
                    let value = values.integer(number, "an element")?;
                    address.1 = value.clamp(0, 255) as u8;
                    if addressed && !(0..8).contains(&value) {
                        let problem = format!("vertex {i}: element {value} isn't one of 0 to 7");
                        return Err(Failure::at(values.place(), problem, REPAIR));
                    }
                }
                Role::Other => skip(number, property.length, values)?,
            }
        }
        if !position.iter().all(|c| c.is_finite()) {
            return Err(Failure::at(
                values.place(),
                format!("vertex {i} is at {position:?}, not finite"),
                REPAIR,
            ));
        }
        mesh.positions.push(Vector3::from(space.turn(position)));
        if addressed {
            addresses.push(address);
        }
    }
    mesh.addresses = addressed.then_some(addresses);
    Ok(())
}

fn faces<V: Values>(
    element: &Element,
    vertices: u64,
    values: &mut V,
    budget: &mut Budget,
    mesh: &mut Mesh,
) -> Result<(), Failure> {
    let is_indices = |name: &str| matches!(name, "vertex_indices" | "vertex_index");
    let found = element.properties.iter().filter(|p| p.length.is_some() && is_indices(&p.name));
    let mut found = found.filter(|p| p.number.is_integer());
    if element.count > 0 && (found.next().is_none() || found.next().is_some()) {
        let problem = "element `face` needs one list of integers `vertex_indices`";
        return Err(Failure::at("head", problem, REWRITE));
    }
    // Most files are of triangles.
    mesh.triangles = budget.list("triangles", element.count)?;
    for i in 0..element.count {
        for property in &element.properties {
            let length =
                property.length.filter(|_| is_indices(&property.name) && property.number.is_integer());
            let Some(length) = length else {
                skip(property.number, property.length, values)?;
                continue;
            };
            let corners = values.integer(length, "the length of a face")?;
            if corners < 3 {
                return Err(Failure::at(values.place(), format!("face {i} has {corners} corners"), REPAIR));
            }
            let mut fan = Fan::default();
            for _ in 0..corners {
                let value = values.integer(property.number, "a corner of a face")?;
                let Some(v) = index(value, vertices) else {
                    let problem = format!("face {i}: {}", out_of_range(value, vertices));
                    return Err(Failure::at(values.place(), problem, REPAIR));
                };
                fan.corner(v, &mut mesh.triangles, budget)?;
            }
        }
    }
    Ok(())
}

fn pass_over<V: Values>(element: &Element, values: &mut V) -> Result<(), Failure> {
    for _ in 0..element.count {
        for property in &element.properties {
            skip(property.number, property.length, values)?;
        }
    }
    Ok(())
}

fn skip<V: Values>(number: Number, length: Option<Number>, values: &mut V) -> Result<(), Failure> {
    let count = match length {
        Some(length) => values.integer(length, "the length of a list")?,
        None => 1,
    };
    if count < 0 {
        return Err(Failure::at(values.place(), format!("a list of length {count}"), REWRITE));
    }
    for _ in 0..count {
        values.real(number, "a property")?;
    }
    Ok(())
}
