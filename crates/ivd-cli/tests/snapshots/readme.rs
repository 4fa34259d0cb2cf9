//! Every command that the README tells its reader to run.
//!
//! Blocks of commands, and commands among the text, run word for word in the shell, each block in a folder of its own. What a
//! block takes for granted is there: the files that the block on single stages makes, and small ones under the names of the
//! reader's own ([`stand_ins`]). What runs in another way, or not at all, is on the list [`OTHERWISE`], with the reason.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::snapshots::{prepare, program, root};

/// How a command runs that doesn't run word for word.
enum Otherwise {
    /// With these words after it.
    With(&'static str),
    /// Not here.
    Not,
}
use Otherwise::{Not, With};

/// Commands by how they begin, how they run instead, and why.
const OTHERWISE: &[(&str, Otherwise, &str)] = &[
    ("cargo test", Not, "this is it"),
    ("cargo install", Not, "it installs another program"),
    ("cargo run --release -p ivd-view", Not, "it opens a window; ivd-view tests it without one"),
    ("just test", Not, "this is it"),
    ("just check", Not, "it compiles everything again; CI does"),
    ("just doc", Not, "it compiles everything again; CI does"),
    ("just stress", Not, "it takes an hour"),
    ("just fuzz", Not, "it takes minutes and another compiler"),
    (
        "ivd bench refinements",
        With("--help"),
        "it takes half a minute, even of 8³ voxels; ivd-bench tests it",
    ),
    ("ivd serve", With("--help"), "it runs until it is interrupted; tests/page drives it"),
    ("ivd bench --quick", With("--help"), "it takes two minutes"),
    ("ivd pipeline fixtures/scenes/mri_head.toml", With("--dry-run"), "tests/golden.py runs it in full"),
    ("ivd pipeline fixtures/scenes/bonsai.toml", With("--dry-run"), "tests/golden.py runs it in full"),
    ("ivd export `", With("--help"), "a command's name alone"),
];

/// A block between fences: its language and text.
fn blocks(readme: &str) -> Vec<(&str, &str)> {
    readme.split("```").skip(1).step_by(2).map(|block| block.split_once('\n').unwrap()).collect()
}

/// Commands of a block, continued lines joined.
fn lines(block: &str) -> Vec<String> {
    block.replace("\\\n", " ").lines().map(str::trim).filter(|l| !l.is_empty()).map(str::to_owned).collect()
}

/// Commands among the text.
fn spoken(readme: &str) -> Vec<String> {
    let text: String = readme.split("```").step_by(2).collect();
    let spans = text.split('`').skip(1).step_by(2);
    let commands = spans.filter(|s| ["ivd ", "just ", "cargo "].iter().any(|name| s.starts_with(name)));
    // The mark tells a name alone, `ivd export`, from a command.
    commands.map(|s| if s == "ivd export" { "ivd export `".to_owned() } else { s.to_owned() }).collect()
}

/// What the justfile runs for `just …`; the command itself where it is no command of `just`.
fn without_just(command: &str, justfile: &str) -> String {
    let Some(rest) = command.strip_prefix("just ") else { return command.to_owned() };
    let (name, words) = rest.split_once(' ').unwrap_or((rest, ""));
    let mut recipe = justfile.lines().skip_while(|l| {
        !l.strip_prefix(name).is_some_and(|after| after.starts_with([':', ' ']) && l.ends_with(':'))
    });
    assert!(recipe.next().is_some(), "the justfile has no `{name}`");
    let body: Vec<&str> = recipe.take_while(|l| l.starts_with(' ')).map(str::trim).collect();
    match body[..] {
        // Whatever the recipe calls them: `just` hands its words on in their order.
        [run] if run.contains("cargo run --release -- ") => {
            let mut words: Vec<&str> = words.split(' ').collect();
            let filled = run.split("{{").map(|part| match part.split_once("}}") {
                Some((_, after)) if words.is_empty() => after.to_owned(),
                Some(("args", after)) => std::mem::take(&mut words).join(" ") + after,
                Some((_, after)) => words.remove(0).to_owned() + after,
                None => part.to_owned(),
            });
            filled.collect::<String>().trim().to_owned()
        }
        _ => command.to_owned(),
    }
}

/// What a command of the README is in the shell; nothing, with the reason told, where it doesn't run.
fn shell_line(command: &str, justfile: &str) -> Option<String> {
    let command = without_just(command, justfile).replace("cargo run --release --", "ivd");
    let command = command.split(" #").next().unwrap().trim();
    let not = |why: &str| {
        eprintln!("README: `{command}` isn't run: {why}");
        None
    };
    let line = command.trim_end_matches('`').trim();
    if let Some((_, how, why)) = OTHERWISE.iter().find(|(begins, ..)| command.starts_with(begins)) {
        return match how {
            With(words) if without_input(line).is_none() => Some(format!("{line} {words}")),
            With(_) => not("its input isn't there"),
            Not => not(why),
        };
    }
    if let Some(input) = without_input(line) {
        return not(&format!("{} isn't there", input.display()));
    }
    if let Some(example) = line.strip_prefix("cargo run -p ").and_then(|l| l.split(' ').next_back()) {
        let built = folder_of_program().join("examples").join(example);
        if !built.exists() {
            return not("cargo has built the program alone, without the examples");
        }
        return Some(built.display().to_string());
    }
    assert!(!line.starts_with("cargo") && !line.starts_with("just"), "`{line}`: how is it run here?");
    Some(line.to_owned())
}

/// The input of the project's scene that a command names, where it is missing.
fn without_input(line: &str) -> Option<PathBuf> {
    let scene = line.split(' ').find(|word| word.starts_with("fixtures/scenes/"))?;
    let text = std::fs::read_to_string(root().join(scene)).unwrap();
    let file = text.lines().find_map(|l| l.strip_prefix("file = \"")?.strip_suffix('"'))?;
    Some(root().join("fixtures/scenes").join(file)).filter(|file| !file.exists())
}

fn folder_of_program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_ivd")).parent().unwrap()
}

