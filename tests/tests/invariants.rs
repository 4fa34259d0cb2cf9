//! The shape of the house: what docs/ARCHITECTURE.md promises and a look at the sources can check.
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::path::{Path, PathBuf};

use ivd_tests::root;

/// Every source file below `crates/`, with its text.
fn sources(ending: &str) -> Vec<(PathBuf, String)> {
    fn walk(folder: &Path, ending: &str, found: &mut Vec<(PathBuf, String)>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, ending, found);
            } else if path.to_string_lossy().ends_with(ending) {
                let text = std::fs::read_to_string(&path).unwrap();
                found.push((path, text));
            }
        }
    }
    let mut found = Vec::new();
    walk(&root().join("crates"), ending, &mut found);
    assert!(!found.is_empty());
    found
}

fn crate_of(path: &Path) -> String {
    let rest = path.strip_prefix(root().join("crates")).unwrap();
    rest.components().next().unwrap().as_os_str().to_string_lossy().into_owned()
}

/// The stages' crates, and what each needs of ours.
const STAGES: &[(&str, &[&str])] = &[
    ("ivd-io", &["ivd-core", "ivd-fs"]),
    ("ivd-phantom", &["ivd-core"]),
    ("ivd-segment", &["ivd-core"]),
    ("ivd-atf", &["ivd-core"]),
    ("ivd-boundary", &["ivd-core"]),
    ("ivd-lattice", &["ivd-core"]),
    ("ivd-octree", &["ivd-core"]),
    ("ivd-field", &["ivd-core"]),
    ("ivd-elastic", &["ivd-core"]),
    ("ivd-motion", &["ivd-core", "ivd-elastic", "ivd-field", "ivd-octree"]),
    ("ivd-map", &["ivd-core", "ivd-elastic", "ivd-field", "ivd-octree"]),
    ("ivd-render", &["ivd-core"]),
];

#[test]
fn bincode_is_named_in_ivd_artefact_alone() {
    for (path, text) in sources(".rs").into_iter().chain(sources("Cargo.toml")) {
        assert!(crate_of(&path) == "ivd-artefact" || !text.contains("bincode"), "{}", path.display());
    }
}

#[test]
fn files_are_replaced_in_ivd_fs_alone() {
    for (path, text) in sources(".rs") {
        let spoken = path.to_string_lossy().replace('\\', "/");
        if crate_of(&path) == "ivd-fs"
            || spoken.contains("/tests/")
            || spoken.contains("/examples/")
            || spoken.ends_with("tests.rs")
        {
            continue;
        }
        let library = text.split("#[cfg(test)]").next().unwrap();
        for (n, line) in library.lines().enumerate() {
            let code = line.trim_start();
            let replaces = [".persist(", "fs::rename(", "NamedTempFile", "File::create(", "fs::write("]
                .iter()
                .any(|p| code.contains(p));
            // The kernel's switches are no files to replace.
            let allowed = code.starts_with("//") || code.contains("\"/proc/");
            assert!(!replaces || allowed, "{}:{}: {line}", path.display(), n + 1);
        }
    }
}

#[test]
fn only_the_program_prints() {
    for (path, text) in sources(".rs") {
        let spoken = path.to_string_lossy().replace('\\', "/");
        let allowed = crate_of(&path) == "ivd-cli"
            || ["/tests/", "/examples/", "/benches/"].iter().any(|f| spoken.contains(f))
            || spoken.ends_with("tests.rs");
        if allowed {
            continue;
        }
        // Tests inside a module may say why they were skipped.
        let library = text.split("#[cfg(test)]").next().unwrap();
        for (n, line) in library.lines().enumerate() {
            let code = line.trim_start();
            let prints = ["println!(", "print!(", "dbg!("].iter().any(|p| code.contains(p));
            assert!(!prints || code.starts_with("//"), "{}:{}: {line}", path.display(), n + 1);
        }
    }
}

