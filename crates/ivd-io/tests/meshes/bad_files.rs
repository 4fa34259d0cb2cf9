//! Damaged and hostile files: each gets its error, which names the file, the place, what is wrong and a remedy.

use ivd_core::{Classified, ErrorClass};
use ivd_io::FileError;
use ivd_io::mesh::Error;
use ivd_io::mesh::Format;

use crate::meshes::other_programs::glb;
use crate::meshes::read;

/// The error holds all of `wanted`, the file's name and a remedy.
fn assert_refused(format: Format, bytes: &[u8], wanted: &[&str]) {
    let shown = String::from_utf8_lossy(&bytes[..bytes.len().min(400)]).into_owned();
    let error = match read(format, bytes) {
        Ok(mesh) => panic!("{} triangles were read from {shown}", mesh.triangles.len()),
        Err(error) => error,
    };
    assert_eq!(error.error_class(), ErrorClass::Input, "{error}");
    let Error::File(FileError::Unreadable { place, problem, remedy, .. }) = &error else { panic!("{error}") };
    assert!(!place.is_empty() && !problem.is_empty() && !remedy.is_empty());
    let message = error.to_string();
    assert!(message.starts_with(&format!("bytes.{}: ", format.ending())), "{message}");
    for part in wanted {
        assert!(message.contains(part), "`{message}` doesn't say `{part}`, of {shown}");
    }
}

#[test]
fn ply_heads() {
    let cases: &[(&str, &[&str])] = &[
        ("", &["line 1", "starts with `ply`"]),
        ("plx\n", &["line 1", "starts with `ply`"]),
        ("ply\nformat ascii 1.0\n", &["no `end_header`"]),
        ("ply\nend_header\n", &["line 2", "`format` is missing"]),
        ("ply\nformat binary_middle_endian 1.0\n", &["line 2", "binary_middle_endian"]),
        ("ply\nformat ascii 1.0\nelephant\n", &["line 3", "elephant"]),
        ("ply\nformat ascii 1.0\nelement vertex many\n", &["line 3", "`many` is no count"]),
        ("ply\nformat ascii 1.0\nelement vertex -1\n", &["line 3", "`-1` is no count"]),
        ("ply\nformat ascii 1.0\nproperty float x\n", &["line 3", "before any element"]),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\n", &["line 4", "property"]),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\n", &["line 4", "property"]),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float\n", &["line 4", "property"]),
        ("ply\nformat ascii 1.0\nend_header\n", &["no element `vertex`"]),
        ("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n", &["no element `face`"]),
        (
            "ply\nformat ascii 1.0\nelement face 0\nelement face 0\nelement vertex 0\nend_header\n",
            &["several elements `face`"],
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex 3\nelement face 0\nend_header\n",
            &["`vertex` has no properties"],
        ),
    ];
    for (text, wanted) in cases {
        assert_refused(Format::Ply, text.as_bytes(), wanted);
    }
    let long = format!("ply\nformat ascii 1.0\ncomment {}\n", "x".repeat(2 << 20));
    assert_refused(Format::Ply, long.as_bytes(), &["no `end_header` in the first 1048576 bytes"]);
    let many = format!("ply\nformat ascii 1.0\nelement e 0\n{}", "property char a\n".repeat(5000));
    assert_refused(Format::Ply, many.as_bytes(), &["more than 4096 elements and properties"]);
}

