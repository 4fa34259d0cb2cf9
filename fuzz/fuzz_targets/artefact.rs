//! Artefacts whose hashes are right and whose content is anything.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::artefacts::check(bytes));
