use std::collections::HashMap;

use quick_xml::Reader;
use quick_xml::events::attributes::AttrError;
use quick_xml::events::{BytesStart, Event};

use super::appended::split;
use super::{Appended, Fault};

/// Most elements inside each other.
pub(crate) const DEEPEST: usize = 64;
/// Bytes of an attribute's value at most: names and numbers are shorter.
const LONGEST: usize = 1024;

/// The elements of a file's XML, and its appended data where there are some.
///
/// # Errors
/// [`Fault::Appended`].
pub(crate) fn open(bytes: &[u8]) -> Result<(Elements<'_>, Option<Appended<'_>>), Fault> {
    let length = bytes.len();
    // The reader would pass over a mark of the encoding without counting it.
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let (xml, appended) = split(bytes).map_err(|(at, broken)| Fault::Appended { at, broken, length })?;
    Ok((Elements { xml, reader: Reader::from_reader(xml), open: Vec::new() }, appended))
}

/// Elements in the order of their tags.
pub(crate) struct Elements<'a> {
    xml: &'a [u8],
    reader: Reader<&'a [u8]>,
    /// Those whose ends are still to come, the outermost first.
    open: Vec<BytesStart<'a>>,
}

/// What comes next in the XML.
enum Step<'a> {
    Start(Element<'a>),
    Text(&'a [u8]),
    End,
    /// A comment or another thing without meaning here.
    Other,
    Eof,
}

/// An element's tag.
pub(crate) struct Element<'a> {
    start: BytesStart<'a>,
    parent: Option<BytesStart<'a>>,
    /// Without anything inside, and without an end tag.
    empty: bool,
}

/// What stands between an element's tags.
pub(crate) struct Text<'a> {
    pub(crate) bytes: &'a [u8],
    /// Whether the element ends before the file does.
    pub(crate) closed: bool,
}

impl<'a> Elements<'a> {
    /// The next element; `None` at the end.
    pub(crate) fn read(&mut self) -> Result<Option<Element<'a>>, Fault> {
        loop {
            match self.step()? {
                Step::Start(element) => return Ok(Some(element)),
                Step::Eof => return Ok(None),
                Step::Text(_) | Step::End | Step::Other => {}
            }
        }
    }

    /// The byte behind what was read.
    pub(crate) fn at(&self) -> usize {
        self.reader.buffer_position() as usize
    }

    /// Passes over the element that came last and what is inside it, and gives the first text between its own tags that isn't white space
    /// alone.
    pub(crate) fn text(&mut self, element: &Element) -> Result<Text<'a>, Fault> {
        let mut text = Text { bytes: &[], closed: true };
        if element.empty {
            return Ok(text);
        }
        let depth = self.open.len();
        loop {
            match self.step()? {
                Step::End if self.open.len() < depth => return Ok(text),
                Step::Text(part)
                    if self.open.len() == depth && text.bytes.is_empty() && !part.trim_ascii().is_empty() =>
                {
                    text.bytes = part;
                }
                Step::Eof => {
                    text.closed = false;
                    return Ok(text);
                }
                _ => {}
            }
        }
    }

    fn step(&mut self) -> Result<Step<'a>, Fault> {
        let before = self.at();
        let event = self.reader.read_event();
        let event =
            event.map_err(|problem| Fault::Xml { at: self.reader.error_position() as usize, problem })?;
        let after = self.at();
        Ok(match event {
            Event::Start(start) => {
                let parent = self.open.last().cloned();
                self.open.push(start.clone());
                if self.open.len() > DEEPEST {
                    return Err(Fault::Deep { at: after });
                }
                Step::Start(Element { start, parent, empty: false })
            }
            Event::Empty(start) => {
                Step::Start(Element { start, parent: self.open.last().cloned(), empty: true })
            }
            Event::End(_) => {
                self.open.pop();
                Step::End
            }
            Event::Text(_) => Step::Text(self.xml.get(before..after).unwrap_or_default()),
            Event::Eof => Step::Eof,
            _ => Step::Other,
        })
    }
}

