/// Which way the first two axes of a file's world run; the third runs to the head in both.
///
/// One is the other turned by 180° about the third axis, so that nothing is mirrored and triangles keep their orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Space {
    /// To the patient's right and front.
    #[default]
    Ras,
    /// To the patient's left and back, as DICOM and ITK have it.
    Lps,
}

impl Space {
    /// `"RAS"` or `"LPS"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ras => "RAS",
            Self::Lps => "LPS",
        }
    }

    /// The space of that name, in either case; else what is wrong with the name.
    pub(crate) fn named(name: &str) -> Result<Self, String> {
        let known =
            [Self::Ras, Self::Lps].into_iter().find(|space| name.trim().eq_ignore_ascii_case(space.name()));
        known.ok_or_else(|| format!("`{}` is neither LPS nor RAS", name.escape_debug()))
    }

    /// What a comment says, as 3D Slicer writes and reads it: `SPACE=LPS` or `SPACE=RAS`, which counts where both stand.
    pub(crate) fn of(comment: &[u8]) -> Option<Self> {
        let says = |what: &[u8]| comment.windows(what.len()).any(|w| w == what);
        if says(b"SPACE=RAS") {
            return Some(Self::Ras);
        }
        says(b"SPACE=LPS").then_some(Self::Lps)
    }

    /// A point or vector of this space in RAS, or one of RAS in this space. 0 − x rather than −x: no negative zeros.
    #[inline]
    pub(crate) fn turn(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Ras => [x, y, z],
            Self::Lps => [0.0 - x, 0.0 - y, z],
        }
    }
}