/// A head of `vertices` and `faces` with the usual properties.
fn head(format: &str, vertices: u64, faces: u64) -> String {
    format!(
        "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

#[test]
fn ply_bodies() {
    let three = "0 0 0\n1 0 0\n0 1 0\n";
    let cases: &[(u64, u64, String, &[&str])] = &[
        (3, 1, String::new(), &["3 times `vertex` need 18 bytes or more, 1 are left"]),
        (u64::MAX, 1, three.into(), &["times `vertex` need"]),
        (4_000_000_000, 0, three.into(), &["4000000000 times `vertex`"]),
        (3, 4_000_000_000, format!("{three}3 0 1 2\n"), &["4000000000 times `face`"]),
        (3, 0, "0 0 0 nan 0 0 1 1 1\n".into(), &["line 10", "vertex 1", "not finite"]),
        (3, 0, "0 0 0\n0 0 -inf\n1 1 1\n".into(), &["line 11", "not finite"]),
        (3, 0, "0 0 0\n0 zero 0\n1 1 1\n".into(), &["line 11", "`zero` is no such number"]),
        (3, 1, format!("{three}3 0 1 3\n"), &["line 13", "index 3 names no vertex of 3"]),
        (3, 1, format!("{three}3 0 1 -1\n"), &["line 13", "index -1 names no vertex of 3"]),
        (3, 1, format!("{three}3 0 1 1.5\n"), &["line 13", "`1.5` is no such number"]),
        (3, 1, format!("{three}2 0 1\n"), &["line 13", "face 0 has 2 corners"]),
        (3, 1, format!("{three}-7 0 1\n"), &["line 13", "face 0 has -7 corners"]),
        (3, 1, format!("{three}9000000000 0 1 2"), &["line 13", "the text ends before a corner"]),
        (3, 2, format!("{three}3 0 1 2\n3"), &["line 14", "the text ends"]),
    ];
    for (vertices, faces, body, wanted) in cases {
        assert_refused(Format::Ply, (head("ascii", *vertices, *faces) + body).as_bytes(), wanted);
    }
    let mut binary = head("binary_little_endian", 1, 1).into_bytes();
    let start = binary.len();
    binary.extend([0; 12]);
    binary.extend([255, 0, 0, 0, 0]);
    let place = format!("byte {}", start + 17);
    assert_refused(Format::Ply, &binary, &[&place, "4 bytes needed, 0 left"]);
    assert_refused(Format::Ply, &binary[..start + 12], &["1 times `face` need 1 bytes or more, 0 are left"]);
    let mut nan = head("binary_big_endian", 1, 0).into_bytes();
    nan.extend(f32::NAN.to_be_bytes());
    nan.extend([0; 8]);
    assert_refused(Format::Ply, &nan, &["vertex 0", "not finite"]);
    let twice = head("ascii", 0, 0).replace("property float y", "property float x");
    assert_refused(Format::Ply, twice.as_bytes(), &["one property `x`"]);
    let flat = head("ascii", 0, 0).replace("property float z\n", "");
    assert_refused(Format::Ply, flat.as_bytes(), &["one property `z`"]);
    let other = head("ascii", 3, 1).replace("vertex_indices", "corners") + three + "3 0 1 2";
    assert_refused(Format::Ply, other.as_bytes(), &["one list of integers `vertex_indices`"]);
    let ours = head("ascii", 1, 0).replace(
        "element face",
        "property int voxel_x\nproperty int voxel_y\nproperty int voxel_z\nproperty uchar element\nelement face",
    );
    assert_refused(Format::Ply, (ours + "0 0 0 1 1 1 8\n").as_bytes(), &["element 8 isn't one of 0 to 7"]);
}

#[test]
fn obj() {
    let cases: &[(&str, &[&str])] = &[
        ("v 1 2\n", &["line 1", "a vertex of 2 coordinates"]),
        ("v\n", &["line 1", "a vertex of 0 coordinates"]),
        ("\n\nv 1 2 x\n", &["line 3", "`x` is no such number"]),
        ("v 1 2 nan\n", &["line 1", "not finite"]),
        ("v 1 1e999 0\n", &["line 1", "not finite"]),
        ("v 0 0 0\nf 1 1 2\n", &["line 2", "index 2 names no vertex of 1"]),
        ("v 0 0 0\nf 1 1 0\n", &["line 2", "index 0 names no vertex"]),
        ("v 0 0 0\nf -1 -1 -2\n", &["line 2", "index -2 names no vertex"]),
        ("v 0 0 0\nf 1 1 -9223372036854775808\n", &["line 2", "names no vertex"]),
        ("v 0 0 0\nf 1 1 99999999999999999999\n", &["line 2", "is no such number"]),
        ("v 0 0 0\nf 1 1\n", &["line 2", "a face of 2 corners"]),
        ("f\n", &["line 1", "a face of 0 corners"]),
        ("v 0 0 0\nf 1/1 /1 1\n", &["line 2", "`/1` is no such number"]),
        ("v 0 0 \\\n0\nf 1 1 \\\n 7\n", &["line 3", "index 7"]),
        ("\u{1}\u{2}\u{3}\n", &["line 1", "no statement of an OBJ file"]),
        ("<?xml?>\n", &["line 1", "`<?xml?>` is no statement"]),
    ];
    for (text, wanted) in cases {
        assert_refused(Format::Obj, text.as_bytes(), wanted);
    }
}

#[test]
fn stl() {
    let facet =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    let cases: &[(String, &[&str])] = &[
        (String::new(), &["byte 0", "0 bytes, and no text"]),
        ("hello".into(), &["5 bytes, and no text"]),
        ("solid x\n".into(), &["line 1", "ends before `endsolid`"]),
        (format!("solid x\n{facet}"), &["line 8", "ends before `endsolid`"]),
        (format!("solid\n{facet}solid\n"), &["line 9", "`solid` doesn't belong here"]),
        (format!("solid\n{}endsolid\n", facet.replace("vertex 0 1 0\n", "")), &["line 6", "`endloop`"]),
        (
            format!("solid\n{}endsolid\n", facet.replace("endloop", "vertex 1 1 1\nendloop")),
            &["line 7", "`vertex`"],
        ),
        (
            format!("solid\n{}endsolid\n", facet.replace("1 0 0", "1 0")),
            &["line 5", "ends before a coordinate"],
        ),
        (
            format!("solid\n{}endsolid\n", facet.replace("1 0 0", "1 0 q")),
            &["line 5", "`q` is no such number"],
        ),
        (format!("solid\n{}endsolid\n", facet.replace("1 0 0", "1 0 NaN")), &["line 5", "not finite"]),
        (format!("solid\n{}endsolid\n", facet.replace("outer loop\n", "")), &["line 3", "`vertex`"]),
        (format!("solid\n{facet}endsolid\nmore\n"), &["line 10", "`more`"]),
    ];
    for (text, wanted) in cases {
        assert_refused(Format::Stl, text.as_bytes(), wanted);
    }
    let mut binary = vec![0; 84 + 50];
    binary[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_refused(
        Format::Stl,
        &binary,
        &["byte 80", "4294967295 triangles need 214748364834 bytes, the file has 134"],
    );
    binary[80..84].copy_from_slice(&1_u32.to_le_bytes());
    assert_refused(Format::Stl, &binary[..133], &["1 triangles need 134 bytes, the file has 133"]);
    binary[96..100].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert_refused(Format::Stl, &binary, &["byte 84", "triangle 0", "not finite"]);
}

const SOUND: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],"buffers":[{"byteLength":44}]}"#;

fn triangle() -> Vec<u8> {
    let mut binary: Vec<u8> =
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|c| c.to_le_bytes()).collect();
    binary.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    binary
}

