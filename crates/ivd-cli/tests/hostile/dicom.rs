//! DICOM: every element missing, given another value, type or length.

use crate::hostile::case::{BAD, Case, EITHER, FINE};

/// Group, number, type and value.
type Element = (u16, u16, &'static [u8; 2], Vec<u8>);

const META: usize = 2;

fn elements() -> Vec<Element> {
    let short = |n: u16| n.to_le_bytes().to_vec();
    vec![
        (2, 0x00, b"UL", 28_u32.to_le_bytes().to_vec()),
        (2, 0x10, b"UI", b"1.2.840.10008.1.2.1\0".to_vec()),
        (0x20, 0x0e, b"UI", b"1.2.3\0".to_vec()),
        (0x20, 0x32, b"DS", b"0\\0\\1 ".to_vec()),
        (0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0 ".to_vec()),
        (0x28, 0x02, b"US", short(1)),
        (0x28, 0x04, b"CS", b"MONOCHROME2 ".to_vec()),
        (0x28, 0x10, b"US", short(2)),
        (0x28, 0x11, b"US", short(3)),
        (0x28, 0x30, b"DS", b"0.5\\0.25".to_vec()),
        (0x28, 0x100, b"US", short(16)),
        (0x28, 0x101, b"US", short(12)),
        (0x28, 0x102, b"US", short(11)),
        (0x28, 0x103, b"US", short(0)),
        (0x28, 0x1052, b"DS", b"-1024 ".to_vec()),
        (0x28, 0x1053, b"DS", b"2 ".to_vec()),
        (0x7fe0, 0x10, b"OW", vec![7; 12]),
    ]
}

/// A file for each element with text: a text in place of its value, or behind it; and elements that name people and things.
pub(crate) fn with_text(text: &str) -> Vec<(String, Vec<u8>)> {
    let more: [Element; 7] = [
        (8, 0x08, b"CS", b"ORIGINAL\\PRIMARY".to_vec()),
        (8, 0x60, b"CS", b"CT".to_vec()),
        (8, 0x103e, b"LO", b"series".to_vec()),
        (0x10, 0x10, b"PN", b"Nobody".to_vec()),
        (0x10, 0x20, b"LO", b"1".to_vec()),
        (0x18, 0x50, b"DS", b"1 ".to_vec()),
        (0x20, 0x11, b"IS", b"1 ".to_vec()),
    ];
    let mut all: Vec<Element> = elements().into_iter().chain(more).collect();
    all.sort_by_key(|e| (e.0, e.1));
    let even = |mut value: Vec<u8>| {
        value.resize(value.len().next_multiple_of(2), b' ');
        value
    };
    let mut files = Vec::new();
    for (i, element) in
        all.iter().enumerate().filter(|(_, e)| !is_long(e.2) && ![b"US", b"UL"].contains(&e.2))
    {
        for value in [text.as_bytes().to_vec(), [&element.3[..], text.as_bytes()].concat()] {
            let mut plain: Vec<Vec<u8>> =
                all.iter().map(|e| bytes(&(e.0, e.1, e.2, even(e.3.clone())), None)).collect();
            plain[i] = bytes(&(element.0, element.1, element.2, even(value)), None);
            files.push((format!("({:04x},{:04x})", element.0, element.1), file(&plain)));
        }
    }
    files
}

fn is_long(kind: &[u8]) -> bool {
    [&b"OB"[..], b"OW", b"SQ", b"UN", b"UT"].contains(&kind)
}

/// An element's bytes; `length` in place of its own.
fn bytes((group, number, kind, value): &Element, length: Option<u32>) -> Vec<u8> {
    let mut out = [group.to_le_bytes(), number.to_le_bytes(), **kind].concat();
    let length = length.unwrap_or(value.len() as u32);
    if is_long(*kind) {
        out.extend([0, 0]);
        out.extend(length.to_le_bytes());
    } else {
        out.extend((length as u16).to_le_bytes());
    }
    out.extend(value);
    out
}

fn file(elements: &[Vec<u8>]) -> Vec<u8> {
    [&[0; 128], &b"DICM"[..], &elements.concat()].concat()
}

fn case(name: String, codes: &'static [i32], bytes: Vec<u8>) -> Case {
    Case::new(format!("dicom {name}"), codes).file("a.dcm", bytes).import()
}

/// Codes of an element that is missing.
fn without(number: u16, group: u16) -> &'static [i32] {
    match (group, number) {
        (2, 0x10) | (0x28, 0x10 | 0x11 | 0x100) | (0x7fe0, _) => BAD,
        (2, 0) => FINE,
        _ => EITHER,
    }
}

pub(crate) fn cases() -> Vec<Case> {
    let good = elements();
    let plain: Vec<Vec<u8>> = good.iter().map(|e| bytes(e, None)).collect();
    let mut cases = vec![case("as it should be".into(), FINE, file(&plain))];
    for (i, element) in good.iter().enumerate() {
        let name = format!("({:04x},{:04x})", element.0, element.1);
        let with = |new: Vec<Vec<u8>>| {
            let mut all = plain.clone();
            all.splice(i..=i, new);
            file(&all)
        };
        cases.push(case(format!("without {name}"), without(element.1, element.0), with(vec![])));
        cases.push(case(format!("{name} twice"), EITHER, with(vec![plain[i].clone(), plain[i].clone()])));
        for length in [0_u32, 1, 0x7ffe, 0xfffe, 0x7fff_fffe, u32::MAX] {
            // A short length field holds the lower half; an element that reaches beyond the file is cut.
            let beyond = if is_long(element.2) { length > 12 } else { length & 0xffff > 600 };
            // The pixels are the last, and all there, whatever else their length speaks of.
            let codes = if beyond && i >= META && element.0 != 0x7fe0 { BAD } else { EITHER };
            cases.push(case(
                format!("{name} of {length} bytes"),
                codes,
                with(vec![bytes(element, Some(length))]),
            ));
        }
        for kind in [b"OB", b"SQ", b"UN", b"\0\0", b"zz"] {
            let other = bytes(&(element.0, element.1, kind, element.3.clone()), None);
            let codes = if kind == b"\0\0" || kind == b"zz" { BAD } else { EITHER };
            cases.push(case(format!("{name} of type {}", kind.escape_ascii()), codes, with(vec![other])));
        }
        for value in nasty(element) {
            let codes = codes(element, &value);
            let changed = bytes(&(element.0, element.1, element.2, value.clone()), None);
            cases.push(case(format!("{name} = {}", value.escape_ascii()), codes, with(vec![changed])));
        }
    }
    let whole = file(&plain);
    cases.extend((0..whole.len()).step_by(9).map(|n| case(format!("cut to {n}"), BAD, whole[..n].to_vec())));
    cases.extend(nested(&plain));
    cases.extend(encapsulated(&plain));
    cases
}

fn nasty(element: &Element) -> Vec<Vec<u8>> {
    let text: [&[u8]; 8] =
        [b"", b"0 ", b"-1", b"nan ", b"1e999 ", b"elephant", b"\\\\\\\\", b"1\\2\\3\\4\\5\\6\\7\\8 "];
    match element.2 {
        b"US" => [0_u16, 1, 2, 7, 8, 32, 0x7fff, 0xffff]
            .map(|n| n.to_le_bytes().to_vec())
            .into_iter()
            .filter(|v| *v != element.3)
            .collect(),
        b"OW" | b"UL" => vec![],
        _ => text.map(<[u8]>::to_vec).to_vec(),
    }
}

/// What a value must lead to.
fn codes(element: &Element, value: &[u8]) -> &'static [i32] {
    let number = value.try_into().map(u16::from_le_bytes).unwrap_or_default();
    match (element.0, element.1) {
        // The transfer syntax: one is right. What the pixels are: one plane of grey.
        (2, 0x10) | (0x28, 0x02) => BAD,
        // Where it isn't said it is grey.
        (0x28, 0x04) if value.is_empty() => EITHER,
        (0x28, 0x04) => BAD,
        // Sizes that the pixels don't fill.
        (0x28, 0x10 | 0x11) if number == 0 || number >= 7 => BAD,
        (0x28, 0x10 | 0x11) => EITHER,
        (0x28, 0x100) if ![8, 16, 32].contains(&number) => BAD,
        (0x28, 0x101) if number == 0 || number > 16 => BAD,
        (0x28, 0x102) if number > 15 => BAD,
        (0x28, 0x103) if number > 1 => BAD,
        // Numbers that are none.
        (0x20, 0x32 | 0x37) | (0x28, 0x30) if value.starts_with(b"nan") || value.starts_with(b"ele") => BAD,
        (0x28, 0x1052 | 0x1053) if [&b"nan "[..], b"1e999 ", b"elephant"].contains(&value) => BAD,
        _ => EITHER,
    }
}

