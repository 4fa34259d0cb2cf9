//! NIfTI-1 and -2, in one file, packed, and as a pair: every field set to what it must not, or may, be.

use crate::hostile::case::{BAD, Case, EITHER, FINE};
use crate::hostile::good;

/// How a field is stored.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    I16,
    I32,
    I64,
    F32,
    F64,
}
use Kind::{F32, F64, I16, I32, I64};

impl Kind {
    fn bytes(self, value: f64) -> Vec<u8> {
        match self {
            I16 => (value as i16).to_le_bytes().to_vec(),
            I32 => (value as i32).to_le_bytes().to_vec(),
            I64 => (value as i64).to_le_bytes().to_vec(),
            F32 => (value as f32).to_le_bytes().to_vec(),
            F64 => value.to_le_bytes().to_vec(),
        }
    }
}

/// What a field's value must lead to.
#[derive(Clone, Copy)]
enum Rule {
    /// The header's size, the magic, the type: one value alone is right.
    Only,
    /// The rank: 1 to 7.
    Rank,
    /// A size within the rank.
    Size,
    /// A place in the file, from the header's end on.
    Offset,
    /// Bits of a voxel: 0 says nothing.
    Bits,
    /// Part of the transform in use.
    Transform,
    /// A slope: 0 and what isn't finite say that there is none.
    Slope,
    /// An intercept beside a slope.
    Intercept,
    /// Not looked at: the transform that isn't in use, sizes beyond the rank.
    Unread,
}

/// Values that a field of integers is set to.
const INTEGERS: [f64; 7] = [0.0, -1.0, 8.0, 1e4, -32768.0, 1e15, -1e18];
/// Values that a field of floating point is set to.
const REALS: [f64; 7] = [0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 5e-324];

fn codes(rule: Rule, kind: Kind, value: f64) -> &'static [i32] {
    // What the field really holds once the value is stored in it.
    let held = match kind {
        I16 => f64::from(value as i16),
        I32 => f64::from(value as i32),
        F32 => f64::from(value as f32),
        _ => value,
    };
    match rule {
        Rule::Only | Rule::Size => BAD,
        Rule::Rank => BAD,
        Rule::Offset if held == 0.0 => FINE,
        Rule::Offset => BAD,
        Rule::Bits if held == 0.0 => FINE,
        Rule::Bits => BAD,
        Rule::Transform if !held.is_finite() => BAD,
        Rule::Transform => EITHER,
        Rule::Slope if held == 0.0 || !held.is_finite() => FINE,
        Rule::Slope => EITHER,
        Rule::Intercept if !held.is_finite() => BAD,
        Rule::Intercept => EITHER,
        Rule::Unread => FINE,
    }
}

/// Name, place, type and rule of every field that is read, and of some that aren't.
fn fields(version: u8) -> Vec<(String, usize, Kind, Rule)> {
    let one = version == 1;
    let pick = |a: usize, b: usize| if one { a } else { b };
    let (size, real) = if one { (I16, F32) } else { (I64, F64) };
    let (width, step) = if one { (2, 4) } else { (8, 8) };
    let code = if one { I16 } else { I32 };
    let mut fields = vec![
        ("sizeof_hdr".into(), 0, I32, Rule::Only),
        ("datatype".into(), pick(70, 12), I16, Rule::Only),
        ("bitpix".into(), pick(72, 14), I16, Rule::Bits),
        ("vox_offset".into(), pick(108, 168), if one { F32 } else { I64 }, Rule::Offset),
        ("scl_slope".into(), pick(112, 176), real, Rule::Slope),
        ("scl_inter".into(), pick(116, 184), real, Rule::Intercept),
        ("sform_code".into(), pick(254, 348), code, Rule::Slope),
        ("dim[0]".into(), pick(40, 16), size, Rule::Rank),
    ];
    for a in 1..8 {
        let rule = if a < 4 { Rule::Size } else { Rule::Unread };
        fields.push((format!("dim[{a}]"), pick(40, 16) + a * width, size, rule));
        fields.push((format!("pixdim[{a}]"), pick(76, 104) + a * step, real, Rule::Unread));
    }
    for a in 0..3 {
        fields.push((format!("quatern[{a}]"), pick(256, 352) + a * step, real, Rule::Unread));
        fields.push((format!("qoffset[{a}]"), pick(268, 376) + a * step, real, Rule::Unread));
    }
    for a in 0..12 {
        fields.push((format!("srow[{a}]"), pick(280, 400) + a * step, real, Rule::Transform));
    }
    fields
}

