//! Files as other programs write them, by hand.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ivd_core::Mesh;
use ivd_core::{Exec, Grid};
use ivd_io::mesh::Format;
use ivd_lattice::figures::measure;
use ivd_lattice::import::{ImportParams, ImportedMesh, lattice};

use crate::meshes::read;

/// Corners and quads of the cube from 1 to 3, as every file below has them.
const CORNERS: [[f64; 3]; 8] = [
    [1.0, 1.0, 1.0],
    [3.0, 1.0, 1.0],
    [3.0, 3.0, 1.0],
    [1.0, 3.0, 1.0],
    [1.0, 1.0, 3.0],
    [3.0, 1.0, 3.0],
    [3.0, 3.0, 3.0],
    [1.0, 3.0, 3.0],
];
const QUADS: [[u32; 4]; 6] =
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

/// Text of numbers with spaces between them.
fn text<T: ToString>(numbers: impl IntoIterator<Item = T>) -> String {
    numbers.into_iter().map(|n| n.to_string()).collect::<Vec<_>>().join(" ")
}

/// A line for each item.
fn lines<T>(items: &[T], line: impl Fn(&T) -> String) -> String {
    items.iter().map(line).collect::<Vec<_>>().concat()
}

/// A cube of 8 mm³ on a grid of 1 mm, closed and outward.
fn assert_cube(mesh: &Mesh) -> ImportedMesh {
    let grid = Grid::with_spacing([6; 3], [1.0; 3]).unwrap();
    let imported = lattice(mesh, &grid, &ImportParams::default(), &Exec::default()).unwrap();
    let figures = measure(&imported.lattice);
    assert!(figures.is_closed_manifold());
    assert_eq!((figures.vertices, figures.triangles, figures.genus), (8, 12, Some(0)));
    assert_eq!((figures.volume_mm3, figures.area_mm2), (8.0, 24.0));
    imported
}

#[test]
fn ascii_ply_of_quads_with_colours_and_edges() {
    let vertices: String = lines(&CORNERS, |c| format!("255 {} 0.5\n", text(c)));
    let faces: String = lines(&QUADS, |q| format!("7 4 {}\n", text(q)));
    let file = format!(
        "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement vertex 8\r\nproperty uchar red\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\nproperty float quality\r\nelement edge 1\r\nproperty int vertex1\r\nproperty int vertex2\r\nelement face 6\r\nproperty uchar flags\r\nproperty list uchar int vertex_index\r\nend_header\r\n{vertices}0 1\n{faces}"
    );
    let imported = assert_cube(&read(Format::Ply, file.as_bytes()).unwrap());
    assert_eq!((imported.flipped, imported.welded), (0, 0));
}

#[test]
fn big_endian_ply_of_quads_with_lists_between() {
    let mut file = b"ply\nformat binary_big_endian 1.0\nelement face 6\nproperty list ushort float weights\nproperty list uint8 ushort vertex_indices\nelement other 2\nproperty double d\nelement vertex 8\nproperty double z\nproperty short y\nproperty float x\nend_header\n".to_vec();
    for quad in QUADS {
        file.extend([0, 1]);
        file.extend(0.5_f32.to_be_bytes());
        file.push(4);
        file.extend(quad.iter().flat_map(|v| (*v as u16).to_be_bytes()));
    }
    file.extend([0; 16]);
    for [x, y, z] in CORNERS {
        file.extend(z.to_be_bytes());
        file.extend((y as i16).to_be_bytes());
        file.extend((x as f32).to_be_bytes());
    }
    assert_cube(&read(Format::Ply, &file).unwrap());
}

#[test]
fn obj_with_negative_indices_texture_normals_and_joined_lines() {
    let vertices: String = lines(&CORNERS, |c| format!("v {} 1.0\nvt 0 0\nvn 0 0 1\n", text(c)));
    let mut faces = String::new();
    for (i, quad) in QUADS.iter().enumerate() {
        let corner = |v: &u32| match i {
            0 => format!("{}", *v as i64 - 8),
            1 => format!("{}/1", v + 1),
            2 => format!("{}//2", v + 1),
            3 => format!("{}/3/-2", *v as i64 - 8),
            _ => format!("{}", v + 1),
        };
        let words: Vec<String> = quad.iter().map(corner).collect();
        let joint = if i == 4 { " \\\n   " } else { " " };
        let (start, end) = (words[..2].join(" "), words[2..].join("\t"));
        faces.extend(["f ", &start, joint, &end, " # a face\n"]);
    }
    let file =
        format!("# by hand\nmtllib a.mtl\no cube\n{vertices}g sides\nusemtl grey\ns off\n{faces}l 1 2\n");
    assert_cube(&read(Format::Obj, file.as_bytes()).unwrap());
}

