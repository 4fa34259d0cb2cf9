//! What a window or a page asks for, line by line.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::sessions::requests(bytes));
