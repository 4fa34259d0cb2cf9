use super::*;
use ivd_core::{ElementKey, Frame, Grid, LatticeSource};

const FAR: f64 = 1_234_567.0;

/// A tetrahedron on an oblique grid far from 0, with places that f32 arithmetic would round.
fn tetrahedron() -> Lattice {
    let (s, c) = 0.3_f64.sin_cos();
    let grid =
        Grid::new([4; 3], [0.1, 0.2, 3.0], [FAR, -2.0, 0.5], [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]);
    let grid = grid.unwrap();
    let key = |padded, element| ElementKey::new(grid.dims(), padded, element);
    Lattice::new(
        grid.clone(),
        vec![key([0, 1, 1], 0), key([2, 1, 1], 1), key([1, 2, 1], 2), key([1, 1, 2], 6)].into(),
        vec![[0.3, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.0, 0.1], [0.2, 0.4, 0.6]].into(),
        vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].into(),
    )
    .unwrap()
    .with_source(LatticeSource::Iso(1.5))
}

fn written(ending: &str, lattice: &Lattice) -> (Written, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("mesh.{ending}"));
    let written = write(&path, lattice, None).unwrap();
    (written, std::fs::read(path).unwrap())
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(u32_at(bytes, at))
}

#[test]
fn ply_holds_exact_positions_addresses_and_triangles() {
    let lattice = tetrahedron();
    let (written, bytes) = written("ply", &lattice);
    assert_eq!(written, Written { touched: true, rounding_mm: 0.0 });
    let end = b"end_header\n";
    let body = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let vertices = &bytes[body..];
    for (i, key) in lattice.keys().iter().enumerate() {
        let at = i * 37;
        let position = lattice.world(i).0;
        assert!((0..3).all(|a| f64_at(vertices, at + 8 * a) == position[a]), "vertex {i}");
        let voxel: [i64; 3] = std::array::from_fn(|a| i64::from(u32_at(vertices, at + 24 + 4 * a) as i32));
        assert_eq!((voxel, vertices[at + 36]), (key.voxel([4; 3]), key.element()));
    }
    let faces = &vertices[4 * 37..];
    assert_eq!(faces.len(), 4 * 13);
    for (t, triangle) in lattice.triangles().iter().enumerate() {
        let read: [u32; 3] = std::array::from_fn(|i| u32_at(faces, t * 13 + 1 + 4 * i));
        assert_eq!((faces[t * 13], read), (3, *triangle));
    }
}

#[test]
fn obj_gives_the_same_f64_back() {
    let lattice = tetrahedron();
    let (_, bytes) = written("OBJ", &lattice);
    let text = String::from_utf8(bytes).unwrap();
    let read: Vec<Vec<f64>> = text
        .lines()
        .filter_map(|l| l.strip_prefix("v "))
        .map(|l| l.split(' ').map(|n| n.parse().unwrap()).collect())
        .collect();
    for (i, p) in read.iter().enumerate() {
        assert_eq!(p.as_slice(), lattice.world(i).0.as_slice());
    }
    assert!(text.ends_with("f 2 3 4\n") && read.len() == 4);
}

#[test]
fn stl_says_what_f32_rounds_away_far_from_the_origin() {
    let (written, bytes) = written("stl", &tetrahedron());
    assert_eq!((bytes.len(), u32_at(&bytes, 80)), (84 + 4 * 50, 4));
    assert!(written.rounding_mm > 1e-3 && written.rounding_mm < 0.07, "{}", written.rounding_mm);
    assert!(!bytes.starts_with(b"solid"), "readers would take it for text");
}

#[test]
fn glb_keeps_differences_far_from_the_origin_and_turns_to_metres_with_y_up() {
    let lattice = tetrahedron();
    let (written, bytes) = written("glb", &lattice);
    assert!(written.rounding_mm < 1e-6);
    assert_eq!((&bytes[..4], u32_at(&bytes, 4), u32_at(&bytes, 8)), (&b"glTF"[..], 2, bytes.len() as u32));
    let text = u32_at(&bytes, 12) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + text]).unwrap();
    let offset: Vec<f64> = serde_json::from_value(json["nodes"][1]["translation"].clone()).unwrap();
    let matrix: Vec<f64> = serde_json::from_value(json["nodes"][0]["matrix"].clone()).unwrap();
    let binary = &bytes[20 + text + 8..];
    assert_eq!(binary.len() as u64, json["buffers"][0]["byteLength"].as_u64().unwrap());
    for i in 0..4 {
        let mm: [f64; 3] = std::array::from_fn(|a| offset[a] + f64::from(f32_at(binary, 12 * i + 4 * a)));
        let world = lattice.world(i).0;
        assert!((Vector3::from(mm) - world).norm() < 1e-6);
        let metres: [f64; 3] = std::array::from_fn(|r| (0..3).map(|c| matrix[4 * c + r] * mm[c]).sum());
        let expected = [-world.x / 1e3, world.z / 1e3, world.y / 1e3];
        assert!((Vector3::from(metres) - Vector3::from(expected)).norm() < 1e-8);
    }
    let lo: Vec<f32> = serde_json::from_value(json["accessors"][0]["min"].clone()).unwrap();
    let least = (0..4).map(|i| f32_at(binary, 12 * i)).fold(f32::INFINITY, f32::min);
    assert_eq!(lo[0], least);
}

