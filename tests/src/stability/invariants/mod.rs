//! What must hold of every stage's result, whatever the input.
//!
//! A check gives `Err` with the place and the numbers. Where a tolerance is needed, the comment beside it says what it
//! is made of. Nothing here calls the code that it judges, but for `ivd_octree::inside` and `nearest`, which are judged
//! here themselves and in their own crate.

pub mod clusters;
pub mod field;
pub mod mesh;
pub mod motion;
pub mod picture;
pub mod segments;
pub mod values;

/// Outcome of a check.
pub type Verdict = Result<(), String>;

/// Rounding of one operation in `f64`, relative.
pub const EPS: f64 = f64::EPSILON;

/// Fails the check with a message unless a condition holds.
#[macro_export]
macro_rules! hold {
    ($condition:expr, $($message:tt)+) => {{
        // A comparison with NaN doesn't hold.
        let holds: bool = $condition;
        if !holds {
            return Err(format!($($message)+));
        }
    }};
}