/// A good file of a version: the affine in use is the sform, slope 2 and intercept 3 are set.
fn good_file(version: u8) -> Vec<u8> {
    let mut one = good::file("nii");
    assert_eq!(one[..4], 348_i32.to_le_bytes());
    one[252..254].copy_from_slice(&0_i16.to_le_bytes());
    one[112..116].copy_from_slice(&2_f32.to_le_bytes());
    one[116..120].copy_from_slice(&3_f32.to_le_bytes());
    if version == 1 {
        return one;
    }
    let real = |at: usize| f64::from(f32::from_le_bytes(one[at..at + 4].try_into().unwrap()));
    let mut two = vec![0; 544];
    two[..4].copy_from_slice(&540_i32.to_le_bytes());
    two[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
    two[12..16].copy_from_slice(&one[70..74]);
    for a in 0..8 {
        let size = i16::from_le_bytes(one[40 + 2 * a..42 + 2 * a].try_into().unwrap());
        two[16 + 8 * a..24 + 8 * a].copy_from_slice(&i64::from(size).to_le_bytes());
        two[104 + 8 * a..112 + 8 * a].copy_from_slice(&real(76 + 4 * a).to_le_bytes());
    }
    two[168..176].copy_from_slice(&544_i64.to_le_bytes());
    two[176..184].copy_from_slice(&2_f64.to_le_bytes());
    two[184..192].copy_from_slice(&3_f64.to_le_bytes());
    two[348..352].copy_from_slice(&1_i32.to_le_bytes());
    for a in 0..12 {
        two[400 + 8 * a..408 + 8 * a].copy_from_slice(&real(280 + 4 * a).to_le_bytes());
    }
    two[500..504].copy_from_slice(&2_i32.to_le_bytes());
    two.extend(&one[352..]);
    two
}

/// The ways in which the same bytes come.
fn cases_of(name: &str, codes: &'static [i32], version: u8, bytes: &[u8]) -> Vec<Case> {
    let header = if version == 1 { 352 } else { 544 };
    let mut pair = bytes[..header].to_vec();
    // A pair says so in its magic, and its voxels begin at 0.
    let magic = if version == 1 { 344 } else { 4 };
    if pair[magic..magic + 2] == *b"n+" {
        pair[magic + 1] = b'i';
    }
    let mut cases = vec![
        Case::new(format!("nii-{version} {name}"), codes).file("a.nii", bytes).import(),
        Case::new(format!("nii.gz-{version} {name}"), codes).file("a.nii.gz", good::gzip(bytes)).import(),
    ];
    if !name.starts_with("vox_offset") {
        let at = if version == 1 { 108..112 } else { 168..176 };
        pair[at].fill(0);
        let pair = Case::new(format!("hdr-{version} {name}"), codes).file("a.hdr", pair);
        cases.push(pair.file("a.img", &bytes[header..]).import());
    }
    cases
}

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for version in [1, 2] {
        let good = good_file(version);
        cases.extend(cases_of("as it should be", FINE, version, &good));
        for (name, at, kind, rule) in fields(version) {
            let values = if matches!(kind, F32 | F64) { REALS } else { INTEGERS };
            for value in values {
                let mut bytes = good.clone();
                let field = kind.bytes(value);
                bytes[at..at + field.len()].copy_from_slice(&field);
                let codes = codes(rule, kind, value);
                cases.extend(cases_of(&format!("{name} = {value}"), codes, version, &bytes));
            }
        }
        let magic = if version == 1 { 344..348 } else { 4..12 };
        for at in magic {
            let mut bytes = good.clone();
            bytes[at] ^= 0x20;
            cases.push(Case::new(format!("nii-{version} magic {at}"), BAD).file("a.nii", bytes).import());
        }
    }
    cases
}
