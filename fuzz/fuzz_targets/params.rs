//! Parameters of stages, and the stages that run with them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::text::params(bytes));
