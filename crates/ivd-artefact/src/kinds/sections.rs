use std::borrow::Cow;
use std::sync::Arc;

use bytemuck::Pod;
use ivd_core::{Buffer, ByteSource};
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::error::Problem;
use crate::{Element, SectionInfo};

/// A section on its way to a file, its bytes borrowed from the value.
pub(crate) struct SectionBytes<'a> {
    pub(crate) name: Cow<'static, str>,
    pub(crate) element: Element,
    /// Slowest axis first.
    pub(crate) shape: Vec<u64>,
    pub(crate) bytes: Cow<'a, [u8]>,
}

impl<'a> SectionBytes<'a> {
    /// A section over `values`, whose memory holds elements of type `element` in C order of `shape`.
    pub(crate) fn new<T: Pod>(
        name: impl Into<Cow<'static, str>>,
        element: Element,
        shape: Vec<u64>,
        values: &'a [T],
    ) -> Self {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        debug_assert_eq!(shape.iter().product::<u64>() * element.bytes(), bytes.len() as u64);
        Self { name: name.into(), element, shape, bytes: Cow::Borrowed(bytes) }
    }
}

/// Hands the sections of a file to a kind's codec, each checked against what the codec expects.
pub(crate) struct Decoder<'a> {
    content: &'a Value,
    sections: &'a [SectionInfo],
    taken: usize,
    source: Arc<dyn ByteSource>,
}

impl<'a> Decoder<'a> {
    pub(crate) fn new(content: &'a Value, sections: &'a [SectionInfo], source: Arc<dyn ByteSource>) -> Self {
        Self { content, sections, taken: 0, source }
    }

    /// What stands beside the sections.
    pub(crate) fn content<T: DeserializeOwned>(&self) -> Result<T, Problem> {
        T::deserialize(self.content).map_err(|e| Problem::Text(e.to_string()))
    }

    /// A section of known shape. Sections are taken in the order in which they were written.
    pub(crate) fn take<T: Pod>(
        &mut self,
        name: &str,
        element: Element,
        shape: &[u64],
    ) -> Result<Buffer<T>, Problem> {
        let section = self.next(name, element)?;
        if section.shape != shape {
            return Err(format!("section `{name}` has shape {:?}, not {shape:?}", section.shape).into());
        }
        self.buffer(section)
    }

    /// A section of any number of rows, each of shape `row`.
    pub(crate) fn take_rows<T: Pod>(
        &mut self,
        name: &str,
        element: Element,
        row: &[u64],
    ) -> Result<Buffer<T>, Problem> {
        let section = self.next(name, element)?;
        if section.shape.is_empty() || section.shape[1..] != *row {
            return Err(format!("section `{name}` has shape {:?}, not rows of {row:?}", section.shape).into());
        }
        self.buffer(section)
    }

    /// Whether the next section has this name and type.
    pub(crate) fn holds(&self, name: &str, element: Element) -> bool {
        self.sections.get(self.taken).is_some_and(|s| s.name == name && s.element == element)
    }

    /// Checks that no section is left.
    pub(crate) fn finish(&self) -> Result<(), Problem> {
        match self.sections.get(self.taken) {
            Some(section) => Err(format!("section `{}` doesn't belong here", section.name).into()),
            None => Ok(()),
        }
    }

    fn next(&mut self, name: &str, element: Element) -> Result<&'a SectionInfo, Problem> {
        let section = self.sections.get(self.taken).filter(|s| s.name == name);
        let section = section.ok_or_else(|| format!("section `{name}` is missing"))?;
        if section.element != element {
            let found = section.element.name();
            return Err(format!("section `{name}` holds {found}, not {}", element.name()).into());
        }
        self.taken += 1;
        Ok(section)
    }

    fn buffer<T: Pod>(&self, section: &SectionInfo) -> Result<Buffer<T>, Problem> {
        let len = section.length as usize / size_of::<T>();
        let fits = section.length as usize == len * size_of::<T>();
        let buffer =
            fits.then(|| Buffer::shared(self.source.clone(), section.offset as usize, len)).flatten();
        buffer.ok_or_else(|| format!("section `{}` can't be viewed", section.name).into())
    }
}
