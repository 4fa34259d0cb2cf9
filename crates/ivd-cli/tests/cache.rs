//! One cache under many processes, and under somebody who tampers with it.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]

use std::collections::BTreeMap;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::Value;

/// Processes that share a cache at once.
const PROCESSES: usize = 64;

/// Phantoms whose pipelines share stages or don't.
const SCENES: [&str; 4] = ["sphere", "torus", "shell", "bars"];

fn scene(phantom: &str, k: u32) -> String {
    format!(
        "schema = 1\n[input]\nphantom = \"{phantom}\"\nsize = 12\n[segment]\nk = {k}\n[boundary]\n[refine]\nlevel = 1\n\
         [output]\nlabels = \"labels.nrrd\"\nlattice = \"lattice.ply\"\n"
    )
}

fn program(at: &Path, words: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivd"));
    command.current_dir(at).args(words).arg("--json");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn ivd(at: &Path, words: &[&str]) -> Command {
    let mut command = program(at, words);
    command.args(["--cache", "cache"]);
    command
}

/// What a run that succeeded told.
fn told(child: Child) -> Value {
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Content hash of every stage that had a result.
fn hashes(report: &Value) -> BTreeMap<String, String> {
    let stages = report["stages"].as_array().unwrap();
    let named = stages.iter().filter(|s| s["output"].is_object());
    named
        .map(|s| (s["stage"].as_str().unwrap().to_owned(), s["output"]["hash"].as_str().unwrap().to_owned()))
        .collect()
}

fn entries(at: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for shelf in at.join("cache/v1").read_dir().unwrap() {
        found.extend(shelf.unwrap().path().read_dir().unwrap().map(|e| e.unwrap().path()));
    }
    found.sort();
    found
}

#[test]
fn sixty_four_processes_share_a_cache() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let jobs: Vec<(String, u32)> =
        SCENES.iter().flat_map(|phantom| [2, 3].map(|k| ((*phantom).to_owned(), k))).collect();
    let mut alone = BTreeMap::new();
    for (i, (phantom, k)) in jobs.iter().enumerate() {
        std::fs::write(at.join(format!("{i}.toml")), scene(phantom, *k)).unwrap();
        let out = format!("alone{i}");
        let command = &mut program(at, &["pipeline", &format!("{i}.toml"), "--out", &out, "--cache", "off"]);
        alone.insert(i, hashes(&told(command.spawn().unwrap())));
    }
    let children: Vec<(usize, Child)> = (0..PROCESSES)
        .map(|n| {
            let i = n % jobs.len();
            let out = format!("out{n}");
            (
                i,
                ivd(at, &["pipeline", &format!("{i}.toml"), "--out", &out, "--threads", "1"])
                    .spawn()
                    .unwrap(),
            )
        })
        .collect();
    for (i, child) in children {
        assert_eq!(hashes(&told(child)), alone[&i], "{:?}", jobs[i]);
    }
    for n in 0..PROCESSES {
        for name in ["labels.nrrd", "lattice.ply"] {
            let [own, other] =
                [format!("out{n}"), format!("alone{}", n % jobs.len())].map(|f| at.join(f).join(name));
            assert!(std::fs::read(own).unwrap() == std::fs::read(other).unwrap(), "{name} of process {n}");
        }
    }
    let left: Vec<PathBuf> = entries(at);
    assert!(left.iter().all(|p| p.extension().is_some_and(|e| e == "ivd")), "stray files: {left:?}");
    for entry in &left {
        ivd_artefact::read(entry).unwrap_or_else(|e| panic!("{e}"));
    }
    let again = told(ivd(at, &["pipeline", "0.toml", "--out", "again"]).spawn().unwrap());
    let states = again["stages"].as_array().unwrap().iter().filter(|s| s["state"] == "ran");
    assert_eq!(states.count(), 0, "everything is in the cache");
}

/// A way of tampering with an entry.
struct Poison {
    name: &'static str,
    /// Does it to the entry; the other path is another valid entry of the same kind where there is one.
    apply: fn(&Path, &Path),
    /// Whether the next run can heal it: a folder in an entry's place stays.
    heals: bool,
}

fn change(path: &Path, edit: impl Fn(&mut Vec<u8>)) {
    let mut bytes = std::fs::read(path).unwrap();
    edit(&mut bytes);
    std::fs::write(path, bytes).unwrap();
}

fn remove(path: &Path) {
    std::fs::remove_file(path).unwrap();
}

const POISONS: [Poison; 13] = [
    Poison { name: "emptied", apply: |p, _| std::fs::write(p, b"").unwrap(), heals: true },
    Poison { name: "cut in the prelude", apply: |p, _| change(p, |b| b.truncate(40)), heals: true },
    Poison { name: "cut in the metadata", apply: |p, _| change(p, |b| b.truncate(300)), heals: true },
    Poison { name: "cut at the end", apply: |p, _| change(p, |b| b.truncate(b.len() - 1)), heals: true },
    Poison { name: "longer", apply: |p, _| change(p, |b| b.push(0)), heals: true },
    Poison { name: "flipped in the prelude", apply: |p, _| change(p, |b| b[10] ^= 1), heals: true },
    Poison { name: "flipped in the metadata", apply: |p, _| change(p, |b| b[120] ^= 1), heals: true },
    Poison { name: "flipped in the padding", apply: |p, _| change(p, |b| b[4000] ^= 1), heals: true },
    Poison {
        name: "flipped in the payload",
        apply: |p, _| change(p, |b| *b.last_mut().unwrap() ^= 1),
        heals: true,
    },
    Poison {
        name: "another entry's bytes",
        apply: |p, other| {
            let bytes = std::fs::read(other).unwrap();
            std::fs::write(p, bytes).unwrap();
        },
        heals: true,
    },
    Poison {
        name: "a folder",
        apply: |p, _| {
            remove(p);
            std::fs::create_dir(p).unwrap();
        },
        heals: false,
    },
    Poison {
        name: "a link to another entry",
        apply: |p, other| {
            remove(p);
            symlink(other, p).unwrap();
        },
        heals: true,
    },
    Poison {
        name: "unreadable",
        apply: |p, _| std::fs::set_permissions(p, std::fs::Permissions::from_mode(0o000)).unwrap(),
        heals: true,
    },
];

#[test]
fn a_tampered_entry_is_made_again_and_never_believed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("a.toml"), scene("sphere", 2)).unwrap();
    std::fs::write(at.join("b.toml"), scene("torus", 2)).unwrap();
    let right = hashes(&told(ivd(at, &["pipeline", "a.toml", "--out", "right"]).spawn().unwrap()));
    let own = entries(at);
    told(ivd(at, &["pipeline", "b.toml", "--out", "other"]).spawn().unwrap());
    let foreign: Vec<PathBuf> = entries(at).into_iter().filter(|p| !own.contains(p)).collect();
    let labels = std::fs::read(at.join("right/labels.nrrd")).unwrap();
    let kind = |path: &Path| ivd_artefact::peek(path).unwrap().kind;
    let foreign: Vec<(ivd_artefact::Kind, PathBuf)> = foreign.into_iter().map(|p| (kind(&p), p)).collect();
    let pairs: Vec<(PathBuf, PathBuf)> = own
        .iter()
        .map(|p| {
            let kind = kind(p);
            let same = foreign.iter().find(|f| f.0 == kind).expect("both scenes have the same stages");
            (p.clone(), same.1.clone())
        })
        .collect();
    let sound: Vec<Vec<u8>> = own.iter().map(|p| std::fs::read(p).unwrap()).collect();
    let others: Vec<Vec<u8>> = pairs.iter().map(|(_, other)| std::fs::read(other).unwrap()).collect();
    for poison in &POISONS {
        for (i, (entry, other)) in pairs.iter().enumerate() {
            (poison.apply)(entry, other);
            let case = format!("{} {}", poison.name, entry.display());
            let _ = std::fs::remove_dir_all(at.join("out"));
            let report = told(ivd(at, &["pipeline", "a.toml", "--out", "out"]).spawn().unwrap());
            assert_eq!(hashes(&report), right, "{case}");
            assert!(std::fs::read(at.join("out/labels.nrrd")).unwrap() == labels, "{case}");
            assert!(std::fs::read(other).unwrap() == others[i], "{case}: the other entry was touched");
            if poison.heals {
                assert!(
                    !entry.is_symlink() && std::fs::read(entry).unwrap() == sound[i],
                    "{case}: not healed"
                );
            } else {
                std::fs::remove_dir(entry).unwrap();
                std::fs::write(entry, &sound[i]).unwrap();
            }
        }
    }
}

#[test]
fn every_byte_region_of_an_entry_is_watched() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let lattice =
        |out: &str| told(ivd(at, &["lattice", "v.ivd", "--iso", "127.5", "-o", out]).spawn().unwrap());
    told(ivd(at, &["phantom", "sphere", "--size", "8", "-o", "v.ivd"]).spawn().unwrap());
    // The lattice's entry, which comes after that of the phantom.
    let before = entries(at);
    let right = lattice("right.ivd");
    let entry = entries(at).into_iter().find(|entry| !before.contains(entry)).unwrap();
    let sound = std::fs::read(&entry).unwrap();
    for part in 0..48 {
        change(&entry, |bytes| {
            let at = bytes.len() * part / 48;
            bytes[at] ^= 1 << (part % 8);
        });
        let again = lattice("again.ivd");
        assert_eq!(
            (&again["output"]["hash"], &again["cached"]),
            (&right["output"]["hash"], &Value::from(false))
        );
        assert!(std::fs::read(&entry).unwrap() == sound, "part {part} is not healed");
        assert_eq!(lattice("again.ivd")["cached"], true);
    }
}
