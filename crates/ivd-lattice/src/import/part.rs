/// A part that edges of two triangles hold together.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) triangles: Vec<u32>,
    pub(super) closed: bool,
}
