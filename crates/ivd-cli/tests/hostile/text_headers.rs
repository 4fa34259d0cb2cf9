//! NRRD and MetaImage: every field of the header missing, given twice, and set to what it must not be.

use crate::hostile::case::{BAD, Case, EITHER, FINE};
use crate::hostile::good;

/// What no field of numbers or names means.
const NASTY: [&str; 14] = [
    "",
    "0",
    "-1",
    "elephant",
    "nan",
    "inf",
    "1e308",
    "99999999999999999999",
    "5 4",
    "5 4 0",
    "5 4 -3",
    "5 4 9999999999",
    "4294967296 4294967296 4294967296",
    "(nan,0,0) (0,1,0) (0,0,1)",
];

/// A field's name, its good value, whether it must be there, and the nasty values that the format allows after all.
type Field = (&'static str, &'static str, bool, Vec<(&'static str, &'static [i32])>);

/// A format's header: how its lines look, and what its fields allow.
struct Format {
    ending: &'static str,
    separator: &'static str,
    fields: Vec<Field>,
    /// What comes before the fields.
    first: &'static str,
    /// What comes between fields and voxels.
    last: &'static str,
    /// Line that names the voxels' own file.
    detached: &'static str,
}

impl Format {
    fn header(&self, change: impl Fn(&str, &str) -> Vec<String>) -> String {
        let mut text = self.first.to_owned();
        for (name, value, _, _) in &self.fields {
            for value in change(name, value) {
                text += &format!("{name}{}{value}\n", self.separator);
            }
        }
        text
    }

    /// The header with its voxels behind it, and with its voxels in a file of their own.
    fn files(&self, name: &str, codes: &'static [i32], header: &str, voxels: &[u8]) -> [Case; 2] {
        let attached = [header.as_bytes(), self.last.as_bytes(), voxels].concat();
        [
            Case::new(format!("{} {name}", self.ending), codes)
                .file(&format!("a.{}", self.ending), attached)
                .import(),
            Case::new(format!("{} detached {name}", self.ending), codes)
                .file("b.hdr.txt", format!("{header}{}", self.detached))
                .file("b.raw", voxels)
                .import(),
        ]
    }

    fn cases(&self) -> Vec<Case> {
        let voxels: Vec<u8> = (0..120).collect();
        let same = |_: &str, value: &str| vec![value.to_owned()];
        let mut cases = self.files("as it should be", FINE, &self.header(same), &voxels).to_vec();
        for (field, good, needed, allowed) in &self.fields {
            let with = |values: Vec<String>| {
                self.header(
                    |name, value| if name == *field { values.clone() } else { vec![value.to_owned()] },
                )
            };
            for nasty in NASTY.iter().filter(|nasty| *nasty != good) {
                let codes = allowed.iter().find(|a| a.0 == *nasty).map_or(BAD, |a| a.1);
                let name = format!("{field} = {nasty}");
                cases.extend(self.files(&name, codes, &with(vec![(*nasty).to_owned()]), &voxels));
            }
            let codes = if *needed { BAD } else { FINE };
            cases.extend(self.files(&format!("without {field}"), codes, &with(vec![]), &voxels));
            let twice = with(vec![(*good).to_owned(), (*good).to_owned()]);
            cases.extend(self.files(&format!("{field} twice"), BAD, &twice, &voxels));
        }
        let good = self.header(same);
        for (name, text) in [
            ("a line without a field", format!("{good}what is this\n")),
            ("a very long line", format!("{good}comment{}{}\n", self.separator, "x".repeat(3 << 20))),
        ] {
            cases.extend(self.files(name, BAD, &text, &voxels));
        }
        // Half a megabyte of a header is much, and no lie.
        let many: String = (0..40_000).map(|i| format!("field{i}{}1\n", self.separator)).collect();
        cases.extend(self.files("very many fields", FINE, &format!("{good}{many}"), &voxels));
        cases
    }
}

