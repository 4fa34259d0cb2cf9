//! Reads GLB: the triangles of the scene, each node's placed by the transforms above it.

use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector3};

use super::json::{Accessor, Node, Primitive, Root};
use super::write::TO_GLTF;
use super::{GENERATOR, ROOT};
use crate::mesh::Mesh;
use crate::mesh::parse::{Budget, Cursor, Failure, REPAIR, REWRITE, index, out_of_range};
use crate::number::Number;
use crate::order::ByteOrder;

/// Longest description that is read (bytes).
const LONGEST: usize = 4 << 20;
/// Most primitives in a scene, counted as often as a node shows them.
const MOST_PRIMITIVES: usize = 1 << 16;
const TRIANGLES: u32 = 4;
const STRIP: u32 = 5;
const FAN: u32 = 6;

pub(in crate::mesh) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Mesh, Failure> {
    let (text, binary) = chunks(bytes)?;
    // Lists of numbers, and at most 65,536 nodes, meshes and accessors of a hundred bytes each.
    budget.take("the scene's description", (30 * text.len() as u64).min(24 << 20))?;
    let root: Root =
        serde_json::from_slice(text).map_err(|e| Failure::at("JSON chunk", e.to_string(), REWRITE))?;
    check(&root)?;
    let mut scene = Scene { root: &root, binary, budget, mesh: Mesh::default(), primitives: 0 };
    scene.walk()?;
    Ok(scene.mesh)
}

/// The description and the binary chunk.
fn chunks(bytes: &[u8]) -> Result<(&[u8], &[u8]), Failure> {
    let mut cursor = Cursor::new(bytes, 0);
    if cursor.take("the magic", 4)? != b"glTF" {
        return Err(Failure::byte(
            0,
            "a GLB file starts with `glTF`",
            "write glTF 2.0 in its binary form (.glb)",
        ));
    }
    let version = cursor.u32("the version")?;
    if version != 2 {
        return Err(Failure::byte(4, format!("version {version}, only 2 is read"), "write glTF 2.0"));
    }
    let length = cursor.u32("the length")? as usize;
    if length > bytes.len() || length < cursor.at() {
        let problem = format!("a length of {length} bytes, the file has {}", bytes.len());
        return Err(Failure::byte(8, problem, REWRITE));
    }
    let mut cursor = Cursor::new(&bytes[..length], cursor.at());
    let (mut text, mut binary) = (None, None);
    while cursor.left() > 0 {
        let at = cursor.at();
        let size = cursor.u32("the length of a chunk")? as usize;
        let kind = cursor.take("the type of a chunk", 4)?;
        let data = cursor.take("a chunk", size)?;
        match kind {
            b"JSON" if text.is_none() => text = Some(data),
            b"BIN\0" if text.is_some() && binary.is_none() => binary = Some(data),
            b"JSON" | b"BIN\0" => {
                return Err(Failure::byte(at, "chunks out of order, or one of them twice", REWRITE));
            }
            _ => {}
        }
    }
    let text = text.ok_or_else(|| Failure::byte(12, "there is no JSON chunk", REWRITE))?;
    if text.len() > LONGEST {
        let problem = format!("{} bytes of description, more than {LONGEST}", text.len());
        return Err(Failure::at("JSON chunk", problem, "join the nodes and meshes of the scene"));
    }
    Ok((text, binary.unwrap_or_default()))
}

fn check(root: &Root) -> Result<(), Failure> {
    if !root.asset.version.starts_with("2.") {
        let problem = format!("version {:?}, only 2.x is read", cut(&root.asset.version));
        return Err(Failure::at("asset", problem, "write glTF 2.0"));
    }
    // Looks of a surface don't move it.
    let harmless = |name: &str| {
        ["KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_", "KHR_xmp"]
            .iter()
            .any(|p| name.starts_with(p))
    };
    if let Some(name) = root.extensions_required.0.iter().find(|name| !harmless(name)) {
        let problem = format!("the extension {} isn't read", cut(name));
        return Err(Failure::at(
            "extensionsRequired",
            problem,
            "write the file without compression or quantisation",
        ));
    }
    Ok(())
}