#[test]
fn glb_containers() {
    let sound = glb(SOUND, &triangle());
    assert_eq!(read(Format::Glb, &sound).unwrap().triangles, [[0, 1, 2]]);
    let with = |at: usize, bytes: &[u8]| {
        let mut file = sound.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    let cases: &[(Vec<u8>, &[&str])] = &[
        (vec![], &["byte 0", "the magic"]),
        (b"{\"asset\":{}}".to_vec(), &["byte 0", "starts with `glTF`"]),
        (with(4, &[1]), &["byte 4", "version 1"]),
        (with(8, &[255; 4]), &["byte 8", "4294967295 bytes"]),
        (with(8, &[3, 0, 0, 0]), &["byte 8"]),
        (with(12, &[255, 255, 255, 127]), &["a chunk", "bytes needed"]),
        (with(16, b"BIN\0"), &["byte 12", "out of order"]),
        (with(16, b"ABCD"), &["out of order"]),
        (sound[..12].to_vec(), &["byte 8"]),
        (glb("{", &[]), &["JSON chunk"]),
        (glb("[]", &[]), &["JSON chunk"]),
        (glb(&"[".repeat(1000), &[]), &["JSON chunk"]),
        (
            glb(&format!("{{\"asset\":{{\"version\":\"2.0\"}}{}}}", " ".repeat(5 << 20)), &[]),
            &["more than 4194304"],
        ),
    ];
    for (file, wanted) in cases {
        assert_refused(Format::Glb, file, wanted);
    }
}

#[test]
fn glb_descriptions() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("\"version\":\"2.0\"", "\"version\":\"1.0\"", &["asset", "version"]),
        ("\"scene\":0", "\"scene\":4", &["scene 4", "none of this number"]),
        ("\"nodes\":[0]", "\"nodes\":[7]", &["node 7", "none of this number"]),
        ("[{\"mesh\":0}]", "[{\"mesh\":5}]", &["mesh 5"]),
        ("[{\"mesh\":0}]", "[{\"mesh\":0,\"children\":[0]}]", &["node 0", "under itself"]),
        ("[{\"mesh\":0}]", "[{\"mesh\":0,\"children\":[1,1]},{}]", &["node 1", "under two nodes"]),
        ("[{\"mesh\":0}]", "[{\"mesh\":-1}]", &["JSON chunk"]),
        ("[{\"mesh\":0}]", "[{\"mesh\":0,\"rotation\":[0,0,0,0]}]", &["vertex 0", "not finite"]),
        ("[{\"mesh\":0}]", "[{\"mesh\":0,\"scale\":[1e308,1,1]},{}]", &["vertex 0", "not finite"]),
        ("[{\"mesh\":0}]", "[{\"mesh\":0,\"matrix\":[1,2,3]}]", &["JSON chunk"]),
        ("\"POSITION\":0", "\"POSITION\":9", &["accessor 9"]),
        ("\"indices\":1", "\"indices\":0", &["accessor 0", "SCALAR of 8, 16 or 32 bits"]),
        ("\"indices\":1", "\"indices\":1,\"mode\":7", &["mesh 0, primitive 0", "mode 7"]),
        ("5126", "5123", &["accessor 0", "VEC3 of floats"]),
        ("VEC3", "VEC2", &["accessor 0", "VEC3 of floats"]),
        ("\"count\":3,\"type\":\"SC", "\"count\":2,\"type\":\"SC", &["no multiple of 3"]),
        ("\"count\":3,\"type\":\"SC", "\"count\":4,\"type\":\"SC", &["accessor 1", "4 entries"]),
        (
            "\"count\":3,\"type\":\"VE",
            "\"count\":4000000000,\"type\":\"VE",
            &["accessor 0", "4000000000 entries"],
        ),
        ("\"count\":3,\"type\":\"VE", "\"count\":0,\"type\":\"VE", &["accessor 0", "0 entries"]),
        (
            "\"count\":3,\"type\":\"VE",
            "\"count\":2,\"type\":\"VE",
            &["accessor 1", "entry 2", "index 2 names no vertex of 2"],
        ),
        ("{\"bufferView\":0,", "{", &["accessor 0", "no bufferView"]),
        ("{\"bufferView\":0,", "{\"sparse\":{},\"bufferView\":0,", &["accessor 0", "sparse"]),
        ("{\"bufferView\":0,", "{\"bufferView\":8,", &["bufferView 8"]),
        (
            "{\"bufferView\":0,",
            "{\"bufferView\":0,\"byteOffset\":18446744073709551615,",
            &["accessor 0", "leave it"],
        ),
        ("\"byteLength\":36", "\"byteLength\":36,\"byteStride\":4", &["accessor 0", "4 apart"]),
        ("\"byteLength\":36", "\"byteLength\":3600", &["leave it or the binary chunk"]),
        ("[{\"byteLength\":44}]", "[{\"byteLength\":44,\"uri\":\"a.bin\"}]", &["outside the file"]),
        ("[{\"byteLength\":44}]", "[]", &["buffer 0"]),
        (
            "\"scene\":0,",
            "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],",
            &["KHR_draco_mesh_compression"],
        ),
    ];
    for (old, new, wanted) in cases {
        assert!(SOUND.contains(old), "{old}");
        assert_refused(Format::Glb, &glb(&SOUND.replacen(old, new, 1), &triangle()), wanted);
    }
    let nan = [&f32::NAN.to_le_bytes()[..], &triangle()[4..]].concat();
    assert_refused(Format::Glb, &glb(SOUND, &nan), &["accessor 0", "vertex 0", "not finite"]);
}