pub(crate) fn nrrd() -> Vec<Case> {
    let directions = "(0.5,0,0) (0,0.75,0) (0,0,2)";
    let format = Format {
        ending: "nrrd",
        separator: ": ",
        first: "NRRD0004\n",
        fields: vec![
            ("type", "int16", true, vec![]),
            ("dimension", "3", true, vec![]),
            ("sizes", "5 4 3", true, vec![]),
            ("endian", "little", true, vec![]),
            ("encoding", "raw", true, vec![]),
            ("space", "left-posterior-superior", false, vec![]),
            ("space directions", directions, false, vec![("", BAD)]),
            ("space origin", "(1,2,3)", false, vec![]),
            (
                "kinds",
                "domain domain domain",
                false,
                vec![
                    ("", FINE),
                    ("5 4 0", EITHER),
                    ("5 4 -3", EITHER),
                    ("5 4 9999999999", EITHER),
                    ("4294967296 4294967296 4294967296", EITHER),
                    ("(nan,0,0) (0,1,0) (0,0,1)", EITHER),
                ],
            ),
            ("line skip", "0", false, vec![]),
            ("byte skip", "0", false, vec![("-1", FINE)]),
        ],
        last: "\n",
        detached: "data file: b.raw\n",
    };
    let mut cases = format.cases();
    // Without directions an origin has no meaning.
    cases.retain(|case| !case.name.contains("without space directions"));
    cases.extend(packed("encoding: gzip", &good::gzip(&(0..120).collect::<Vec<u8>>())));
    cases
}

/// A deflated stream damaged at every part.
fn packed(encoding: &str, packed: &[u8]) -> Vec<Case> {
    let header = format!("NRRD0004\ntype: int16\ndimension: 3\nsizes: 5 4 3\nendian: little\n{encoding}\n\n");
    let case = |name: String, codes, data: &[u8]| {
        Case::new(format!("nrrd {encoding} {name}"), codes)
            .file("a.nrrd", [header.as_bytes(), data].concat())
            .import()
    };
    let mut cases = vec![case("as it should be".into(), FINE, packed)];
    for at in (10..packed.len()).step_by(4) {
        let mut bytes = packed.to_vec();
        bytes[at] ^= 0x10;
        cases.push(case(format!("flipped at {at}"), BAD, &bytes));
        cases.push(case(format!("cut to {at}"), BAD, &packed[..at]));
    }
    cases
}

pub(crate) fn metaimage() -> Vec<Case> {
    let flag: Vec<(&str, &[i32])> = vec![("0", FINE)];
    let format = Format {
        ending: "mha",
        separator: " = ",
        first: "",
        fields: vec![
            ("ObjectType", "Image", false, NASTY.iter().map(|n| (*n, EITHER)).collect()),
            ("NDims", "3", true, vec![]),
            ("BinaryData", "True", false, vec![("0", EITHER), ("1e308", EITHER)]),
            ("BinaryDataByteOrderMSB", "False", false, [&flag[..], &[("1e308", EITHER)]].concat()),
            ("CompressedData", "False", false, [&flag[..], &[("1e308", EITHER)]].concat()),
            ("TransformMatrix", "1 0 0 0 1 0 0 0 1", false, vec![]),
            (
                "Offset",
                "1 2 3",
                false,
                vec![
                    ("5 4 0", FINE),
                    ("5 4 -3", FINE),
                    ("5 4 9999999999", FINE),
                    ("4294967296 4294967296 4294967296", FINE),
                ],
            ),
            (
                "ElementSpacing",
                "0.5 0.75 2",
                false,
                vec![("5 4 9999999999", EITHER), ("4294967296 4294967296 4294967296", EITHER)],
            ),
            ("DimSize", "5 4 3", true, vec![]),
            ("ElementNumberOfChannels", "1", false, vec![]),
            ("HeaderSize", "0", false, vec![("-1", FINE)]),
            ("ElementType", "MET_SHORT", true, vec![]),
        ],
        last: "ElementDataFile = LOCAL\n",
        detached: "ElementDataFile = b.raw\n",
    };
    let mut cases = format.cases();
    // A file that begins with another field isn't told from any text, unless its name says so; this one's name doesn't.
    cases.retain(|case| !(case.name.contains("detached") && case.name.contains("ObjectType")));
    cases
}