fn run(folder: &Path, line: &str) {
    let path = std::env::var("PATH").unwrap();
    let mut shell = Command::new("sh");
    shell.envs(program(folder).get_envs().filter_map(|(name, value)| Some((name, value?))));
    shell.env("PATH", format!("{}:{path}", folder_of_program().display())).current_dir(folder);
    let output = shell.args(["-euc", line]).output().unwrap();
    assert!(output.status.success(), "`{line}`: {}", String::from_utf8_lossy(&output.stderr));
}

/// Small files under the names that the README gives to its reader's own.
fn stand_ins(folder: &Path, readme: &str) {
    let (_, scene) = blocks(readme).into_iter().find(|(language, _)| *language == "toml").unwrap();
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    std::os::unix::fs::symlink(root().join("fixtures"), folder.join("fixtures")).unwrap();
    prepare(
        folder,
        &[
            "phantom head --size 64 -o small.ivd --truth organs.nrrd --quiet",
            "export small.ivd -o their-scan.nii.gz --quiet",
            "phantom head --size 128 --type u16 -o scan.ivd --quiet",
            "phantom sphere --size 128 -o tool.ivd --quiet",
            "lattice tool.ivd --iso 127.5 -o ball.ivd --quiet",
            "export ball.ivd -o someone-elses.stl --quiet",
            "phantom sphere --size 32 -o sphere.ivd --quiet",
            "export sphere.ivd -o sphere.nrrd --quiet",
            "export sphere.ivd -o slices.tif --quiet",
        ],
    );
    crate::files::export(&folder.join("a-dicom-export"));
    std::os::unix::fs::symlink(folder.join("a-dicom-export"), folder.join("export")).unwrap();
    // The scene's scan: a ball of 8 mm voxels whose front lies at the scene's handle.
    let bytes = std::fs::read(folder.join("sphere.nrrd")).unwrap();
    let end = bytes.windows(2).position(|two| two == b"\n\n").unwrap();
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let placed = header
        .replace("(-1.0,0.0,0.0) (0.0,-1.0,0.0) (0.0,0.0,1.0)", "(-8.0,0.0,0.0) (0.0,-8.0,0.0) (0.0,0.0,8.0)")
        .replace("origin: (0.0,0.0,0.0)", "origin: (434.0,102.0,350.0)");
    assert!(placed.contains("434") && placed.contains("-8.0"), "{header}");
    std::fs::write(folder.join("placed.nrrd"), [placed.as_bytes(), &bytes[end..]].concat()).unwrap();
    prepare(folder, &["import placed.nrrd -o placed.ivd --quiet", "export placed.ivd -o MR.nii.gz --quiet"]);
}

/// A folder with the files of another; what replaces one of them leaves the other folder as it was.
fn copy(from: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in std::fs::read_dir(from).unwrap().map(|f| f.unwrap()) {
        let to = folder.path().join(file.file_name());
        let kind = file.file_type().unwrap();
        if kind.is_symlink() {
            std::os::unix::fs::symlink(std::fs::read_link(file.path()).unwrap(), to).unwrap();
        } else if kind.is_file() {
            std::fs::hard_link(file.path(), to).unwrap();
        }
    }
    folder
}

#[test]
fn every_command_of_the_readme_runs() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let justfile = std::fs::read_to_string(root().join("justfile")).unwrap();
    let shell: Vec<Vec<String>> = blocks(&readme)
        .into_iter()
        .filter(|(language, _)| *language == "sh")
        .map(|(_, b)| lines(b))
        .collect();
    let count: usize = shell.iter().map(Vec::len).sum();
    assert!(shell.len() >= 8 && count >= 40, "{} blocks, {count} commands", shell.len());
    let (stages, others): (Vec<_>, Vec<_>) = shell.iter().partition(|b| b[0].starts_with("ivd phantom"));
    let mut ran = BTreeSet::new();
    let mut run_all = |folder: &Path, block: &[String]| {
        for line in block.iter().filter_map(|command| shell_line(command, &justfile)) {
            run(folder, &line);
            ran.insert(line);
        }
    };

    let made = tempfile::tempdir().unwrap();
    stand_ins(made.path(), &readme);
    for block in stages {
        run_all(made.path(), block);
    }
    for block in others {
        let folder = copy(made.path());
        // Where no command names a place in it, a smaller head does: to find classes in the large one takes half a minute.
        if block.iter().all(|command| command.starts_with("ivd segment")) {
            prepare(folder.path(), &["phantom head --size 32 -o head.ivd --quiet"]);
        }
        run_all(folder.path(), block);
    }
    let folder = copy(made.path());
    for line in spoken(&readme).iter().filter_map(|command| shell_line(command, &justfile)) {
        if ran.insert(line.clone()) {
            run(folder.path(), &line);
        }
    }
}

#[test]
fn commands_of_just_are_what_the_justfile_says() {
    let justfile = "a b=\"x\" *args=\"\":\n    cargo run --release -- pipeline {{b}} --explain {{args}}\n\ntest:\n    cargo test\n";
    assert_eq!(
        without_just("just a s.toml --quiet", justfile),
        "cargo run --release -- pipeline s.toml --explain --quiet"
    );
    assert_eq!(without_just("just a s.toml", justfile), "cargo run --release -- pipeline s.toml --explain");
    assert_eq!(without_just("just test", justfile), "just test");
    assert_eq!(without_just("ivd info", justfile), "ivd info");
}
