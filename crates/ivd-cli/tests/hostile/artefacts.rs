//! Artefacts of every kind: cut, flipped, with a head that lies, and with right hashes over wrong content.

use std::path::Path;

use ivd_artefact::{ContentHash, Provenance};
use serde_json::json;

use crate::hostile::case::{BAD, Case};
use crate::hostile::good;

/// The kinds, and the command that needs each; the file is `a.ivd`.
const KINDS: [(&str, &str); 10] = [
    ("volume", "segment a.ivd -o out.ivd"),
    ("labels", "atf good.ivd a.ivd -o out.ivd"),
    ("mask", "segment good.ivd --mask a.ivd -o out.ivd"),
    ("transfer", "render good.ivd --transfer a.ivd --size 4x4 -o out.png"),
    ("lattice", "refine a.ivd --level 1 -o out.ivd"),
    ("octree", "map good.ivd a.ivd good.ivd -o out.ivd"),
    ("motion", "map good.ivd good.ivd a.ivd -o out.ivd"),
    ("displacement", "warp good.ivd a.ivd -o out.ivd"),
    ("image", "export a.ivd -o out.png"),
    ("tree", "export a.ivd -o out.json"),
];

/// The artefact that stands in the command's other places, by the kind that is damaged.
fn other(kind: &str) -> &'static str {
    if ["octree", "motion"].contains(&kind) { "lattice" } else { "volume" }
}

fn golden(kind: &str) -> Vec<u8> {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/artefacts");
    std::fs::read(fixtures.join(format!("{kind}.v1.ivd"))).unwrap()
}

/// Makes the root right again, so that what lies behind it is met.
fn seal(bytes: &mut [u8]) {
    let end = u32::from_le_bytes(bytes[20..24].try_into().unwrap()) as usize;
    let end = end.clamp(64, bytes.len());
    let root = blake3::Hasher::new().update(&bytes[..32]).update(&bytes[64..end]).finalize();
    bytes[32..64].copy_from_slice(root.as_bytes());
}

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (kind, words) in KINDS {
        let good = golden(kind);
        let beside = golden(other(kind));
        let case = |name: String, codes, bytes: Vec<u8>| {
            Case::new(format!("{kind} {name}"), codes)
                .file("a.ivd", bytes)
                .words(words)
                .file("good.ivd", beside.clone())
                .says("a.ivd")
        };
        for part in 0..40 {
            let length = good.len() * part / 40;
            cases.push(case(format!("cut to {length}"), BAD, good[..length].to_vec()));
        }
        cases.push(case("longer by a byte".into(), BAD, [&good[..], &[0]].concat()));
        for part in 0..50 {
            // Half of the places in the head, where the fields are.
            let at = if part % 2 == 0 { part * 14 } else { good.len() * part / 50 };
            let mut bytes = good.clone();
            bytes[at] ^= 1 << (part % 8);
            cases.push(case(format!("flipped at {at}"), BAD, bytes));
        }
        // Every field of the prelude but the root, under a right root.
        for (field, at, width) in [
            ("magic", 0, 4),
            ("container version", 4, 2),
            ("kind", 6, 2),
            ("kind version", 8, 2),
            ("sections", 10, 2),
            ("flags", 12, 4),
            ("metadata length", 16, 4),
            ("payload offset", 20, 4),
            ("payload length", 24, 8),
        ] {
            for value in [0, 1, 0x7fff_ffff_ffff_ffff, u64::MAX, 1 << 40, 4095] {
                let mut bytes = good.clone();
                bytes[at..at + width].copy_from_slice(&value.to_le_bytes()[..width]);
                if bytes == good {
                    continue;
                }
                seal(&mut bytes);
                // Another kind with the same sections would be another artefact; none has them.
                cases.push(case(format!("{field} = {value}"), BAD, bytes));
            }
        }
        cases.extend(
            contents(&good)
                .into_iter()
                .map(|(name, bytes)| case(name, CONTENT, bytes).or_says("grids").or_says("reads")),
        );
    }
    cases
}

/// A volume whose head has a text wherever it has one: its stage, parameters, inputs and figures.
pub(crate) fn with_text(text: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ivd");
    let mut from = Provenance::new(text, json!({ "method": text, text: [text, { text: text }] }));
    from = from.with_input(text, ContentHash([7; 32]));
    text.clone_into(&mut from.backend);
    let figures = json!({ text: text, "classes": [{ "name": text, text: 1 }] });
    ivd_artefact::write_with_metrics(&path, &good::volume(), &from, &figures).unwrap();
    std::fs::read(path).unwrap()
}

/// What a file with right hashes may meet: its values may be strange and still make sense, or not fit what stands beside it.
const CONTENT: &[i32] = &[0, 2, 3, 4, 5];

/// Numbers of the metadata replaced, the root made right.
fn contents(good: &[u8]) -> Vec<(String, Vec<u8>)> {
    let end = 64 + u32::from_le_bytes(good[16..20].try_into().unwrap()) as usize;
    let mut found = Vec::new();
    let digits: Vec<usize> =
        (64..end).filter(|&at| good[at].is_ascii_digit() && good[at - 1] != b'v').collect();
    for (n, &at) in digits.iter().enumerate() {
        // Of the digits, one in three: there are a hundred in a grid.
        if n % 3 != 0 {
            continue;
        }
        for digit in [b'9', b'-', b'e'] {
            let mut bytes = good.to_vec();
            bytes[at] = digit;
            seal(&mut bytes);
            found.push((format!("`{}` at {at}", char::from(digit)), bytes));
        }
    }
    found
}
