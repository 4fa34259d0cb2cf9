use super::Project;

/// The greatest value: maximum intensity projection, or the minimum, where the sign is turned.
pub(crate) struct Greatest;

impl Project for Greatest {
    type Seen = f32;

    fn nothing(&self) -> f32 {
        f32::NEG_INFINITY
    }

    #[inline(always)]
    fn take(&self, greatest: &mut f32, value: Option<f32>, _: f32) {
        if let Some(value) = value {
            *greatest = greatest.max(value);
        }
    }

    #[inline(always)]
    fn is_settled(&self, _: &f32) -> bool {
        false
    }

    #[inline(always)]
    fn passes(&self, greatest: &f32, bound: f32) -> bool {
        bound <= *greatest
    }

    fn shown(&self, greatest: &f32) -> f32 {
        *greatest
    }
}