const SURFACE: &str = r#"<VTKFile type="PolyData" byte_order="LittleEndian"><PolyData><FieldData><Array type="String" Name="SPACE" format="ascii">82 65 83 0</Array></FieldData><Piece NumberOfPoints="3" NumberOfPolys="1"><PointData></PointData><Points><DataArray type="Float32" Name="Points" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0</DataArray></Points><Polys><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2</DataArray><DataArray type="Int32" Name="offsets" format="ascii">3</DataArray></Polys></Piece></PolyData></VTKFile>"#;

#[test]
fn vtp() {
    assert_eq!(read(Format::Vtp, SURFACE.as_bytes()).unwrap().triangles, [[0, 1, 2]]);
    let cases: &[(&str, &str, &[&str])] = &[
        ("\"PolyData\"", "\"ImageData\"", &["VTKFile", "`ImageData`", "PolyData"]),
        (" type=\"PolyData\"", "", &["VTKFile", "no type"]),
        ("\"LittleEndian\"", "\"MiddleEndian\"", &["MiddleEndian"]),
        (" byte_order", " header_type=\"UInt8\" byte_order", &["header type `UInt8`"]),
        (" byte_order", " compressor=\"vtkLZ4DataCompressor\" byte_order", &["vtkLZ4DataCompressor"]),
        (" byte_order", " byte_order=", &["VTKFile"]),
        ("82 65 83 0", "88 65 83 0", &["field SPACE", "`XAS`"]),
        ("NumberOfPoints=\"3\"", "NumberOfPoints=\"three\"", &["NumberOfPoints", "`three`"]),
        ("NumberOfPoints=\"3\"", "NumberOfPoints=\"4\"", &["\"Points\"", "9 numbers instead of 12"]),
        ("NumberOfPoints=\"3\"", "NumberOfPoints=\"2\"", &["\"Points\"", "more than 6 numbers"]),
        ("NumberOfPoints=\"3\"", "NumberOfPoints=\"18446744073709551615\"", &["NumberOfPoints"]),
        ("NumberOfPolys=\"1\"", "NumberOfPolys=\"2\"", &["\"offsets\"", "1 numbers instead of 2"]),
        ("\"3\" format", "\"2\" format", &["2 components"]),
        ("Float32", "Complex", &["\"Points\"", "type isn't a number's"]),
        (
            "type=\"Int32\" Name=\"conn",
            "type=\"Float32\" Name=\"conn",
            &["\"connectivity\"", "isn't an integer's"],
        ),
        ("0 0 0 1 0 0 0 1 0", "0 0 0 1 0 0 0 nan 0", &["\"Points\"", "number 7", "not finite"]),
        ("0 0 0 1 0 0 0 1 0", "0 0 0 1 0 0 0 one 0", &["\"Points\", line 1", "`one`"]),
        ("0 1 2", "0 1 3", &["piece 0, polygon 0", "index 3 names no vertex of 3"]),
        ("0 1 2", "0 1 -1", &["polygon 0", "index -1"]),
        ("0 1 2", "0 1", &["\"connectivity\"", "2 numbers instead of 3"]),
        (">3<", ">2<", &["polygon 0", "less than 3"]),
        (">3<", ">-3<", &["polygon 0", "less than 3"]),
        (">3<", ">9000000000000<", &["\"connectivity\"", "3 numbers instead of 9000000000000"]),
        ("Name=\"offsets\"", "Name=\"starts\"", &["piece 0", "no DataArray offsets in Polys"]),
        ("<Points>", "<Pints>", &["XML"]),
        ("format=\"ascii\">0 0", "format=\"binary\">0 0", &["\"Points\"", "base64"]),
        ("format=\"ascii\">0 0", "format=\"binary\">AAAA", &["\"Points\"", "data"]),
        ("format=\"ascii\">0 0", "format=\"octal\">0 0", &["\"Points\"", "format `octal`"]),
        ("format=\"ascii\">0 0", "format=\"appended\">0 0", &["\"Points\"", "no offset"]),
        ("format=\"ascii\">0 0", "format=\"appended\" offset=\"0\">0 0", &["AppendedData is missing"]),
    ];
    for (old, new, wanted) in cases {
        assert!(SURFACE.contains(old), "{old}");
        assert_refused(Format::Vtp, SURFACE.replacen(old, new, 1).as_bytes(), wanted);
    }
    assert_refused(Format::Vtp, b"", &["VTKFile", "missing"]);
    assert_refused(Format::Vtp, b"just text", &["VTKFile", "missing"]);
    let deep = "<VTKFile type=\"PolyData\">".to_owned() + &"<a>".repeat(100);
    assert_refused(Format::Vtp, deep.as_bytes(), &["more than 64 deep"]);
    let many = "<VTKFile type=\"PolyData\">".to_owned() + &"<Piece/>".repeat(5000);
    assert_refused(Format::Vtp, many.as_bytes(), &["more than 4096 arrays and pieces"]);
}

