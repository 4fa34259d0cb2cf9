//! Scans that tests make.

use ivd_artefact::Cache;
use ivd_core::{Exec, Value as _, Volume};
use ivd_frames::{Model, Subject, Tell};
use ivd_pipeline::ExportOptions;

use super::common::{loaded, patient};

/// What a scene shows of a volume, which it names `scan.nrrd`.
pub(crate) fn model_of(volume: Volume, text: &str) -> Model {
    let folder = tempfile::tempdir().unwrap();
    let artefact = volume.into_artefact();
    let (file, exec) = (folder.path().join("scan.nrrd"), Exec::default());
    ivd_pipeline::export_with(&artefact, &file, &ExportOptions::default(), &exec).unwrap();
    let mut loaded = loaded(text);
    folder.path().clone_into(&mut loaded.folder);
    let subject = Subject::open(&loaded, false, &Cache::disabled(), &exec, &Tell::default()).unwrap();
    patient(subject, exec)
}