impl Element<'_> {
    pub(crate) fn name(&self) -> &[u8] {
        self.start.name().into_inner()
    }

    /// Name of the element around it; empty where there is none.
    pub(crate) fn parent(&self) -> &[u8] {
        self.parent.as_ref().map_or(&[], |parent| parent.name().into_inner())
    }

    /// The name as text.
    fn shown(&self) -> String {
        String::from_utf8_lossy(self.name()).into_owned()
    }

    /// An attribute's value without the white space around it. Attributes behind it aren't looked at.
    pub(crate) fn get(&self, key: &'static str) -> Result<Option<String>, Fault> {
        for attribute in self.start.attributes().with_checks(false) {
            let attribute =
                attribute.map_err(|problem| Fault::Attributes { element: self.shown(), problem })?;
            if attribute.key.as_ref() == key.as_bytes() {
                let bytes = attribute.value.len();
                if bytes > LONGEST {
                    return Err(Fault::Long { element: self.shown(), key, bytes });
                }
                return Ok(Some(String::from_utf8_lossy(&attribute.value).trim().to_owned()));
            }
        }
        Ok(None)
    }

    /// Refuses attributes that are malformed or given twice. In time linear in their number: the XML reader's own search takes the square.
    pub(crate) fn check(&self) -> Result<(), Fault> {
        let fault = |problem| Fault::Attributes { element: self.shown(), problem };
        let mut seen = HashMap::new();
        for attribute in self.start.attributes().with_checks(false) {
            let key = attribute.map_err(fault)?.key.into_inner();
            let at = key.as_ptr() as usize - self.start.as_ptr() as usize;
            if let Some(before) = seen.insert(key, at) {
                return Err(fault(AttrError::Duplicated(at, before)));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of the elements with their parents' and what `DataArray`s hold, or what is wrong.
    fn told(xml: &[u8]) -> Result<Vec<String>, Fault> {
        let (mut elements, _) = open(xml)?;
        let mut told = Vec::new();
        while let Some(element) = elements.read()? {
            let [parent, name] = [element.parent(), element.name()].map(String::from_utf8_lossy);
            told.push(format!("{parent}/{name}"));
            if element.name() == b"DataArray" {
                let text = elements.text(&element)?;
                told.push(format!("{} {}", String::from_utf8_lossy(text.bytes), text.closed));
            }
        }
        Ok(told)
    }

    #[test]
    fn elements_come_with_their_parents_and_an_array_with_its_first_text() {
        let xml = b"\xEF\xBB\xBF<a><b/> <DataArray>\n<key>no</key> 1 2<!-- -->3</DataArray><c></c></a>";
        assert_eq!(told(xml).unwrap(), ["/a", "a/b", "a/DataArray", " 1 2 true", "a/c"]);
        assert_eq!(told(b"<DataArray/><a/>").unwrap(), ["/DataArray", " true", "/a"]);
        assert_eq!(told(b"<DataArray>7").unwrap(), ["/DataArray", "7 false"]);
    }

    #[test]
    fn elements_deeper_than_any_are_refused_inside_an_array_too() {
        assert_eq!(told(&b"<a>".repeat(DEEPEST)).unwrap().len(), DEEPEST);
        assert!(matches!(told(&b"<a>".repeat(DEEPEST + 1)), Err(Fault::Deep { at: 195 })));
        let inside = [&b"<DataArray>"[..], &b"<a>".repeat(DEEPEST)].concat();
        assert!(matches!(told(&inside), Err(Fault::Deep { at: 203 })));
        assert!(matches!(told(b"<a></b>"), Err(Fault::Xml { .. })));
    }

    #[test]
    fn attributes_are_trimmed_and_long_twofold_or_malformed_ones_refused() {
        let first = |xml: &'static str| open(xml.as_bytes()).unwrap().0.read().unwrap().unwrap();
        assert_eq!(first("<a x=' 1 ' x='2' y/>").get("x").unwrap().unwrap(), "1");
        assert!(first("<a x='1'/>").get("y").unwrap().is_none());
        assert!(matches!(first("<a x y='1'/>").get("y"), Err(Fault::Attributes { .. })));
        let long = format!("<a x='{}'/>", "1".repeat(LONGEST + 1));
        let (mut elements, _) = open(long.as_bytes()).unwrap();
        let element = elements.read().unwrap().unwrap();
        assert!(element.check().is_ok());
        assert!(matches!(element.get("x"), Err(Fault::Long { key: "x", bytes: 1025, .. })));
    }

    #[test]
    fn what_is_said_of_attributes_given_twice_is_what_the_xml_reader_says() {
        for xml in ["<a x='1' yy='2' yy='3'/>", "<a  x='1'\n x='2' y/>", "<a x='1' y/>", "<a x=1/>"] {
            let (mut elements, _) = open(xml.as_bytes()).unwrap();
            let element = elements.read().unwrap().unwrap();
            let said = element.start.attributes().find_map(Result::err).unwrap();
            let Err(Fault::Attributes { problem, .. }) = element.check() else { panic!("{xml}") };
            assert_eq!(problem, said, "{xml}");
        }
    }
}
