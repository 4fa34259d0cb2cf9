//! Artefacts with right hashes.
//!
//! A hash over every byte stops random damage at the door, so the fuzzer writes what lies behind it: lines of text for the
//! metadata, then the sections' bytes. Here they become a file whose hashes are right and whose content is anything.

use ivd_artefact::{Artefact, Kind, Provenance, open, read, write};
use ivd_core::{ByteSource as _, Image, Volume, Voxels};

use crate::{exec, files, lattices, stages};

/// Most voxels and vertices that are worked on: the decoder is what is tried here.
const SMALL: usize = 4096;

/// One section as the fuzzer wants it.
#[derive(Debug, Default)]
pub struct Section {
    /// Its name.
    pub name: String,
    /// Its element type.
    pub element: String,
    /// Its shape.
    pub shape: Vec<u64>,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// An artefact as the fuzzer wants it.
#[derive(Debug, Default)]
pub struct Wanted {
    /// Code of the kind.
    pub kind: u16,
    /// Version of the kind.
    pub version: u16,
    /// Canonical JSON of the parameters, of the metrics and of the content.
    pub json: [String; 3],
    /// The sections.
    pub sections: Vec<Section>,
}

impl Wanted {
    /// Reads the fuzzer's form: kind and version, three lines of JSON, and for every section a line of name, element, shape
    /// and number of bytes; after an empty line the sections' bytes.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let end = bytes.windows(2).position(|w| w == b"\n\n")?;
        let head = std::str::from_utf8(&bytes[..end]).ok()?;
        let mut rest = &bytes[end + 2..];
        let mut lines = head.lines();
        let (kind, version) = lines.next()?.split_once(' ')?;
        let mut wanted = Self {
            kind: kind.parse().ok()?,
            version: version.parse().ok()?,
            json: [lines.next()?.into(), lines.next()?.into(), lines.next()?.into()],
            sections: Vec::new(),
        };
        for line in lines {
            let words: Vec<&str> = line.split(' ').collect();
            let [name, element, shape, length] = words[..] else { return None };
            let shape = shape.split('x').map(|n| n.parse().ok()).collect::<Option<Vec<u64>>>()?;
            let length = length.parse::<usize>().ok()?.min(rest.len());
            let (taken, left) = rest.split_at(length);
            rest = left;
            wanted.sections.push(Section {
                name: name.into(),
                element: element.into(),
                shape,
                bytes: taken.into(),
            });
        }
        Some(wanted)
    }

    /// The fuzzer's form.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut text = format!("{} {}\n{}\n", self.kind, self.version, self.json.join("\n"));
        for s in &self.sections {
            let shape: Vec<String> = s.shape.iter().map(u64::to_string).collect();
            text += &format!("{} {} {} {}\n", s.name, s.element, shape.join("x"), s.bytes.len());
        }
        let mut bytes = (text + "\n").into_bytes();
        bytes.extend(self.sections.iter().flat_map(|s| &s.bytes));
        bytes
    }

    /// The file; docs/artefacts.md has the layout.
    pub fn to_file(&self) -> Vec<u8> {
        let table_bytes: usize = self
            .sections
            .iter()
            .map(|s| 8 * 7 + s.name.len() + s.element.len() + 8 * s.shape.len() + 96)
            .sum();
        let json_bytes: usize = self.json.iter().map(String::len).sum();
        let payload_offset = (64 + json_bytes + table_bytes + 256).next_multiple_of(4096);
        let mut at = payload_offset;
        let mut table = number(self.sections.len() as u64);
        let mut payload = Vec::new();
        for s in &self.sections {
            at = at.next_multiple_of(4096);
            payload.resize(at - payload_offset, 0);
            payload.extend(&s.bytes);
            table.extend(row(s, at as u64));
            at += s.bytes.len();
        }
        let metadata = [
            text("fuzz"),
            1_u32.to_le_bytes().to_vec(),
            text(&self.json[0]),
            number(0),
            text("cpu"),
            text(&self.json[1]),
            text(&self.json[2]),
            table,
        ]
        .concat();
        let mut file = b"IVDA\x01\x00".to_vec();
        file.extend(self.kind.to_le_bytes());
        file.extend(self.version.to_le_bytes());
        file.extend((self.sections.len() as u16).to_le_bytes());
        file.extend([0; 4]);
        file.extend((metadata.len() as u32).to_le_bytes());
        file.extend((payload_offset as u32).to_le_bytes());
        file.extend((payload.len() as u64).to_le_bytes());
        file.extend([0; 32]);
        file.extend(metadata);
        file.resize(payload_offset, 0);
        seal(&mut file);
        file.extend(payload);
        file
    }
}

fn number(n: u64) -> Vec<u8> {
    n.to_le_bytes().to_vec()
}

fn text(text: &str) -> Vec<u8> {
    [&number(text.len() as u64), text.as_bytes()].concat()
}

fn row(section: &Section, offset: u64) -> Vec<u8> {
    let chunks: Vec<[u8; 32]> =
        section.bytes.chunks(ivd_artefact::CHUNK).map(|chunk| *blake3::hash(chunk).as_bytes()).collect();
    let shape: Vec<u8> = section.shape.iter().flat_map(|n| n.to_le_bytes()).collect();
    [
        text(&section.name),
        text(&section.element),
        number(section.shape.len() as u64),
        shape,
        number(offset),
        number(section.bytes.len() as u64),
        blake3::hash(chunks.as_flattened()).as_bytes().to_vec(),
        number(chunks.len() as u64),
        chunks.concat(),
    ]
    .concat()
}

