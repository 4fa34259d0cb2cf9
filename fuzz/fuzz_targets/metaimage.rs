//! MetaImage: any bytes are a volume or an error.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::files::read("mhd", bytes));
