use ivd_core::BrickRange;

use crate::samples::Top;

/// The places of a table along values: which value lies where, and up to where all are clear.
pub(crate) struct ValueAxis {
    low: f32,
    scale: f32,
    top: Top,
    clear_up_to: i32,
}

impl ValueAxis {
    /// So many places, two at least, over a range of fast values.
    pub(crate) fn new([low, high]: [f32; 2], places: usize) -> Self {
        let width = f64::from(high) - f64::from(low);
        let last = (places - 1) as f64;
        let scale = if width > 0.0 { (last / width) as f32 } else { 0.0 };
        Self { low, scale, top: Top::new(last as f32), clear_up_to: -1 }
    }

    /// The same, where `occupied` says how many places before each one aren't clear.
    pub(crate) fn with_clear(self, occupied: &[u32]) -> Self {
        let clear = occupied[1..].partition_point(|&count| count == 0);
        Self { clear_up_to: clear as i32 - 1, ..self }
    }

    /// The nearest place of a finite fast value.
    #[inline(always)]
    pub(crate) fn index(&self, value: f32) -> usize {
        self.top.whole((value - self.low) * self.scale + 0.5)
    }

    /// The places of every value of a brick, half open, widened by one on both sides, more than the rounding of an interpolated value can leave
    /// them; `None` where the brick has no data.
    pub(crate) fn places(&self, range: BrickRange, shift: f64) -> Option<[usize; 2]> {
        let fast = |stored: f32| (f64::from(stored) - shift) as f32;
        let end = self.top.number() as usize + 1;
        (range.min <= range.max).then(|| {
            [self.index(fast(range.min)).saturating_sub(1), (self.index(fast(range.max)) + 2).min(end)]
        })
    }

    /// What turns a fast value into a place, `(value - low) · scale + 0.5` in `0 ..= top`: low, scale, top.
    pub(crate) fn numbers(&self) -> [f32; 3] {
        [self.low, self.scale, self.top.number()]
    }

    /// The last place that is clear with all below it; −1 where the first isn't.
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn clear_up_to(&self) -> i32 {
        self.clear_up_to
    }
}
