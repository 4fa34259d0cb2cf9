//! Numbers side by side, one operation on all of them: in the processor's wide registers, or plainly where it has none.
//!
//! What is written for a trait here is compiled twice, and gives the same bytes: every operation is one of IEEE 754, rounded by itself.
//!
//! The argument for the `unsafe` blocks: a value of a wide type exists only where the processor has AVX2, as whoever makes the first of
//! them promises; every other is made of one.

/// Four `f64`.
pub(crate) trait Four: Copy {
    /// # Safety
    ///
    /// The processor has what the type needs.
    #[allow(unsafe_code, reason = "argued in the module's head")]
    unsafe fn load(from: &[f64; 4]) -> Self;
    fn store(self) -> [f64; 4];
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, factor: f64) -> Self;

    /// `self + other · factor`.
    #[inline(always)]
    fn along(self, other: Self, factor: f64) -> Self {
        self.plus(other.times(factor))
    }
}

/// Eight `f32`.
pub(crate) trait Eight: Copy {
    /// # Safety
    ///
    /// The processor has what the type needs.
    #[allow(unsafe_code, reason = "argued in the module's head")]
    unsafe fn load(from: &[f32; 8]) -> Self;
    fn store(self) -> [f32; 8];
    /// Eight times the same.
    fn all(self, value: f32) -> Self;
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    /// The smaller of two; `other` where one isn't a number.
    fn least(self, other: Self) -> Self;
    /// The larger of two; `other` where one isn't a number.
    fn most(self, other: Self) -> Self;
    fn size(self) -> Self;
}

/// Methods of two plain lanes, each number with its own.
macro_rules! plainly {
    ($($method:ident: |$a:ident, $b:ident| $op:expr),* $(,)?) => {$(
        #[inline(always)]
        fn $method(self, other: Self) -> Self {
            let mut out = self;
            for (x, y) in out.iter_mut().zip(other) {
                let ($a, $b) = (*x, y);
                *x = $op;
            }
            out
        }
    )*};
}

impl Four for [f64; 4] {
    #[inline(always)]
    #[allow(unsafe_code, reason = "needs nothing")]
    unsafe fn load(from: &[f64; 4]) -> Self {
        *from
    }
    #[inline(always)]
    fn store(self) -> [f64; 4] {
        self
    }
    plainly! { plus: |a, b| a + b, minus: |a, b| a - b }

    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        let mut out = self;
        for x in &mut out {
            *x *= factor;
        }
        out
    }
}

impl Eight for [f32; 8] {
    #[inline(always)]
    #[allow(unsafe_code, reason = "needs nothing")]
    unsafe fn load(from: &[f32; 8]) -> Self {
        *from
    }
    #[inline(always)]
    fn store(self) -> [f32; 8] {
        self
    }
    #[inline(always)]
    fn all(self, value: f32) -> Self {
        [value; 8]
    }
    plainly! {
        plus: |a, b| a + b,
        minus: |a, b| a - b,
        times: |a, b| a * b,
        least: |a, b| if a < b { a } else { b },
        most: |a, b| if a > b { a } else { b },
    }

    #[inline(always)]
    fn size(self) -> Self {
        let mut out = self;
        for x in &mut out {
            *x = x.abs();
        }
        out
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "argued in the module's head")]
mod avx2 {
    use std::arch::x86_64 as x86;

    use super::{Eight, Four};

    /// Four in a register.
    #[derive(Clone, Copy)]
    pub(crate) struct WideFour(x86::__m256d);

    /// Eight in a register.
    #[derive(Clone, Copy)]
    pub(crate) struct WideEight(x86::__m256);