#[test]
fn vtp_appended() {
    let with = |offset: &str, tail: &str| {
        let old = "format=\"ascii\">0 0 0 1 0 0 0 1 0</DataArray>";
        assert!(SURFACE.contains(old));
        let array = format!("format=\"appended\" offset=\"{offset}\"/>");
        SURFACE.replacen(old, &array, 1).replace("</VTKFile>", tail).into_bytes()
    };
    let cases: &[(Vec<u8>, &[&str])] = &[
        (with("0", "<AppendedData encoding=\"raw\">_"), &["\"Points\"", "end too early"]),
        (with("0", "<AppendedData encoding=\"raw\">x"), &["AppendedData", "begin with `_`"]),
        (with("0", "<AppendedData encoding=\"rot13\">_"), &["neither `raw` nor `base64`"]),
        (with("0", "<AppendedData encoding=\"raw\""), &["its tag doesn't end"]),
        (with("99", "<AppendedData encoding=\"raw\">_abc"), &["\"Points\"", "offset 99 of 3"]),
        (with("-1", "<AppendedData encoding=\"raw\">_abc"), &["offset", "`-1`"]),
        (with("0", "<AppendedData encoding=\"raw\">_\u{24}\0\0\0abc"), &["\"Points\"", "end too early"]),
        (with("0", "<AppendedData encoding=\"raw\">_\u{25}\0\0\0abc"), &["37 bytes, no multiple of 4"]),
        (with("0", "<AppendedData encoding=\"raw\">_\u{20}\0\0\0abc"), &["8 numbers instead of 9"]),
        (with("0", "<AppendedData encoding=\"base64\">_A#AA"), &["\"Points\"", "base64"]),
    ];
    for (file, wanted) in cases {
        assert_refused(Format::Vtp, file, wanted);
    }
    // Zlib: a table of billions of blocks, blocks that aren't zlib, sizes that wrap.
    let zlib = |table: &[u32], tail: &[u8]| {
        let mut file = with("0", "<AppendedData encoding=\"raw\">_");
        let text = String::from_utf8(file).unwrap();
        file = text.replace(" byte_order", " compressor=\"vtkZLibDataCompressor\" byte_order").into_bytes();
        file.extend(table.iter().flat_map(|n| n.to_le_bytes()));
        file.extend(tail);
        file
    };
    assert_refused(Format::Vtp, &zlib(&[u32::MAX, 36, 0], &[]), &["a table of 4294967295 blocks"]);
    assert_refused(Format::Vtp, &zlib(&[1, 36, 0, 8], b"no zlib."), &["\"Points\"", "zlib"]);
    assert_refused(Format::Vtp, &zlib(&[1, 36, 0, u32::MAX], b"no zlib."), &["\"Points\"", "end too early"]);
    assert_refused(Format::Vtp, &zlib(&[1, 1, 37, 8], b"no zlib."), &["1 blocks of 1 bytes, the last of 37"]);
    assert_refused(Format::Vtp, &zlib(&[1, u32::MAX, 0, 8], b"no zlib."), &["\"Points\""]);
}

