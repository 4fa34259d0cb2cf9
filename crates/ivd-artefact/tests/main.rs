//! What is written is read again, from a cache too, and what is damaged is told.

mod cache;
mod golden;
mod hostile;
mod lazy;
mod roundtrip;
mod samples;