#[test]
fn obj_faces_may_come_before_their_vertices() {
    let faces: String = lines(&QUADS, |q| format!("f {}\n", text(q.map(|v| v + 1))));
    let vertices: String = lines(&CORNERS, |c| format!("v {}\n", text(c)));
    assert_cube(&read(Format::Obj, (faces + &vertices).as_bytes()).unwrap());
}

/// A text STL, its facets in the order of the quads.
fn ascii_stl(name: &str, sign: f64) -> String {
    let vertex = |v: &u32| {
        let [x, y, z] = CORNERS[*v as usize];
        format!("      vertex {:e} {:e} {z:e}\n", sign * x, sign * y)
    };
    let facet = |t: &[u32; 3]| {
        format!("  facet normal nan 0 0\n    OUTER loop\n{}    endloop\n  endfacet\n", lines(t, vertex))
    };
    let facets = lines(&QUADS, |&[a, b, c, d]| lines(&[[a, b, c], [a, c, d]], facet));
    format!("solid {name}\n{facets}endsolid\n")
}

#[test]
fn ascii_stl_is_welded() {
    let imported = assert_cube(&read(Format::Stl, ascii_stl("cube of mine", 1.0).as_bytes()).unwrap());
    assert_eq!((imported.vertices_in, imported.welded), (36, 28));
}

#[test]
fn slicers_mark_says_that_a_file_is_lps() {
    assert_cube(&read(Format::Stl, ascii_stl("3D Slicer output. SPACE=LPS", -1.0).as_bytes()).unwrap());
    let vertices: String = lines(&CORNERS, |[x, y, z]| format!("v -{x} -{y} {z}\n"));
    let faces: String = lines(&QUADS, |q| format!("f {}\n", text(q.map(|v| v + 1))));
    assert_cube(&read(Format::Obj, format!("# SPACE=LPS\n{vertices}{faces}").as_bytes()).unwrap());
}

#[test]
fn binary_stl_that_begins_with_solid_is_told_by_its_size() {
    let mut file = [b' '; 80].to_vec();
    file[..5].copy_from_slice(b"solid");
    file.extend(12_u32.to_le_bytes());
    for [a, b, c, d] in QUADS {
        for t in [[a, b, c], [a, c, d]] {
            file.extend([0; 12]);
            file.extend(t.iter().flat_map(|v| CORNERS[*v as usize]).flat_map(|c| (c as f32).to_le_bytes()));
            file.extend([1, 2]);
        }
    }
    assert_cube(&read(Format::Stl, &file).unwrap());
}

/// A VTP whose arrays are encoded by `array(type, name, components, numbers)`, in LPS.
fn vtp(head: &str, array: impl Fn(&str, &str, usize, &[f64]) -> String, tail: &str) -> Vec<u8> {
    let points: Vec<f64> = CORNERS.iter().flat_map(|[x, y, z]| [-x, -y, *z]).collect();
    let corners: Vec<f64> = QUADS.as_flattened().iter().map(|v| f64::from(*v)).collect();
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" {head}>\n<PolyData><Piece NumberOfPoints=\"8\" NumberOfPolys=\"6\">\n<PointData Normals=\"n\">{}</PointData>\n<CellData></CellData>\n<Points>{}</Points>\n<Verts></Verts>\n<Polys>{}{}</Polys>\n</Piece></PolyData>{tail}</VTKFile>\n",
        array("Float32", "n", 1, &[0.0; 8]),
        array("Float32", "Points", 3, &points),
        array("Int64", "connectivity", 1, &corners),
        array("Int32", "offsets", 1, &[4.0, 8.0, 12.0, 16.0, 20.0, 24.0]),
    )
    .into_bytes()
}

