use super::{Element, Fault};
use crate::number::Number;
use crate::order::ByteOrder;

/// How a file's binary arrays are encoded.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coding {
    pub(crate) order: ByteOrder,
    /// Type of the words in front of an array: 32 or 64 bits without a sign.
    pub(crate) word: Number,
    /// In zlib blocks; else plain.
    pub(crate) zlib: bool,
}

impl Coding {
    /// What the element `VTKFile` says.
    pub(crate) fn of(file: &Element) -> Result<Self, Fault> {
        let order = match file.get("byte_order")?.as_deref() {
            None | Some("LittleEndian") => ByteOrder::Little,
            Some("BigEndian") => ByteOrder::Big,
            Some(other) => return Err(Fault::ByteOrder(other.to_owned())),
        };
        let word = match file.get("header_type")?.as_deref() {
            None | Some("UInt32") => Number::U32,
            Some("UInt64") => Number::U64,
            Some(other) => return Err(Fault::HeaderType(other.to_owned())),
        };
        let zlib = match file.get("compressor")?.as_deref() {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => return Err(Fault::Compressor(other.to_owned())),
        };
        Ok(Self { order, word, zlib })
    }
}

/// Checks that the element `VTKFile` says that the file holds data of type `wanted`.
pub(crate) fn check_type(file: &Element, wanted: &str) -> Result<(), Fault> {
    let found = file.get("type")?;
    if found.as_deref() == Some(wanted) { Ok(()) } else { Err(Fault::Type(found)) }
}