    /// Methods of two registers, each by one instruction.
    macro_rules! of_two {
        ($($method:ident: $instruction:ident),* $(,)?) => {$(
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: there is AVX2, as there is a value.
                Self(unsafe { x86::$instruction(self.0, other.0) })
            }
        )*};
    }

    impl Four for WideFour {
        #[inline(always)]
        unsafe fn load(from: &[f64; 4]) -> Self {
            // SAFETY: the caller's; four numbers are there.
            Self(unsafe { x86::_mm256_loadu_pd(from.as_ptr()) })
        }
        #[inline(always)]
        fn store(self) -> [f64; 4] {
            let mut out = [0.0; 4];
            // SAFETY: there is AVX2, as there is a value; room for four.
            unsafe { x86::_mm256_storeu_pd(out.as_mut_ptr(), self.0) };
            out
        }
        of_two! { plus: _mm256_add_pd, minus: _mm256_sub_pd }

        #[inline(always)]
        fn times(self, factor: f64) -> Self {
            // SAFETY: there is AVX2, as there is a value.
            Self(unsafe { x86::_mm256_mul_pd(self.0, x86::_mm256_set1_pd(factor)) })
        }
    }

    impl Eight for WideEight {
        #[inline(always)]
        unsafe fn load(from: &[f32; 8]) -> Self {
            // SAFETY: the caller's; eight numbers are there.
            Self(unsafe { x86::_mm256_loadu_ps(from.as_ptr()) })
        }
        #[inline(always)]
        fn store(self) -> [f32; 8] {
            let mut out = [0.0; 8];
            // SAFETY: there is AVX2, as there is a value; room for eight.
            unsafe { x86::_mm256_storeu_ps(out.as_mut_ptr(), self.0) };
            out
        }
        #[inline(always)]
        fn all(self, value: f32) -> Self {
            // SAFETY: there is AVX2, as there is a value.
            Self(unsafe { x86::_mm256_set1_ps(value) })
        }
        of_two! {
            plus: _mm256_add_ps, minus: _mm256_sub_ps, times: _mm256_mul_ps, least: _mm256_min_ps, most: _mm256_max_ps,
        }

        #[inline(always)]
        fn size(self) -> Self {
            // SAFETY: there is AVX2, as there is a value.
            Self(unsafe { x86::_mm256_andnot_ps(x86::_mm256_set1_ps(-0.0), self.0) })
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::{WideEight, WideFour};

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;

    #[allow(unsafe_code, reason = "who calls asks the processor first")]
    fn of_eight<E: Eight>(a: &[f32; 8], b: &[f32; 8]) -> Vec<[u32; 8]> {
        // SAFETY: the caller found AVX2.
        let [a, b] = unsafe { [E::load(a), E::load(b)] };
        let all = [a.plus(b), a.minus(b), a.times(b), a.least(b), a.most(b), a.size(), a.all(-1.5)];
        all.iter().map(|v| v.store().map(f32::to_bits)).collect()
    }

    #[allow(unsafe_code, reason = "who calls asks the processor first")]
    fn of_four<F: Four>(a: &[f64; 4], b: &[f64; 4]) -> Vec<[u64; 4]> {
        // SAFETY: the caller found AVX2.
        let [a, b] = unsafe { [F::load(a), F::load(b)] };
        let all = [a.plus(b), a.minus(b), a.times(0.1), a.along(b, -0.3)];
        all.iter().map(|v| v.store().map(f64::to_bits)).collect()
    }

    #[test]
    fn wide_lanes_do_what_plain_ones_do_also_with_what_is_no_number() {
        if !ivd_core::has_avx2() {
            return;
        }
        let a = [0.1, -0.0, f32::NAN, 3.5, -2.0, 1e38, -1e-40, f32::INFINITY];
        let b = [0.7, 0.0, 1.0, f32::NAN, -2.0, 9e38_f64 as f32, 1e-40, 2.0];
        let sound = |rows: Vec<[u32; 8]>| -> Vec<[u32; 8]> {
            // Which of the bits that say what isn't a number are set is nobody's promise.
            let plain = |bits: u32| if f32::from_bits(bits).is_nan() { f32::NAN.to_bits() } else { bits };
            rows.into_iter().map(|row| row.map(plain)).collect()
        };
        assert_eq!(sound(of_eight::<[f32; 8]>(&a, &b)), sound(of_eight::<WideEight>(&a, &b)));
        let (a, b) = ([0.1, -0.0, 1e300, 1e-310], [0.7, 0.0, -3e307, 0.3]);
        assert_eq!(of_four::<[f64; 4]>(&a, &b), of_four::<WideFour>(&a, &b));
    }
}
