//! The program as it is called: what it prints, writes, refuses and survives.

mod bench;
mod budget;
mod cache;
mod call;
mod combine;
mod deform;
mod faults;
mod hostile;
mod killed;
mod lattice;
mod neck;
mod parts;
mod pictures;
mod program;
mod segment;
mod snapshots;
mod space;
