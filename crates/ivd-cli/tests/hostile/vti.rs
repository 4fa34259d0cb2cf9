//! VTI: every attribute missing, given twice or wrong, in each way of keeping the voxels.

use crate::hostile::case::{BAD, Case, EITHER, FINE};
use crate::hostile::good;

const NASTY: [&str; 9] = [
    "",
    "-1",
    "elephant",
    "nan",
    "1e308",
    "99999999999999999999",
    "0 4 0 3",
    "0 4 0 3 0 99999999",
    "4 0 3 0 2 0",
];

/// The attributes with their good values, by element.
const ATTRIBUTES: [(&str, &str, &str); 10] = [
    ("VTKFile", "type", "ImageData"),
    ("VTKFile", "byte_order", "LittleEndian"),
    ("VTKFile", "header_type", "UInt64"),
    ("ImageData", "WholeExtent", "0 4 0 3 0 2"),
    ("ImageData", "Origin", "1 2 3"),
    ("ImageData", "Spacing", "0.5 0.75 2"),
    ("ImageData", "Direction", "1 0 0 0 1 0 0 0 1"),
    ("Piece", "Extent", "0 4 0 3 0 2"),
    ("DataArray", "type", "Int16"),
    ("DataArray", "NumberOfComponents", "1"),
];

/// Ways of keeping the voxels.
#[derive(Clone, Copy, PartialEq)]
enum Kept {
    Ascii,
    Base64,
    Appended,
    Zlib,
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for part in bytes.chunks(3) {
        let word = u32::from_be_bytes([0, part[0], *part.get(1).unwrap_or(&0), *part.get(2).unwrap_or(&0)]);
        for i in 0..4 {
            let digit = char::from(DIGITS[(word >> (18 - 6 * i) & 63) as usize]);
            text.push(if i <= part.len() { digit } else { '=' });
        }
    }
    text
}