#[test]
fn stage_crates_need_exactly_what_the_architecture_says() {
    for (path, text) in sources(".rs") {
        let (name, declares) = (crate_of(&path), text.contains("STAGE: Stage = Stage {"));
        assert!(
            !declares || STAGES.iter().any(|(known, _)| *known == name),
            "STAGES doesn't tell what {name} may need"
        );
    }
    for (name, told) in STAGES {
        let text = std::fs::read_to_string(root().join("crates").join(name).join("Cargo.toml")).unwrap();
        assert_eq!(needed(&text), *told, "{name}");
    }
}

#[test]
fn what_draws_a_report_knows_no_stage() {
    let text = std::fs::read_to_string(root().join("crates/ivd-report/Cargo.toml")).unwrap();
    assert_eq!(needed(&text), ["ivd-core"]);
}

#[test]
fn what_runs_a_scene_knows_no_budget() {
    for (path, text) in sources(".rs").into_iter().filter(|(path, _)| crate_of(path) == "ivd-pipeline") {
        let mut code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        assert!(!code.any(|line| line.to_lowercase().contains("budget")), "{}", path.display());
    }
}

/// Ours among the crates that a manifest needs, in its order.
fn needed(manifest: &str) -> Vec<&str> {
    let dependencies = manifest.split("[dependencies]").nth(1).unwrap_or("").split("\n[").next().unwrap();
    let ours = dependencies.lines().filter(|line| line.starts_with("ivd-"));
    ours.map(|line| line.split(['.', ' ', '=']).next().unwrap()).collect()
}

/// A line for each crate with those of ours that it needs, each below all of them.
fn arrows() -> String {
    let manifests = sources("Cargo.toml");
    let mut left: Vec<(String, Vec<&str>)> =
        manifests.iter().map(|(path, text)| (crate_of(path), needed(text))).collect();
    left.sort();
    let (mut placed, mut lines) = (Vec::new(), Vec::new());
    while !left.is_empty() {
        let ready = |needs: &[&str]| needs.iter().all(|krate| placed.iter().any(|done| done == krate));
        let (next, later): (Vec<_>, Vec<_>) = left.into_iter().partition(|(_, needs)| ready(needs));
        assert!(!next.is_empty(), "crates need each other in a circle: {later:?}");
        for (name, needs) in next {
            lines.push(if needs.is_empty() {
                name.clone()
            } else {
                format!("{name} → {}", needs.join(", "))
            });
            placed.push(name);
        }
        left = later;
    }
    lines.join("\n")
}