/// Sequences inside sequences.
fn nested(plain: &[Vec<u8>]) -> Vec<Case> {
    let undefined: Vec<u8> = vec![8, 0, 0x40, 0x11, b'S', b'Q', 0, 0, 0xff, 0xff, 0xff, 0xff];
    let item = [0xfe, 0xff, 0, 0xe0, 0xff, 0xff, 0xff, 0xff];
    let open = [&undefined[..], &item].concat();
    [1_usize, 63, 1000, 100_000]
        .into_iter()
        .map(|depth| {
            let mut all = plain.to_vec();
            all.insert(META, open.repeat(depth));
            case(format!("{depth} sequences that don't end"), BAD, file(&all))
        })
        .collect()
}

/// Fragments that lie, for every way of packing.
fn encapsulated(plain: &[Vec<u8>]) -> Vec<Case> {
    let fragment =
        |length: u32, data: &[u8]| [&[0xfe, 0xff, 0, 0xe0], &length.to_le_bytes()[..], data].concat();
    let end = [0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0];
    let head = [0xe0, 0x7f, 0x10, 0, b'O', b'B', 0, 0, 0xff, 0xff, 0xff, 0xff];
    let mut run_lengths = vec![0; 64];
    run_lengths[0] = 1;
    run_lengths[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
    let jpeg: &[u8] =
        b"\xff\xd8\xff\xc3\0\x0b\x10\xff\xff\xff\xff\x01\x01\x11\0\xff\xda\0\x08\x01\x01\0\x01\0\0\0";
    let jpeg_2000: &[u8] = b"\xff\x4f\xff\x51\0\x29\0\0\x7f\xff\xff\xff\x7f\xff\xff\xff\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0\0\0\0\0\0\0\x01\x0f\x01\x01";
    let mut cases = Vec::new();
    for syntax in [
        "1.2.840.10008.1.2.5",
        "1.2.840.10008.1.2.4.50",
        "1.2.840.10008.1.2.4.57",
        "1.2.840.10008.1.2.4.70",
        "1.2.840.10008.1.2.4.90",
        "1.2.840.10008.1.2.4.91",
        "1.2.840.10008.1.2.1.98",
    ] {
        let mut value = syntax.as_bytes().to_vec();
        value.resize(value.len().next_multiple_of(2), 0);
        let uid = bytes(&(2, 0x10, b"UI", value), None);
        let contents: [(&str, Vec<u8>); 9] = [
            ("nothing", vec![]),
            ("no fragment", [&fragment(0, &[])[..], &end].concat()),
            ("an empty fragment", [&fragment(0, &[])[..], &fragment(0, &[]), &end].concat()),
            ("a fragment beyond the file", [&fragment(0, &[])[..], &fragment(0x7fff_fffe, &[1, 2])].concat()),
            ("a fragment without an end", [&fragment(0, &[])[..], &fragment(u32::MAX, &[1, 2])].concat()),
            ("zeros", [&fragment(0, &[])[..], &fragment(64, &[0; 64]), &end].concat()),
            ("run lengths that lie", [&fragment(0, &[])[..], &fragment(64, &run_lengths), &end].concat()),
            ("a JPEG that lies", [&fragment(0, &[])[..], &fragment(jpeg.len() as u32, jpeg), &end].concat()),
            (
                "a JPEG 2000 that lies",
                [&fragment(0, &[])[..], &fragment(jpeg_2000.len() as u32, jpeg_2000), &end].concat(),
            ),
        ];
        for (name, content) in contents {
            let mut all = plain.to_vec();
            all[1].clone_from(&uid);
            all.remove(0);
            let last = all.len() - 1;
            all[last] = [&head[..], &content].concat();
            // In the last of them fragments are pixels as they are.
            let codes = if syntax.ends_with("98") { EITHER } else { BAD };
            cases.push(case(format!("{syntax} with {name}"), codes, file(&all)));
        }
    }
    cases
}
