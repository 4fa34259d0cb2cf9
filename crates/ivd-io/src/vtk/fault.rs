use quick_xml::events::attributes::AttrError;

use super::Broken;

/// What is wrong with a file of VTK's. Values are as the file has them.
#[derive(Debug)]
pub(crate) enum Fault {
    /// Its XML, at this byte.
    Xml { at: usize, problem: quick_xml::Error },
    /// Too many elements inside each other, before this byte.
    Deep { at: usize },
    /// An element's attributes.
    Attributes { element: String, problem: AttrError },
    /// An attribute's value is so long that it can't be a name or a number.
    Long { element: String, key: &'static str, bytes: usize },
    /// `AppendedData`, which begins at this byte of a file of `length`.
    Appended { at: usize, broken: Broken, length: usize },
    /// `VTKFile` is of no type, or of another one.
    Type(Option<String>),
    /// A byte order that there isn't.
    ByteOrder(String),
    /// A type of the words in front of an array that there isn't.
    HeaderType(String),
    /// A compressor that isn't read.
    Compressor(String),
    /// An array's format that there isn't.
    Format(String),
    /// An appended array says no offset.
    NoOffset,
    /// One that is no number.
    Offset(String),
    /// An appended array in a file without `AppendedData`.
    NoAppended,
    /// One that begins behind the end of the appended data.
    Beyond { offset: u64, length: usize },
}
