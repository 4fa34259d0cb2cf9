//! Readers and writers of volumes and meshes, on sound, hostile and real files.

mod field;
mod headers;
mod hostile;
mod meshes;
mod notes;
mod real_volumes;
mod round_trip;