fn words(numbers: &[u64]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

/// A block of 120 bytes as VTK packs it: one full block, its own length, its packed length.
fn packed(head: [u64; 4], data: &[u8]) -> Vec<u8> {
    [words(&head), data.to_vec()].concat()
}

fn file(kept: Kept, attribute: impl Fn(&str, &str, &str) -> String, data: Option<Vec<u8>>) -> Vec<u8> {
    let element = |name: &str, more: &str| {
        let list: String =
            ATTRIBUTES.iter().filter(|a| a.0 == name).map(|a| attribute(a.0, a.1, a.2)).collect();
        format!("<{name}{list}{more}>")
    };
    let voxels: Vec<u8> = (0..120).collect();
    let plain = || [words(&[120]), voxels.clone()].concat();
    let zlib = good::zlib(&voxels);
    let data = data.unwrap_or_else(|| match kept {
        Kept::Zlib => packed([1, 120, 0, zlib.len() as u64], &zlib),
        Kept::Ascii => voxels.iter().take(60).map(|v| format!("{v} ")).collect::<String>().into_bytes(),
        _ => plain(),
    });
    let compressor = if kept == Kept::Zlib { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
    let (format, inline) = match kept {
        Kept::Ascii => ("ascii", String::from_utf8_lossy(&data).into_owned()),
        Kept::Base64 => ("binary", base64(&data)),
        _ => ("appended", String::new()),
    };
    let mut text = element("VTKFile", compressor) + &element("ImageData", "") + &element("Piece", "");
    text += "<PointData Scalars=\"v\">";
    text += &element("DataArray", &format!(" Name=\"v\" format=\"{format}\" offset=\"0\""));
    text += &format!("{inline}</DataArray></PointData></Piece></ImageData>");
    let mut bytes = text.into_bytes();
    if format == "appended" {
        bytes.extend(b"<AppendedData encoding=\"raw\">_");
        bytes.extend(&data);
        bytes.extend(b"</AppendedData>");
    }
    bytes.extend(b"</VTKFile>");
    bytes
}

/// What an attribute may be besides its good value.
fn allowed(name: &str, value: &str) -> &'static [i32] {
    match (name, value) {
        // What isn't VTK's names nothing; an empty type is one of those.
        ("header_type" | "byte_order" | "NumberOfComponents", "") => EITHER,
        _ => BAD,
    }
}

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let same = |_: &str, name: &str, value: &str| format!(" {name}=\"{value}\"");
    let case = |name: String, codes, bytes: Vec<u8>| {
        Case::new(format!("vti {name}"), codes).file("a.vti", bytes).import()
    };
    for (kept, how) in
        [(Kept::Ascii, "ascii"), (Kept::Base64, "base64"), (Kept::Appended, "appended"), (Kept::Zlib, "zlib")]
    {
        cases.push(case(format!("{how} as it should be"), FINE, file(kept, same, None)));
        for (element, attribute, _) in ATTRIBUTES {
            let with = |text: Option<String>| {
                file(
                    kept,
                    |e, a, v| {
                        if (e, a) == (element, attribute) {
                            text.clone().unwrap_or_default()
                        } else {
                            same(e, a, v)
                        }
                    },
                    None,
                )
            };
            for value in NASTY {
                let bytes = with(Some(format!(" {attribute}=\"{value}\"")));
                cases.push(case(
                    format!("{how} {element} {attribute} = {value}"),
                    allowed(attribute, value),
                    bytes,
                ));
            }
            // The extent may stand in either of two places. Words of 4 bytes are taken where nothing is said: a plain
            // block's length is the same in them, a packed one's isn't.
            let lies = attribute == "type" || attribute == "header_type" && kept == Kept::Zlib;
            let codes = if lies { BAD } else { FINE };
            cases.push(case(format!("{how} without {element} {attribute}"), codes, with(None)));
            let twice = with(Some(format!(" {attribute}=\"1\" {attribute}=\"1\"")));
            cases.push(case(format!("{how} {element} {attribute} twice"), BAD, twice));
        }
    }
    cases.extend(blocks());
    let good = String::from_utf8_lossy(&file(Kept::Ascii, same, None)).into_owned();
    for (name, text) in [
        ("no XML", "just text with <VTKFile in it".to_owned()),
        ("nothing inside", "<VTKFile type=\"ImageData\"></VTKFile>".to_owned()),
        ("deeply nested", "<VTKFile>".to_owned() + &"<a>".repeat(200_000)),
        ("an entity bomb", good.replace("1 2 3", "&lol;&lol;&lol;")),
        ("two pieces", good.replace("</ImageData>", "<Piece Extent=\"0 4 0 3 0 2\"></Piece></ImageData>")),
        ("tags that don't match", good.replace("</PointData>", "</CellData>")),
        ("too few numbers", good.replace("58 59", "58")),
        ("a word among the numbers", good.replace("58 59", "58 fifty")),
        ("a number beyond the type", good.replace("58 59", "58 99999")),
    ] {
        cases.push(case(name.to_owned(), BAD, text.into_bytes()));
    }
    cases
}

/// Block headers that lie.
fn blocks() -> Vec<Case> {
    let same = |_: &str, name: &str, value: &str| format!(" {name}=\"{value}\"");
    let voxels: Vec<u8> = (0..120).collect();
    let zlib = good::zlib(&voxels);
    let length = zlib.len() as u64;
    let mut cases = Vec::new();
    for head in [
        [0, 120, 0, length],
        [2, 120, 0, length],
        [u64::MAX, 120, 0, length],
        [1 << 40, 1, 0, length],
        [1, 0, 0, length],
        [1, 119, 0, length],
        [1, 1 << 40, 0, length],
        [1, u64::MAX, 0, length],
        [1, 120, 119, length],
        [1, 120, u64::MAX, length],
        [1, 120, 0, length - 1],
        [1, 120, 0, 1 << 40],
        [1, 120, 0, u64::MAX],
    ] {
        let bytes = file(Kept::Zlib, same, Some(packed(head, &zlib)));
        cases.push(Case::new(format!("vti zlib blocks {head:?}"), BAD).file("a.vti", bytes).import());
    }
    for bytes in [0, 1, 119, 1 << 40, u64::MAX] {
        let data = [words(&[bytes]), voxels.clone()].concat();
        for kept in [Kept::Appended, Kept::Base64] {
            let file = file(kept, same, Some(data.clone()));
            cases.push(Case::new(format!("vti block of {bytes}"), BAD).file("a.vti", file).import());
        }
    }
    cases
}
