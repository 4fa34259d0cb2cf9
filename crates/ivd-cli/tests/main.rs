//! The program as it is called: what it prints, writes, refuses and survives.

mod advice;
mod bench;
mod budget;
mod cache;
mod call;
mod combine;
mod cuts;
mod deform;
mod faults;
mod files;
mod first_hour;
mod hands;
mod hostile;
mod killed;
mod labelled;
mod lattice;
mod neck;
mod onto;
mod parts;
mod pictures;
mod program;
mod recipes;
mod second_hour;
mod segment;
mod snapshots;
mod space;