#[test]
fn the_arrows_of_the_architecture_are_those_of_the_manifests() {
    let page = root().join("docs/ARCHITECTURE.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let (head, rest) = text.split_once("<!-- arrows -->\n").unwrap();
    let (_, tail) = rest.split_once("<!-- end of arrows -->").unwrap();
    let now = format!("{head}<!-- arrows -->\n```text\n{}\n```\n<!-- end of arrows -->{tail}", arrows());
    if std::env::var_os("IVD_SNAPSHOTS").is_some_and(|wish| wish == "write") {
        std::fs::write(&page, now).unwrap();
    } else {
        assert!(
            text == now,
            "docs/ARCHITECTURE.md shows other arrows than the manifests; IVD_SNAPSHOTS=write writes them"
        );
    }
}

/// What reads, writes, packs or maps files, or writes them in another form.
const OF_FILES: [&str; 14] = [
    "quick-xml",
    "flate2",
    "zlib-rs",
    "base64",
    "tiff",
    "png",
    "jpeg-decoder",
    "jpeg2k",
    "toml",
    "memmap2",
    "tempfile",
    "bincode",
    "ivd-fs",
    "ivd-artefact",
];

#[test]
fn whoever_embeds_a_stage_brings_nothing_that_reads_files() {
    for (name, _) in STAGES.iter().filter(|(_, needed)| !needed.contains(&"ivd-fs")) {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let tree = ["tree", "--offline", "--edges", "normal", "--prefix", "none", "--package", name];
        let told = std::process::Command::new(cargo).args(tree).current_dir(root()).output().unwrap();
        let text = String::from_utf8_lossy(&told.stdout).into_owned();
        assert!(told.status.success() && text.starts_with(name), "{}", String::from_utf8_lossy(&told.stderr));
        let brought = text.lines().filter_map(|line| line.split(' ').next());
        let wrong: Vec<&str> = brought.filter(|krate| OF_FILES.contains(krate)).collect();
        assert!(wrong.is_empty(), "{name} brings {wrong:?}");
    }
}

#[test]
fn the_program_has_no_window_unless_one_is_asked_for() {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let tree = ["tree", "--offline", "--edges", "normal", "--prefix", "none", "--package", "ivd-cli"];
    let told = std::process::Command::new(cargo).args(tree).current_dir(root()).output().unwrap();
    let text = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(
        told.status.success() && text.starts_with("ivd-cli"),
        "{}",
        String::from_utf8_lossy(&told.stderr)
    );
    let of_windows = |krate: &str| ["ivd-view", "eframe", "egui", "winit"].contains(&krate);
    let brought: Vec<&str> =
        text.lines().filter_map(|line| line.split(' ').next()).filter(|k| of_windows(k)).collect();
    assert!(brought.is_empty(), "{brought:?}");
}

#[test]
fn only_the_crates_of_files_touch_files() {
    for (path, text) in sources(".rs") {
        let name = crate_of(&path);
        let pure = STAGES.iter().any(|(stage, needed)| *stage == name && !needed.contains(&"ivd-fs"));
        let spoken = path.to_string_lossy().replace('\\', "/");
        if !pure || !spoken.contains(&format!("{name}/src/")) || spoken.ends_with("tests.rs") {
            continue;
        }
        let library = text.split("#[cfg(test)]").next().unwrap();
        for (n, line) in library.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")) {
            let touches = ["std::fs", "fs::", "File::", "Path"].iter().any(|word| line.contains(word));
            assert!(!touches, "{}:{}: {line}", path.display(), n + 1);
        }
    }
}

#[test]
fn no_source_file_outgrows_six_hundred_lines() {
    for (path, text) in sources(".rs") {
        assert!(text.lines().count() <= 600, "{}: {} lines", path.display(), text.lines().count());
    }
}

/// Each crate's tests are one program: a file that it doesn't name would never be compiled.
#[test]
fn every_file_of_tests_is_a_module_of_its_crates_one_program() {
    let crates = std::fs::read_dir(root().join("crates")).unwrap().map(|entry| entry.unwrap().path());
    for folder in crates.chain([root().join("tests")]).map(|path| path.join("tests")).filter(|f| f.is_dir()) {
        let main = std::fs::read_to_string(folder.join("main.rs")).unwrap();
        let manifest = std::fs::read_to_string(folder.join("../Cargo.toml")).unwrap();
        assert!(manifest.contains("autotests = false"), "{}", folder.display());
        for path in std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            // A folder without `mod.rs` holds what is taken in by path.
            let is_module = path.is_file() || path.join("mod.rs").is_file();
            let named = main.contains(&format!("mod {name};"));
            assert!(!is_module || name == "main" || named, "{} is in no program", path.display());
        }
    }
}

#[test]
fn every_scene_in_fixtures_is_read() {
    for entry in std::fs::read_dir(root().join("fixtures/scenes")).unwrap() {
        let path = entry.unwrap().path();
        ivd_pipeline::scene::load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
    }
}

/// rustc 1.95 may hand two calls of a named closure the same copy of an array, so that the second sees what the first has
/// changed (rust-lang/rust#155241; it made a test's matrix wrong at `opt-level` 2). A `fn` is safe.
#[test]
fn no_named_closure_changes_an_array_that_it_takes_by_value() {
    for (path, text) in sources(".rs") {
        for (n, line) in text.lines().enumerate() {
            let arguments = line.split_once("= |").and_then(|(_, rest)| rest.split_once('|'));
            let changes = arguments.is_some_and(|(arguments, _)| {
                arguments
                    .split("mut ")
                    .skip(1)
                    .any(|a| a.split_once(": ").is_some_and(|(_, t)| t.starts_with('[')))
            });
            assert!(!changes, "{}:{}: make it a fn: {line}", path.display(), n + 1);
        }
    }
}
