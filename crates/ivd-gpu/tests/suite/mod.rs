//! Passes of a device against the processor's. Without an adapter each test says that it is skipped; where `IVD_EXPECT_ADAPTER` is set, that is a
//! failure.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests fail by panicking")]

#[allow(dead_code, reason = "the other crate uses all of it")]
#[path = "../../../ivd-render/tests/pictures/common.rs"]
mod common;
mod equal;
mod faults;
mod limits;
mod pictures;
mod sides;

use ivd_gpu::{Choice, Gpu, Options};

/// An adapter for a test; `None`, said aloud, where there is none and none is expected.
pub(crate) fn gpu(options: Options) -> Option<Gpu> {
    let expected = std::env::var("IVD_EXPECT_ADAPTER").ok();
    match Gpu::open(Options { choice: Choice::from_env(), ..options }) {
        Ok(gpu) => {
            if let Some(expected) = expected {
                assert!(gpu.adapter().name.contains(&expected), "{} isn't {expected}", gpu.adapter().name);
            }
            Some(gpu)
        }
        Err(error) => {
            assert!(expected.is_none(), "an adapter is expected: {error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}

/// What is planted in shaders.
pub(crate) fn with_planted(planted: &'static [(&'static str, &'static str)]) -> Options {
    Options { planted: planted.to_vec(), ..Options::default() }
}