/// A name as it may stand in a message.
fn cut(name: &str) -> String {
    name.chars().take(40).collect()
}

/// What is missing where an index leads nowhere.
fn nowhere(what: &str, i: u32) -> Failure {
    Failure::at(format!("{what} {i}"), "there is none of this number", REWRITE)
}

/// A node's place in the world.
#[derive(Clone, Copy)]
struct Placement {
    linear: Matrix3<f64>,
    offset: Vector3<f64>,
}

impl Placement {
    const UNMOVED: Self = Self {
        linear: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        offset: Vector3::new(0.0, 0.0, 0.0),
    };

    /// From metres with y up to mm, RAS: left is +x, the head +y, the front +z.
    fn to_ras() -> Self {
        let linear = Matrix3::new(-1e3, 0.0, 0.0, 0.0, 0.0, 1e3, 0.0, 1e3, 0.0);
        Self { linear, offset: Vector3::zeros() }
    }

    /// Of what stands under a node of this placement.
    fn then(&self, node: &Node) -> Self {
        let inner = if let Some(matrix) = &node.matrix {
            let m = Matrix4::from_column_slice(matrix.as_slice());
            Self { linear: m.fixed_view::<3, 3>(0, 0).into(), offset: m.fixed_view::<3, 1>(0, 3).into() }
        } else {
            let scale = node.scale.as_deref().map_or(Vector3::repeat(1.0), |s| Vector3::from(*s));
            let rotation = node.rotation.as_deref().map_or(Matrix3::identity(), |&[x, y, z, w]| {
                let q = nalgebra::Quaternion::new(w, x, y, z);
                UnitQuaternion::try_new(q, 0.0)
                    .map_or(Matrix3::repeat(f64::NAN), |q| q.to_rotation_matrix().into_inner())
            });
            let offset = node.translation.as_deref().map_or(Vector3::zeros(), |t| Vector3::from(*t));
            Self { linear: rotation * Matrix3::from_diagonal(&scale), offset }
        };
        Self { linear: self.linear * inner.linear, offset: self.offset + self.linear * inner.offset }
    }
}

/// How a primitive's corners make triangles.
struct Shape {
    mode: u32,
    /// Index of the first vertex.
    first: u32,
    vertices: u64,
    /// Whether the node is mirrored.
    flip: bool,
}

struct Scene<'a> {
    root: &'a Root,
    binary: &'a [u8],
    budget: &'a mut Budget,
    mesh: Mesh,
    primitives: usize,
}

impl<'a> Scene<'a> {
    fn walk(&mut self) -> Result<(), Failure> {
        let nodes = &self.root.nodes;
        let mut seen = vec![false; nodes.0.len()];
        let tops: Vec<u32> = self.tops()?;
        // Our root's transform and the way back are each other's inverse: neither is taken.
        let ours = self.root.asset.generator.as_deref() == Some(GENERATOR)
            && tops.len() == 1
            && nodes.get(tops[0]).is_some_and(|node| {
                node.name.as_deref() == Some(ROOT)
                    && node.matrix.as_deref() == Some(&TO_GLTF)
                    && node.mesh.is_none()
            });
        // A node is marked when it is first named, so that no more are open than there are.
        let mut name = |i: u32| {
            let seen = seen.get_mut(i as usize).ok_or_else(|| nowhere("node", i))?;
            if std::mem::replace(seen, true) {
                let problem = "it hangs under two nodes, or under itself";
                return Err(Failure::at(format!("node {i}"), problem, REWRITE));
            }
            Ok(i)
        };
        let mut open: Vec<(u32, Placement)> = Vec::new();
        for &top in tops.iter().rev() {
            open.push((name(top)?, Placement::to_ras()));
        }
        while let Some((i, above)) = open.pop() {
            let node = nodes.get(i).ok_or_else(|| nowhere("node", i))?;
            let here = if ours && i == tops[0] { Placement::UNMOVED } else { above.then(node) };
            if let Some(mesh) = node.mesh {
                self.mesh_of(mesh, &here)?;
            }
            for &child in node.children.0.iter().rev() {
                open.push((name(child)?, here));
            }
        }
        Ok(())
    }