fn encoded(kind: &str, numbers: &[f64], big: bool) -> Vec<u8> {
    let bytes = |n: f64| match (kind, big) {
        ("Float32", false) => (n as f32).to_le_bytes().to_vec(),
        ("Float32", true) => (n as f32).to_be_bytes().to_vec(),
        ("Int32", false) => (n as i32).to_le_bytes().to_vec(),
        ("Int32", true) => (n as i32).to_be_bytes().to_vec(),
        (_, false) => (n as i64).to_le_bytes().to_vec(),
        (_, true) => (n as i64).to_be_bytes().to_vec(),
    };
    numbers.iter().flat_map(|n| bytes(*n)).collect()
}

#[test]
fn vtp_in_ascii_with_information_beside_the_numbers() {
    let array = |kind: &str, name: &str, components: usize, numbers: &[f64]| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\"><InformationKey name=\"a\"><Value index=\"0\">1</Value></InformationKey>\n {}\n</DataArray>",
            text(numbers)
        )
    };
    assert_cube(&read(Format::Vtp, &vtp("version=\"1.0\"", array, "")).unwrap());
}

#[test]
fn vtp_in_inline_base64_of_either_byte_order() {
    for big in [false, true] {
        let array = |kind: &str, name: &str, components: usize, numbers: &[f64]| {
            let data = encoded(kind, numbers, big);
            let length = data.len() as u32;
            let head = if big { length.to_be_bytes() } else { length.to_le_bytes() };
            let text = STANDARD.encode([&head[..], &data].concat());
            format!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">\n  {text}\n</DataArray>"
            )
        };
        let order = if big { "byte_order=\"BigEndian\"" } else { "byte_order=\"LittleEndian\"" };
        assert_cube(&read(Format::Vtp, &vtp(order, array, "")).unwrap());
    }
}

#[test]
fn vtp_in_zlib_blocks_appended_as_base64_and_raw() {
    for raw in [false, true] {
        let appended = std::cell::RefCell::new(Vec::<u8>::new());
        let array = |kind: &str, name: &str, components: usize, numbers: &[f64]| {
            let data = encoded(kind, numbers, false);
            let blocks: Vec<Vec<u8>> = data
                .chunks(32)
                .map(|block| {
                    let mut z = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
                    z.write_all(block).unwrap();
                    z.finish().unwrap()
                })
                .collect();
            let mut head = vec![blocks.len() as u64, 32, data.len() as u64 % 32];
            head.extend(blocks.iter().map(|b| b.len() as u64));
            let head: Vec<u8> = head.into_iter().flat_map(u64::to_le_bytes).collect();
            let offset = appended.borrow().len();
            if raw {
                appended.borrow_mut().extend([head, blocks.concat()].concat());
            } else {
                let text = STANDARD.encode(head) + &STANDARD.encode(blocks.concat());
                appended.borrow_mut().extend(text.as_bytes());
            }
            format!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" offset=\"{offset}\"/>"
            )
        };
        let head = "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"";
        let mut file = vtp(head, array, "@");
        let at = file.iter().rposition(|b| *b == b'@').unwrap();
        let encoding = if raw { "raw" } else { "base64" };
        let mut tail = format!("<AppendedData encoding=\"{encoding}\">\n _").into_bytes();
        tail.extend(appended.into_inner());
        tail.extend(b"\n</AppendedData>");
        file.splice(at..=at, tail);
        assert_cube(&read(Format::Vtp, &file).unwrap());
    }
}

#[test]
fn vtp_in_two_pieces_of_strips_and_polygons_says_its_space() {
    let array = |kind: &str, name: &str, components: usize, numbers: &[f64]| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\">{}</DataArray>",
            text(numbers)
        )
    };
    let points: Vec<f64> = CORNERS.as_flattened().to_vec();
    // The four sides as one strip, the top and the bottom as polygons of another piece.
    let strip = [0.0, 4.0, 3.0, 7.0, 2.0, 6.0, 1.0, 5.0, 0.0, 4.0];
    let file = format!(
        "<VTKFile type=\"PolyData\"><PolyData><FieldData><Array type=\"String\" Name=\"SPACE\" format=\"ascii\">82 65 83 0</Array></FieldData><Piece NumberOfPoints=\"8\" NumberOfStrips=\"1\"><Points>{0}</Points><Strips>{1}{2}</Strips></Piece><Piece NumberOfPoints=\"8\" NumberOfPolys=\"2\"><Points>{0}</Points><Polys>{3}{4}</Polys></Piece></PolyData></VTKFile>",
        array("Float64", "Points", 3, &points),
        array("Int32", "connectivity", 1, &strip),
        array("Int32", "offsets", 1, &[10.0]),
        array("Int32", "connectivity", 1, &[0.0, 3.0, 2.0, 1.0, 4.0, 5.0, 6.0, 7.0]),
        array("UInt8", "offsets", 1, &[4.0, 8.0]),
    );
    let imported = assert_cube(&read(Format::Vtp, file.as_bytes()).unwrap());
    assert_eq!((imported.welded, imported.flipped), (8, 0));
    let marked = format!("\u{feff}{file}");
    assert_cube(&read(Format::Vtp, marked.as_bytes()).unwrap());
}

