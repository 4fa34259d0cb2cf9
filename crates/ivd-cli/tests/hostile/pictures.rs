//! TIFF and PNG: every tag and every field of the head wrong.

use crate::hostile::case::{BAD, Case, EITHER, FINE};
use crate::hostile::good;

/// Number, type, count and value of an entry of a TIFF's directory.
type Tag = (u16, u16, u32, u32);

/// 5 × 4 pixels of 16 bits in one strip.
const TAGS: [Tag; 10] = [
    (256, 4, 1, 5),
    (257, 4, 1, 4),
    (258, 3, 1, 16),
    (259, 3, 1, 1),
    (262, 3, 1, 1),
    (273, 4, 1, 8),
    (277, 3, 1, 1),
    (278, 4, 1, 4),
    (279, 4, 1, 40),
    (339, 3, 1, 2),
];

/// A TIFF of one page: head, pixels, directory.
fn tiff(tags: &[Tag], next: u32) -> Vec<u8> {
    let mut bytes = b"II*\0\x30\0\0\0".to_vec();
    bytes.extend((0..40).map(|i| i * 3));
    bytes.extend((tags.len() as u16).to_le_bytes());
    for (number, kind, count, value) in tags {
        bytes.extend(number.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(count.to_le_bytes());
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend(next.to_le_bytes());
    bytes
}

/// A TIFF for each tag of text, which lies behind the directory.
pub(crate) fn tiff_with_text(text: &str) -> Vec<(String, Vec<u8>)> {
    let texts = [format!("{text}\0"), format!("ImageJ=1.53\nimages=1\nunit={text}\nspacing={text}\n\0")];
    // Description, maker, model, software, date, artist, host, copyright.
    let numbers = [270_u16, 271, 272, 305, 306, 315, 316, 33432];
    let mut files = Vec::new();
    for number in numbers {
        for text in &texts {
            let mut tags = TAGS.to_vec();
            let at = 48 + 2 + 12 * (tags.len() + 1) + 4;
            tags.push((number, 2, text.len() as u32, at as u32));
            tags.sort_by_key(|tag| tag.0);
            let mut bytes = tiff(&tags, 0);
            bytes.extend(text.bytes());
            files.push((format!("tag {number}"), bytes));
        }
    }
    files
}

/// A PNG for each chunk of text, and one whose own name for a chunk is none.
pub(crate) fn png_with_text(text: &str) -> Vec<(String, Vec<u8>)> {
    let rows = good::zlib(&[[0, 1, 2, 3, 4, 5]; 4].concat());
    let text = text.as_bytes();
    let name = |at: usize| text.get(at).copied().unwrap_or(b'x');
    [
        ("tEXt", chunk(*b"tEXt", &[text, &[0], text].concat())),
        ("zTXt", chunk(*b"zTXt", &[text, &[0, 0], &good::zlib(text)[..]].concat())),
        ("iTXt", chunk(*b"iTXt", &[text, &[0, 0, 0], text, &[0], text, &[0], text].concat())),
        ("iCCP", chunk(*b"iCCP", &[text, &[0, 0], &good::zlib(text)[..]].concat())),
        ("sPLT", chunk(*b"sPLT", &[text, &[0, 8]].concat())),
        ("name of a chunk", chunk([name(0), name(1), name(2), name(3)], text)),
    ]
    .map(|(name, chunk)| (name.to_owned(), png(HEAD, &rows, &[chunk])))
    .to_vec()
}

/// What a tag's value may be without making the file wrong.
fn allowed(number: u16, value: u32) -> &'static [i32] {
    match (number, value) {
        // A narrower, shorter picture is one, and rows a strip may be more than there are.
        (256 | 257, 1) | (278, 5..) => FINE,
        // A photometric interpretation of white as 0; another place or length of the strip within the file.
        (262, 0) | (273 | 279, _) => EITHER,
        // 8 bits, the words of the format for numbers.
        (258, 8) | (339, 1 | 4) => EITHER,
        // Packed by another rule: the pixels aren't.
        _ => BAD,
    }
}

fn tiffs() -> Vec<Case> {
    let case = |name: String, codes, bytes: Vec<u8>| {
        Case::new(format!("tiff {name}"), codes).file("a.tif", bytes).import()
    };
    let mut cases = vec![case("as it should be".into(), FINE, tiff(&TAGS, 0))];
    for (i, tag) in TAGS.iter().enumerate() {
        let with = |change: &dyn Fn(&mut Tag)| {
            let mut tags = TAGS;
            change(&mut tags[i]);
            tiff(&tags, 0)
        };
        for value in [0, 1, 8, 7, 100_000, 0x7fff_ffff, u32::MAX].into_iter().filter(|v| *v != tag.3) {
            let codes = allowed(tag.0, value);
            cases.push(case(format!("tag {} = {value}", tag.0), codes, with(&|t| t.3 = value)));
        }
        for kind in [0, 2, 5, 12, 13, 99] {
            cases.push(case(format!("tag {} of type {kind}", tag.0), EITHER, with(&|t| t.1 = kind)));
        }
        for count in [0, 2, 1000, u32::MAX] {
            cases.push(case(format!("tag {} of {count} values", tag.0), EITHER, with(&|t| t.2 = count)));
        }
        let mut without = TAGS.to_vec();
        without.remove(i);
        cases.push(case(format!("without tag {}", tag.0), EITHER, tiff(&without, 0)));
        let twice = [&TAGS[..=i], &TAGS[i..]].concat();
        cases.push(case(format!("tag {} twice", tag.0), EITHER, tiff(&twice, 0)));
    }
    for next in [48, 8, 1, 0x7fff_fff0, u32::MAX] {
        cases.push(case(format!("the next page at {next}"), BAD, tiff(&TAGS, next)));
    }
    let mut tags = TAGS;
    (tags[0].3, tags[1].3, tags[7].3) = (100_000, 100_000, 100_000);
    cases.push(case("100 000 × 100 000 pixels".into(), BAD, tiff(&tags, 0)));
    let many = vec![(256, 4, 1, 5); 60_000];
    cases.push(case("60 000 times one tag".into(), BAD, tiff(&many, 0)));
    cases
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

fn chunk(name: [u8; 4], data: &[u8]) -> Vec<u8> {
    let body = [&name[..], data].concat();
    [&(data.len() as u32).to_be_bytes(), &body[..], &crc(&body).to_be_bytes()].concat()
}

/// A PNG of a head and packed rows.
fn png(head: [u8; 13], packed: &[u8], more: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    bytes.extend(chunk(*b"IHDR", &head));
    bytes.extend(more.concat());
    bytes.extend(chunk(*b"IDAT", packed));
    bytes.extend(chunk(*b"IEND", &[]));
    bytes
}

/// 5 × 4 pixels of 8 bit grey, not interlaced.
const HEAD: [u8; 13] = [0, 0, 0, 5, 0, 0, 0, 4, 8, 0, 0, 0, 0];

fn pngs() -> Vec<Case> {
    let rows = good::zlib(&[[0, 1, 2, 3, 4, 5]; 4].concat());
    let case = |name: String, codes, bytes: Vec<u8>| {
        Case::new(format!("png {name}"), codes)
            .file("slices/s1.png", bytes.clone())
            .file("slices/s2.png", bytes)
            .words("import slices -o out.ivd")
            .says("slices")
    };
    let mut cases = vec![case("as it should be".into(), FINE, png(HEAD, &rows, &[]))];
    for (at, field) in
        ["width", "height", "depth", "colour", "packing", "filter", "interlace"].iter().enumerate()
    {
        let place = if at < 2 { 4 * at + 3 } else { 6 + at };
        for value in [0, 1, 2, 3, 4, 6, 7, 16, 255_u8].into_iter().filter(|v| *v != HEAD[place]) {
            let mut head = HEAD;
            head[place] = value;
            // A smaller picture than there is: what follows is passed over.
            let codes = if at < 2 && (1..HEAD[place]).contains(&value) { EITHER } else { BAD };
            cases.push(case(format!("{field} = {value}"), codes, png(head, &rows, &[])));
        }
    }
    for size in [[0x7f, 0xff, 0xff, 0xff], [0, 1, 0x86, 0xa0], [0x80, 0, 0, 0]] {
        for at in [0, 4] {
            let mut head = HEAD;
            head[at..at + 4].copy_from_slice(&size);
            cases.push(case(format!("a side of {size:?}"), BAD, png(head, &rows, &[])));
        }
    }
    let mut bombed = HEAD;
    bombed[..8].copy_from_slice(&[0, 1, 0x86, 0xa0, 0, 1, 0x86, 0xa0]);
    cases.push(case("100 000 × 100 000 pixels".into(), BAD, png(bombed, &rows, &[])));
    let text = [&b"k\0\0"[..], &good::zlib(&vec![b'a'; 200 << 20])].concat();
    cases.push(case("a bomb of text".into(), EITHER, png(HEAD, &rows, &[chunk(*b"zTXt", &text)])));
    let profile = [&b"k\0\0"[..], &good::zlib(&vec![0; 200 << 20])].concat();
    cases.push(case("a bomb of a profile".into(), EITHER, png(HEAD, &rows, &[chunk(*b"iCCP", &profile)])));
    let whole = png(HEAD, &rows, &[]);
    for at in (0..whole.len() - 12).step_by(2) {
        let mut bytes = whole.clone();
        bytes[at] ^= 4;
        cases.push(case(format!("flipped at {at}"), BAD, bytes));
    }
    for length in (0..whole.len() - 12).step_by(3) {
        cases.push(case(format!("cut to {length}"), BAD, whole[..length].to_vec()));
    }
    let other = png(
        {
            let mut head = HEAD;
            head[3] = 4;
            head
        },
        &good::zlib(&[[0, 1, 2, 3, 4]; 4].concat()),
        &[],
    );
    cases.push(
        Case::new("png slices of two sizes", BAD)
            .file("slices/s1.png", whole)
            .file("slices/s2.png", other)
            .words("import slices -o out.ivd")
            .says("slices"),
    );
    cases
}

pub(crate) fn cases() -> Vec<Case> {
    [tiffs(), pngs()].concat()
}