/// Makes the root right. `file` ends where the payload begins, or before.
fn seal(file: &mut [u8]) {
    if file.len() >= 64 {
        let root = blake3::Hasher::new().update(&file[..32]).update(&file[64..]).finalize();
        file[32..64].copy_from_slice(root.as_bytes());
    }
}

/// Reads the bytes as an artefact: after `!` as a head with its root made right, else in the fuzzer's form.
pub fn check(bytes: &[u8]) {
    let file = match bytes.split_first() {
        Some((b'!', head)) => {
            let mut file = head.to_vec();
            seal(&mut file);
            file
        }
        _ => match Wanted::parse(bytes) {
            Some(wanted) => wanted.to_file(),
            None => return,
        },
    };
    let path = files::path("x.ivd");
    // A file that is mapped must not be cut short: a new one takes its name.
    let _ = std::fs::remove_file(&path);
    std::fs::write(&path, file).expect("the temporary folder is writable");
    if let Ok(opened) = open(&path) {
        for section in &opened.info().sections {
            let first = section.offset as usize;
            opened.touch(first..first + section.length as usize);
        }
    }
    let Ok(loaded) = read(&path) else { return };
    let copy = files::path("copy.ivd");
    let written = write(&copy, &loaded.artefact, &Provenance::new("fuzz", serde_json::json!({})));
    // The fuzzer's JSON isn't in canonical form, so that the first hash may differ; what we wrote may not.
    let again = read(&copy).expect("what was written is read");
    assert_eq!(written.expect("what was read is written").hash, again.hash, "the copy has another hash");
    use_it(&loaded.artefact);
}

/// Does what the program would do with it.
fn use_it(artefact: &Artefact) {
    match artefact {
        Artefact::Volume(volume) if volume.grid().len() <= SMALL => {
            let _ = ivd_segment::kmvs(volume, None, &ivd_segment::KmvsParams::default(), exec());
            let _ = volume.range();
            if let Some([low, high]) = volume.range() {
                let iso = ivd_lattice::extract::Iso::Value(low.midpoint(high));
                let params = ivd_lattice::extract::ExtractParams { iso };
                let _ = ivd_lattice::extract::extract(volume, None, &params, exec());
            }
        }
        Artefact::Labels(labels) if labels.grid().len() <= SMALL => {
            let voxels: Vec<u8> = (0..labels.grid().len()).map(|i| i as u8).collect();
            let Ok(volume) = Volume::new(labels.grid().clone(), Voxels::from(voxels)) else { return };
            if let Ok(built) = ivd_atf::transfer(&volume, labels, &ivd_atf::Params::default(), exec()) {
                stages::draw(&volume, &built.transfer, Some(labels), None);
            }
            let _ = ivd_boundary::component(
                &volume,
                Some(labels),
                &ivd_boundary::ComponentParams::default(),
                exec(),
            );
        }
        Artefact::Mask(mask) if mask.grid().len() <= SMALL => {
            let voxels: Vec<u8> = (0..mask.grid().len()).map(|i| i as u8).collect();
            let Ok(volume) = Volume::new(mask.grid().clone(), Voxels::from(voxels)) else { return };
            let _ = ivd_segment::kmvs(&volume, Some(mask), &ivd_segment::KmvsParams::default(), exec());
            let params = ivd_lattice::extract::ExtractParams { iso: ivd_lattice::extract::Iso::Mask };
            let _ = ivd_lattice::extract::extract(&volume, Some(mask), &params, exec());
        }
        Artefact::Transfer(transfer) => stages::draw(&stages::ball(), transfer, None, None),
        Artefact::Lattice(lattice) if lattice.grid().len() <= SMALL && lattice.keys().len() <= SMALL => {
            lattices::take_through(lattice, &[], &[], ivd_lattice::refine::Target::Level(1));
        }
        Artefact::Octree(octree) => {
            let lattice = stages::octahedron();
            if let Ok(index) = ivd_octree::prepare(lattice, octree) {
                let _ = index.nearest(nalgebra::Vector3::new(0.5, 3.0, -2.0), f64::INFINITY);
            }
        }
        Artefact::Motion(motion) => {
            let lattice = stages::octahedron();
            let octree = ivd_octree::build(lattice, &ivd_octree::Params::default(), exec());
            stages::carry(lattice, &octree.expect("an octahedron"), motion);
        }
        Artefact::Displacement(displacement) if displacement.grid().len() <= SMALL => {
            let voxels: Vec<u8> = (0..displacement.grid().len()).map(|i| i as u8).collect();
            let Ok(volume) = Volume::new(displacement.grid().clone(), Voxels::from(voxels)) else { return };
            let params = ivd_field::warp::WarpParams::default();
            let _ = ivd_field::warp::volume(&volume, displacement, &params, exec());
            if let Ok(built) = ivd_atf::from_isovalue(&volume, 7.0, &ivd_atf::Params::default(), exec()) {
                stages::draw(&volume, &built.transfer, None, Some(displacement));
            }
        }
        Artefact::Tree(tree) if tree.grid.len() <= SMALL => {
            let _ = ivd_segment::cut(tree, &ivd_segment::CutParams::default(), exec());
        }
        Artefact::Image(image) => {
            let (size, black) = ([image.width(), image.height()], vec![0; image.rgba().len()]);
            let black = Image::of_frames(size, image.frames(), black);
            let _ = ivd_render::difference(image, &black.expect("of the same size"));
        }
        _ => {}
    }
}

/// Names of the kinds, for the seeds.
pub fn kinds() -> [Kind; 10] {
    Kind::ALL
}
