//! What people type: scenes, parameters, handles.

use std::path::PathBuf;

use ivd_core::op::fields;
use ivd_pipeline::list::{STAGES, keys};
use ivd_pipeline::params::{from_toml, read_entry};
use ivd_pipeline::plan::Plan;
use ivd_pipeline::scene::{self, Loaded, Override};

use crate::stages;

/// Reads a scene, with overrides after a line `---` where there is one, and plans it.
pub fn scene(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let (text, overrides) = text.split_once("\n---\n").unwrap_or((text, ""));
    let overrides: Vec<Override> = overrides.lines().filter_map(|line| line.parse().ok()).collect();
    let Ok(scene) = scene::parse(text, &overrides) else { return };
    let loaded = Loaded { scene, folder: PathBuf::new(), file: PathBuf::from("scene.toml") };
    for until in [None, Some("map")] {
        let _ = Plan::new(&loaded, None, until);
    }
}

/// Reads one line as everything that a line can be.
pub fn handles(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    for stage in STAGES {
        for key in keys(stage) {
            let _ = read_entry(None, key.field(), text);
        }
        for method in stage.methods {
            for field in fields((method.schema)()) {
                let _ = read_entry(None, field, text);
            }
        }
    }
    if let Ok([x, y, z]) = scene::triple(text) {
        assert!((x + y + z).is_finite() || x.is_finite());
    }
    if let Ok(o) = text.parse::<Override>() {
        assert!(!o.path.is_empty() && o.path.iter().all(|key| !key.is_empty()));
        let _ = scene::parse("schema = 1\n[input]\nphantom = \"head\"\n[output]\n", &[o]);
    }
}

/// Reads parameters of the stage that the first byte names, and runs it on something tiny.
pub fn params(bytes: &[u8]) {
    let Some((stage, text)) = bytes.split_first() else { return };
    let Ok(text) = std::str::from_utf8(text) else { return };
    let Ok(table) = text.parse::<toml::Table>() else { return };
    let Ok(serde_json::Value::Object(keys)) = from_toml(toml::Value::Table(table)) else { return };
    stages::parameters(usize::from(*stage), keys);
}
