//! Every part of the window has a name of its own; the tree of them is kept.

use std::collections::BTreeMap;
use std::path::PathBuf;

use egui::accesskit::Role;
use egui_kittest::kittest::{AccessKitNode, NodeT as _};

use super::common::Here;
use super::keyboard::chosen;

/// What holds parts, and words that say what is shown just now, are none themselves.
fn is_part(node: &AccessKitNode<'_>) -> bool {
    let contains = matches!(
        node.role(),
        Role::GenericContainer | Role::Menu | Role::Pane | Role::ScrollView | Role::Window | Role::Unknown
    );
    // Of bars that scroll egui gives no name away, and keys need none.
    let bars = matches!(node.role(), Role::ScrollBar);
    !contains && !bars && !matches!(node.role(), Role::Label | Role::TextRun) && !node.is_hidden()
}

/// Roles and names of what hands can reach.
fn parts(here: &Here) -> Vec<(Role, String)> {
    let nodes = here.harness.root().children_recursive();
    let nodes = nodes.map(|node| node.accesskit_node()).filter(is_part);
    nodes.map(|node| (node.role(), node.label().unwrap_or_default())).collect()
}

pub(crate) fn assert_named(here: &Here) {
    let mut named: BTreeMap<String, Vec<Role>> = BTreeMap::new();
    for (role, name) in parts(here) {
        named.entry(name).or_default().push(role);
    }
    let twice: Vec<_> = named.iter().filter(|(name, roles)| name.is_empty() || roles.len() > 1).collect();
    assert!(twice.is_empty(), "without a name of its own: {twice:?}");
}

#[test]
fn every_part_has_a_name_of_its_own() {
    let mut here = Here::ball();
    here.press("Handle where the slices meet");
    here.press("Pin where the slices meet");
    here.told("a handle and a pin", |told| told.handles.len() == 1 && told.pins.len() == 1);
    for (menu, item) in [
        ("Cut where the slices meet", "Cut along the sagittal slice"),
        ("Clip by a plane", "Plane along the axial slice"),
    ] {
        chosen(&mut here, menu);
        here.harness.run_ok();
        assert_named(&here);
        here.press(item);
        // What comes of it makes other rows, and lets those below go elsewhere.
        here.told("it is done", |told| {
            told.incision.is_some() && (told.clips.len() == 1 || menu != "Clip by a plane")
        });
        here.harness.run_ok();
    }
    chosen(&mut here, "Keep a box");
    here.told("a cut, a plane and a box", |told| told.incision.is_some() && told.clips.len() == 2);
    here.harness.run_ok();
    assert_named(&here);
    let lines: Vec<String> = parts(&here).iter().map(|(role, name)| format!("{role:?} {name}")).collect();
    let tree = lines.join("\n") + "\n";
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/window/tree.txt");
    if std::env::var_os("IVD_SNAPSHOTS").is_some_and(|word| word == "write") {
        std::fs::write(&file, tree).unwrap();
        return;
    }
    let kept = std::fs::read_to_string(&file).unwrap_or_default().replace('\r', "");
    assert!(kept == tree, "other parts than in {}; IVD_SNAPSHOTS=write writes it:\n{tree}", file.display());
    for menu in ["File", "Edit", "View"] {
        here.press(menu);
        here.harness.run_ok();
        assert_named(&here);
        here.press(menu);
    }
}