    /// Nodes of the scene shown; without scenes all that hang under no other.
    fn tops(&self) -> Result<Vec<u32>, Failure> {
        let shown = self.root.scene.unwrap_or(0);
        match self.root.scenes.get(shown) {
            Some(scene) => Ok(scene.nodes.0.clone()),
            None if self.root.scene.is_some() => Err(nowhere("scene", shown)),
            None => {
                let mut below = vec![false; self.root.nodes.0.len()];
                for &child in self.root.nodes.0.iter().flat_map(|n| &n.children.0) {
                    *below.get_mut(child as usize).ok_or_else(|| nowhere("node", child))? = true;
                }
                Ok((0..below.len() as u32).filter(|&i| !below[i as usize]).collect())
            }
        }
    }

    fn mesh_of(&mut self, i: u32, here: &Placement) -> Result<(), Failure> {
        let parts = self.root.meshes.get(i).ok_or_else(|| nowhere("mesh", i))?;
        self.primitives += parts.primitives.0.len();
        if self.primitives > MOST_PRIMITIVES {
            let problem = format!("the scene has more than {MOST_PRIMITIVES} primitives");
            return Err(Failure::at(format!("mesh {i}"), problem, "join the meshes of the scene"));
        }
        // Primitives of different looks often share their vertices.
        let mut last: Option<(u32, usize)> = None;
        for (p, primitive) in parts.primitives.0.iter().enumerate() {
            let place = format!("mesh {i}, primitive {p}");
            let mode = primitive.mode.unwrap_or(TRIANGLES);
            if mode > FAN {
                return Err(Failure::at(place, format!("mode {mode} isn't one of 0 to 6"), REWRITE));
            }
            if mode < TRIANGLES {
                continue;
            }
            let Some(position) = primitive.attributes.position else { continue };
            let first = match last {
                Some((accessor, first)) if accessor == position => first,
                _ => self.positions(position, here)?,
            };
            last = Some((position, first));
            let shape = Shape {
                mode,
                first: first as u32,
                vertices: (self.mesh.positions.len() - first) as u64,
                flip: here.linear.determinant() < 0.0,
            };
            self.triangles(primitive, &shape, &place)?;
        }
        Ok(())
    }

    /// Appends an accessor's positions; gives the index of the first.
    fn positions(&mut self, i: u32, here: &Placement) -> Result<usize, Failure> {
        let place = format!("accessor {i}");
        let accessor = self.root.accessors.get(i).ok_or_else(|| nowhere("accessor", i))?;
        if (accessor.component_type, accessor.shape.as_str()) != (5126, "VEC3") {
            return Err(Failure::at(
                place,
                "positions must be VEC3 of floats (5126)",
                "write them without quantisation",
            ));
        }
        let (data, stride) = self.data(i, accessor, 12)?;
        let (first, count) = (self.mesh.positions.len(), accessor.count as usize);
        if u32::try_from(first + count).is_err() {
            return Err(Failure::at(place, "more than 2³² vertices", "split the scene"));
        }
        self.budget.grow("positions", &mut self.mesh.positions, count)?;
        for v in 0..count {
            let bytes = &data[v * stride..v * stride + 12];
            let p = Vector3::from_fn(|a, _| Number::F32.real(&bytes[4 * a..4 * a + 4], ByteOrder::Little));
            // Sums of one term are exact: an unmoved axis keeps its numbers.
            let world = here.linear * p + here.offset;
            if !world.iter().all(|c| c.is_finite()) {
                let problem = format!("vertex {v} is at {:?}, not finite", world.as_slice());
                return Err(Failure::at(place, problem, REPAIR));
            }
            self.mesh.positions.push(world);
        }
        Ok(first)
    }

