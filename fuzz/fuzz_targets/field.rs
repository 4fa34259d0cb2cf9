//! Tiny volumes of any values through every stage.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::fields::check(bytes));