#[test]
fn vtp_holds_exact_positions_in_lps_addresses_and_triangles() {
    let lattice = tetrahedron();
    let (written, bytes) = written("vtp", &lattice);
    assert_eq!(written.rounding_mm, 0.0);
    let mark = b"<AppendedData encoding=\"raw\">\n   _";
    let body = bytes.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len();
    let head = std::str::from_utf8(&bytes[..body]).unwrap();
    assert!(head.contains("NumberOfPoints=\"4\"") && head.contains("NumberOfPolys=\"4\""));
    // Where the head says that an array begins, and its bytes.
    let array = |name: &str| {
        let line = head.lines().find(|l| l.contains(&format!("Name=\"{name}\""))).unwrap();
        let offset = line.split("offset=\"").nth(1).unwrap().split('"').next().unwrap();
        let at = body + offset.parse::<usize>().unwrap();
        let length = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        &bytes[at + 8..at + 8 + length]
    };
    let (points, voxels, elements) = (array("Points"), array("voxel"), array("element"));
    assert_eq!((points.len(), voxels.len(), elements.len()), (96, 48, 4));
    for (i, key) in lattice.keys().iter().enumerate() {
        let [x, y, z] = lattice.world(i).0.into();
        let found: [f64; 3] = std::array::from_fn(|a| f64_at(points, 24 * i + 8 * a));
        assert_eq!(found, [-x, -y, z], "vertex {i}");
        let voxel: [i64; 3] = std::array::from_fn(|a| i64::from(u32_at(voxels, 12 * i + 4 * a) as i32));
        assert_eq!((voxel, elements[i]), (key.voxel([4; 3]), key.element()));
    }
    let numbers = |bytes: &[u8]| -> Vec<i64> {
        bytes.chunks(8).map(|c| i64::from_le_bytes(c.try_into().unwrap())).collect()
    };
    let corners: Vec<i64> = lattice.triangles().iter().flatten().map(|&v| i64::from(v)).collect();
    assert_eq!(numbers(array("connectivity")), corners);
    assert_eq!(numbers(array("offsets")), [3, 6, 9, 12]);
}

#[test]
fn a_file_whose_bytes_would_not_change_keeps_its_time() {
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join("mesh").with_extension(format.ending());
        assert!(write(&path, &tetrahedron(), None).unwrap().touched);
        let time = std::fs::metadata(&path).unwrap().modified().unwrap();
        assert!(!write(&path, &tetrahedron(), None).unwrap().touched, "{format:?}");
        assert_eq!(std::fs::metadata(&path).unwrap().modified().unwrap(), time);
        let mut moved = vec![[0.0; 3]; 4];
        moved[2][1] = 1e-3;
        assert!(write_deformed(&path, &tetrahedron(), &moved, None).unwrap().touched, "{format:?}");
    }
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        Format::ALL.len(),
        "no temporary file is left"
    );
}

#[test]
fn no_displacement_writes_the_bytes_of_the_lattice_at_rest() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.ply");
    write(&path, &tetrahedron(), None).unwrap();
    assert!(!write_deformed(&path, &tetrahedron(), &[[0.0; 3]; 4], None).unwrap().touched);
}

#[test]
fn what_cannot_be_written_is_named() {
    let lattice = tetrahedron();
    let folder = tempfile::tempdir().unwrap();
    for name in ["mesh", "mesh.vtk"] {
        assert!(matches!(write(&folder.path().join(name), &lattice, None), Err(Error::Format { .. })));
    }
    let nowhere = folder.path().join("missing/mesh.ply");
    assert!(matches!(write(&nowhere, &lattice, None), Err(Error::File(FileError::Io { .. }))));
    let path = folder.path().join("mesh.ply");
    assert!(write_deformed(&path, &lattice, &[[0.0; 3]; 3], None).is_err());
    assert!(write_deformed(&path, &lattice, &[[f64::NAN; 3]; 4], None).is_err());
    assert!(!path.exists());
}

