//! The program `ivd`.
fn main() {}
