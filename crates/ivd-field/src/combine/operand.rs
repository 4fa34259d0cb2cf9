use ivd_core::Displacement;

/// One of the things that are combined.
#[derive(Debug)]
pub struct Operand<'a, V> {
    /// The value.
    pub value: &'a V,
    /// What it is read through, where it is still at rest; on the value's grid.
    pub displacement: Option<&'a Displacement>,
}

impl<V> Clone for Operand<'_, V> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<V> Copy for Operand<'_, V> {}

impl<'a, V> From<&'a V> for Operand<'a, V> {
    fn from(value: &'a V) -> Self {
        Self { value, displacement: None }
    }
}
