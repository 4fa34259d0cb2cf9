/// What a kernel counts.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counts {
    pub(super) changed: u64,
    pub(super) bricks: u64,
}

impl std::iter::Sum for Counts {
    fn sum<I: Iterator<Item = Self>>(counts: I) -> Self {
        counts.fold(Self::default(), |a, b| Self {
            changed: a.changed + b.changed,
            bricks: a.bricks + b.bricks,
        })
    }
}