#[test]
fn an_empty_lattice_is_a_valid_file_in_every_format() {
    let lattice = tetrahedron().subset(&[], vec![]).unwrap();
    for format in Format::ALL {
        let (_, bytes) = written(format.ending(), &lattice);
        assert!(!bytes.is_empty());
    }
}

/// The tetrahedron in two frames.
fn motion(lattice: &Lattice) -> ivd_core::Motion {
    let frame = |time: f64, by: f64| {
        let displacement = (0..4).map(|v| [by, 0.5 * by * f64::from(v), -0.1]).collect();
        Frame { time, displacement }
    };
    ivd_core::Motion::new(lattice.grid().clone(), 4, vec![frame(0.1, 1.0), frame(0.4, -2.5)]).unwrap()
}

#[test]
fn glb_holds_a_morph_target_for_every_frame_and_an_animation_through_them() {
    let (lattice, folder) = (tetrahedron(), tempfile::tempdir().unwrap());
    let motion = motion(&lattice);
    let path = folder.path().join("m.glb");
    assert!(write_motion(&path, &lattice, &motion, None).unwrap().touched);
    assert!(!write_motion(&path, &lattice, &motion, None).unwrap().touched);
    let bytes = std::fs::read(&path).unwrap();
    let text = u32_at(&bytes, 12) as usize;
    let description: serde_json::Value = serde_json::from_slice(&bytes[20..20 + text]).unwrap();
    let binary = &bytes[28 + text..];
    assert_eq!(binary.len() as u64, description["buffers"][0]["byteLength"].as_u64().unwrap());
    let floats = |accessor: &serde_json::Value, width: usize| -> Vec<f32> {
        let accessor = &description["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &description["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let [at, len] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
        assert_eq!(len, 4 * width * accessor["count"].as_u64().unwrap() as usize);
        (0..len / 4).map(|i| f32_at(binary, at + 4 * i)).collect()
    };
    let shape = &description["meshes"][0];
    let targets = shape["primitives"][0]["targets"].as_array().unwrap();
    assert_eq!((targets.len(), shape["weights"].as_array().unwrap().len()), (2, 2));
    for (target, frame) in targets.iter().zip(motion.frames()) {
        let expected: Vec<f32> = frame.displacement.iter().flatten().map(|&c| c as f32).collect();
        assert_eq!(floats(&target["POSITION"], 3), expected);
    }
    let sampler = &description["animations"][0]["samplers"][0];
    assert_eq!(floats(&sampler["input"], 1), [0.0, 0.1, 0.4]);
    assert_eq!(floats(&sampler["output"], 1), [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let target = &description["animations"][0]["channels"][0]["target"];
    assert_eq!((target["node"].as_u64(), target["path"].as_str()), (Some(1), Some("weights")));
    // What reads meshes sees the lattice at rest.
    assert_eq!(read(&path, u64::MAX).unwrap().triangles, lattice.triangles());
}

#[test]
fn a_series_has_a_file_for_rest_and_for_every_frame_with_their_times() {
    let (lattice, folder) = (tetrahedron(), tempfile::tempdir().unwrap());
    let motion = motion(&lattice);
    let path = folder.path().join("a & b.pvd");
    assert!(write_motion(&path, &lattice, &motion, None).unwrap().touched);
    assert!(!write_motion(&path, &lattice, &motion, None).unwrap().touched);
    let text = std::fs::read_to_string(&path).unwrap();
    for (i, time) in ["0", "0.1", "0.4"].iter().enumerate() {
        let entry = format!("timestep=\"{time}\" part=\"0\" file=\"a &amp; b_000{i}.vtp\"");
        assert!(text.contains(&entry), "{text}");
        let frame = read(&folder.path().join(format!("a & b_000{i}.vtp")), u64::MAX).unwrap();
        for (v, position) in frame.positions.iter().enumerate() {
            let moved = i.checked_sub(1).map_or([0.0; 3], |i| motion.frames()[i].displacement[v]);
            assert_eq!(*position, lattice.world(v).0 + Vector3::from(moved), "frame {i}, vertex {v}");
        }
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
}

#[test]
fn other_formats_have_the_last_frame_and_a_motion_of_another_lattice_is_refused() {
    let (lattice, folder) = (tetrahedron(), tempfile::tempdir().unwrap());
    let motion = motion(&lattice);
    let path = folder.path().join("m.ply");
    write_motion(&path, &lattice, &motion, None).unwrap();
    let last = Vector3::from(motion.frames()[1].displacement[3]);
    assert_eq!(read(&path, u64::MAX).unwrap().positions[3], lattice.world(3).0 + last);
    // Times that don't grow are a second apart.
    let mut frames = motion.frames().to_vec();
    frames[0].time = 0.0;
    assert_eq!(super::placed::times(&frames), [0.0, 1.0, 2.0]);
    let frame = Frame { time: 0.0, displacement: vec![[0.0; 3]; 5].into() };
    let other = ivd_core::Motion::new(lattice.grid().clone(), 5, vec![frame]).unwrap();
    let error = write_motion(&path, &lattice, &other, None).unwrap_err().to_string();
    assert!(error.contains("moves 5 vertices"), "{error}");
}

/// The corners of every triangle as they are read.
fn corners(format: Format, bytes: &[u8]) -> Vec<[f64; 3]> {
    let mesh = read_bytes(format, bytes, u64::MAX).unwrap();
    mesh.triangles.iter().flatten().map(|&v| mesh.positions[v as usize].into()).collect()
}

/// The same file saying RAS whatever it is in: its numbers are then read as they stand.
fn said_to_be_ras(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (from, to) in [("SPACE=LPS", "SPACE=RAS"), (">76 80 83 0<", ">82 65 83 0<")] {
        if let Some(at) = bytes.windows(from.len()).position(|w| w == from.as_bytes()) {
            bytes[at..at + from.len()].copy_from_slice(to.as_bytes());
        }
    }
    bytes
}

#[test]
fn files_say_their_space_as_3d_slicer_reads_it_and_lie_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let lattice = tetrahedron();
    let rest: Vec<[f64; 3]> =
        lattice.triangles().iter().flatten().map(|&v| lattice.world(v as usize).0.into()).collect();
    for format in [Format::Ply, Format::Obj, Format::Stl, Format::Vtp] {
        for space in [None, Some(Space::Ras), Some(Space::Lps)] {
            let path = folder.path().join(format!("mesh.{}", format.ending()));
            write(&path, &lattice, space).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            let own = if format == Format::Vtp { Space::Lps } else { Space::Ras };
            let (is, case) = (space.unwrap_or(own), format!("{format:?} {space:?}"));
            let says = |text: &str| bytes.windows(text.len()).any(|w| w == text.as_bytes());
            if format == Format::Vtp {
                let codes = is.name().bytes().map(|c| c.to_string()).collect::<Vec<_>>().join(" ");
                assert!(
                    says(&format!("Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">{codes} 0<")),
                    "{case}"
                );
                assert!(says("Name=\"UNIT\" NumberOfTuples=\"1\" format=\"ascii\">109 109 0<"), "{case}");
            } else {
                assert!(says(&format!("SPACE={}", is.name())) && says("positions in mm"), "{case}");
                let other = if is == Space::Ras { "SPACE=LPS" } else { "SPACE=RAS" };
                assert!(!says(other) && !bytes[..5].eq_ignore_ascii_case(b"solid"), "{case}");
            }
            let near = |a: &[[f64; 3]], b: &[[f64; 3]]| {
                let limit = if format == Format::Stl { 0.1 } else { 0.0 };
                let pairs = a.iter().flatten().zip(b.iter().flatten());
                a.len() == b.len() && pairs.into_iter().all(|(a, b)| (a - b).abs() <= limit)
            };
            assert!(near(&corners(format, &bytes), &rest), "{case}: read back in RAS");
            let negated = |[x, y, z]: [f64; 3]| if is == Space::Lps { [-x, -y, z] } else { [x, y, z] };
            let stand: Vec<[f64; 3]> = rest.iter().copied().map(negated).collect();
            assert!(near(&corners(format, &said_to_be_ras(&bytes)), &stand), "{case}: as the numbers stand");
        }
    }
}

#[test]
fn the_normals_of_an_stl_are_those_of_its_own_axes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.stl");
    let mut normals = Vec::new();
    for space in [Space::Ras, Space::Lps] {
        write(&path, &tetrahedron(), Some(space)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let normal = |t: usize| [0, 4, 8].map(|a| f64::from(f32_at(&bytes, 84 + 50 * t + a)));
        normals.push((0..4).map(normal).collect::<Vec<_>>());
    }
    for (ras, lps) in normals[0].iter().zip(&normals[1]) {
        assert!((0..3).all(|a| (Space::Lps.turn(*ras)[a] - lps[a]).abs() < 1e-6), "{ras:?} {lps:?}");
    }
}

#[test]
fn a_glb_has_its_own_axes_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.glb");
    for space in [Space::Ras, Space::Lps] {
        let error = write(&path, &tetrahedron(), Some(space)).unwrap_err();
        assert_eq!(ivd_core::Classified::error_class(&error), ivd_core::ErrorClass::Usage);
        assert!(error.to_string().contains("metres with y up; leave the space out"), "{error}");
        assert!(!path.exists());
    }
}