    /// The bytes of an accessor's entries of `size` bytes, and how far apart they lie.
    fn data(&self, i: u32, accessor: &Accessor, size: usize) -> Result<(&'a [u8], usize), Failure> {
        let bad = |problem: String, remedy| Failure::at(format!("accessor {i}"), problem, remedy);
        let plain = "write the file without sparse or empty accessors";
        if accessor.sparse.is_some() {
            return Err(bad("sparse entries aren't read".into(), plain));
        }
        let v = accessor.buffer_view.ok_or_else(|| bad("it has no bufferView".into(), plain))?;
        let view = self.root.buffer_views.get(v).ok_or_else(|| nowhere("bufferView", v))?;
        let buffer = self.root.buffers.get(view.buffer).ok_or_else(|| nowhere("buffer", view.buffer))?;
        if view.buffer != 0 || buffer.uri.is_some() {
            let problem = "its data are outside the file's binary chunk";
            return Err(bad(problem.into(), "write everything into one .glb"));
        }
        let stride = view.byte_stride.unwrap_or(size as u64);
        if accessor.count == 0 || stride < size as u64 {
            let problem = format!("{} entries of {size} bytes, {stride} apart", accessor.count);
            return Err(bad(problem, REWRITE));
        }
        let inside = |start: u64, length: u64, whole: u64| {
            start.checked_add(length).filter(|&end| end <= whole).map(|end| start as usize..end as usize)
        };
        let view_at = inside(view.byte_offset, view.byte_length, self.binary.len() as u64);
        let needed = (accessor.count - 1).checked_mul(stride).and_then(|n| n.checked_add(size as u64));
        let entries_at = needed.and_then(|n| inside(accessor.byte_offset, n, view.byte_length));
        let (Some(view_at), Some(entries_at)) = (view_at, entries_at) else {
            let problem = format!(
                "{} entries from byte {} of bufferView {v} leave it or the binary chunk of {} bytes",
                accessor.count,
                accessor.byte_offset,
                self.binary.len()
            );
            return Err(bad(problem, REWRITE));
        };
        Ok((&self.binary[view_at][entries_at], stride as usize))
    }

    /// Appends a primitive's triangles; those of a mirrored node are turned over.
    fn triangles(&mut self, primitive: &Primitive, shape: &Shape, place: &str) -> Result<(), Failure> {
        let Some(i) = primitive.indices else {
            return self.assemble(shape, shape.vertices as usize, place, |at| Ok(at as u32));
        };
        let accessor = self.root.accessors.get(i).ok_or_else(|| nowhere("accessor", i))?;
        let number = match (accessor.component_type, accessor.shape.as_str()) {
            (5121, "SCALAR") => Number::U8,
            (5123, "SCALAR") => Number::U16,
            (5125, "SCALAR") => Number::U32,
            _ => {
                let problem = "indices must be SCALAR of 8, 16 or 32 bits without sign (5121, 5123, 5125)";
                return Err(Failure::at(format!("accessor {i}"), problem, REWRITE));
            }
        };
        let (data, stride) = self.data(i, accessor, number.bytes())?;
        self.assemble(shape, accessor.count as usize, place, |at| {
            let value = number.integer(&data[at * stride..at * stride + number.bytes()], ByteOrder::Little);
            index(value, shape.vertices).ok_or_else(|| {
                let problem = format!("entry {at}: {}", out_of_range(value, shape.vertices));
                Failure::at(format!("accessor {i}"), problem, REPAIR)
            })
        })
    }

    fn assemble(
        &mut self,
        shape: &Shape,
        count: usize,
        place: &str,
        corner: impl Fn(usize) -> Result<u32, Failure>,
    ) -> Result<(), Failure> {
        let triangles = match shape.mode {
            TRIANGLES if !count.is_multiple_of(3) => {
                let problem = format!("{count} corners, no multiple of 3");
                return Err(Failure::at(place, problem, REWRITE));
            }
            TRIANGLES => count / 3,
            _ => count.saturating_sub(2),
        };
        self.budget.grow("triangles", &mut self.mesh.triangles, triangles)?;
        for t in 0..triangles {
            let [a, b, c] = match shape.mode {
                TRIANGLES => [3 * t, 3 * t + 1, 3 * t + 2],
                STRIP => [t, t + 1 + t % 2, t + 2 - t % 2],
                _ => [t + 1, t + 2, 0],
            };
            let [b, c] = if shape.flip { [c, b] } else { [b, c] };
            let first = shape.first;
            self.mesh.triangles.push([corner(a)? + first, corner(b)? + first, corner(c)? + first]);
        }
        Ok(())
    }
}
