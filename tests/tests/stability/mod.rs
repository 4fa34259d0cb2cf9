//! Numerical stability: what no input, however awkward, may break. `just stress` runs the long forms.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

mod cases;
mod determinism;
mod indices;
mod planted;
mod rounding;
mod scaling;
mod scenes;
mod spaces;
mod symmetry;

/// Whether a case has its turn: of each eight in a row one, each time the next, so that what goes round by eights comes round too. All have
/// where `IVD_STRESS_EVERY` is 1, as `just stress` has it; one of so many where it is more.
fn has_its_turn(case: u64) -> bool {
    let every = asked("IVD_STRESS_EVERY", 8);
    case % every == case / every % every
}

/// A number from the environment, so that `just stress` can ask for more than the normal suite does.
fn asked(name: &str, default: u64) -> u64 {
    std::env::var(name)
        .map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name}={text} is no number")))
}