#[test]
fn a_glb_of_many_small_meshes_is_read() {
    let meshes = 400;
    let (mut nodes, mut shown) = (Vec::new(), Vec::new());
    for i in 0..meshes {
        nodes.push("{\"mesh\":0}");
        shown.push(i.to_string());
    }
    let json = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"scene\":0,\"scenes\":[{{\"nodes\":[{}]}}],\"nodes\":[{}],\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}}}]}}],\"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}}],\"bufferViews\":[{{\"buffer\":0,\"byteLength\":36}}],\"buffers\":[{{\"byteLength\":36}}]}}",
        shown.join(","),
        nodes.join(",")
    );
    let binary: Vec<u8> =
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().flat_map(f32::to_le_bytes).collect();
    let mesh = read(Format::Glb, &glb(&json, &binary)).unwrap();
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (3 * meshes, meshes));
}

/// A GLB of one description and binary chunk.
pub(crate) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut text = json.as_bytes().to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + text.len() as u32 + binary.len() as u32).to_le_bytes());
    file.extend((text.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(text);
    file.extend((binary.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}

#[test]
fn glb_in_metres_under_nodes_with_strips_and_small_indices() {
    // The cube from 0 to 1 m in glTF's axes, two millimetres a side and mirrored by its nodes.
    let unit: Vec<f32> = (0..8_u8).flat_map(|c| [c & 1, c >> 1 & 1, c >> 2 & 1].map(f32::from)).collect();
    let mut binary: Vec<u8> = unit.iter().flat_map(|c| c.to_le_bytes()).collect();
    // Sides as a strip of 8-bit indices, the rest as triangles of 16-bit ones.
    let strip = [4_u8, 0, 5, 1, 7, 3, 6, 2, 4, 0];
    let caps = [0_u8, 3, 1, 0, 2, 3, 4, 5, 7, 4, 7, 6];
    binary.extend(strip);
    binary.extend([0; 2]);
    binary.extend(caps.iter().flat_map(|v| u16::from(*v).to_le_bytes()));
    let json = r#"{"asset":{"version":"2.0","generator":"by hand"},"scene":0,"scenes":[{"nodes":[1]}],
        "nodes":[{"mesh":0,"scale":[1,1,-1]},{"children":[2],"translation":[-0.003,0.001,0.003]},
                 {"children":[0],"scale":[0.002,0.002,0.002],"rotation":[0,0,0,1]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":9},"indices":1,"mode":5},
                                 {"attributes":{"POSITION":0},"indices":2},{"attributes":{"POSITION":0},"mode":0}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},
                     {"bufferView":1,"componentType":5121,"count":10,"type":"SCALAR"},
                     {"bufferView":1,"byteOffset":12,"componentType":5123,"count":12,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":96,"byteStride":12},{"buffer":0,"byteOffset":96,"byteLength":36}],
        "buffers":[{"byteLength":132}],"materials":[{}]}"#;
    let mesh = read(Format::Glb, &glb(json, &binary)).unwrap();
    // By the standard (−x, z, y): x from −3 + 0…2 mm becomes 1…3, z from 3 − 2…3 mm the front.
    let low = mesh.positions.iter().fold(mesh.positions[0], |low, p| low.inf(p));
    assert!((low - nalgebra::Vector3::repeat(1.0)).norm() < 1e-6, "{low}");
    let grid = Grid::with_spacing([6; 3], [1.0; 3]).unwrap();
    let imported = lattice(&mesh, &grid, &ImportParams::default(), &Exec::default()).unwrap();
    let figures = measure(&imported.lattice);
    assert!(figures.is_closed_manifold() && (figures.volume_mm3 - 8.0).abs() < 1e-5);
    assert_eq!((imported.flipped, figures.triangles), (0, 12));
}
