//! Logs of sessions, done again.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::sessions::log(bytes));
