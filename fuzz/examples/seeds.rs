//! Writes the seeds: `cargo run --example seeds`, from the folder `fuzz`.
//!
//! Small files that every reader takes, so that the fuzzer begins behind the first checks.

use std::fs;
use std::path::{Path, PathBuf};

use ivd_artefact::{Kind, KindCode, peek};
use ivd_core::{Exec, Grid, Volume, Voxels};
use ivd_frames::Log;
use ivd_fuzz::artefacts::{Section, Wanted};
use ivd_io::mesh::{self, Format};
use ivd_lattice::extract::{ExtractParams, Iso, extract};

type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR"));
    volumes(&fuzz.join("seeds"))?;
    dicom(&fuzz.join("seeds/dicom"))?;
    artefacts(&fuzz.join("seeds/artefact"), &fuzz.join("../fixtures/artefacts"))?;
    scenes(&fuzz.join("seeds/scene"), &fuzz.join("../fixtures/scenes"))?;
    words(&fuzz.join("seeds"))?;
    windows(&fuzz.join("seeds"))?;
    meshes(&fuzz.join("seeds/mesh"))?;
    noise(&fuzz.join("seeds"))
}

fn put(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> Outcome {
    fs::create_dir_all(folder)?;
    assert!(bytes.as_ref().len() < 4096, "{name} is no small seed");
    Ok(fs::write(folder.join(name), bytes)?)
}

/// Volumes as our own writers write them, and headers that they never write.
fn volumes(seeds: &Path) -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let grid = Grid::new(
        [4, 3, 2],
        [0.5, 0.7, 2.0],
        [1.0, -2.0, 3.0],
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    )?;
    let values: Vec<i16> = (0..24).map(|i| i * 31 - 200).collect();
    let short = Volume::new(grid.clone(), Voxels::from(values))?;
    let reals: Vec<f32> = (0..24).map(|i| if i == 7 { f32::NAN } else { i as f32 * 0.25 }).collect();
    let real = Volume::with_scale(grid.clone(), Voxels::from(reals), 0.5, 3.0)?;
    let bytes = Volume::new(grid, Voxels::from((0..24).collect::<Vec<u8>>()))?;
    let exec = Exec::default();
    for (target, ending) in [
        ("nifti", "nii"),
        ("nifti", "nii.gz"),
        ("nrrd", "nrrd"),
        ("nrrd", "nhdr"),
        ("metaimage", "mha"),
        ("metaimage", "mhd"),
        ("vti", "vti"),
        ("tiff", "tif"),
    ] {
        for (name, volume) in [("i16", &short), ("f32", &real), ("u8", &bytes)] {
            let file = format!("{name}.{ending}");
            if ivd_io::volume::write(&at(&file), volume, &exec).is_ok() {
                let written = fs::read(at(&file))?;
                // The fuzz target keeps its data in x.raw.
                let text = String::from_utf8_lossy(&written).replace(&format!("{name}.raw"), "x.raw");
                let detached = ending.ends_with("hd") || ending.ends_with("hdr");
                put(&seeds.join(target), &file, if detached { text.into_bytes() } else { written })?;
            }
        }
    }
    let nrrd = |name: &str, fields: &str, data: &str| {
        let header = "NRRD0005\n# c\ntype: uchar\ndimension: 3\nsizes: 2 2 2";
        put(&seeds.join("nrrd"), name, format!("{header}\n{fields}\n\n{data}"))
    };
    nrrd("ascii", "encoding: ascii", "1 2 3 4 5 6 7 8")?;
    nrrd("hex", "encoding: hex", "0102030405060708")?;
    nrrd("list", "encoding: raw\ndata file: LIST 2\nx.raw\nx.raw", "")?;
    nrrd("pattern", "encoding: raw\ndata file: x%d.raw 1 2 1 2", "")?;
    nrrd(
        "spacings",
        "encoding: raw\nspacings: 1 2 nan\naxis mins: 0 0 0\nline skip: 0\nbyte skip: -1\nkey:=value",
        "abcdefgh",
    )?;
    nrrd(
        "colours",
        "encoding: raw\nkinds: RGB-color domain domain\nspace: left-posterior-superior\nspace origin: (0,0,0)\nspace directions: none (1,0,0) (0,1,0)\nendian: big",
        "abcdefgh",
    )?;
    let mha = |fields: &str| {
        format!(
            "ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\n{fields}\nElementType = MET_UCHAR\nElementDataFile = LOCAL\nabcdefgh"
        )
    };
    put(&seeds.join("metaimage"), "ascii", mha("BinaryData = False\nElementSpacing = 1 1 2"))?;
    put(
        &seeds.join("metaimage"),
        "frame",
        mha(
            "BinaryData = True\nBinaryDataByteOrderMSB = True\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\nAnatomicalOrientation = RAI\nHeaderSize = -1\nCompressedData = False",
        ),
    )?;
    put(
        &seeds.join("metaimage"),
        "list",
        "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = LIST\nx.raw\nx.raw\n",
    )?;
    put(
        &seeds.join("vti"),
        "ascii",
        "<VTKFile type=\"ImageData\" version=\"0.1\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 1 0 1 0 1\" Origin=\"0 0 0\" Spacing=\"1 1 1\" Direction=\"1 0 0 0 1 0 0 0 1\"><Piece Extent=\"0 1 0 1 0 1\"><PointData Scalars=\"s\"><DataArray type=\"UInt8\" Name=\"s\" format=\"ascii\">1 2 3 4 5 6 7 8</DataArray></PointData></Piece></ImageData></VTKFile>",
    )?;
    put(
        &seeds.join("vti"),
        "base64",
        "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"BigEndian\" header_type=\"UInt32\"><ImageData WholeExtent=\"0 1 0 1 0 1\" Origin=\"0 0 0\" Spacing=\"1 1 1\"><Piece Extent=\"0 1 0 1 0 1\"><PointData><DataArray type=\"UInt8\" Name=\"s\" format=\"binary\">AAAACAECAwQFBgcI</DataArray></PointData></Piece></ImageData></VTKFile>",
    )?;
    pngs(&seeds.join("png"))
}