/// Files that say little and would make much.
#[test]
fn bombs_are_refused_before_they_take_memory() {
    // A mesh shown by very many nodes.
    let nodes: Vec<String> = (0..60_000).map(|_| "{\"mesh\":0}".to_owned()).collect();
    let all: Vec<String> = (0..60_000).map(|i: u32| i.to_string()).collect();
    let vertices = 3 * 1000;
    let json = SOUND
        .replace("[{\"mesh\":0}]", &format!("[{}]", nodes.join(",")))
        .replace("\"nodes\":[0]", &format!("\"nodes\":[{}]", all.join(",")))
        .replace("\"count\":3,\"type\":\"VE", &format!("\"count\":{vertices},\"type\":\"VE"))
        .replace(",\"indices\":1", "")
        .replace("\"byteLength\":36", &format!("\"byteLength\":{}", 12 * vertices));
    assert_refused(Format::Glb, &glb(&json, &vec![0; 12 * vertices]), &["size", "64 MiB and four times"]);
    // Primitives beyond counting.
    let primitives = vec!["{\"attributes\":{}}"; 60_000].join(",");
    let json = SOUND
        .replace("{\"attributes\":{\"POSITION\":0},\"indices\":1}", &primitives)
        .replace("[{\"mesh\":0}]", "[{\"mesh\":0,\"children\":[1]},{\"mesh\":0}]");
    assert_refused(Format::Glb, &glb(&json, &triangle()), &["more than 65536 primitives"]);
    let json = SOUND.replace("[{\"mesh\":0}]", &format!("[{}]", vec!["{}"; 70_000].join(",")));
    assert_refused(Format::Glb, &glb(&json, &triangle()), &["JSON chunk", "65537"]);
    // One polygon of very many corners on 8-bit indices: twelve bytes for each.
    let mut file = b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar y\nproperty uchar z\nelement face 1\nproperty list uint uchar vertex_indices\nend_header\n\0\0\0".to_vec();
    let corners = 12_u32 << 20;
    file.extend(corners.to_le_bytes());
    file.resize(file.len() + corners as usize, 0);
    assert_refused(Format::Ply, &file, &["triangles would need", "64 MiB and four times"]);
    // Half a gigabyte of zeros in a few hundred kilobytes.
    let points = 20_u64 << 20;
    let block = vec![0_u8; 12 << 20];
    let packed = {
        use std::io::Write;
        let mut z = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        z.write_all(&block).unwrap();
        z.finish().unwrap()
    };
    let blocks = 12 * points as usize / block.len();
    let mut file = format!("<VTKFile type=\"PolyData\" compressor=\"vtkZLibDataCompressor\"><PolyData><Piece NumberOfPoints=\"{points}\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/></Points></Piece></PolyData><AppendedData encoding=\"raw\">_").into_bytes();
    file.extend([blocks as u32, block.len() as u32, 0].iter().flat_map(|n| n.to_le_bytes()));
    file.extend((0..blocks).flat_map(|_| (packed.len() as u32).to_le_bytes()));
    file.extend(packed.repeat(blocks));
    assert_refused(Format::Vtp, &file, &["positions would need", "64 MiB and four times"]);
}
