//! Mesh files of any format, and the lattices that are made of them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ivd_fuzz::meshes::check(bytes));