fn pngs(folder: &Path) -> Outcome {
    for (name, colour, depth, bytes) in [
        ("grey8", png::ColorType::Grayscale, png::BitDepth::Eight, 12),
        ("grey16", png::ColorType::Grayscale, png::BitDepth::Sixteen, 24),
        ("grey1", png::ColorType::Grayscale, png::BitDepth::One, 3),
        ("rgb", png::ColorType::Rgb, png::BitDepth::Eight, 36),
        ("rgba", png::ColorType::Rgba, png::BitDepth::Eight, 48),
    ] {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, 4, 3);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let data: Vec<u8> = (0..bytes).map(|i| i * 5).collect();
        encoder.write_header()?.write_image_data(&data)?;
        put(folder, name, file)?;
    }
    Ok(())
}

/// One slice of 3 × 2 pixels, element by element, in three transfer syntaxes and with an encapsulated fragment.
fn dicom(folder: &Path) -> Outcome {
    let element = |group: u16, number: u16, vr: &[u8; 2], value: &[u8]| {
        let mut bytes = [group.to_le_bytes(), number.to_le_bytes(), *vr].concat();
        let value = [value, if value.len() % 2 == 1 { b" " } else { b"" }].concat();
        if [b"OW", b"OB", b"SQ", b"UN"].contains(&vr) {
            bytes.extend([0, 0]);
            bytes.extend((value.len() as u32).to_le_bytes());
        } else {
            bytes.extend((value.len() as u16).to_le_bytes());
        }
        bytes.extend(value);
        bytes
    };
    let short = |n: u16| n.to_le_bytes();
    let image = |bits: u16| {
        [
            element(0x20, 0x0e, b"UI", b"1.2.3"),
            element(0x20, 0x32, b"DS", b"0\\0\\1"),
            element(0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0"),
            element(0x28, 0x02, b"US", &short(1)),
            element(0x28, 0x04, b"CS", b"MONOCHROME2"),
            element(0x28, 0x10, b"US", &short(2)),
            element(0x28, 0x11, b"US", &short(3)),
            element(0x28, 0x30, b"DS", b"0.5\\0.25"),
            element(0x28, 0x100, b"US", &short(bits)),
            element(0x28, 0x101, b"US", &short(bits)),
            element(0x28, 0x102, b"US", &short(bits - 1)),
            element(0x28, 0x103, b"US", &short(0)),
            element(0x28, 0x1052, b"DS", b"-1024"),
            element(0x28, 0x1053, b"DS", b"2"),
        ]
        .concat()
    };
    let file = |syntax: &[u8], data: &[u8]| {
        let meta = element(2, 0x10, b"UI", syntax);
        let length = element(2, 0, b"UL", &(meta.len() as u32).to_le_bytes());
        [&[0; 128], &b"DICM"[..], &length, &meta, data].concat()
    };
    let pixels = element(0x7fe0, 0x10, b"OW", &[7; 12]);
    put(folder, "explicit", file(b"1.2.840.10008.1.2.1\0", &[image(16), pixels].concat()))?;
    let encapsulated = |fragment: &[u8]| {
        let mut bytes = vec![0xe0, 0x7f, 0x10, 0x00, b'O', b'B', 0, 0, 0xff, 0xff, 0xff, 0xff];
        for item in [&[][..], fragment] {
            bytes.extend([0xfe, 0xff, 0x00, 0xe0]);
            bytes.extend((item.len() as u32).to_le_bytes());
            bytes.extend(item);
        }
        bytes.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
        bytes
    };
    // One segment of run lengths: six literal bytes.
    let mut rle = [1_u32, 64].iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    rle.resize(64, 0);
    rle.extend([5, 1, 2, 3, 4, 5, 6, 0]);
    put(folder, "rle", file(b"1.2.840.10008.1.2.5\0", &[image(8), encapsulated(&rle)].concat()))?;
    put(folder, "jpeg", file(b"1.2.840.10008.1.2.4.70", &[image(8), encapsulated(LOSSLESS)].concat()))?;
    put(
        folder,
        "jpeg2000",
        file(b"1.2.840.10008.1.2.4.90", &[image(8), encapsulated(b"\xff\x4f\xff\x51\0\x29")].concat()),
    )
}

/// The head of a lossless JPEG of 3 × 2 pixels: what follows is the fuzzer's to find.
const LOSSLESS: &[u8] = b"\xff\xd8\xff\xc3\x00\x0b\x08\x00\x02\x00\x03\x01\x01\x11\x00\xff\xc4\x00\x15\x00\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\xff\xda\x00\x08\x01\x01\x00\x01\x00\x00\x00\x00\x00\x00\xff\xd9";

fn artefacts(folder: &Path, golden: &Path) -> Outcome {
    for kind in Kind::ALL {
        let file = golden.join(format!("{kind}.v1.ivd"));
        let (info, bytes) = (peek(&file)?, fs::read(&file)?);
        let sections = info
            .sections
            .iter()
            .map(|s| Section {
                name: s.name.clone(),
                element: s.element.name().into(),
                shape: s.shape.clone(),
                bytes: bytes[s.offset as usize..(s.offset + s.length) as usize].into(),
            })
            .collect();
        let json = ["{}".into(), "null".into(), info.meta.to_string()];
        let wanted = Wanted { kind: kind.code(), version: info.kind_version, json, sections };
        let seed = wanted.to_bytes();
        if seed.len() < 4096 {
            put(folder, kind.name(), seed)?;
        }
        put(folder, &format!("{kind}-head"), [b"!", &bytes[..bytes.len().min(4000)]].concat())?;
    }
    Ok(())
}

fn scenes(folder: &Path, fixtures: &Path) -> Outcome {
    for entry in fs::read_dir(fixtures)? {
        let file: PathBuf = entry?.path();
        put(folder, &file.file_name().expect("a file").to_string_lossy(), fs::read(&file)?)?;
    }
    put(
        folder,
        "overrides",
        "schema = 1\n[input]\nphantom = \"head\"\n[output]\nreport = true\n\n---\nrender.mode=mip\ndeform.handle.0.radius=3\n",
    )
}

/// A log with every kind of event, and requests of every kind.
fn windows(seeds: &Path) -> Outcome {
    let head = Log::head("schema = 1\n[input]\nphantom = \"sphere\"\n[output]\nimages = [\"before\"]\n");
    let step = |events: &str| format!("{{\"step\":{{\"name\":\"a\",\"events\":[{events}]}}}}\n");
    let add = r#"{"add":{"at":{"nearestto":[4,4,7]},"action":{"move":[0,0,0.5]},"radius":6}}"#;
    let rest = [
        r#"{"move":{"handle":0,"by":[0,0.3,0.5]}}"#,
        r#"{"radius":{"handle":0,"radius":4}},{"stiffness":{"newton_per_metre":20}}"#,
        r#"{"pin":{"at":{"nearestto":[4,4,1]},"radius":2}}"#,
        r#"{"level":1},{"map":{"method":"biharmonic"}}"#,
        r#"{"space":{"step":{"kind":"cut","centre":[4,4,6],"normal":[1,0,0],"radius":3,"open":0.5}}}"#,
        r#"{"clip":{"part":{"plane":{"point":[4,4,4],"normal":[0,1,0]}}}},{"unclip":{"clip":0}},{"remove_space":{"space":0}}"#,
        r#"{"pull":{"handle":0,"with":[0,0,2]}},{"release":{"fix":0}},{"remove":{"handle":0}},"reset""#,
    ];
    let lines = rest.map(step).concat();
    put(&seeds.join("log"), "handle", format!("{head}\n{}{lines}\"undo\"\n\"redo\"\n", step(add)))?;
    put(&seeds.join("log"), "half", format!("{head}\n{}\"undo", step(add)))?;
    let drag = [
        r#"{"do":"orbit","by":[0.1,0.2]}"#,
        r#"{"do":"zoom","factor":1.5,"at":[0.5,0.5]}"#,
        r#"{"do":"hover","pane":"volume","at":[0.5,0.5]}"#,
        r#"{"do":"radius","radius":6}"#,
        r#"{"do":"grab","pane":"volume","at":[0.5,0.5]}"#,
        r#"{"do":"drag","to":[0.55,0.5],"lock":"x"}"#,
        r#"{"do":"wheel","steps":-2}"#,
        r#"{"do":"drop"}"#,
        r#"{"do":"pin","pane":"axial","at":[0.4,0.5]}"#,
        r#"{"do":"undo"}"#,
        r#"{"do":"redo"}"#,
    ];
    put(&seeds.join("requests"), "drag", drag.join("\n"))?;
    let others = [
        r#"{"do":"resize","size":[40,64]}"#,
        r#"{"do":"slice","pane":"coronal","steps":2}"#,
        r#"{"do":"cross","pane":"axial","at":[0.3,0.4]}"#,
        r#"{"do":"cut","along":"sagittal"}"#,
        r#"{"do":"compare","shows":"both","at":0.4}"#,
        r#"{"do":"measure","pane":"axial","from":[0.3,0.5],"to":[0.7,0.4]}"#,
        r#"{"do":"ruler","ruler":0,"places":[[8,8,3],[8,8,13],[3,8,13]]}"#,
        r#"{"do":"unmeasure","ruler":0}"#,
        r#"{"do":"window","by":[0.1,-0.1]}"#,
        r#"{"do":"add","place":[8,8,13],"by":[0,0,1]}"#,
        r#"{"do":"move","handle":0,"by":[0,0,2]}"#,
        r#"{"do":"stiffness","stiffness":12}"#,
        r#"{"do":"solver","solver":"springs"}"#,
        r#"{"do":"material","class":1,"stiffness":30}"#,
        r#"{"do":"level","level":1}"#,
        r#"{"do":"depth","weight":"one"}"#,
        r#"{"do":"map","map":"biharmonic"}"#,
        r#"{"do":"incise","centre":[8,8,8],"normal":[1,0,0],"radius":5,"open":1}"#,
        r#"{"do":"stroke","pane":"axial","from":[0.3,0.5],"to":[0.7,0.4]}"#,
        r#"{"do":"open","space":0,"radius":5,"open":2}"#,
        r#"{"do":"clip_here","along":"coronal"}"#,
        r#"{"do":"move_clip","clip":0,"part":{"box":{"min":[0,0,0],"max":[9,9,9]}}}"#,
        r#"{"do":"clip_in","space":"rest"}"#,
        r#"{"do":"clip","point":[8,9,8],"normal":[0,-1,0]}"#,
        r#"{"do":"close","space":0}"#,
        r#"{"do":"unclip","clip":0}"#,
        r#"{"do":"save","what":"scene"}"#,
        r#"{"do":"reset"}"#,
    ];
    put(&seeds.join("requests"), "others", others.join("\n"))
}

fn words(seeds: &Path) -> Outcome {
    for (name, line) in [
        ("pick", "pick=1,2,3;move=0,4,0;radius=25"),
        ("vertex", "vertex=7;force=1e3,-2,.5;radius=1e-3"),
        ("fix", "pick=-1,2.5,3;radius=4"),
        ("override", "deform.handle.0.radius=7.5"),
        ("list", "segment.values=[1.0, 2.0]"),
        ("class", "densest"),
    ] {
        put(&seeds.join("handles"), name, line)?;
    }
    for (stage, text) in [
        (0, "method = \"threshold\"\nvalues = [1.0, 50.5]"),
        (0, "method = \"kmvs\"\nk = 3"),
        (1, "resolution = 64\nmax_opacity = 0.5\nmin_opacity = 0.1\nsize_exponent = 0.5\nsoftness = 0.0"),
        (2, "class = \"densest\"\nseed = [4.0, 4.0, 4.0]\nfill_holes = false"),
        (2, "above = 40.0"),
        (3, "level = 1\nmax_turn_degrees = 60.0\nshape_weight = 0.01"),
        (3, "max_error = 0.1"),
        (4, "leaf_size = 2"),
        (
            5,
            "stiffness = 10.0\nduration = 0.1\ndt = 0.01\nground = 2.0\nliteral = true\n[[handle]]\npick = [4, 4, 7]\nmove = [0, 0, 1.0]\nradius = 5.0\n[[fix]]\npick = [4, 4, 1]\nradius = 2.0",
        ),
        (5, "[[handle]]\nvertex = 3\nforce = [0, 0, 100.0]\nradius = 5.0"),
        (6, "weight = \"one\"\ndepth = 3.0\nmargin = 4.0\noutside = \"free\"\ntolerance = 0.9"),
        (7, "order = \"cubic\"\nbackground = -1.0"),
        (
            8,
            "mode = \"iso\"\niso = 50.0\nsize = [8, 8]\nview = [30.0, -80.0]\nzoom = 2.0\nstep = 0.3\nprojection = \"perspective\"\nbackground = [0.0, 0.0, 0.0, 0.0]",
        ),
        (8, "mode = \"mip\"\nannotate = false\nshading = false\ntermination = 2.0\nskip = false"),
    ] {
        let seed = [&[stage], text.as_bytes()].concat();
        put(&seeds.join("params"), &format!("{stage}-{}", text.len()), seed)?;
    }
    Ok(())
}

/// A small lattice as our writers write it, and files in the encodings that they never use. The first byte is the format.
fn meshes(folder: &Path) -> Outcome {
    let grid = Grid::with_spacing([3; 3], [1.0; 3])?;
    let mut voxels = vec![0_u8; 27];
    voxels[13] = 200;
    let volume = Volume::new(grid, Voxels::from(voxels))?;
    let params = ExtractParams { iso: Iso::Value(90.0) };
    let lattice = extract(&volume, None, &params, &Exec::default())?.lattice;
    let temporary = tempfile::tempdir()?;
    for (i, format) in (0_u8..).zip(Format::ALL) {
        let file = temporary.path().join("mesh").with_extension(format.ending());
        mesh::write(&file, &lattice, None)?;
        put(folder, format.ending(), [&[i], &fs::read(file)?[..]].concat())?;
    }
    let head = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\nproperty list uchar int vertex_index\nend_header\n";
    let body = "1 1 1\n2 1 1\n1 2 1\n1 1 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
    put(folder, "ascii.ply", format!("\0ply\nformat ascii 1.0\n{head}{body}"))?;
    let mut big = format!("\0ply\nformat binary_big_endian 1.0\n{head}").into_bytes();
    big.extend(
        [1.0_f32, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 2.0].iter().flat_map(|c| c.to_be_bytes()),
    );
    for t in [[0_u32, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        big.push(3);
        big.extend(t.iter().flat_map(|v| v.to_be_bytes()));
    }
    put(folder, "big.ply", big)?;
    put(
        folder,
        "quads.obj",
        "\x01v 1 1 1\nv 2 1 1\nv 2 2 1\nv 1 2 1 \\\n 1\nf -4/1 -3//2 3/1/1 4\nf 1 4 3 2\n",
    )?;
    put(
        folder,
        "ascii.stl",
        "\x42solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n",
    )?;
    let vtp = |head: &str, points: &str| {
        format!(
            "\x04<VTKFile type=\"PolyData\" {head}><PolyData><Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\" NumberOfStrips=\"1\"><Points>{points}</Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\">0 1 2</DataArray><DataArray type=\"Int32\" Name=\"offsets\">3</DataArray></Polys><Strips><DataArray type=\"Int32\" Name=\"connectivity\">2 1 0</DataArray><DataArray type=\"Int32\" Name=\"offsets\">3</DataArray></Strips></Piece></PolyData>"
        )
    };
    let ascii = "<DataArray type=\"Float32\" NumberOfComponents=\"3\">0 0 0 1 0 0 0 1 0</DataArray>";
    put(folder, "ascii.vtp", vtp("", ascii) + "</VTKFile>")?;
    let inline = "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">JAAAAAAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAA==</DataArray>";
    put(folder, "base64.vtp", vtp("header_type=\"UInt32\"", inline) + "</VTKFile>")?;
    let appended = "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/>";
    // One zlib block of 36 zeros, stored.
    let mut zlib = vtp("compressor=\"vtkZLibDataCompressor\"", appended).into_bytes();
    zlib.extend(b"<AppendedData encoding=\"raw\">_");
    zlib.extend([1_u32, 36, 0, 47].iter().flat_map(|n| n.to_le_bytes()));
    zlib.extend([0x78, 0x01, 0x01, 36, 0, 219, 255]);
    zlib.extend([0; 36]);
    zlib.extend([0, 36, 0, 1]);
    zlib.extend(b"</AppendedData></VTKFile>");
    put(folder, "zlib.vtp", zlib)
}

/// Noise of several lengths, which gives several shapes.
fn noise(seeds: &Path) -> Outcome {
    for target in ["lattice", "field"] {
        for seed in 0..12_u64 {
            let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1;
            let bytes: Vec<u8> = (0..60 + 60 * seed)
                .map(|_| {
                    state =
                        state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 56) as u8
                })
                .collect();
            put(&seeds.join(target), &format!("noise{seed}"), bytes)?;
        }
    }
    Ok(())
}
