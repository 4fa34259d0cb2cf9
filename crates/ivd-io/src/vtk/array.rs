use ivd_core::VoxelType;

use super::{Appended, Element, Fault};
use crate::number::Number;

/// Where an array's numbers are.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Content<'a> {
    /// Numbers as text.
    Ascii(&'a [u8]),
    /// Base64, between the tags or appended; what follows the array as well.
    Base64(&'a [u8]),
    /// Bytes as they are, and what follows the array.
    Raw(&'a [u8]),
}

impl<'a> Content<'a> {
    /// What the array's tag says. [`Content::between`] adds the text between its tags.
    pub(crate) fn of(array: &Element, appended: Option<Appended<'a>>) -> Result<Self, Fault> {
        match array.get("format")?.as_deref() {
            None | Some("ascii") => Ok(Self::Ascii(&[])),
            Some("binary") => Ok(Self::Base64(&[])),
            Some("appended") => {
                let offset = array.get("offset")?.ok_or(Fault::NoOffset)?;
                let offset: u64 = offset.parse().map_err(|_| Fault::Offset(offset))?;
                let appended = appended.ok_or(Fault::NoAppended)?;
                let rest = usize::try_from(offset).ok().and_then(|offset| appended.bytes.get(offset..));
                let rest = rest.ok_or(Fault::Beyond { offset, length: appended.bytes.len() })?;
                Ok(if appended.raw { Self::Raw(rest) } else { Self::Base64(rest) })
            }
            Some(other) => Err(Fault::Format(other.to_owned())),
        }
    }

    /// The same with the text between the array's tags, where its numbers stand there.
    pub(crate) fn between(self, text: &'a [u8]) -> Self {
        match self {
            Self::Ascii([]) => Self::Ascii(text),
            Self::Base64([]) => Self::Base64(text),
            appended => appended,
        }
    }
}

/// VTK's names of types, and which voxels have them.
const TYPES: [(&str, Number, Option<VoxelType>); 10] = [
    ("Int8", Number::I8, Some(VoxelType::I8)),
    ("UInt8", Number::U8, Some(VoxelType::U8)),
    ("Int16", Number::I16, Some(VoxelType::I16)),
    ("UInt16", Number::U16, Some(VoxelType::U16)),
    ("Int32", Number::I32, Some(VoxelType::I32)),
    ("UInt32", Number::U32, Some(VoxelType::U32)),
    ("Int64", Number::I64, None),
    ("UInt64", Number::U64, None),
    ("Float32", Number::F32, Some(VoxelType::F32)),
    ("Float64", Number::F64, Some(VoxelType::F64)),
];

/// The type of that name.
pub(crate) fn number(name: &str) -> Option<Number> {
    TYPES.iter().find(|t| t.0 == name).map(|t| t.1)
}

/// The voxels of that name; `None` where there are no such voxels.
pub(crate) fn voxel_type(name: &str) -> Option<VoxelType> {
    TYPES.iter().find(|t| t.0 == name).and_then(|t| t.2)
}

/// The name of a voxel's type.
pub(crate) fn type_name(voxel_type: VoxelType) -> &'static str {
    let named = TYPES.iter().find(|t| t.2 == Some(voxel_type));
    named.expect("every type of voxel has a name").0
}

/// Text as a string array has it: a list of character codes that ends in 0.
pub(crate) fn codes(text: &str) -> String {
    text.bytes().chain([0]).map(|code| code.to_string()).collect::<Vec<_>>().join(" ")
}

/// The text of such a list, up to its first 0; what is no code stands as `?`.
pub(crate) fn text_of_codes(list: &[u8]) -> String {
    let codes = list.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let code = |word: &[u8]| std::str::from_utf8(word).ok()?.parse::<u8>().ok();
    codes.map(|word| code(word).unwrap_or(b'?')).take_while(|&c| c != 0).map(char::from).collect()
}
