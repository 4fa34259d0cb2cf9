//! What people type: scenes, parameters, handles.

use std::path::PathBuf;

use ivd_pipeline::plan::Plan;
use ivd_pipeline::scene::{self, ClassChoice, FixSection, HandleSection, IsoChoice, Loaded, Override, Scene};
use serde::de::DeserializeOwned;

use crate::stages;

/// Reads a scene, with overrides after a line `---` where there is one, and plans it.
pub fn scene(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let (text, overrides) = text.split_once("\n---\n").unwrap_or((text, ""));
    let overrides: Vec<Override> = overrides.lines().filter_map(|line| line.parse().ok()).collect();
    let Ok(scene) = scene::parse(text, &overrides) else { return };
    let written = toml::to_string(&scene).expect("a scene can be written");
    let again: Scene = toml::from_str(&written).expect("what was written is read");
    assert_eq!(format!("{again:?}"), format!("{scene:?}"));
    let loaded = Loaded { scene, folder: PathBuf::new(), file: PathBuf::from("scene.toml") };
    for until in [None, Some("map")] {
        let _ = Plan::new(&loaded, None, until);
    }
}

/// Reads one line as everything that a line can be.
pub fn handles(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(handle) = text.parse::<HandleSection>() {
        handle.check().expect("a handle that was read is sound");
    }
    if let Ok(fix) = text.parse::<FixSection>() {
        assert!(fix.radius > 0.0 && fix.pick.iter().all(|c| c.is_finite()));
    }
    if let Ok([x, y, z]) = scene::triple(text) {
        assert!((x + y + z).is_finite() || x.is_finite());
    }
    if let Ok(o) = text.parse::<Override>() {
        assert!(!o.path.is_empty() && o.path.iter().all(|key| !key.is_empty()));
        let _ = scene::parse("schema = 1\n[input]\nphantom = \"head\"\n[output]\n", &[o]);
    }
    let _ = text.parse::<ClassChoice>();
    let _ = text.parse::<IsoChoice>();
}

fn section<T: DeserializeOwned>(text: &str) -> Option<T> {
    toml::from_str(text).ok()
}

/// Reads parameters of the stage that the first byte names, and runs it on something tiny.
pub fn params(bytes: &[u8]) {
    let Some((stage, text)) = bytes.split_first() else { return };
    let Ok(text) = std::str::from_utf8(text) else { return };
    match stage % 9 {
        0 => section(text).map(|s| stages::segment(&s)),
        1 => section(text).map(|s| stages::atf(&s)),
        2 => section(text).map(|s| stages::boundary(&s)),
        3 => section(text).map(|s| stages::refine(&s)),
        4 => section(text).map(|s| stages::octree(&s)),
        5 => section(text).map(stages::deform),
        6 => section(text).map(|s| stages::map(&s)),
        7 => section(text).map(|s| stages::warp(&s)),
        _ => section(text).map(stages::render),
    };
}
